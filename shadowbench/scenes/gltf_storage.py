"""Where a glTF's numbers lie: buffers, their views, which may be compressed, and accessors, which may be sparse."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import AliasChoices, AliasPath, Field, model_validator

from shadowbench.scenes.gltf_fields import Count, JsonObject, Number, ViewIndex, index_into

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # by componentType
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}  # of components, by type
MOST_DECOMPRESSED = 2 << 30
"""Limit on the bytes of a file's compressed bufferViews, once decompressed."""
MOST_ZEROS = 1 << 26
"""Limit on the numbers of a file's accessors without a bufferView, which are zero but for the sparse ones."""
DENSEST = 1024
"""Most bytes that a byte of meshopt's streams stands for: a control byte for 256 elements of 4 bytes, appendix A of
KHR_meshopt_compression."""

BufferIndex = Annotated[Count, index_into("buffers")]


class Range(NamedTuple):
    """The elements of an accessor that lie in a bufferView: their number, type and place."""

    bufferView: int
    byteOffset: int
    length: int
    dtype: np.dtype[Any]
    numbers: int


class _SparseIndices(JsonObject):
    bufferView: ViewIndex
    byteOffset: Count = 0
    componentType: Literal[5121, 5123, 5125]


class _SparseValues(JsonObject):
    bufferView: ViewIndex
    byteOffset: Count = 0


class _Sparse(JsonObject):
    count: Count
    indices: _SparseIndices
    values: _SparseValues


class Accessor(JsonObject):
    """`count` elements in a bufferView, of which `sparse` replaces some."""

    bufferView: ViewIndex | None = None
    byteOffset: Count = 0
    count: Count
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = Field(False, strict=True)
    min: list[Number] | None = None
    max: list[Number] | None = None
    sparse: _Sparse | None = None

    @property
    def row(self) -> tuple[np.dtype[Any], int]:
        """Type and number of an element's components."""
        return np.dtype(DTYPES[self.componentType]), NUMBERS[self.type]

    @property
    def dense(self) -> Range | None:
        """All elements, None if they are zero."""
        return None if self.bufferView is None else Range(self.bufferView, self.byteOffset, self.count, *self.row)

    @property
    def replaced(self) -> tuple[Range, Range] | None:
        """Indices and values of the elements that `sparse` replaces."""
        if self.sparse is None:
            return None
        (count, at, to), (dtype, numbers) = dict(self.sparse).values(), self.row
        indices = Range(at.bufferView, at.byteOffset, count, np.dtype(DTYPES[at.componentType]), 1)
        return indices, Range(to.bufferView, to.byteOffset, count, dtype, numbers)


class _Compressed(JsonObject):
    """A bufferView's elements as EXT_meshopt_compression and KHR_meshopt_compression store them.

    The second has more of the same stream: vertex codec 1, and the filter COLOR.
    """

    buffer: BufferIndex
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=256, strict=True)]
    count: Count
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"] = "NONE"

    @property
    def end(self) -> int:
        return self.byteOffset + self.byteLength

    @model_validator(mode="after")
    def _as_specified(self) -> Self:
        strides: Sequence[int] = (2, 4)
        if self.mode == "ATTRIBUTES":
            strides = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}.get(self.filter, range(4, 257, 4))
        elif self.filter != "NONE":
            raise ValueError(f"found filter {self.filter} with mode {self.mode}; allowed: with ATTRIBUTES")
        if self.byteStride not in strides:
            allowed = " or ".join(map(str, strides)) if len(strides) < 3 else "multiples of 4 up to 256"
            raise ValueError(f"found byteStride {self.byteStride} with {self.mode} {self.filter}; allowed: {allowed}")
        if self.mode == "TRIANGLES" and self.count % 3:
            raise ValueError(f"found {self.count} indices of TRIANGLES; allowed: multiples of 3")
        if self.count * self.byteStride > DENSEST * self.byteLength:
            raise ValueError(f"found {self.byteLength} bytes, too few for {self.count} elements")
        return self


class BufferView(JsonObject):
    """Bytes of a buffer. compressed: what decompresses to them, by an extension."""

    buffer: BufferIndex
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=252, strict=True)] | None = None
    compressed: _Compressed | None = Field(
        None,
        validation_alias=AliasChoices(
            AliasPath("extensions", "EXT_meshopt_compression"), AliasPath("extensions", "KHR_meshopt_compression")
        ),
    )

    @property
    def end(self) -> int:
        """Byte of the buffer at which it ends."""
        return self.byteOffset + self.byteLength


class Buffer(JsonObject):
    """Bytes of a file or of the JSON."""

    uri: str | None = None
    byteLength: Count


def check_sizes(buffers: list[Buffer], views: list[BufferView], accessors: list[Accessor]) -> None:
    """Raises ValueError for what lies outside its buffer or bufferView, or decompresses to too much."""
    for k, view in enumerate(views, 1):
        for source in (view, view.compressed):
            if source is not None and source.end > (size := buffers[source.buffer].byteLength):
                raise ValueError(f"bufferViews {k}: ends at byte {source.end} of a buffer of {size}")
        if (packed := view.compressed) is not None and packed.count * packed.byteStride != view.byteLength:
            found = f"{packed.count} elements of {packed.byteStride} bytes are compressed"
            raise ValueError(f"bufferViews {k}: {found} in a bufferView of {view.byteLength}")
    total = sum(view.byteLength for view in views if view.compressed is not None)
    if total > MOST_DECOMPRESSED:
        raise ValueError(f"its bufferViews decompress to {total} bytes; allowed are at most {MOST_DECOMPRESSED}")
    for k, accessor in enumerate(accessors, 1):
        for part in (accessor.dense, *(accessor.replaced or ())):
            if part is not None:
                _check_range(part, views[part.bufferView], f"accessors {k}")


def _check_range(part: Range, view: BufferView, where: str) -> None:
    row = part.dtype.itemsize * part.numbers
    if view.byteStride is not None and view.byteStride < row and part.length > 1:
        raise ValueError(f"{where}: elements of {row} bytes overlap at a byteStride of {view.byteStride}")
    end = part.byteOffset + (part.length and (part.length - 1) * (view.byteStride or row) + row)
    if end > view.byteLength:
        raise ValueError(f"{where}: {part.length} elements end at byte {end} of a bufferView of {view.byteLength}")
