"""Assumptions about a mesh file without a scene file: ground, camera and light."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
import typer

import shadowbench
from shadowbench.commands import app
from shadowbench.options import ViewOptions
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.assumed import without_ground
from shadowbench.scenes.geometry import bounds_of
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_digest
from shadowbench.scenes.opening import chosen_view
from shadowbench.studies.study import Study
from shadowbench.survey.survey import explanations_of, needs
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


@pytest.mark.parametrize(("floor", "added"), [(1.0, False), (0.75, False), (0.5, True), (0.0, True), (-1.0, True)])
def test_a_file_with_a_floor_gets_no_ground(tmp_path: Path, floor: float, added: bool) -> None:
    """Of a width relative to the box; a negative one faces down."""
    box = trimesh.creation.box(bounds=[(-1, 0.1, -1), (1, 1.1, 1)])
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * [floor, 1, abs(floor)]
    plane = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
    path = tmp_path / "room.obj"
    trimesh.util.concatenate([box, plane] if floor else [box]).export(path)
    assert ("ground" in [mesh.name for mesh in load_scene(path).meshes]) == added


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


@pytest.mark.parametrize(
    ("parts", "own"),
    [
        pytest.param([SLAB, BOX], True, id="a box on a slab"),
        pytest.param([SLAB, foliage(0.3)], True, id="a slab under leaves that hide it and hang over it"),
        pytest.param([SLAB, TOP, *legs(0.05)], True, id="a table on a slab"),
        pytest.param([*(part.apply_translation((1e5, -9e4, 3e5)) for part in turned(0, (1, 0, 0), SLAB, BOX))], True,
                     id="a slab far from the origin"),
        pytest.param(turned(40, (0, 1, 0), SLAB, BOX), True, id="a slab that is turned about the vertical"),
        pytest.param(turned(20, (1, 0, 0), SLAB, BOX), True, id="a tilted slab"),
        pytest.param([relief(0.2)], True, id="a terrain"),
        pytest.param([relief(0.2), block(-0.2, -0.05, -0.2, 0.2, 1, 0.2)], True, id="a house that goes into a terrain"),
        pytest.param(ROOM, True, id="a room with a ceiling"),
        pytest.param([CLOSED_ROOM], True, id="a room of one box, seen from inside"),
        pytest.param([BOX], False, id="a box"),
        pytest.param([trimesh.creation.icosphere(3)], False, id="a ball"),
        pytest.param([foliage(0)], False, id="a bush"),
        pytest.param([TOP, *legs(0.05)], False, id="a table"),
        pytest.param([TOP, *legs(0.002)], False, id="a table on legs thinner than the distance of the rays"),
        pytest.param([block(-0.25, 0, -0.25, 0.25, 0.09, 0.25), block(-0.1, 0.09, -0.1, 0.1, 2, 0.1)], False,
                     id="a statue on its plinth"),
        pytest.param([half_ball(1)], False, id="a dome"),
        pytest.param([half_ball(-1)], False, id="a bowl"),
        pytest.param([block(x, 0, z, x + 8, 9, z + 8) for x in range(0, 60, 10) for z in range(0, 60, 10)], False,
                     id="houses"),
        pytest.param(turned(50, (1, 0, 0), SLAB), False, id="a slab that stands nearly upright"),
        pytest.param([trimesh.Trimesh([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])], False,
                     id="a vertical plane"),
    ],
)  # fmt: skip
def test_a_ground_is_thin_over_half_the_footprint_and_all_stands_on_it(
    tmp_path: Path, parts: list[trimesh.Trimesh], own: bool
) -> None:
    path = tmp_path / "model.ply"
    trimesh.util.concatenate(parts).export(path)
    assert ("ground" not in [mesh.name for mesh in load_scene(path).meshes]) == own


def test_a_slab_under_a_box_needs_no_larger_a_map_than_its_top(tmp_path: Path) -> None:
    plane = trimesh.Trimesh([[-1, 0.02, 1], [1, 0.02, 1], [1, 0.02, -1], [-1, 0.02, -1]], [[0, 1, 2], [0, 2, 3]])
    sizes = []
    for name, floor in (("slab", SLAB), ("plane", plane)):
        path = tmp_path / f"{name}.obj"
        trimesh.util.concatenate([floor, BOX]).export(path)
        edge_size = needs(chosen_view(path, 128, ViewOptions(camera="3,2,4", target="0,0.3,0"))).texels.edge_size
        assert edge_size is not None
        sizes.append(edge_size)
    assert sizes[0] == pytest.approx(sizes[1], rel=0.05)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_what_rounding_leaves_of_a_coordinate_is_printed_as_0(tmp_path: Path, size: float) -> None:
    """A box that stands on y = 0 but for a part in 10⁸ of its size, as single precision leaves it."""
    low = np.array([-1, -1e-8, -1 + 1e-8]) * size
    path = tmp_path / "box.obj"
    path.write_text(trimesh.creation.box(bounds=[low, np.array([1, 2, 1]) * size]).export(file_type="obj", digits=14))
    notes = load_scene(path).notes
    assert "at y = 0 around (0, 0)," in notes[1]
    height = f"{size:g}"
    assert f"looking at (0, {height}, 0)," in notes[2]


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


def test_needs_tells_the_map_sizes_with_and_without_the_ground(tmp_path: Path, box: Path) -> None:
    """A table beside a post: a short shadow on the table, a long one on the ground; a box has the latter alone."""
    found, bare = (needs(chosen_view(str(box), 64, ViewOptions(no_ground=no_ground))) for no_ground in (False, True))
    assert found.without_ground == bare.texels and bare.without_ground is None
    rows = {row.need: row.reason for row in explanations_of(found)}
    assert "no shadow's edge is visible" in rows["without ground"]
    assert "without ground" not in {row.need for row in explanations_of(bare)}
    table = trimesh.creation.box(bounds=[(-1, 0.1, -1), (1, 1.1, 1)])
    post = trimesh.creation.box(bounds=[(-0.1, 1.1, -0.1), (0.1, 2.1, 0.1)])
    path = tmp_path / "table.obj"
    trimesh.util.concatenate([table, post]).export(path)
    both = needs(chosen_view(str(path), 128))
    assert both.texels.edge_size and both.without_ground and both.without_ground.edge_size
    row = next(row for row in explanations_of(both) if row.need == "without ground")
    assert row.number == f"{both.without_ground.edge_size:.0f}"
    assert row.reason.endswith(f"(--no-ground), instead of {both.texels.edge_size:.0f} with it")


def test_every_command_that_takes_a_mesh_file_can_leave_the_ground_out_and_place_camera_and_light() -> None:
    for name, command in typer.main.get_command(app).commands.items():
        options = {option for one in command.params for option in one.opts}
        places = {"--no-ground", "--sun", "--camera", "--target", "--lamp", "--sun-at"}
        assert places & options == (places if "--up" in options else set()), name


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off"])
def test_a_file_without_an_up_axis_is_rotated_by_the_option(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"post.{suffix}"
    trimesh.creation.box(bounds=[(0.5, 0.5, 0), (1.5, 3.5, 10)]).export(path)
    said, y, z = load_scene(path), load_scene(path, up="y"), load_scene(path, up="z")
    assert bounds_of(y.meshes[0].vertices) == pytest.approx(np.array([[0.5, 0.5, 0], [1.5, 3.5, 10]]))
    assert bounds_of(z.meshes[0].vertices) == pytest.approx(np.array([[0.5, 0, -3.5], [1.5, 10, -0.5]]))
    assert (y.meshes[0].vertices == said.meshes[0].vertices).all()
    corners = z.meshes[0].vertices[z.meshes[0].faces]
    assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6 == pytest.approx(30)
    line = f"no up axis in post.{suffix}: assumed y; --up z takes z"
    assert [line in scene.notes for scene in (said, y, z)] == [True, False, False]


@pytest.mark.parametrize(
    ("reference", "up", "words"),
    [
        ("cube-on-plane", "z", ["cube-on-plane specifies its up axis", ".obj .ply .stl .off"]),
        ("scene.toml", "y", ["scene.toml specifies its up axis", "rotate = [-90, 0, 0]"]),
        ("model.gltf", "z", ["model.gltf specifies its up axis"]),
        ("model.obj", "Z", ["found 'Z'; allowed: y, z"]),
    ],
)
def test_up_is_refused_where_it_is_known_or_no_axis(reference: str, up: str, words: list[str]) -> None:
    refused(reference, *words, up=up)


def test_a_scene_file_is_never_given_a_ground(scene_file: Callable[..., Path]) -> None:
    scene = load_scene(scene_file('[[mesh]]\nshape = "box"\n'))
    assert [mesh.name for mesh in scene.meshes] == ["box"]
    assert [note.split(" in ")[0] for note in scene.notes] == ["no camera", "no light"]


def test_a_speck_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "speck.obj"
    path.write_text("v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3\n")
    refused(path, "speck.obj: all meshes together span")
