"""`export`: the exported view, read back, has the same shadows, and its matrices give the same pixels."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.masks.export import (
    MARGIN,
    PADDING,
    clip_of,
    describe,
    export_view,
    glb_of,
    light_box,
)
from shadowbench.measure.scoring import positions
from shadowbench.options import ViewSize
from shadowbench.scenes.file_contents import Chosen
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Light, Scene, View, view_of
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.masks import read_mask
from shadowbench.truths.rays import ViewRays
from shadowbench.truths.trace import Truth, trace
from tests.parallel import parallel

SIZE = 128


def read_back(folder: Path, size: ViewSize) -> View:
    """The view of scene.glb; not through load_scene, which gives a ground to what has none."""
    contents = read_meshes(folder / "scene.glb")
    scene = Scene("read", contents.meshes, contents.cameras, contents.lights)
    return view_of(scene, scene.cameras[0], scene.lights[0], size)


def assert_same_shadows(view: View, folder: Path, truth: Truth | None = None) -> None:
    truth = truth or trace(view, 1)
    export_view(view, folder, view.scene.name)
    again = trace(read_back(folder, view.size), 1)
    assert (truth.visibility[truth.receivers] < 0.5).any()
    decided = ~truth.undecided
    assert np.count_nonzero(decided & (truth.receivers != again.receivers)) == 0
    assert np.count_nonzero(decided & (truth.visibility != again.visibility)) == 0


@pytest.mark.parametrize("name", ["stairs", "spot-lamp", "room-with-lamp", "terrain"])
def test_a_scene_that_is_read_back_has_the_same_shadows(builtin: Callable[..., View], name: str, tmp_path) -> None:
    assert_same_shadows(builtin(name, "96x54"), tmp_path)


def test_a_scene_a_thousand_kilometres_away_keeps_its_shadows(builtin: Callable[..., View], tmp_path: Path) -> None:
    near = builtin("stairs", SIZE)
    far = np.array([1e6, 2e5, -3e5])
    scene = replace(near.scene, meshes=tuple(replace(mesh, vertices=mesh.vertices + far) for mesh in near.scene.meshes))
    camera = replace(
        near.camera,
        position=tuple(near.camera.position + far),
        target=tuple(near.camera.target + far),
    )
    assert_same_shadows(view_of(scene, camera, near.light, SIZE), tmp_path)


@pytest.fixture(scope="module")
def seen(builtin: Callable[..., View]) -> Callable[..., View]:
    """The view of a built-in scene, or by parallel rays that of NAME's."""

    def view(name: str, size: int | str = SIZE) -> View:
        return parallel(load_scene(name[:-2]), size) if name.endswith("'s") else builtin(name, size)

    return view


@pytest.mark.parametrize("name", ["stairs", "stairs's", "spot-lamp", "lamp-by-wall's"])
def test_camera_light_and_names_are_read_back(seen: Callable[..., View], name: str, tmp_path: Path) -> None:
    view = seen(name)
    export_view(view, tmp_path, name)
    found = read_back(tmp_path, SIZE)
    assert found.camera.name == view.camera.name
    assert (found.camera.fov_y, found.camera.height) == (view.camera.fov_y, view.camera.height)
    np.testing.assert_allclose(found.camera.basis(), view.camera.basis(), atol=1e-12)
    np.testing.assert_allclose(found.near_far, view.near_far, rtol=1e-6)
    assert (found.light.kind, found.light.name) == (view.light.kind, view.light.name)
    assert found.light.angle == pytest.approx(view.light.angle)
    np.testing.assert_allclose(found.light.homogeneous[0], view.light.homogeneous[0], atol=1e-12)
    assert [mesh.name for mesh in found.scene.meshes] == [mesh.name for mesh in view.scene.meshes]


def tree_of(glb: bytes) -> dict[str, Any]:
    """What of a .glb is JSON."""
    (length,) = struct.unpack("<I", glb[12:16])
    tree: dict[str, Any] = json.loads(glb[20 : 20 + length])
    return tree


def materials(glb: bytes) -> dict[str, dict[str, Any]]:
    """Each mesh's material."""
    tree = tree_of(glb)
    return {mesh["name"]: tree["materials"][mesh["primitives"][0]["material"]] for mesh in tree["meshes"]}


