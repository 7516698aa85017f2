"""glTF files: cameras, lights, nodes, notes and errors."""

import base64
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Light
from tests.scenes.conftest import refused

Gltf = Callable[..., Path]
LENS = {"yfov": 0.7, "znear": 0.25, "zfar": 40.0, "aspectRatio": 1.5}
QUARTER_ABOUT_X = [-math.sin(math.pi / 4), 0.0, 0.0, math.cos(math.pi / 4)]  # −z turns to −y


def with_light(light: dict[str, Any]) -> dict[str, Any]:
    return {
        "nodes": [
            {"mesh": 0},
            {
                "rotation": QUARTER_ABOUT_X,
                "translation": [1, 2, 3],
                "extensions": {"KHR_lights_punctual": {"light": 0}},
            },
        ],
        "scenes": [{"nodes": [0, 1]}],
        "extensions": {"KHR_lights_punctual": {"lights": [light]}},
        "extensionsRequired": ["KHR_lights_punctual"],
    }


def with_lens(lens: dict[str, float]) -> dict[str, Any]:
    return {"nodes": [{"mesh": 0, "camera": 0}], "cameras": [{"type": "perspective", "perspective": lens}]}


def test_a_camera_looks_along_minus_z_of_its_node(gltf_file: Gltf) -> None:
    for name in ("a.gltf", "a.glb"):
        path = gltf_file(
            name,
            nodes=[
                {"mesh": 0},
                {"translation": [10, 0, 0], "children": [2, 3]},
                {"camera": 0, "translation": [0, 5, 0], "rotation": QUARTER_ABOUT_X},
                {"camera": 0, "scale": [3, 3, 3]},
            ],
            scenes=[{"nodes": [0, 1]}],
            cameras=[{"type": "perspective", "perspective": LENS}],
        )
        down, ahead = read_meshes(path).cameras
        assert (down.name, ahead.name) == ("camera", "camera-2")
        assert down.position == pytest.approx((10, 5, 0))
        assert down.basis()[2] == pytest.approx([0, 1, 0], abs=1e-12)
        assert down.basis()[1] == pytest.approx([0, 0, -1], abs=1e-12)
        assert (down.fov_y, down.near, down.far) == (0.7, 0.25, 40.0)
        assert ahead.basis() == pytest.approx(np.eye(3))
        assert load_scene(path).cameras == (down, ahead)


def test_an_orthographic_camera_is_twice_its_magnification_high(gltf_file: Gltf) -> None:
    lens = {"xmag": 2, "ymag": 1.5, "znear": 0.0, "zfar": 10}
    path = gltf_file(
        nodes=[{"mesh": 0, "camera": 0}], cameras=[{"type": "orthographic", "orthographic": lens}], scene=0
    )
    scene = load_scene(path)
    (camera,) = scene.cameras
    assert (camera.height, camera.fov_y, camera.near, camera.far) == (3.0, 0.0, None, 10.0)
    assert any("camera" in note and "1.333 times as wide as high" in note for note in scene.notes)


def test_lights_shine_along_minus_z_of_their_node(gltf_file: Gltf) -> None:
    def light(given: dict[str, Any]) -> Light:
        (light,) = load_scene(gltf_file(**with_light(given))).lights
        return light

    sun, bulb = light({"type": "directional"}), light({"type": "point"})
    assert sun.kind == "directional" and sun.direction == pytest.approx((0, -1, 0))
    assert (bulb.kind, bulb.position) == ("point", (1, 2, 3))
    lamp = light({"type": "spot", "name": "desk/lamp", "spot": {"outerConeAngle": 0.4}})
    assert (lamp.kind, lamp.name, lamp.position) == ("spot", "desk-lamp", (1, 2, 3))
    assert lamp.angle == pytest.approx(0.8)
    assert light({"type": "spot"}).angle == pytest.approx(math.pi / 2)
    assert math.degrees(light({"type": "spot", "spot": {"outerConeAngle": math.pi / 2}}).angle) == pytest.approx(170)


