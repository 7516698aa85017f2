"""The JSON of a glTF, and its vertices and indices from a .glb's binary chunk, data URIs or files in its folder."""

import base64
import binascii
import json
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.draco import Blob, Decoded, decode
from shadowbench.scenes.gltf_layout import Accessor, Layout, Primitive
from shadowbench.scenes.strips import fan_faces, strip_faces

TRIANGLES, STRIP, FAN = 4, 5, 6
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class TrianglePrimitive(NamedTuple):
    """A triangle primitive: index of its mesh, (V, 3) positions, (F, 3) indices into them, not yet validated."""

    mesh: int
    primitive: Primitive
    positions: NDArray[Any]
    faces: NDArray[Any]


def read_json(path: Path) -> tuple[dict[str, Any], bytes | None]:
    """The JSON of a .gltf or .glb, and the binary chunk of a .glb or None. Raises ValueError for other files."""
    data, chunk = path.read_bytes(), None
    if path.suffix.lower() == ".glb":
        if len(data) < 20 or data[:4] != b"glTF":
            raise ValueError("not a GLB: the first four bytes are not glTF")
        version, length, end, kind = struct.unpack("<IIII", data[4:20])
        end += 20
        if version != 2:
            raise ValueError(f"glTF version {version}; allowed: 2")
        if length > len(data) or kind != JSON_CHUNK or end > len(data):
            raise ValueError(f"cut short: {len(data)} bytes of {length}")
        if end + 8 <= len(data):
            size, kind = struct.unpack("<II", data[end : end + 8])
            if kind == BINARY_CHUNK:
                chunk = data[end + 8 : end + 8 + size]
        data = data[20:end]
    document = json.loads(data)
    if not isinstance(document, dict):
        raise ValueError("the JSON is not an object")
    return document, chunk


def read_primitives(layout: Layout, chunk: bytes | None, path: Path, where: str) -> Iterator[TrianglePrimitive]:
    """The triangle primitives in the order of the file. Raises InputError for invalid data.

    chunk: the binary chunk of a .glb, or None.
    """
    buffers = [
        _buffer(layout, number, chunk if number == 0 else None, path, f"{where}: buffers {number + 1}")
        for number in range(len(layout.buffers))
    ]
    decoded = _decompressed(layout, buffers, where)
    for number, each in [(number, each) for number, mesh in enumerate(layout.meshes) for each in mesh.primitives]:
        if each.mode not in (TRIANGLES, STRIP, FAN):
            continue
        mesh_where = f"{where}: mesh {layout.meshes[number].name or number + 1!r:.60}"
        position = each.attributes.get("POSITION")
        if position is None or (each.draco is not None and each.draco_position is None):
            raise InputError(f"{mesh_where}: a primitive has no POSITION")
        if each.draco is not None:
            positions, faces = decoded[each.draco, each.draco_position]
        else:
            positions = _array(layout, buffers, position, "VEC3", where)
            faces = _faces(layout, buffers, each, len(positions), mesh_where)
        yield TrianglePrimitive(number, each, _dequantized(positions, layout.accessors[position]), faces)


def _decompressed(layout: Layout, buffers: list[bytes], where: str) -> dict[tuple[int, int | None], Decoded]:
    """All primitives of KHR_draco_mesh_compression, decoded once each, by bufferView and id of the positions."""
    blobs = {}
    for each in layout.primitives:
        if each.draco is not None and each.draco_position is not None:
            view = layout.bufferViews[each.draco]
            data = buffers[view.buffer][view.byteOffset : view.end]
            blobs[each.draco, each.draco_position] = Blob(data, each.draco_position)
    return dict(zip(blobs, decode([*blobs.values()], where), strict=True)) if blobs else {}


def _faces(layout: Layout, buffers: list[bytes], primitive: Primitive, count: int, where: str) -> NDArray[Any]:
    """(F, 3) faces of a primitive of `count` vertices."""
    corners: NDArray[Any] = np.arange(count, dtype=np.uint64)
    if primitive.indices is not None:
        corners = _array(layout, buffers, primitive.indices, "SCALAR", where).ravel()
    if primitive.mode != TRIANGLES:
        # The largest index begins another strip: in all files, as the specification forbids it as an index.
        return (strip_faces if primitive.mode == STRIP else fan_faces)(corners, int(np.iinfo(corners.dtype).max))
    if len(corners) % 3:
        raise InputError(f"{where}: {len(corners)} corners of triangles; allowed are multiples of 3")
    return corners.reshape(-1, 3)


def _array(layout: Layout, buffers: list[bytes], index: int, kind: str, where: str) -> NDArray[Any]:
    """(count, n) array of an accessor, a view of its buffer; kind: SCALAR, of unsigned integers, or VEC3."""
    accessor = layout.accessors[index]
    place = f"{where}: accessors {index + 1}"
    dtype, numbers = accessor.row
    if accessor.type != kind or (kind == "SCALAR" and dtype.kind != "u"):
        allowed = kind + " of unsigned integers" * (kind == "SCALAR")
        raise InputError(f"{place}: found {accessor.type} of {accessor.componentType}; allowed: {allowed}")
    if accessor.sparse is not None:
        raise InputError(f"{place}: sparse accessors are not supported")
    if accessor.bufferView is None:
        raise InputError(f"{place}: has no bufferView, and no extension fills it")
    view = layout.bufferViews[accessor.bufferView]
    return np.ndarray(
        (accessor.count, numbers),
        dtype,
        buffer=buffers[view.buffer],
        offset=view.byteOffset + accessor.byteOffset,
        strides=(view.byteStride or numbers * dtype.itemsize, dtype.itemsize),
    )


def _dequantized(positions: NDArray[Any], accessor: Accessor) -> NDArray[np.float64]:
    """float64 positions, with normalised integers of KHR_mesh_quantization converted to fractions."""
    dtype, _ = accessor.row
    if accessor.normalized and dtype.kind in "iu":
        return np.maximum(positions.astype(np.float64) / np.iinfo(dtype).max, -1.0)
    return positions.astype(np.float64)


def _buffer(layout: Layout, number: int, chunk: bytes | None, path: Path, where: str) -> bytes:
    """The bytes of a buffer. Raises InputError for missing ones, or a file outside the glTF's folder."""
    buffer = layout.buffers[number]
    data = chunk if buffer.uri is None else _from_uri(buffer.uri, path, where)
    if data is None:
        raise InputError(f"{where}: found no uri; only the first buffer of a .glb may lack it")
    if len(data) < buffer.byteLength:
        raise InputError(f"{where}: cut short: {len(data)} bytes of {buffer.byteLength}")
    return data[: buffer.byteLength]


def _from_uri(uri: str, path: Path, where: str) -> bytes:
    where = f"{where}: uri {uri!r:.60}"
    if uri.startswith("data:"):
        head, comma, text = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise InputError(f"{where}; allowed: a file, or data in base64")
        try:
            return base64.b64decode(text, validate=True)
        except binascii.Error as error:
            raise InputError(f"{where}: not base64: {error}") from error
    folder = path.parent.resolve()
    try:
        file = Path(os.path.realpath(folder / unquote(uri)))
        inside, there = file.is_relative_to(folder), file.is_file()
    except (OSError, ValueError):  # a null byte, a name too long
        inside, there = True, False
    if not inside or not there:
        wrong = "is not a file in" if inside else "leads outside"
        raise InputError(f"{where} {wrong} {folder}; allowed are files in it")
    return file.read_bytes()
