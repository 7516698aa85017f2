"""Scene files: their fields, and one-line errors for invalid ones."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.errors import InputError
from shadowbench.scenes.library import load_scene, transform_of
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.scene_tables import MeshTable
from shadowbench.scenes.shapes import build_shape
from tests.scenes.conftest import refused

SceneFile = Callable[..., Path]
BOX = '[[mesh]]\nshape = "box"\n'


def test_degrees_become_radians_and_names_have_defaults(scene_file: SceneFile) -> None:
    scene = load_scene(
        scene_file(
            "[[camera]]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\nfov_y = 60\nnear = 0.5\nfar = 20\n"
            "[[camera]]\nposition = [5, 1, 0]\ntarget = [0, 0, 0]\n"
            '[[camera]]\nname = "low"\nposition = [5, 1, 0]\ntarget = [0, 0, 0]\n'
            '[[light]]\nkind = "directional"\ndirection = [0, -1, 0]\n'
            '[[light]]\nkind = "spot"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\nangle = 90\n'
            '[[light]]\nname = "bulb"\nkind = "point"\nposition = [0, 3, 0]\n' + BOX
        )
    )
    assert [camera.name for camera in scene.cameras] == ["camera", "camera-2", "low"]
    assert [light.name for light in scene.lights] == ["light", "light-2", "bulb"]
    assert scene.cameras[0].fov_y == pytest.approx(math.pi / 3)
    assert (scene.cameras[0].near, scene.cameras[0].far) == (0.5, 20)
    assert scene.cameras[1].up == (0, 1, 0)
    assert scene.lights[1].angle == pytest.approx(math.pi / 2)
    assert scene.name == "scene"
    assert not scene.notes


def test_lights_have_sizes(scene_file: SceneFile) -> None:
    text = (
        '[[light]]\nkind = "directional"\ndirection = [0, -1, 0]\nangular_radius = 0.25\n'
        '[[light]]\nkind = "point"\nposition = [0, 3, 0]\nradius = 0.1\n'
        '[[light]]\nkind = "disc"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\nradius = 0.2\n'
        '[[light]]\nkind = "rectangle"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\nup = [1, 0, 0]\nsize = [1, 2]\n'
        "[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n"
    )
    scene = load_scene(scene_file(text + BOX))
    assert [light.radius for light in scene.lights] == [math.radians(0.25), 0.1, 0.2, 0.0]
    assert (scene.lights[3].size, scene.lights[3].up) == ((1, 2), (1, 0, 0))
    assert [light.soft for light in scene.lights] == [True] * 4
    assert not scene.notes


angles = st.floats(-720, 720)
lengths = st.floats(-50, 50)
factors = st.floats(0.01, 100) | st.floats(-100, -0.01)


@given(
    rotate=st.tuples(angles, angles, angles),
    scale=st.tuples(factors, factors, factors),
    translate=st.tuples(lengths, lengths, lengths),
)
def test_the_transform_is_translate_rz_ry_rx_scale(
    rotate: tuple[float, ...], scale: tuple[float, ...], translate: tuple[float, ...]
) -> None:
    table = MeshTable.model_validate({"shape": "box", "rotate": rotate, "scale": scale, "translate": translate})
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(rotate)), np.sin(np.radians(rotate))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    point = np.array([0.3, -0.7, 1.1])
    expected = about_z @ about_y @ about_x @ (point * scale) + translate
    assert transform_of(table) @ [*point, 1.0] == pytest.approx([*expected, 1.0], abs=1e-9)


def test_a_mirrored_mesh_keeps_its_outside_out(scene_file: SceneFile) -> None:
    for scale in ("-1", "[-1, 1, 1]", "[1, -2, 3]", "[-1, -1, 1]"):
        (mesh,) = load_scene(scene_file(f'[[mesh]]\nshape = "cone"\nscale = {scale}\n')).meshes
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def test_copies_are_repeated_at_steps(scene_file: SceneFile) -> None:
    text = BOX + "repeat = [{ count = 3, step = [2, 0, 0] }, { count = 2, step = [0, 0, -5] }]\n"
    scene = load_scene(scene_file(text))
    centers = [tuple(mesh.vertices.mean(axis=0).round(9) + 0.0) for mesh in scene.meshes]
    assert centers == [(x, 0, z) for x in (0, 2, 4) for z in (0, -5)]
    assert len({mesh.name for mesh in scene.meshes}) == 6
    single = load_scene(scene_file(BOX + "repeat = { count = 24, step = [0.25, 0, 0] }\n"))
    assert len(single.meshes) == 24


def mesh_beside(path: Path) -> None:
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\n")


def test_a_file_lies_beside_the_scene_or_in_assets(scene_file: SceneFile, tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "home").mkdir()
    mesh_beside(tmp_path / "assets" / "far.obj")
    mesh_beside(tmp_path / "home" / "near.obj")
    text = '[[mesh]]\nfile = "near.obj"\n[[mesh]]\nfile = "far.obj"\nscale = 2\n'
    path = scene_file(text, name="home/scene.toml")
    scene = load_scene(path, assets=tmp_path / "assets")
    assert [mesh.name for mesh in scene.meshes] == ["near", "far"]
    with pytest.raises(InputError, match=r"far\.obj.*--assets"):
        load_scene(path)


def test_a_link_may_not_lead_outside(scene_file: SceneFile, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    mesh_beside(tmp_path / "secret.obj")
    link = tmp_path / "home" / "link.obj"
    try:
        os.symlink(tmp_path / "secret.obj", link)
    except OSError:
        pytest.skip("no symbolic links here")
    path = scene_file('[[mesh]]\nfile = "link.obj"\n', name="home/scene.toml")
    with pytest.raises(InputError, match="outside"):
        load_scene(path)
    assert load_scene(path, assets=tmp_path).meshes[0].name == "secret"
    dotted = scene_file('[[mesh]]\nfile = "../secret.obj"\n', name="home/dotted.toml")
    with pytest.raises(InputError, match="outside"):
        load_scene(dotted)


def test_a_files_zero_area_triangles_are_counted_and_said(scene_file: SceneFile, tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\n")
    scene = load_scene(scene_file('[[mesh]]\nfile = "a.obj"\n'))
    assert (scene.dropped, len(scene.geometry.faces)) == (1, 1)
    assert [note for note in scene.notes if "assumed" not in note] == ["scene.toml: 1 zero-area triangle(s) left out"]


CAMERA = "[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n"
SUN = '[light]\nkind = "directional"\ndirection = [0, -1, 0]\n'
LAMP = '[light]\nkind = "point"\nposition = [0, 3, 0]\n'
PANEL = '[light]\nkind = "rectangle"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\n'


def test_a_bad_scene_file_is_one_line(scene_file: SceneFile) -> None:
    for text, words in (
        ("[[mesh]\n", ["not TOML"]),
        (CAMERA, ["mesh", "none"]),
        ('[mesh]\nshape = "box"\n', ["[[mesh]]"]),
        ('nam = "x"\n' + BOX, ["unknown field 'nam'", "name"]),
        ('name = "a/b"\n' + BOX, ["name", "a/b"]),
        (BOX + "colour = [1, 1, 1]\n", ["colour", "color"]),
        (BOX + "scale = 0\n", ["scale", "0"]),
        (BOX + "scale = [1, 1]\n", ["scale 3: found none"]),
        (BOX + "scale = 1e18\ntranslate = [1e18, 0, 0]\n", ["coordinate"]),
        (BOX + "color = [2, 0, 0]\n", ["color", "2"]),
        (BOX + "casts = 1\n", ["casts: found 1; allowed: true or false"]),
        (BOX + 'file = "a.obj"\n', ["not both"]),
        ("[[mesh]]\nscale = 1\n", ["neither"]),
        ('[[mesh]]\nshape = "cubus"\n', ["cubus", "box", "terrain"]),
        (BOX + "subdivisions = 3\n", ["subdivisions", "translate"]),
        ('[[mesh]]\nshape = "sphere"\nsubdivisions = 99\n', ["subdivisions", "99"]),
        ('[[mesh]]\nfile = "nothing.obj"\n', ["nothing.obj", "--assets"]),
        ('[[mesh]]\nfile = "a\\u0000b.obj"\n', ["file"]),
        ('[[mesh]]\nfile = "scene.toml"\n', ["scene.toml", ".glb"]),
        (BOX + "repeat = { count = 0, step = [1, 0, 0] }\n", ["count", "0"]),
        (BOX + "repeat = [{ count = 1000, step = [1, 0, 0] }, { count = 101, step = [1, 0, 0] }]\n", ["101000"]),
        (BOX + f"repeat = [{', '.join(3 * ['{ count = 2, step = [1, 0, 0] }'])}]\n", ["at most 2 entries"]),
        (
            '[[mesh]]\nshape = "sphere"\nsubdivisions = 7\nrepeat = { count = 49999, step = [1, 0, 0] }\n',
            ["triangles"],
        ),
        ("[camera]\nposition = [0, 0, 0]\ntarget = [0, 0, 0]\n" + BOX, ["position", "target"]),
        (CAMERA + "fov_y = 0\n" + BOX, ["fov_y: found 0; allowed: greater than or equal to 0.01"]),
        (CAMERA + "up = [0, 0, 0]\n" + BOX, ["up"]),
        (CAMERA + "kind = 'flat'\n" + BOX, ["kind", "flat", "orthographic"]),
        (CAMERA + "kind = 'orthographic'\nheight = 0\n" + BOX, ["height", "0", "greater than 0"]),
        (CAMERA + "kind = 'orthographic'\n" + BOX, ["kind orthographic has height"]),
        (CAMERA + "kind = 'orthographic'\nheight = 3\nfov_y = 40\n" + BOX, ["height, not fov_y"]),
        (CAMERA + "height = 3\n" + BOX, ["kind perspective has fov_y, not height"]),
        (CAMERA + "near = 5\nfar = 2\n" + BOX, ["near", "5"]),
        (2 * "[[camera]]\nname = 'a'\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n" + BOX, ["'a'", "differ"]),
        ("[light]\ndirection = [0, -1, 0]\n" + BOX, ["kind", "spot"]),
        ('[light]\nkind = "area"\n' + BOX, ["kind", "area", "point"]),
        (SUN.replace("-1", "0") + BOX, ["direction"]),
        *((SUN + f"angular_radius = {size}\n" + BOX, ["angular_radius", size]) for size in ("-1", "90")),
        (SUN + "radius = 1\n" + BOX, ["'radius'", "did you mean 'angular_radius'"]),
        (LAMP + "radius = -0.1\n" + BOX, ["radius", "-0.1"]),
        (PANEL + "size = [0, 1]\n" + BOX, ["size", "found [0.0, 1.0]"]),
        ('[light]\nkind = "spot"\nposition = [0, 3, 0]\ndirection = [0, -1, 0]\nangle = 171\n' + BOX, ["angle", "171"]),
    ):
        refused(scene_file(text), "scene.toml", *words)


whole = st.integers(-(2**20), 2**20).map(float)


@given(shift=st.tuples(whole, whole, whole), power=st.integers(-20, 20))
def test_placing_can_be_undone(shift: tuple[float, float, float], power: int) -> None:
    box, cone = build_shape("box", {}, "test"), build_shape("cone", {}, "test")
    shapes = [(box.vertices, box.faces), (np.add(cone.vertices, (2.0, 1.0, 0.0)), cone.faces)]
    meshes = tuple(Mesh("shape", vertices * 2.0**power + shift, faces) for vertices, faces in shapes)
    scene = Scene("two", meshes, (), ())
    placed = scene.placement.scene(scene)
    for here, there in zip(scene.meshes, placed.meshes, strict=True):
        back = there.vertices / scene.placement.scale + scene.placement.center
        assert back == pytest.approx(here.vertices, rel=1e-12, abs=1e-9)
    low, high = placed.geometry.bounds
    assert low == pytest.approx(-high, abs=1e-6)
    assert 0.7 <= np.linalg.norm(high - low) <= 1.5
