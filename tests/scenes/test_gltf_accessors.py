"""Attributes of glTF primitives, stored in every way."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.exchange.gltf import export_glb

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.scenes.gltf_storage import (
    Data,
    TrianglePrimitive,
    floats_of,
    integers_of,
    read_buffers,
    read_json,
    read_primitives,
)
from shadowbench.strict import validated


def primitives(path: Path) -> list[TrianglePrimitive]:
    document, chunk = read_json(path)
    layout = validated(Layout, document, path.name, context=document)
    return list(read_primitives(read_buffers(layout, chunk, path, path.name)))


def test_an_attribute_is_read_compressed_or_not(tmp_path: Path) -> None:
    for compressed in (False, True):
        ball = trimesh.creation.icosphere(subdivisions=1)
        ball.visual = trimesh.visual.TextureVisuals(uv=ball.vertices[:, :2])
        path = tmp_path / "ball.glb"
        path.write_bytes(export_glb(trimesh.Scene(ball), extension_draco=compressed))
        (primitive,) = primitives(path)
        coordinates = primitive.floats("TEXCOORD_0", "VEC2")
        assert coordinates is not None and primitive.floats("COLOR_0", "VEC3", "VEC4") is None
        # By the file format v is down in images, and compression rounds.
        assert coordinates * [1, -1] + [0, 1] == pytest.approx(primitive.positions[:, :2], abs=2e-3)
        with pytest.raises(InputError, match=r"ball\.glb: .*found .*; allowed: VEC3$"):
            primitive.floats("TEXCOORD_0", "VEC3")


VALUES = np.array([[1, 2, 3], [4, 5, 6]], np.float32)


def sparse(base: np.ndarray | None, places: list[int], parts: dict[str, Any]) -> Data:
    """Five elements, `base` or zeros, of which VALUES replaces some; parts: what is different of `sparse`."""
    blob = VALUES.tobytes() + np.array(places, np.uint8).tobytes()
    table = {"count": 2, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}, **parts}
    accessor = {"componentType": 5126, "count": 5, "type": "VEC3", "sparse": table}
    document = {
        "asset": {"version": "2.0"},
        "accessors": [accessor if base is None else {**accessor, "bufferView": 2}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 24},
            {"buffer": 0, "byteOffset": 24, "byteLength": 2},
            {"buffer": 1, "byteLength": 60},
        ],
        "buffers": [{"byteLength": len(blob)}, {"byteLength": 60}],
    }
    layout = validated(Layout, document, "a", context=document)
    return Data(layout, [blob, np.zeros((5, 3), np.float32).tobytes() if base is None else base.tobytes()], "a")


@pytest.mark.parametrize("base", [None, np.arange(15, dtype=np.float32).reshape(5, 3)], ids=["zeros", "a bufferView"])
def test_a_sparse_accessor_replaces_elements_of_its_base(base: np.ndarray | None) -> None:
    expected = np.zeros((5, 3)) if base is None else base.copy()
    expected[[1, 4]] = VALUES
    assert floats_of(sparse(base, [1, 4], {}), 0, "VEC3").tolist() == expected.tolist()


def test_an_invalid_sparse_accessor_is_one_line() -> None:
    for places, parts, words in (
        ([1, 5], {}, "sparse: found index 5; allowed: 0 to 4"),
        ([1, 2], {"count": 3}, "accessors 1: 3 elements end at byte 3 of a bufferView of 2"),
        ([1, 2], {"values": {"bufferView": 0, "byteOffset": 1}}, "end at byte 25"),
        ([1, 2], {"indices": {"bufferView": 1, "componentType": 5126}}, "componentType"),
    ):
        with pytest.raises(InputError, match=words):
            floats_of(sparse(None, places, parts), 0, "VEC3")


def test_normalised_integers_are_fractions() -> None:
    for code, dtype, largest in ((5120, "i1", 127), (5121, "u1", 255), (5122, "i2", 32767), (5123, "u2", 65535)):
        values = np.array([0, 1, largest, np.iinfo(dtype).min], dtype)
        document = {
            "asset": {"version": "2.0"},
            "accessors": [
                {"bufferView": 0, "componentType": code, "count": 4, "type": "SCALAR", "normalized": normalized}
                for normalized in (True, False)
            ],
            "bufferViews": [{"buffer": 0, "byteLength": values.nbytes}],
            "buffers": [{"byteLength": values.nbytes}],
        }
        data = Data(validated(Layout, document, "a", context=document), [values.tobytes()], "a")
        assert floats_of(data, 0, "SCALAR").ravel() == pytest.approx([0, 1 / largest, 1, -1 if dtype[0] == "i" else 0])
        assert floats_of(data, 1, "SCALAR").ravel().tolist() == values.tolist()
        if dtype[0] == "u":
            assert integers_of(data, 1, "SCALAR").ravel().tolist() == values.tolist()
        else:
            with pytest.raises(InputError, match="SCALAR of unsigned integers"):
                integers_of(data, 1, "SCALAR")
