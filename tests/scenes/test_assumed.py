"""Assumptions about a mesh file without a scene file: ground, camera and light."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

import shadowbench
from shadowbench.options import ViewOptions
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.assumed import without_ground
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_digest
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.triangles import bounds_of
from shadowbench.studies.study import Study
from tests.scenes.conftest import refused


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.obj"
    trimesh.creation.box(bounds=[(4, 1, -2.5), (6, 5, -1.5)]).export(path)
    return path


def test_a_box_alone_gets_a_ground_a_camera_and_a_sun(box: Path) -> None:
    scene = load_scene(box)
    diagonal, center = math.sqrt(4 + 16 + 1), np.array([5.0, 3.0, -2.0])
    assert [mesh.name for mesh in scene.meshes] == ["box", "ground"]
    ground = scene.meshes[1]
    assert bounds_of(ground.vertices) == pytest.approx(
        np.array([[5 - 2 * diagonal, 1, -2 - 2 * diagonal], [5 + 2 * diagonal, 1, -2 + 2 * diagonal]])
    )
    assert ground.casts and ground.receives and not ground.closed
    assert scene.geometry.normals[-2:] == pytest.approx(np.array([[0, 1, 0], [0, 1, 0]]))

    (camera,) = scene.cameras
    assert camera.target == pytest.approx(center)
    assert math.degrees(camera.fov_y) == pytest.approx(36)
    away = np.subtract(camera.position, center)
    assert np.linalg.norm(away) == pytest.approx(diagonal / 2 / math.sin(math.radians(18)))
    assert away / np.linalg.norm(away) == pytest.approx(np.array([1.25, 1.2, 2.7]) / math.hypot(1.25, 1.2, 2.7))

    (light,) = scene.lights
    assert (light.kind, light.direction) == ("directional", (0.8, -1.0, -0.6))
    assert [note.split(" in ")[0] for note in scene.notes] == ["no up axis", "no ground", "no camera", "no light"]
    assert all("box.obj: assumed" in note for note in scene.notes)


def block(*bounds: float) -> trimesh.Trimesh:
    """A box from its lowest to its highest corner."""
    return trimesh.creation.box(bounds=np.reshape(bounds, (2, 3)))


def turned(degrees: float, axis: tuple[int, int, int], *parts: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    matrix = trimesh.transformations.rotation_matrix(math.radians(degrees), axis)
    return [part.copy().apply_transform(matrix) for part in parts]


def relief(height: float) -> trimesh.Trimesh:
    """A terrain of 2 × 2 m, as a sheet: hills of this height above its valleys."""
    x, z = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 60), indexing="ij")
    y = height * (np.sin(4 * x) * np.cos(5 * z) + 1) / 2
    at = np.arange(3600).reshape(60, 60)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return trimesh.Trimesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)


def foliage(low: float) -> trimesh.Trimesh:
    """Leaves from this height up to 2 m, which hide all that is below from above."""
    random = np.random.default_rng(0)
    leaves = random.uniform([-1.1, low, -1.1], [1.1, 2, 1.1], (6000, 1, 3)) + random.normal(0, 0.06, (6000, 3, 3))
    return trimesh.Trimesh(leaves.reshape(-1, 3), np.arange(18000).reshape(-1, 3))


def half_ball(up: int) -> trimesh.Trimesh:
    """The shell of the upper or lower half of a ball, whose triangles face up."""
    ball = trimesh.creation.icosphere(4)
    ball.update_faces(up * ball.triangles_center[:, 1] > 0)
    return ball if up > 0 else trimesh.Trimesh(ball.vertices, ball.faces[:, ::-1])


SLAB, BOX = block(-1, 0, -1, 1, 0.02, 1), block(-0.3, 0.02, -0.3, 0.3, 0.62, 0.3)
TOP = block(-0.75, 0.7, -0.4, 0.75, 0.74, 0.4)
ROOM = [
    block(-3, -0.2, -2, 3, 0, 2), block(-3, 3, -2, 3, 3.2, 2), block(-3, 0, -2.2, 3, 3, -2), block(-3, 0, 2, 3, 3, 2.2),
    block(-3.2, 0, -2, -3, 3, 2), block(3, 0, -2, 3.2, 3, 2), block(-0.5, 0, -0.5, 0.5, 0.7, 0.5),
]  # fmt: skip
CLOSED_ROOM = trimesh.Trimesh(block(-3, 0, -2, 3, 3, 2).vertices, block(-3, 0, -2, 3, 3, 2).faces[:, ::-1])


def legs(width: float) -> list[trimesh.Trimesh]:
    return [block(x, 0, z, x + width, 0.7, z + width) for x in (-0.75, 0.75 - width) for z in (-0.4, 0.4 - width)]


GROUNDS = {
    "a box on a slab": [SLAB, BOX],
    "a slab under leaves that hide it and hang over it": [SLAB, foliage(0.3)],
    "a table on a slab": [SLAB, TOP, *legs(0.05)],
    "a slab far from the origin": [
        part.apply_translation((1e5, -9e4, 3e5)) for part in turned(0, (1, 0, 0), SLAB, BOX)
    ],
    "a tilted slab": turned(20, (1, 0, 0), SLAB, BOX),
    "a terrain": [relief(0.2)],
    "a house that goes into a terrain": [relief(0.2), block(-0.2, -0.05, -0.2, 0.2, 1, 0.2)],
    "a room with a ceiling": ROOM,
    "a room of one box, seen from inside": [CLOSED_ROOM],
}
NO_GROUNDS = {
    "a box": [BOX],
    "a ball": [trimesh.creation.icosphere(3)],
    "a bush": [foliage(0)],
    "a table": [TOP, *legs(0.05)],
    "a table on legs thinner than the distance of the rays": [TOP, *legs(0.002)],
    "a statue on its plinth": [block(-0.25, 0, -0.25, 0.25, 0.09, 0.25), block(-0.1, 0.09, -0.1, 0.1, 2, 0.1)],
    "a dome": [half_ball(1)],
    "a bowl": [half_ball(-1)],
    "houses": [block(x, 0, z, x + 8, 9, z + 8) for x in range(0, 60, 10) for z in range(0, 60, 10)],
    "a slab that stands nearly upright": turned(50, (1, 0, 0), SLAB),
    "a vertical plane": [trimesh.Trimesh([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])],
}


def test_a_ground_is_thin_over_half_the_footprint_and_all_stands_on_it(tmp_path: Path) -> None:
    path = tmp_path / "model.ply"
    for what, parts in (GROUNDS | NO_GROUNDS).items():
        trimesh.util.concatenate(parts).export(path)
        assert ("ground" not in [mesh.name for mesh in load_scene(path).meshes]) == (what in GROUNDS), what


def test_without_the_ground_the_rest_is_the_same_and_its_view_another(box: Path) -> None:
    view, bare = (chosen_view(str(box), 64, ViewOptions(no_ground=no_ground)) for no_ground in (False, True))
    assert [mesh.name for mesh in bare.scene.meshes] == ["box"] and bare.scene.cameras == view.scene.cameras
    assert view.scene.notes[1].endswith("which receives and casts shadows; --no-ground leaves it out")
    assert bare.scene.notes[1] == "no ground in box.obj: none assumed" and bare.scene.notes[2:] == view.scene.notes[2:]
    assert view_digest(bare) != view_digest(view)
    assert chosen_view(view.scene, 64, ViewOptions(no_ground=True)).scene.notes == bare.scene.notes  # loaded before
    assert len(shadowbench.load(box, no_ground=True).meshes) == 1
    study = Study.of([str(box)], [parse_spec("unshadowed", techniques())], no_ground=True, view_size=64)
    (block,) = study.blocks()
    assert view_digest(block.view) == view_digest(bare) and study.facts["no_ground"] is True


def test_a_scene_that_was_given_no_ground_loses_none() -> None:
    scene = load_scene("stairs")
    bare = without_ground(scene)
    assert bare.meshes == scene.meshes and bare.notes[-1] == "no-ground: no ground was assumed in stairs"


def test_a_file_without_an_up_axis_is_rotated_by_the_option(tmp_path: Path) -> None:
    for suffix in ("obj", "ply", "stl", "off"):
        path = tmp_path / f"post.{suffix}"
        trimesh.creation.box(bounds=[(0.5, 0.5, 0), (1.5, 3.5, 10)]).export(path)
        said, y, z = load_scene(path), load_scene(path, up="y"), load_scene(path, up="z")
        assert bounds_of(y.meshes[0].vertices) == pytest.approx(np.array([[0.5, 0.5, 0], [1.5, 3.5, 10]]))
        assert bounds_of(z.meshes[0].vertices) == pytest.approx(np.array([[0.5, 0, -3.5], [1.5, 10, -0.5]]))
        assert (y.meshes[0].vertices == said.meshes[0].vertices).all()
        corners = z.meshes[0].vertices[z.meshes[0].faces]
        assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6 == pytest.approx(
            30
        )
        line = f"no up axis in post.{suffix}: assumed y; --up z takes z"
        assert [line in scene.notes for scene in (said, y, z)] == [True, False, False]


def test_up_is_refused_where_it_is_known_or_no_axis() -> None:
    for reference, up, words in (
        ("cube-on-plane", "z", ["cube-on-plane specifies its up axis", ".obj .ply .stl .off"]),
        ("scene.toml", "y", ["scene.toml specifies its up axis", "rotate = [-90, 0, 0]"]),
        ("model.gltf", "z", ["model.gltf specifies its up axis"]),
        ("model.obj", "Z", ["found 'Z'; allowed: y, z"]),
    ):
        refused(reference, *words, up=up)


def test_a_speck_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "speck.obj"
    path.write_text("v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3\n")
    refused(path, "speck.obj: all meshes together span")