def test_only_closed_meshes_that_are_wound_outwards_get_single_sided_materials(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    plane, cube = view.scene.meshes
    turned = np.ascontiguousarray(cube.faces[:, ::-1])
    beside = np.concatenate([cube.vertices, 0.5 * cube.vertices + 9]), len(cube.vertices)
    meshes = {
        "plane": plane,
        "cube": cube,
        "inward": replace(cube, faces=turned),
        "open": replace(cube, faces=cube.faces[1:]),
        "one turned": replace(cube, faces=np.concatenate([turned[:1], cube.faces[1:]])),
        "part inward": replace(cube, vertices=beside[0], faces=np.concatenate([cube.faces, turned + beside[1]])),
        "unshared": replace(
            cube,
            vertices=cube.vertices[cube.faces.ravel()],
            faces=np.arange(3 * len(cube.faces), dtype=np.int32).reshape(-1, 3),
        ),
        "no caster": replace(cube, casts=False),
        "far": replace(cube, vertices=cube.vertices + 1e6),
    }
    scene = replace(view.scene, meshes=tuple(replace(mesh, name=name) for name, mesh in meshes.items()))
    every = replace(view, scene=scene)
    single = {name for name, found in materials(glb_of(every, sides="closed")).items() if not found["doubleSided"]}
    assert single == {"cube", "unshared", "no caster", "far"}
    assert all(found["doubleSided"] for found in materials(glb_of(every)).values())
    described = describe(every, "scene", "closed")
    assert {mesh["name"] for mesh in described["meshes"] if mesh["closed"]} == single


def test_bounds_box_and_sides_are_described(
    shadowbench: Callable, builtin: Callable[..., View], tmp_path: Path
) -> None:
    view = builtin("stairs", SIZE)
    for options, sides in (((), "double"), (("--sides", "closed"), "closed")):
        folder = tmp_path / sides
        assert shadowbench("export", "stairs", folder, "--view-size", str(SIZE), *options).code == 0
        found = json.loads((folder / "view.json").read_text(encoding="utf-8"))
        np.testing.assert_allclose([found["bounds"]["low"], found["bounds"]["high"]], view.scene.geometry.bounds)
        assert found["light"]["box"] == light_box(view)
        assert found["sides"] == sides
        material = materials((folder / "scene.glb").read_bytes())["stairs"]
        assert material["doubleSided"] == (sides == "double")
        assert material["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 1]


@pytest.mark.parametrize("name", ["cube-on-plane", "cube-on-plane's", "colonnade", "room-with-lamp"])
def test_the_nearest_surface_is_the_nearest_that_is_seen(seen: Callable[..., View], name: str) -> None:
    """As far as between two pixels; the camera of two scenes is within their bounds."""
    view = seen(name)
    hit = trace(view, 1).triangle
    nearest = float((positions(view, hit) @ -view.camera.basis()[2])[hit >= 0].min())
    assert 0.99 * nearest < describe(view, name)["camera"]["nearest"] <= nearest * (1 + 1e-12)


@pytest.mark.parametrize("size", [SIZE, "64x36", "20x64"])
@pytest.mark.parametrize("name", ["stairs", "stairs's"])
def test_the_written_matrices_lead_to_the_pixel_centres_that_are_traced(
    seen: Callable[..., View], name: str, size: int | str, tmp_path: Path
) -> None:
    view = seen(name, size)
    export_view(view, tmp_path, "stairs")
    found = json.loads((tmp_path / "view.json").read_text(encoding="utf-8"))
    matrix = np.array(found["camera"]["projection"]) @ np.array(found["camera"]["view"])
    rays = ViewRays(view).camera_rays(slice(0, view.size.height))
    points = (rays.origins + 3 * rays.directions).T
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    x, y = (clip[:, :2] / clip[:, 3:]).T
    rows, columns = np.divmod(np.arange(view.size.pixels), view.size.width)
    np.testing.assert_allclose(x, (2 * columns + 1) / found["image"]["width"] - 1, atol=1e-9)
    np.testing.assert_allclose(y, 1 - (2 * rows + 1) / found["image"]["height"], atol=1e-9)


def test_the_description_says_what_gltf_has_no_word_for(builtin: Callable[..., View], tmp_path: Path) -> None:
    view = builtin("cube-on-plane", 32)
    plane, cube = view.scene.meshes
    spot = Light("lamp", "spot", direction=(0.0, -2.0, 0.0), position=(0.0, 3.0, 0.0), angle=np.radians(60))
    scene = replace(view.scene, meshes=(plane, replace(cube, casts=False)))
    described = describe(view_of(scene, view.camera, spot, 32), "cube-on-plane")
    expected = {"name": "lamp", "kind": "spot", "direction": [0, -1, 0], "position": [0, 3, 0]}
    assert {key: described["light"][key] for key in expected} == expected
    assert described["light"]["cone"] == pytest.approx(60)
    assert [mesh["casts"] for mesh in described["meshes"]] == [True, False]
    assert described["mask"]["score"] == "shadowbench score cube-on-plane MASK.png --view camera --light lamp"


@pytest.mark.parametrize(
    ("name", "radius", "size"), [("window", None, [1.4, 1.0]), ("shade", 0.02, None), ("fence", 0.2665, None)]
)
def test_a_light_s_size_is_in_the_description_and_gltf_has_the_light_at_its_centre(
    builtin: Callable[..., View], name: str, radius: float | None, size: list[float] | None, tmp_path: Path
) -> None:
    view = builtin(name, 32)
    export_view(view, tmp_path, name)
    described = json.loads((tmp_path / "view.json").read_text(encoding="utf-8"))
    light, read = described["light"], read_back(tmp_path, 32).light
    assert (read.kind, read.soft, read.angle) == (view.light.hard_kind, False, view.light.frustum_angle or 0.0)
    assert sum("glTF" in line for line in described["assumptions"]) == 1
    assert (light["kind"], light["size"]) == (view.light.kind, size)
    assert light["radius"] == (radius and pytest.approx(radius))


def test_the_example_is_a_mask_without_an_error(shadowbench: Callable, tmp_path: Path) -> None:
    assert shadowbench("export", "spot-lamp", tmp_path / "out", "--view-size", "96").code == 0
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["scene.glb", "truth.png", "view.json"]
    assert read_mask(tmp_path / "out" / "truth.png").shape == (96, 96)
    answer = shadowbench("score", "spot-lamp", tmp_path / "out" / "truth.png", "--json")
    assert json.loads(answer.out)["metrics"]["iou"] == 1
    assert json.loads(answer.out)["warnings"] == []


def test_bad_input_is_one_line(shadowbench: Callable, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for arguments, line in [
        (("stairs", tmp_path / "new", "--view", "no"), "view: found 'no'; allowed: camera"),
        (("stairs", tmp_path / "file" / "x"), "cannot be created"),
        (("nowhere", tmp_path / "new"), "is no built-in scene"),
        (("stairs", tmp_path / "new", "--sides", "front"), "'front' is not one of 'closed', 'double'"),
    ]:
        answer = shadowbench("export", *arguments)
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1) and line in answer.err


def in_camera(points: np.ndarray, box: dict) -> np.ndarray:
    """(N, 3) right, up and depth of points in the box's orthographic camera, looking from position at target."""
    forward = (np.array(box["target"]) - box["position"]) / box["depth"]
    return (points - box["position"]) @ np.array([np.cross(forward, box["up"]), box["up"], forward]).T


def used(view: View) -> np.ndarray:
    return view.scene.geometry.vertices[view.scene.geometry.faces].reshape(-1, 3)


@pytest.mark.parametrize("name", ["stairs", "fence"])
def test_the_box_of_a_directional_light_is_tight(builtin: Callable[..., View], name: str) -> None:
    view = builtin(name, SIZE)
    box = light_box(view)
    travelled = np.subtract(box["target"], box["position"]) / box["depth"]
    np.testing.assert_allclose(travelled, np.negative(view.light.homogeneous[0]), atol=1e-12)
    found = in_camera(used(view), box)
    half = np.array([box["width"], box["height"]]) / 2
    np.testing.assert_allclose(found[:, :2].min(axis=0), -half, rtol=1e-9)
    np.testing.assert_allclose(found[:, :2].max(axis=0), half, rtol=1e-9)
    margin = MARGIN * (half.max() * 2 + box["depth"])
    assert 0 < found[:, 2].min() < margin
    assert 0 < box["depth"] - found[:, 2].max() < margin


def test_a_map_pads_the_box_by_texels_and_a_phase_moves_it_by_parts_of_one(builtin: Callable[..., View]) -> None:
    view = builtin("stairs", SIZE)
    tight, padded = light_box(view), light_box(view, 256)
    texel = {side: padded[side] / 256 for side in ("width", "height")}
    for side, length in texel.items():
        assert padded[side] - tight[side] == pytest.approx(2 * PADDING * length)
    moved = light_box(view, 256, (0.5, -0.25))
    assert {name: moved[name] for name in ("up", "width", "height", "depth")} == {
        name: padded[name] for name in ("up", "width", "height", "depth")
    }
    for end in ("position", "target"):
        step = in_camera(np.array(moved[end]), padded) - in_camera(np.array(padded[end]), padded)
        np.testing.assert_allclose(step, [0.5 * texel["width"], -0.25 * texel["height"], 0], atol=1e-12)


def test_a_mesh_that_neither_casts_nor_receives_does_not_enlarge_the_box(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    sky = replace(view.scene.meshes[1], vertices=100 * view.scene.meshes[1].vertices, casts=False, receives=False)
    assert light_box(replace(view, scene=replace(view.scene, meshes=(*view.scene.meshes, sky)))) == light_box(view)


def test_near_is_at_the_triangle_that_is_nearest_not_at_its_corners(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    plane = replace(view.scene, meshes=view.scene.meshes[:1])
    down, position = (0.0, -1.0, 0.0), (0.1, 0.5, 0.0)
    for light, near in (
        (Light("bulb", "point", position=position), 0.5),
        (Light("spot", "spot", position=position, direction=down, angle=1.0), 0.5),
        (Light("up", "spot", position=position, direction=(0.0, 1.0, 0.0), angle=1.0), 0.5),  # nothing in its cone
        (Light("in", "point", position=(0.1, 0.0, 0.0)), None),
    ):
        box = light_box(replace(view, scene=plane, light=light))
        assert box["near"] == (pytest.approx(near, rel=2e-3) if near else box["far"] / 1e4)
        assert box["near"] < box["far"]


MOVED = """
mesh = [
    { name = "floor", shape = "plane", scale = 6, translate = [1000, 0, 0] },
    { name = "post", shape = "box", translate = [1000.5, 0.5, 0] },
]
[[sequence]]
name = "turns"
frames = 5
[[sequence.key]]
time = 1.0
camera = { target = [1001, 0, 0] }
light = { direction = [1, -1, 0] }
object = { post = { translate = [0, 0.5, 0], rotate = [0, 90, 30] } }
"""


@pytest.mark.parametrize(
    ("scene", "sequence", "moving"),
    [
        ("stairs", "pan", "camera"),
        ("spot-lamp", "carried-lamp", "light"),
        ("cube-on-plane", "moving-caster", "cube"),
        ("moved", "turns", "post camera light"),
    ],
)
def test_an_animation_that_is_read_back_has_the_frames_and_view_json_their_matrices(
    shadowbench: Callable, scene: str, sequence: str, moving: str, tmp_path: Path
) -> None:
    """The scene `moved` is far from the origin, so that its nodes are translated besides."""
    if scene == "moved":
        (tmp_path / "moved.toml").write_text(MOVED, encoding="utf-8")
        scene = str(tmp_path / "moved.toml")
    out, view = tmp_path / "out", chosen_view(scene, ViewSize(32, 24))
    answer = shadowbench("export", scene, out, "--view-size", "32x24", "--sequence", sequence, "--frames", "3")
    assert answer.code == 0, answer.err
    clip, described = clip_of(view, sequence, 3), json.loads((out / "view.json").read_text(encoding="utf-8"))
    assert (described["sequence"]["name"], len(described["sequence"]["frames"])) == (sequence, 3)
    tree = tree_of((out / "scene.glb").read_bytes())
    nodes = [tree["nodes"][one["target"]["node"]]["name"] for one in tree["animations"][0]["channels"]]
    assert list(dict.fromkeys(nodes)) == moving.split()
    for index, (frame, written) in enumerate(zip(clip.frames, described["sequence"]["frames"], strict=True)):
        read = read_meshes(out / "scene.glb", chosen=Chosen(time=written["time"]))
        (camera,), (light,) = read.cameras, read.lights
        for mesh, original in zip(read.meshes, frame.scene.meshes, strict=True):
            corners = original.vertices[original.faces]
            np.testing.assert_allclose(mesh.vertices[mesh.faces], corners, atol=1e-5 * np.abs(corners).max())
        np.testing.assert_allclose(camera.position, frame.camera.position, rtol=1e-6)
        np.testing.assert_allclose(camera.basis(), frame.camera.basis(), atol=1e-6)
        np.testing.assert_allclose(light.homogeneous[0], frame.light.homogeneous[0], atol=1e-5)
        np.testing.assert_array_equal(written["camera"]["projection"], frame.projection)
        np.testing.assert_allclose(np.array(written["camera"]["view"])[:3, :3], frame.camera.basis())
        assert written["light"]["box"] == light_box(frame)
        truth = trace(frame, 1)
        assert np.array_equal(read_mask(out / "truth" / f"00{index}.png"), truth.visibility)


def test_what_an_animation_cannot_say_is_said(shadowbench: Callable, tmp_path: Path) -> None:
    small = "--view-size", "16"
    answer = shadowbench("export", "stairs", tmp_path / "out", *small, "--sequence", "zoom", "--frames", "2")
    assert "sequence zoom changes the field of view, which glTF cannot say" in answer.err
    for arguments, line in [
        (("walker", tmp_path / "new", *small, "--sequence", "walker"), "walker changes its shape; allowed: sequences"),
        (("stairs", tmp_path / "new", "--sequence", "all"), "--sequence: found 'all'; allowed: one, such as dolly"),
        (("stairs", tmp_path / "new", "--frames", "3"), "--frames 3: is for a --sequence, which is not given"),
    ]:
        answer = shadowbench("export", *arguments)
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1) and line in answer.err
