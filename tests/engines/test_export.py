"""`export`: the exported view, read back, has the same shadows, and its matrices give the same pixels."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.engines.export import describe, export_view, glb_of, projection_matrix, view_matrix
from shadowbench.engines.light_box import light_box
from shadowbench.gl.gbuffer import view_projection
from shadowbench.measure.scoring import depths
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Light, Scene, View, view_of
from shadowbench.scores.masks import read_mask
from shadowbench.truths.rays import ViewRays
from shadowbench.truths.trace import Truth, trace

SIZE = 128


def read_back(folder: Path, size: int) -> View:
    """The view of scene.glb; not through load_scene, which gives a ground to what has none."""
    contents = read_meshes(folder / "scene.glb")
    scene = Scene("read", contents.meshes, contents.cameras, contents.lights)
    return view_of(scene, scene.cameras[0], scene.lights[0], size)


def assert_same_shadows(view: View, folder: Path, truth: Truth | None = None) -> None:
    truth = truth or trace(view, 1)
    export_view(view, truth, folder, view.scene.name)
    again = trace(read_back(folder, view.size), 1)
    assert (truth.visibility[truth.receivers] < 0.5).any()
    decided = ~truth.undecided
    assert np.count_nonzero(decided & (truth.receivers != again.receivers)) == 0
    assert np.count_nonzero(decided & (truth.visibility != again.visibility)) == 0


@pytest.mark.parametrize("name", hard_names())
def test_a_scene_that_is_read_back_has_the_same_shadows(builtin: Callable[..., View], name: str, tmp_path) -> None:
    assert_same_shadows(builtin(name, SIZE), tmp_path)


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


@pytest.mark.parametrize("name", ["stairs", "spot-lamp", "lamp-by-wall"])
def test_camera_light_colours_and_names_are_read_back(builtin: Callable[..., View], name: str, tmp_path: Path) -> None:
    view = builtin(name, SIZE)
    export_view(view, trace(view, 1), tmp_path, name, colours=True)
    found = read_back(tmp_path, SIZE)
    assert found.camera.name == view.camera.name
    assert found.camera.fov_y == view.camera.fov_y
    np.testing.assert_allclose(found.camera.basis(), view.camera.basis(), atol=1e-12)
    np.testing.assert_allclose(found.near_far, view.near_far, rtol=1e-6)
    assert (found.light.kind, found.light.name) == (view.light.kind, view.light.name)
    assert found.light.angle == pytest.approx(view.light.angle)
    np.testing.assert_allclose(found.light.homogeneous[0], view.light.homogeneous[0], atol=1e-12)
    assert [(mesh.name, mesh.color) for mesh in found.scene.meshes] == [
        (mesh.name, mesh.color) for mesh in view.scene.meshes
    ]


def parsed(glb: bytes) -> tuple[dict[str, Any], Callable[[int], np.ndarray]]:
    """The JSON of a .glb, and a function for the array of an accessor."""
    (length,) = struct.unpack("<I", glb[12:16])
    tree, data = json.loads(glb[20 : 20 + length]), glb[28 + length :]

    def array(index: int) -> np.ndarray:
        accessor = tree["accessors"][index]
        width, kind = {"VEC3": 3, "SCALAR": 1}[accessor["type"]], {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        start = tree["bufferViews"][accessor["bufferView"]]["byteOffset"] + accessor.get("byteOffset", 0)
        return np.frombuffer(data, kind, accessor["count"] * width, start).reshape(-1, width)

    return tree, array


def materials(glb: bytes) -> dict[str, dict[str, Any]]:
    """Each mesh's material."""
    tree, _ = parsed(glb)
    return {mesh["name"]: tree["materials"][mesh["primitives"][0]["material"]] for mesh in tree["meshes"]}


