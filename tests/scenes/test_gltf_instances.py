"""Meshes that EXT_mesh_gpu_instancing draws many times."""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shadowbench.scenes.meshes import read_meshes
from tests.scenes.conftest import TRIANGLE, refused

Gltf = Callable[..., Path]
PLACES = np.array([[0, 0, 0], [5, 0, 0], [0, 7, 0]], np.float32)
TURNS = np.array([[0, 0, 0, 1], [0, 0, 1, 1], [0.1, 0.2, 0.3, 0.4]], np.float32)  # of any length
SIZES = np.array([[1, 1, 1], [2, 2, 2], [1, -3, 1]], np.float32)


def instanced(gltf_file: Gltf, attributes: dict[str, np.ndarray], **node: Any) -> Path:
    """A triangle in a node with instances."""
    parts, accessors, views = [TRIANGLE.tobytes()], [], [{"buffer": 0, "byteLength": TRIANGLE.nbytes}]
    for rows in attributes.values():
        code = {"float32": 5126, "int16": 5122}[str(rows.dtype)]
        views.append({"buffer": 0, "byteOffset": len(b"".join(parts)), "byteLength": rows.nbytes})
        kind = f"VEC{rows.shape[1]}"
        accessors.append({"bufferView": len(views) - 1, "componentType": code, "count": len(rows), "type": kind})
        accessors[-1] |= {"normalized": True} if code == 5122 else {}
        parts.append(rows.tobytes())
    blob = b"".join(parts)
    extension = {"attributes": {name: k for k, name in enumerate(attributes, 1)}}
    return gltf_file(
        nodes=[{"mesh": 0, "name": "tree", "extensions": {"EXT_mesh_gpu_instancing": extension}, **node}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}],
        accessors=[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}, *accessors],
        bufferViews=views,
        buffers=[{"byteLength": len(blob), "uri": "data:;base64," + base64.b64encode(blob).decode()}],
        extensionsRequired=["EXT_mesh_gpu_instancing"],
    )


def test_each_instance_is_the_mesh_scaled_turned_moved_and_then_as_its_node(gltf_file: Gltf) -> None:
    attributes = {"TRANSLATION": PLACES, "ROTATION": TURNS, "SCALE": SIZES}
    scene = read_meshes(instanced(gltf_file, attributes, scale=[2, 2, 2], translation=[0, 0, 1]))
    assert [mesh.name for mesh in scene.meshes] == ["tree 1", "tree 2", "tree 3"] and not scene.notes
    for mesh, place, turn, size in zip(scene.meshes, PLACES, TURNS, SIZES, strict=True):
        expected = 2 * (Rotation.from_quat(turn).apply(TRIANGLE * size) + place) + [0, 0, 1]
        winding = slice(None, None, -1 if size.prod() < 0 else 1)  # of a mirrored one too, outside stays outside
        assert mesh.vertices[mesh.faces[0]][winding] == pytest.approx(expected, abs=1e-6)


def test_a_node_of_one_instance_is_not_numbered_and_of_none_draws_nothing(gltf_file: Gltf) -> None:
    assert [mesh.name for mesh in read_meshes(instanced(gltf_file, {"SCALE": SIZES[:1]})).meshes] == ["tree"]
    refused(instanced(gltf_file, {"SCALE": SIZES[:0]}), "no triangles")


def test_invalid_instances_are_one_line(gltf_file: Gltf) -> None:
    for attributes, words in (
        ({"TRANSLATION": PLACES, "SCALE": SIZES[:2]}, ["attributes of 2 and 3 elements differ"]),
        ({"ROTATION": PLACES}, ["accessors 2: found VEC3", "allowed: VEC4"]),
        ({"SCALE": np.ones((50_001, 3), np.float32)}, ["50001 primitives", "50000"]),
    ):
        refused(instanced(gltf_file, attributes), "model.gltf", *words)


def test_instances_count_as_triangles_before_they_are_made(gltf_file: Gltf, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shadowbench.scenes.gltf_layout.MOST_TRIANGLES", 2)
    refused(instanced(gltf_file, {"SCALE": SIZES}), "9 vertices; allowed are 6")