def test_an_invalid_or_unsupported_gltf_is_one_line_that_names_the_place(gltf_file: Gltf) -> None:
    for parts, words in (
        ({"extensionsRequired": ["EXT_made_up"]}, ["EXT_made_up"]),
        ({"primitive": {"mode": 7}}, ["mode: found 7; allowed: 0, 1, 2, 3, 4, 5 or 6"]),
        ({"accessor": {"bufferView": None, "count": 10**9}}, ["without a bufferView have 3000000000 numbers"]),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, ["ancestor"]),
        ({"nodes": [{"mesh": 7}]}, ["nodes 1.mesh: found 7; allowed: 0 to 0"]),
        ({"nodes": [{"mesh": 0, "scale": [1e30, 1, 1]}]}, ["1e+30"]),
        ({"indices": np.array([0, 1, 9])}, ["vertex 9"]),
        ({"indices": np.array([0, 1])}, ["2 corners of triangles; allowed are multiples of 3"]),
        ({"primitive": {"attributes": {}}}, ["no POSITION"]),
        (with_lens({"yfov": 0.0, "znear": 0.1}), ["yfov"]),
        (with_light({"type": "area"}), ["lights 1.type: found 'area'; allowed: 'directional', 'point' or 'spot'"]),
        (with_light({"type": "spot", "spot": {"outerConeAngle": -1}}), ["outerConeAngle"]),
        ({"accessor": {"byteOffset": 12}}, ["accessors 1", "byte 48", "36"]),
        ({"accessor": {"type": "VEC2"}}, ["accessors 1", "VEC3"]),
        ({"accessor": {"bufferView": 5}}, ["accessors 1.bufferView", "5", "0 to 1"]),
        ({"bufferViews": [{"buffer": 0, "byteOffset": 40, "byteLength": 36}] * 2}, ["bufferViews 1", "76", "48"]),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}]}, ["accessors 1", "unsigned"]),
        ({"nodes": [{"mesh": 0, "translation": [1, "x", 2]}]}, ["translation", "'x'"]),
        ({"asset": {"version": 2}}, ["version"]),
        ({"nodes": [{"mesh": 0}] * 50_001}, ["nodes", "50000"]),
        ({"bufferViews": [{"buffer": 0, "byteLength": 44, "byteStride": 4}] * 2}, ["accessors 1", "byteStride of 4"]),
        ({"primitive": {"mode": 0}}, ["holds no triangles"]),
    ):
        refused(gltf_file(**parts), "model.gltf", *words)


def test_a_hidden_node_hides_meshes_and_lights_below_it_and_no_camera(gltf_file: Gltf) -> None:
    hidden = {"KHR_node_visibility": {"visible": False}}
    light = {"KHR_lights_punctual": {"light": 0}}
    path = gltf_file(
        nodes=[
            {"mesh": 0, "name": "seen", "extensions": {"KHR_node_visibility": {"visible": True}}},
            {"mesh": 0, "children": [2, 3], "extensions": hidden},
            {"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": True}}},
            {"camera": 0, "extensions": light},
        ],
        scenes=[{"nodes": [0, 1]}],
        cameras=[{"type": "perspective", "perspective": LENS}],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        extensionsRequired=["KHR_node_visibility"],
    )
    contents = read_meshes(path)
    assert [mesh.name for mesh in contents.meshes] == ["seen"]
    assert (len(contents.cameras), len(contents.lights)) == (1, 0)
    assert contents.notes == (
        "model.gltf: 2 mesh(es) of hidden nodes left out",
        "model.gltf: 1 light(s) of hidden nodes left out",
        "model.gltf: camera camera: made for pictures 1.5 times as wide as high; --view-size sets the shape",
    )


