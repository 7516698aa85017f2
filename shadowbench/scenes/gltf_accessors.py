"""Elements of a glTF's accessors as arrays, whatever their types."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.scenes.gltf_storage import Accessor, Range
from shadowbench.scenes.vectors import Floats

BOUNDS_OFF = 0.01
"""Difference from an accessor's min and max, as a share of the largest extent, that exporters' rounding explains."""


class Data(NamedTuple):
    """A glTF's layout, the bytes of its buffers, and the beginning of its error messages."""

    layout: Layout
    buffers: list[bytes]
    where: str


def floats_of(data: Data, index: int, *types: str) -> Floats:
    """(count, n) float64 elements of an accessor of one of the types, with normalised integers as fractions.

    types: as in the specification, SCALAR, VEC2, VEC3, VEC4 or MAT4. Raises InputError for another one, and for
    elements that the accessor's own min and max contradict.
    """
    accessor, elements = data.layout.accessors[index], stored(data, index, *types)
    _check_bounds(elements, accessor, f"{data.where}: accessors {index + 1}")
    return as_floats(elements, accessor)


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


def _check_bounds(elements: NDArray[Any], accessor: Accessor, where: str) -> None:
    """Raise InputError for elements that are not as their accessor's min and max say.

    So they are where a byteStride or an offset is wrong, and triangles would go from anywhere to anywhere.
    """
    if accessor.min is None or accessor.max is None or not len(elements):
        return
    if {len(accessor.min), len(accessor.max)} != {elements.shape[1]}:
        found = f"{len(accessor.min)} and {len(accessor.max)} numbers"
        raise InputError(f"{where}: found min and max of {found}; allowed: {elements.shape[1]}, as its elements")
    given = np.array([accessor.min, accessor.max])
    read = np.array([elements.min(axis=0), elements.max(axis=0)])
    off = BOUNDS_OFF * np.ptp(given, axis=0).max() + 1e-6 * np.abs(given).max()
    # Some exporters give those of normalised integers as fractions. What is NaN is refused elsewhere, if it matters.
    if all((np.abs(values - given) > off).any() for values in (read.astype(np.float64), as_floats(read, accessor))):
        low, high, least, most = (f"({', '.join(f'{value:.6g}' for value in row)})" for row in (*read, *given))
        raise InputError(
            f"{where}: found elements from {low} to {high}, but min and max say {least} to {most}: its data, or the "
            "byteStride or an offset, are wrong"
        )


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
