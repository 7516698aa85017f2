"""Elements of a glTF's accessors as arrays, whatever their types."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.scenes.gltf_storage import Accessor, Range
from shadowbench.scenes.vectors import Floats


class Data(NamedTuple):
    """A glTF's layout, the bytes of its buffers, and the beginning of its error messages."""

    layout: Layout
    buffers: list[bytes]
    where: str


def floats_of(data: Data, index: int, *types: str) -> Floats:
    """(count, n) float64 elements of an accessor of one of the types, with normalised integers as fractions.

    types: as in the specification, SCALAR, VEC2, VEC3, VEC4 or MAT4. Raises InputError for another one, and where the
    file has no data.
    """
    return as_floats(stored(data, index, *types), data.layout.accessors[index])


def integers_of(data: Data, index: int, *types: str) -> NDArray[Any]:
    """(count, n) unsigned integers of an accessor of one of the types. Raises InputError as `floats_of` does."""
    accessor = data.layout.accessors[index]
    if accessor.row[0].kind != "u":
        raise _wrong(data, index, f"{' or '.join(types)} of unsigned integers")
    return stored(data, index, *types)


def stored(data: Data, index: int, *types: str) -> NDArray[Any]:
    """(count, n) elements of an accessor, a view of their buffer or sparse. Raises InputError as `floats_of` does."""
    accessor = data.layout.accessors[index]
    if accessor.type not in types:
        raise _wrong(data, index, " or ".join(types))
    place, dense, replaced = f"{data.where}: accessors {index + 1}", accessor.dense, accessor.replaced
    if dense is None and replaced is None:
        raise InputError(f"{place}: has no bufferView, and no extension fills it")
    dtype, numbers = accessor.row
    elements = np.zeros((accessor.count, numbers), dtype) if dense is None else _range(data, dense)
    if replaced is None:
        return elements
    indices, values = (_range(data, part) for part in replaced)
    if (indices >= accessor.count).any():
        raise InputError(f"{place}: sparse: found index {indices.max()}; allowed: 0 to {accessor.count - 1}")
    elements = elements.copy()
    elements[indices[:, 0]] = values
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
    found = data.layout.accessors[index]
    return InputError(
        f"{data.where}: accessors {index + 1}: found {found.type} of {found.componentType}; allowed: {allowed}"
    )
