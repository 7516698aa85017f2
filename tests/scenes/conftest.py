"""Fixtures that write scene files, mesh files and glTF documents."""

import base64
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.library import load_scene
from tests.scenes.rigs import glb_of

PYDANTIC = re.compile(
    r"Field required|should (be|have|match)|Value error|Unable to parse|validation|valid (string|integer|list|dict)"
)
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], dtype=np.float32)


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a scene file; without `complete` it has no camera and no light of its own."""

    def write(text: str, name: str = "scene.toml", complete: bool = False) -> Path:
        head = (
            "[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n"
            '[light]\nkind = "directional"\ndirection = [0.5, -1, 0.2]\n'
        )
        path = tmp_path / name
        path.write_text((head if complete else "") + text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def mesh_file(tmp_path: Path) -> Callable[[str, str | bytes], Path]:
    def write(name: str, data: str | bytes) -> Path:
        path = tmp_path / name
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        return path

    return write


@pytest.fixture
def gltf_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a .gltf or .glb of one mesh with one primitive; keywords replace or add top-level parts."""

    def write(
        name: str = "model.gltf",
        positions: np.ndarray = TRIANGLE,
        indices: np.ndarray | None = None,
        primitive: dict[str, Any] | None = None,
        accessor: dict[str, Any] | None = None,
        **parts: Any,
    ) -> Path:
        indices = np.arange(len(positions), dtype=np.uint32) if indices is None else indices.astype(np.uint32)
        first, second = positions.tobytes(), indices.tobytes()
        kinds = {"float32": 5126, "uint16": 5123, "int16": 5122}
        buffers = [{"byteLength": len(first) + len(second)}]
        primitives = [{"attributes": {"POSITION": 0}, "indices": 1, **(primitive or {})}]
        position = {"bufferView": 0, "componentType": kinds[str(positions.dtype)], "count": len(positions)}
        document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": "node", "mesh": 0}],
            "meshes": [{"name": "mesh", "primitives": primitives}],
            "accessors": [
                {**position, "type": "VEC3", **(accessor or {})},
                {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"},
            ],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": len(first)},
                {"buffer": 0, "byteOffset": len(first), "byteLength": len(second)},
            ],
            "buffers": buffers,
            **parts,
        }
        blob = first + second
        path = tmp_path / name
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
            document["buffers"][0].setdefault("uri", uri)
            path.write_text(json.dumps(document))
        else:
            path.write_bytes(glb_of(document, blob))
        return path

    return write


def refused(path: str | Path, *words: str, **options: Any) -> None:
    """Loading fails with one short line that has all the words, and no phrase of pydantic."""
    with pytest.raises(InputError) as error:
        load_scene(path, **options)
    line = str(error.value)
    assert line.isprintable() and len(line) < 1000
    assert PYDANTIC.search(line) is None
    assert [word for word in words if word not in line] == []