@pytest.mark.parametrize("name", ["stairs", "terrain"])
def test_normals_are_flat(builtin: Callable[..., View], name: str) -> None:
    view = builtin(name, SIZE)
    tree, array = parsed(glb_of(view))
    for mesh, written in zip(view.scene.meshes, tree["meshes"], strict=True):
        (primitive,) = written["primitives"]
        faces = array(primitive["indices"]).reshape(-1, 3)
        corners = mesh.vertices[mesh.faces]
        np.testing.assert_array_equal(array(primitive["attributes"]["POSITION"])[faces], corners.astype(np.float32))
        normals = array(primitive["attributes"]["NORMAL"])[faces]
        exact = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        exact /= np.linalg.norm(exact, axis=1, keepdims=True)
        np.testing.assert_allclose(normals, np.repeat(exact[:, None], 3, axis=1), atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-6)


def test_triangles_are_read_back_as_they_were(builtin: Callable[..., View], tmp_path: Path) -> None:
    view = builtin("stairs", SIZE)
    (tmp_path / "scene.glb").write_bytes(glb_of(view, sides="closed"))
    for mesh, again in zip(view.scene.meshes, read_back(tmp_path, SIZE).scene.meshes, strict=True):
        assert len(again.vertices) == len(mesh.vertices)
        np.testing.assert_array_equal(
            again.vertices[again.faces], mesh.vertices[mesh.faces].astype(np.float32).astype(np.float64)
        )


def test_materials_are_white_or_have_the_meshes_colours(builtin: Callable[..., View]) -> None:
    view = builtin("stairs", SIZE)
    for colours in (False, True):
        found = materials(glb_of(view, colours=colours))
        for mesh in view.scene.meshes:
            color = list(mesh.color) if colours else [1, 1, 1]
            surface = {"baseColorFactor": [*color, 1], "metallicFactor": 0, "roughnessFactor": 1}
            assert found[mesh.name]["pbrMetallicRoughness"] == surface


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
    for options, sides, color in (((), "double", [1, 1, 1]), (("--sides", "closed", "--colours"), "closed", None)):
        folder = tmp_path / sides
        assert shadowbench("export", "stairs", folder, "--view-size", str(SIZE), *options).code == 0
        found = json.loads((folder / "view.json").read_text(encoding="utf-8"))
        np.testing.assert_allclose([found["bounds"]["low"], found["bounds"]["high"]], view.scene.geometry.bounds)
        assert found["light"]["box"] == light_box(view)
        assert found["sides"] == sides
        material = materials((folder / "scene.glb").read_bytes())["stairs"]
        assert material["doubleSided"] == (sides == "double")
        stairs = next(mesh for mesh in view.scene.meshes if mesh.name == "stairs")
        assert material["pbrMetallicRoughness"]["baseColorFactor"] == [*(color or stairs.color), 1]


@pytest.mark.parametrize("name", ["cube-on-plane", "colonnade", "room-with-lamp"])
def test_the_nearest_surface_is_the_nearest_that_is_seen(builtin: Callable[..., View], name: str) -> None:
    """As far as between two pixels; the camera of two scenes is within their bounds."""
    view = builtin(name, SIZE)
    hit = trace(view, 1).triangle
    seen = float(depths(view, hit)[hit >= 0].min())
    assert 0.99 * seen < describe(view, name)["camera"]["nearest"] <= seen


def test_the_matrices_are_those_that_our_own_techniques_use(builtin: Callable[..., View]) -> None:
    view = builtin("stairs", SIZE)
    np.testing.assert_allclose(projection_matrix(view) @ view_matrix(view.camera), view_projection(view), atol=1e-12)


def test_the_written_matrices_lead_to_the_pixel_centres_that_are_traced(
    builtin: Callable[..., View], tmp_path: Path
) -> None:
    view = builtin("stairs", SIZE)
    export_view(view, trace(view, 1), tmp_path, "stairs")
    found = json.loads((tmp_path / "view.json").read_text(encoding="utf-8"))
    matrix = np.array(found["camera"]["projection"]) @ np.array(found["camera"]["view"])
    directions = ViewRays(view).directions(slice(0, SIZE)).reshape(3, -1).T
    points = np.asarray(view.camera.position) + 3 * directions
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    x, y = (clip[:, :2] / clip[:, 3:]).T
    rows, columns = np.divmod(np.arange(SIZE * SIZE), SIZE)
    np.testing.assert_allclose(x, (2 * columns + 1) / found["image"]["width"] - 1, atol=1e-9)
    np.testing.assert_allclose(y, 1 - (2 * rows + 1) / found["image"]["height"], atol=1e-9)


