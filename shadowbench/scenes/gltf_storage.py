"""The numbers of a glTF: its JSON, buffers, decompressed, elements of accessors, and primitives' vertices and indices.

Buffers are a .glb's binary chunk, data URIs or files in its folder.
"""

import base64
import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.files import read_beside
from shadowbench.scenes.compression import DracoBlob, DracoMesh, decode_draco, decode_meshopt
from shadowbench.scenes.gltf_layout import NUMBERS, Accessor, Layout, Primitive, Range
from shadowbench.scenes.polygons import fan_faces, strip_faces
from shadowbench.scenes.vectors import Floats


class Data(NamedTuple):
    """A glTF's layout, the bytes of its buffers, and the beginning of its error messages."""

    layout: Layout
    buffers: list[bytes]
    where: str


def floats_of(data: Data, index: int, *types: str) -> Floats:
    """(count, n) float64 elements of an accessor of one of the types, with normalised integers as fractions.

    types: as in the specification, SCALAR, VEC2, VEC3, VEC4 or MAT4. Raises InputError for another one.
    """
    return as_floats(stored(data, index, *types), data.layout.accessors[index])


def integers_of(data: Data, index: int, *types: str) -> NDArray[Any]:
    """(count, n) unsigned integers of an accessor of one of the types. Raises InputError for another one."""
    accessor = data.layout.accessors[index]
    if accessor.row[0].kind != "u":
        raise _wrong(data, index, f"{' or '.join(types)} of unsigned integers")
    return stored(data, index, *types)


def stored(data: Data, index: int, *types: str, rows: slice = slice(None)) -> NDArray[Any]:
    """(count, n) elements of an accessor, a view of their buffer or sparse; rows: only these of them.

    Raises InputError for another type than these.
    """
    accessor = data.layout.accessors[index]
    if accessor.type not in types:
        raise _wrong(data, index, " or ".join(types))
    place, dense, replaced = f"{data.where}: accessors {index + 1}", accessor.dense, accessor.replaced
    dtype, numbers = accessor.row
    start, stop, _ = rows.indices(accessor.count)
    # Without a bufferView all are zeros, by the specification.
    elements = np.zeros((stop - start, numbers), dtype) if dense is None else _range(data, dense)[rows]
    if replaced is None:
        return elements
    indices, values = (_range(data, part) for part in replaced)
    if (indices >= accessor.count).any():
        raise InputError(f"{place}: sparse: found index {indices.max()}; allowed: 0 to {accessor.count - 1}")
    elements = elements if dense is None else elements.copy()
    chosen = (indices[:, 0] >= start) & (indices[:, 0] < stop)
    elements[indices[chosen, 0] - start] = values[chosen]
    return elements


def _range(data: Data, part: Range) -> NDArray[Any]:
    """(count, n) elements, a view of their buffer."""
    view = data.layout.bufferViews[part.bufferView]
    return np.ndarray(
        (part.length, part.numbers),
        part.dtype,
        buffer=data.buffers[view.buffer],
        offset=view.byteOffset + part.byteOffset,
        strides=(view.byteStride or part.numbers * part.dtype.itemsize, part.dtype.itemsize),
    )


def as_floats(elements: NDArray[Any], accessor: Accessor) -> Floats:
    """Elements of an accessor as float64, with normalised integers as fractions."""
    dtype, _ = accessor.row
    if accessor.normalized and dtype.kind in "iu":
        return np.maximum(elements.astype(np.float64) / np.iinfo(dtype).max, -1.0)
    return elements.astype(np.float64)


def _wrong(data: Data, index: int, allowed: str) -> InputError:
    accessor = data.layout.accessors[index]
    return InputError(
        f"{data.where}: accessors {index + 1}: found {accessor.type} of {accessor.componentType}; allowed: {allowed}"
    )


def decompressed(data: Data) -> Data:
    """The same with each compressed bufferView in a buffer of its own. Raises InputError or ValueError."""
    views, buffers = list(data.layout.bufferViews), list(data.buffers)
    for k, view in enumerate(views):
        if (packed := view.compressed) is not None:
            stream = buffers[packed.buffer][packed.byteOffset : packed.end]
            views[k] = view.model_copy(update={"buffer": len(buffers), "byteOffset": 0, "compressed": None})
            rows = decode_meshopt(stream, packed.count, packed.byteStride, packed.mode, packed.filter, data.where)
            buffers.append(rows)
    return Data(data.layout.model_copy(update={"bufferViews": views}), buffers, data.where)


