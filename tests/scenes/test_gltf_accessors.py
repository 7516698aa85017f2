"""Attributes of glTF primitives, stored in every way."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.exchange.gltf import export_glb

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_accessors import Data, floats_of, integers_of
from shadowbench.scenes.gltf_bytes import TrianglePrimitive, read_buffers, read_json, read_primitives
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.strict import validated


def primitives(path: Path) -> list[TrianglePrimitive]:
    document, chunk = read_json(path)
    layout = validated(Layout, document, path.name, context=document)
    return list(read_primitives(read_buffers(layout, chunk, path, path.name)))


@pytest.mark.parametrize("compressed", [False, True])
def test_an_attribute_is_read_compressed_or_not(tmp_path: Path, compressed: bool) -> None:
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


@pytest.mark.parametrize(
    ("code", "dtype", "largest"), [(5120, "i1", 127), (5121, "u1", 255), (5122, "i2", 32767), (5123, "u2", 65535)]
)
def test_normalised_integers_are_fractions(code: int, dtype: str, largest: int) -> None:
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