def test_the_description_says_the_light_and_what_gltf_has_no_word_for(
    builtin: Callable[..., View], tmp_path: Path
) -> None:
    view = builtin("cube-on-plane", 32)
    cube = replace(view.scene.meshes[1], casts=False)
    spot = Light("lamp", "spot", direction=(0.0, -2.0, 0.0), position=(0.0, 3.0, 0.0), angle=np.radians(60))
    view = view_of(replace(view.scene, meshes=(view.scene.meshes[0], cube)), view.camera, spot, 32)
    export_view(view, trace(view, 1), tmp_path, "cube-on-plane")
    found = json.loads((tmp_path / "view.json").read_text(encoding="utf-8"))
    expected = {"name": "lamp", "kind": "spot", "direction": [0, -1, 0], "position": [0, 3, 0]}
    assert {key: found["light"][key] for key in expected} == expected
    assert found["light"]["cone"] == pytest.approx(60)
    assert [mesh["casts"] for mesh in found["meshes"]] == [True, False]
    assert found["mask"]["score"] == "shadowbench score cube-on-plane MASK.png --view camera --light lamp"


@pytest.mark.parametrize("name", ["window", "shade", "fence"])
def test_a_light_s_size_is_in_the_description_and_gltf_has_the_light_at_its_centre(
    builtin: Callable[..., View], name: str, tmp_path: Path
) -> None:
    view = builtin(name, 32)
    export_view(view, trace(view, 1), tmp_path, name)
    found = json.loads((tmp_path / "view.json").read_text(encoding="utf-8"))
    light, read = found["light"], read_back(tmp_path, 32).light
    assert light["kind"] == view.light.kind
    assert (read.kind, read.soft, read.angle) == (view.light.hard_kind, False, view.light.frustum_angle or 0.0)
    assert sum("glTF" in line for line in found["assumptions"]) == 1
    if name == "window":
        assert light["size"] == [1.4, 1.0] and light["radius"] is None
        assert np.dot(light["up"], light["direction"]) == pytest.approx(0, abs=1e-12) and light["up"][1] > 0.5
    else:
        assert light["radius"] == pytest.approx(0.02 if name == "shade" else 0.2665)
        assert light["size"] is None and light["up"] is None


def test_the_example_is_a_mask_without_an_error(shadowbench: Callable, tmp_path: Path) -> None:
    assert shadowbench("export", "spot-lamp", tmp_path / "out", "--view-size", "96").code == 0
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["scene.glb", "truth.png", "view.json"]
    assert read_mask(tmp_path / "out" / "truth.png").shape == (96, 96)
    answer = shadowbench("score", "spot-lamp", tmp_path / "out" / "truth.png", "--json")
    assert json.loads(answer.out)["metrics"]["iou"] == 1
    assert json.loads(answer.out)["warnings"] == []


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("stairs", "{}/new", "--view", "no"), "view: found 'no'; allowed: camera"),
        (("stairs", "{}/new", "--light", "no"), "light: found 'no'; allowed: light"),
        (("stairs", "{}/file/x"), "cannot be created"),
        (("nowhere", "{}/new"), "is no built-in scene"),
        (("stairs", "{}/new", "--sides", "front"), "'front' is not one of 'closed', 'double'"),
    ],
)
def test_bad_input_is_one_line(shadowbench: Callable, tmp_path: Path, arguments: tuple[str, ...], line: str) -> None:
    (tmp_path / "file").touch()
    answer = shadowbench("export", *(part.format(tmp_path) for part in arguments))
    assert (answer.code, answer.out) == (2, "")
    assert line in answer.err and answer.err.count("\n") == 1
