"""Vertex and index arrays of a glTF, from the binary chunk of a .glb, data URIs, or files in the glTF's folder."""

import base64
import binascii
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.draco import Blob, Decoded, decode
from shadowbench.scenes.gltf_layout import DTYPES, NUMBERS, Accessor, Layout, Primitive

UNSIGNED = (5121, 5123, 5125)
TRIANGLES, STRIP = 4, 5


class TrianglePrimitive(NamedTuple):
    """A triangle primitive: index of its mesh, (V, 3) positions, (F, 3) indices into them, not yet validated."""

    mesh: int
    primitive: Primitive
    positions: NDArray[Any]
    faces: NDArray[Any]


def read_primitives(layout: Layout, chunk: bytes | None, path: Path, where: str) -> Iterator[TrianglePrimitive]:
    """The triangle primitives in the order of the file. Raises InputError for invalid data."""
    buffers = buffers_of(layout, chunk, path, where)
    decoded = _decompressed(layout, buffers, where)
    for number, mesh in enumerate(layout.meshes):
        for primitive in mesh.primitives:
            if primitive.mode in (TRIANGLES, STRIP):
                positions, corners = _arrays(layout, buffers, primitive, decoded, f"{where}: meshes[{number}]")
                yield TrianglePrimitive(number, primitive, positions, corners)


def _decompressed(layout: Layout, buffers: list[bytes], where: str) -> dict[tuple[int, int], Decoded]:
    """All primitives of KHR_draco_mesh_compression, decoded once each, by bufferView and id of the positions."""
    found = [
        (draco.bufferView, draco.attributes["POSITION"])
        for mesh in layout.meshes
        for primitive in mesh.primitives
        if (draco := primitive.extensions.KHR_draco_mesh_compression) is not None and "POSITION" in draco.attributes
    ]
    keys = list(dict.fromkeys(found))
    views = [layout.bufferViews[index] for index, _ in keys]
    blobs = [buffers[view.buffer][view.byteOffset : view.byteOffset + view.byteLength] for view in views]
    if not blobs:
        return {}
    decoded = decode([Blob(blob, number) for blob, (_, number) in zip(blobs, keys, strict=True)], where)
    return dict(zip(keys, decoded, strict=True))


def _arrays(
    layout: Layout,
    buffers: list[bytes],
    primitive: Primitive,
    decoded: dict[tuple[int, int], Decoded],
    where: str,
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """(V, 3) positions and (F, 3) faces of a primitive."""
    if "POSITION" not in primitive.attributes:
        raise InputError(f"{where}: a primitive has no POSITION")
    accessor = layout.accessors[primitive.attributes["POSITION"]]
    draco = primitive.extensions.KHR_draco_mesh_compression
    if draco is not None:
        if "POSITION" not in draco.attributes:
            raise InputError(f"{where}: KHR_draco_mesh_compression holds no POSITION")
        mesh = decoded[draco.bufferView, draco.attributes["POSITION"]]
        return _dequantized(mesh.positions, accessor), mesh.faces
    positions = _array(layout, buffers, primitive.attributes["POSITION"], "VEC3", where)
    corners = np.arange(len(positions))
    if primitive.indices is not None:
        corners = _array(layout, buffers, primitive.indices, "SCALAR", where).ravel().astype(np.int64)
    if primitive.mode == STRIP:
        from trimesh.util import triangle_strips_to_faces

        return _dequantized(positions, accessor), triangle_strips_to_faces([corners])
    if len(corners) % 3:
        raise InputError(f"{where}: {len(corners)} corners of triangles; allowed are multiples of 3")
    return _dequantized(positions, accessor), corners.reshape(-1, 3)


def _array(layout: Layout, buffers: list[bytes], index: int, kind: str, where: str) -> NDArray[Any]:
    """(count, n) array of an accessor, a view of its buffer. The layout must have been validated."""
    accessor = layout.accessors[index]
    if accessor.type != kind or (kind == "SCALAR" and accessor.componentType not in UNSIGNED):
        found = f"{accessor.type} of {accessor.componentType}"
        raise InputError(
            f"{where}: accessors[{index}] is {found}; allowed: {kind}{' of unsigned integers' * (kind == 'SCALAR')}"
        )
    if accessor.bufferView is None:
        raise InputError(f"{where}: accessors[{index}] has no bufferView, and no extension fills it")
    view = layout.bufferViews[accessor.bufferView]
    dtype, numbers = np.dtype(DTYPES[accessor.componentType]), NUMBERS[kind]
    return np.ndarray(
        (accessor.count, numbers),
        dtype,
        buffer=buffers[view.buffer],
        offset=view.byteOffset + accessor.byteOffset,
        strides=(view.byteStride or numbers * dtype.itemsize, dtype.itemsize),
    )


def _dequantized(positions: NDArray[Any], accessor: Accessor) -> NDArray[np.float64]:
    """float64 positions, with normalised integers of KHR_mesh_quantization converted to fractions."""
    fractions = positions.astype(np.float64)
    dtype = np.dtype(DTYPES[accessor.componentType])
    if accessor.normalized and dtype.kind in "iu":
        return np.maximum(fractions / np.iinfo(dtype).max, -1.0)
    return fractions


def buffers_of(layout: Layout, chunk: bytes | None, path: Path, where: str) -> list[bytes]:
    """The bytes of each buffer, `byteLength` each; chunk: the binary chunk of a .glb, or None.

    Raises InputError for missing bytes, or a file outside the glTF's folder.
    """
    found = []
    for number, buffer in enumerate(layout.buffers):
        buffer_where = f"{where}: buffers[{number}]"
        if buffer.uri is not None:
            data = _from_uri(buffer.uri, path, buffer_where)
        elif number == 0 and chunk is not None:
            data = chunk
        else:
            raise InputError(f"{buffer_where}: found no uri; only the first buffer of a .glb may lack it")
        if len(data) < buffer.byteLength:
            raise InputError(f"{buffer_where}: cut short: {len(data)} bytes of {buffer.byteLength}")
        found.append(data[: buffer.byteLength])
    return found


def _from_uri(uri: str, path: Path, where: str) -> bytes:
    if uri.startswith("data:"):
        head, comma, text = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise InputError(f"{where}: uri {uri!r:.60}; allowed: a file, or data in base64")
        try:
            return base64.b64decode(text, validate=True)
        except binascii.Error as error:
            raise InputError(f"{where}: uri {uri!r:.60}: not base64: {error}") from error
    folder = path.parent.resolve()
    try:
        file = Path(os.path.realpath(folder / unquote(uri)))
        inside, there = file.is_relative_to(folder), file.is_file()
    except (OSError, ValueError):  # a null byte, a name too long
        inside, there = True, False
    if not inside:
        raise InputError(f"{where}: uri {uri!r:.60} leads outside {folder}; allowed are files in it")
    if not there:
        raise InputError(f"{where}: uri {uri!r:.60} is not a file in {folder}")
    return file.read_bytes()
