"""Materials of OBJ files: colours, and what they cut out."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.scenes.cutouts import cut_out
from shadowbench.scenes.file_contents import BY_DEFAULT, Chosen
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import GREY, Mesh, Scene
from tests.scenes.conftest import refused

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
QUAD = "f 1/1 2/2 3/3 4/4\n"
GREYS = np.array([[0, 255], [128, 127]], dtype=np.uint8)
LEAF = np.dstack([np.full((2, 2, 3), 40, np.uint8), GREYS])


def png(path: Path, texels: np.ndarray) -> None:
    Image.fromarray(texels).save(path, "PNG")


@pytest.fixture
def painted(tmp_path: Path):
    """The scene of an OBJ file beside an MTL file and images."""

    def read(mtl: str | bytes | None, obj: str = SQUARE + "usemtl a\n" + QUAD, chosen: Chosen = BY_DEFAULT) -> Scene:
        png(tmp_path / "grey.png", GREYS)
        png(tmp_path / "leaf.png", LEAF)
        png(tmp_path / "opaque.png", np.full((2, 2, 3), 40, np.uint8))
        if mtl is not None:
            (tmp_path / "a.mtl").write_bytes(mtl if isinstance(mtl, bytes) else mtl.encode())
        path = tmp_path / "a.obj"
        path.write_text("mtllib a.mtl\n" + obj)
        return read_meshes(path, chosen=chosen)

    return read


def only(scene: Scene) -> Mesh:
    (mesh,) = scene.meshes
    return mesh


def cut(scene: Scene) -> np.ndarray:
    cutout = only(scene).cutout
    assert cutout is not None
    return cutout.words


def test_v_is_turned_downwards_and_coordinates_lie_at_their_corners(painted) -> None:
    mesh = only(painted("newmtl a\nmap_d leaf.png"))
    assert mesh.coordinates is not None and mesh.coordinates.dtype == np.float32
    places = dict(
        zip(map(tuple, mesh.vertices[mesh.faces].reshape(-1, 3).tolist()),
            map(tuple, mesh.coordinates.reshape(-1, 2).tolist()), strict=True)
    )  # fmt: skip
    assert places == {(0, 0, 0): (0, 1), (1, 0, 0): (1, 1), (1, 1, 0): (1, 0), (0, 1, 0): (0, 0)}


def test_indices_of_coordinates_are_read_in_every_form(painted) -> None:
    for face in (
        "f 1/-4 2/-3 3/-2 4/-1",
        "f 1/1/1 2/2/1 3/3/1 4/4/1",
        "f 1/1/ 2/2/ 3/3/ 4/4/",
        "f -4/1 -3/2//9 \\\n -2/3 -1/4",
    ):
        obj = SQUARE + "vn 0 0 1\nusemtl a\n"
        plain, other = (only(painted("newmtl a\nmap_d leaf.png", obj + text)) for text in (QUAD, face))
        assert np.array_equal(plain.coordinates, other.coordinates)


def test_a_mask_is_the_alpha_of_its_image_or_else_its_luminance(painted) -> None:
    for mtl, alpha in (
        ("map_d leaf.png", GREYS),
        ("map_d grey.png", GREYS),
        ("MAP_D -clamp on -s 1 1 1 grey.png", GREYS),
        ("map_Kd leaf.png\nmap_d leaf.png", GREYS),
        ("map_Kd opaque.png\nmap_d grey.png", GREYS),
    ):
        scene = painted("newmtl a\n" + mtl)
        assert np.array_equal(cut(scene), cut_out(alpha, wrap=only(scene).cutout.wrap).words)
        assert any("1 material(s) cut out where d · map_d is below 0.5" in note for note in scene.notes)


def test_dissolve_is_a_factor_of_the_mask_and_d_comes_before_tr(painted) -> None:
    for mtl, factor in (("d 0.8", 0.8), ("Tr 0.2", 0.8), ("Tr 1\nd 1", 1.0)):
        assert np.array_equal(cut(painted(f"newmtl a\nmap_d grey.png\n{mtl}")), cut_out(GREYS, factor).words)


def test_faces_whose_material_is_opaque_nowhere_are_left_out_and_told(painted) -> None:
    faces = SQUARE + "usemtl glass\nf 1 2 3\nusemtl a\nf 1 3 4\nusemtl glass\nf 2 3 4\n"
    scene = painted("newmtl glass\nd 0.3\nnewmtl a\nKd 1 0 0", faces)
    assert only(scene).faces.shape == (1, 3) and only(scene).color == (1.0, 0.0, 0.0)
    assert any("2 face(s) left out whose material is opaque nowhere" in note for note in scene.notes)
    assert only(painted("newmtl a\nd 0.6")).cutout is None, "as of a blended glTF, all of it is kept or nothing"


def test_materials_that_look_different_are_meshes_of_their_own(painted) -> None:
    faces = "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 2 3 4\n"
    mtl = "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\nnewmtl c\nKd 1 0 0\n"
    scene = painted(mtl, SQUARE + faces + "o box\n" + faces + "o one\nusemtl b\nf 1 2 4\n")
    assert [(mesh.name, mesh.color, len(mesh.faces)) for mesh in scene.meshes] == [
        ("a", (1.0, 0.0, 0.0), 2), ("b", (0.0, 0.0, 1.0), 1),
        ("box a", (1.0, 0.0, 0.0), 2), ("box b", (0.0, 0.0, 1.0), 1), ("one", (0.0, 0.0, 1.0), 1),
    ]  # fmt: skip


def test_a_black_kd_beside_a_texture_is_grey(painted) -> None:
    colors = [only(painted(f"newmtl a\n{kd}\nmap_Kd leaf.png")).color for kd in ("Kd 1 0.5 0", "Kd 0 0 0")]
    assert colors == [(1.0, 0.5, 0.0), GREY]


def test_what_is_not_read_is_a_note_and_the_mesh_is_there(painted) -> None:
    for mtl, note in (
        (None, "mtllib 'a.mtl' is not a file in"),
        ("newmtl a\nmap_d none.png", "map_d 'none.png' is not a file in"),
        ("newmtl a\nmap_d ../leaf.png", "map_d '../leaf.png' leads outside"),
        ("newmtl a\nmap_d /etc/hostname", "map_d '/etc/hostname' leads outside"),
        ("newmtl a\nmap_d a.mtl", "map_d 'a.mtl': not an image"),
        ("newmtl a\nmap_d -o 0.5 0 0 grey.png", "map_d -o: left out"),
        (b"\xff\xfe\0nonsense", ""),
        ("newmtl a\nKd spectral b.rfl\nd halo\nTr nan\nmap_d\nmap_Kd -clamp", ""),
    ):
        scene = painted(mtl)
        assert len(only(scene).faces) == 2 and only(scene).color == GREY
        assert any(note in line for line in scene.notes) or not note


def test_names_may_have_blanks_and_backslashes(painted, tmp_path: Path) -> None:
    (tmp_path / "my textures").mkdir()
    png(tmp_path / "my textures" / "a leaf.png", LEAF)
    (tmp_path / "my own.mtl").write_text("newmtl a b\nmap_d my textures\\a leaf.png\n")
    obj = SQUARE + "mtllib my own.mtl\nmtllib other.mtl a.mtl\nusemtl a b\n" + QUAD
    assert np.array_equal(cut(painted("newmtl c\nKd 1 0 0\n", obj)), cut_out(GREYS).words)


def test_a_coordinate_that_is_none_is_one_line(painted, tmp_path: Path) -> None:
    for obj, words in (
        (SQUARE + "usemtl a\nf 1/9 2/1 3/1\n", ["line 11", "texture coordinate 9", "has 4"]),
        (SQUARE + "usemtl a\nf 1/0 2/1 3/1\n", ["line 11", "texture coordinate 0"]),
        (SQUARE + "vt 0.5\nusemtl a\nf 1/1 2/1 3/5\n", ["line 10", "found 1 numbers; 2"]),
        (SQUARE + "usemtl a\nf 1/x 2/1 3/1\n", ["line 11", "'1/x'"]),
    ):
        painted("newmtl a\nmap_d leaf.png\n")
        (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + obj)
        refused(tmp_path / "a.obj", "a.obj", *words)


def test_a_ply_may_have_coordinates(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    path = tmp_path / "a.ply"
    path.write_text(
        head
        + "property float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0\n1 0 0 1 0.25\n0 1 0 0.5 1\n3 0 1 2\n"
    )
    assert only(read_meshes(path)).coordinates.tolist() == [[[0, 1], [1, 0.75], [0.5, 0]]]