def test_ignored_light_properties_are_notes(gltf_file: Gltf) -> None:
    for light, words in (
        ({"type": "point", "range": 2.5}, ["range 2.5 m"]),
        ({"type": "spot", "intensity": 0}, ["intensity 0"]),
        ({"type": "spot", "range": 9, "intensity": 0.0}, ["range 9 m", "intensity 0"]),
        ({"type": "point", "intensity": 3.0}, []),
        ({"type": "directional", "range": 5}, []),
        ({"type": "spot", "spot": {"outerConeAngle": 1.57}}, ["170"]),
    ):
        notes = read_meshes(gltf_file(**with_light(light))).notes
        assert len(notes) == len(words)
        assert all(word in note for word, note in zip(words, notes, strict=True))


def test_an_extension_that_is_not_read_is_a_note(gltf_file: Gltf) -> None:
    for parts in (
        {"extensions": {"CESIUM_RTC": {"center": [6378137, 0, 0]}}},
        {"nodes": [{"mesh": 0, "extensions": {"CESIUM_RTC": {}, "KHR_node_visibility": {"visible": True}}}]},
        {"extensionsUsed": ["CESIUM_RTC", "KHR_materials_ior", "FB_ngon_encoding"]},
    ):
        assert read_meshes(gltf_file(**parts)).notes == ("model.gltf: drawn as if the file did not use CESIUM_RTC",)
    (note,) = read_meshes(gltf_file(extensionsUsed=["KHR_materials_variants"])).notes
    assert note.endswith("did not use KHR_materials_variants")


def test_quantised_positions_are_scaled_to_fractions(gltf_file: Gltf) -> None:
    quantised = np.array([[0, 0, 0], [65535, 0, 0], [0, 65535, 0]], dtype=np.uint16)
    required = {"extensionsRequired": ["KHR_mesh_quantization"]}
    (mesh,) = read_meshes(gltf_file(positions=quantised, accessor={"normalized": True}, **required)).meshes
    assert mesh.vertices.max() == pytest.approx(1.0)


def test_a_glb_whose_json_ends_with_nul_is_read(gltf_file: Gltf) -> None:
    path = gltf_file("a.glb")
    data = bytearray(path.read_bytes())
    end = 20 + int.from_bytes(data[12:16], "little")
    blanks = len(data[20:end]) - len(data[20:end].rstrip())
    padded = data[: end - blanks] + bytes(blanks + 4) + data[end:]
    padded[12:16], padded[8:12] = (end - 16).to_bytes(4, "little"), len(padded).to_bytes(4, "little")
    path.write_bytes(padded)
    assert len(load_scene(path).meshes) == 2


@pytest.mark.parametrize("base", [True, False], ids=["a bufferView", "zeros"])
def test_a_sparse_accessor_replaces_elements_of_its_base(gltf_file: Gltf, base: bool) -> None:
    values, places = np.array([[0, 1, 2], [4, 5, 6]], np.float32), np.array([1, 4], np.uint8)
    points = np.arange(15, dtype=np.float32).reshape(5, 3) ** 2
    blob = points.tobytes() + np.array([0, 1, 4, 2, 4, 1], np.uint32).tobytes() + values.tobytes() + places.tobytes()
    views = [(0, 60), (60, 24), (84, 24), (108, 2)]

    def written(**changed: Any) -> Path:
        sparse = {"count": 2, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 2}}
        position = {"componentType": 5126, "count": 5, "type": "VEC3", "sparse": sparse | changed}
        return gltf_file(
            accessors=[
                position | ({"bufferView": 0} if base else {}),
                {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"},
            ],
            bufferViews=[{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in views],
            buffers=[{"byteLength": 110, "uri": "data:;base64," + base64.b64encode(blob).decode()}],
        )

    expected = points if base else np.zeros((5, 3))
    expected[places] = values
    (mesh,) = read_meshes(written()).meshes
    assert np.array_equal(mesh.vertices[mesh.faces], expected[[[0, 1, 4], [2, 4, 1]]])
    refused(written(count=3), "accessors 1: 3 elements end at byte 3 of a bufferView of 2")
    refused(written(indices={"bufferView": 3, "componentType": 5126}), "componentType")
    views[3] = (59, 2)
    refused(written(), "sparse: found index")