TRIANGLES, STRIP, FAN = 4, 5, 6
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class TrianglePrimitive(NamedTuple):
    """A triangle primitive: index of its mesh, and its (F, 3) indices of vertices, not yet validated.

    decoded: its attributes that were compressed, by name.
    """

    mesh: int
    primitive: Primitive
    faces: NDArray[Any]
    data: Data
    decoded: Mapping[str, NDArray[Any]]

    @property
    def positions(self) -> Floats:
        """(V, 3) float64."""
        positions = self.floats("POSITION", "VEC3")
        assert positions is not None  # as `read_primitives` checks
        return positions

    def floats(self, name: str, *types: str) -> Floats | None:
        """(V, n) float64 elements of an attribute of one of the types, None if there is none. Raises InputError."""
        index = self._accessor(name)
        if index is None or name not in self.decoded:
            return None if index is None else floats_of(self.data, index, *types)
        return as_floats(self._compressed(name, types), self.data.layout.accessors[index])

    def integers(self, name: str, *types: str) -> NDArray[Any] | None:
        """(V, n) unsigned integers of an attribute, as `floats`."""
        index = self._accessor(name)
        if index is None or name not in self.decoded:
            return None if index is None else integers_of(self.data, index, *types)
        return self._compressed(name, types).astype(np.uint32)

    def by_corner(self, values: NDArray[np.floating]) -> NDArray[np.float32]:
        """(F, 3, …) float32 of (V, …) values of the vertices, whose indices must be valid."""
        corners: NDArray[np.float32] = values[self.faces].astype(np.float32)
        return corners

    def check_count(self, name: str, accessor: int) -> None:
        """Raise InputError unless an accessor has an element for each vertex: before it is filled."""
        counts = [
            len(self.decoded[each]) if each in self.decoded else self.data.layout.accessors[index].count
            for each, index in ((name, accessor), ("POSITION", self.primitive.attributes["POSITION"]))
        ]
        if counts[0] != counts[1]:
            found = f"{name} has {counts[0]} elements"
            raise InputError(f"{self.data.where}: {found}; allowed: {counts[1]}, one for each POSITION")

    def _accessor(self, name: str) -> int | None:
        """The accessor of an attribute, None if there is none."""
        index = self.primitive.attributes.get(name)
        if index is not None:
            self.check_count(name, index)
        return index

    def _compressed(self, name: str, types: tuple[str, ...]) -> NDArray[Any]:
        values = self.decoded[name]
        if values.shape[1] not in [NUMBERS[each] for each in types]:
            allowed = " or ".join(types)
            raise InputError(f"{self.data.where}: {name}: found {values.shape[1]} components; allowed: {allowed}")
        return values


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
        data = data[20:end].rstrip(b"\0")  # some exporters pad with these in place of blanks
    document = json.loads(data)
    if not isinstance(document, dict):
        raise ValueError("the JSON is not an object")
    return document, chunk


def read_buffers(layout: Layout, chunk: bytes | None, path: Path, where: str) -> Data:
    """The layout with the bytes of its buffers, decompressed. Raises InputError.

    chunk: the binary chunk of a .glb, or None.
    """
    used = {(view.compressed or view).buffer for view in layout.bufferViews}  # others may stand for what is compressed
    buffers = [
        _buffer(layout, number, chunk if number == 0 else None, path, f"{where}: buffers {number + 1}")
        if number in used
        else b""
        for number in range(len(layout.buffers))
    ]
    return decompressed(Data(layout, buffers, where))


def read_primitives(data: Data) -> Iterator[TrianglePrimitive]:
    """The triangle primitives in the order of the file. Raises InputError for invalid data."""
    layout = data.layout
    decoded = _decompressed(data)
    for number, each in [(number, each) for number, mesh in enumerate(layout.meshes) for each in mesh.primitives]:
        if each.mode not in (TRIANGLES, STRIP, FAN):
            continue
        where = f"{data.where}: mesh {layout.meshes[number].name or number + 1!r:.60}"
        position = each.attributes.get("POSITION")
        if position is None or (each.draco is not None and "POSITION" not in each.draco_ids):
            raise InputError(f"{where}: a primitive has no POSITION")
        if each.draco is not None:
            attributes, faces = decoded[each.draco, *each.draco_ids.items()]
            yield TrianglePrimitive(number, each, faces, data, attributes)
        else:
            faces = _faces(data, each, layout.accessors[position].count, where)
            yield TrianglePrimitive(number, each, faces, data, {})


def _decompressed(data: Data) -> dict[tuple[Any, ...], DracoMesh]:
    """All primitives of KHR_draco_mesh_compression, decoded once each, by bufferView and ids of the attributes."""
    blobs = {}
    for each in data.layout.primitives:
        if each.draco is not None and "POSITION" in each.draco_ids:
            view = data.layout.bufferViews[each.draco]
            blob = data.buffers[view.buffer][view.byteOffset : view.end]
            blobs[each.draco, *each.draco_ids.items()] = DracoBlob(blob, each.draco_ids)
    return dict(zip(blobs, decode_draco([*blobs.values()], data.where), strict=True)) if blobs else {}


def _faces(data: Data, primitive: Primitive, count: int, where: str) -> NDArray[Any]:
    """(F, 3) faces of a primitive of `count` vertices."""
    corners: NDArray[Any] = np.arange(count, dtype=np.uint64)
    if primitive.indices is not None:
        corners = integers_of(data, primitive.indices, "SCALAR").ravel()
    if primitive.mode != TRIANGLES:
        # The largest index begins another strip: in all files, as the specification forbids it as an index.
        return (strip_faces if primitive.mode == STRIP else fan_faces)(corners, int(np.iinfo(corners.dtype).max))
    if len(corners) % 3:
        raise InputError(f"{where}: {len(corners)} corners of triangles; allowed are multiples of 3")
    return corners.reshape(-1, 3)


def _buffer(layout: Layout, number: int, chunk: bytes | None, path: Path, where: str) -> bytes:
    """The bytes of a buffer. Raises InputError for missing ones, or a file outside the glTF's folder."""
    buffer = layout.buffers[number]
    data = chunk if buffer.uri is None else read_uri(buffer.uri, path, where)
    if data is None:
        raise InputError(f"{where}: found no uri; only the first buffer of a .glb may lack it")
    if len(data) < buffer.byteLength:
        raise InputError(f"{where}: cut short: {len(data)} bytes of {buffer.byteLength}")
    return data[: buffer.byteLength]


def read_uri(uri: str, path: Path, where: str) -> bytes:
    """The bytes of a data URI, or of a file in the folder of the glTF at `path`. Raises InputError or ValueError."""
    where = f"{where}: uri {uri!r:.60}"
    if uri.startswith("data:"):
        head, comma, text = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise InputError(f"{where}; allowed: a file, or data in base64")
        return base64.b64decode(text, validate=True)
    return read_beside(unquote(uri), path.parent, where)
