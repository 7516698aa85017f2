"""PLY reader, text and binary: vertices and faces, with any other properties skipped.

Not read by trimesh, because it assumes that all lists of a binary file are as long as the first, and triangulates
polygons as fans.
"""

import re
import struct
from codecs import BOM_UTF8
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import check_indices
from shadowbench.scenes.lines import Lines, lines_of, numbers, with_newlines
from shadowbench.scenes.polygons import Integers, Polygons, gather

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
Order = Literal["=", "<", ">"]
ORDERS: dict[str, Order] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
END = re.compile(rb"end_header[ \t]*(\r\n|\n|\r)")
LONGEST_HEADER = 65536


class Property(NamedTuple):
    """A property of an element. length: type of a list's length, None for a single number."""

    name: str
    type: np.dtype[Any]
    length: np.dtype[Any] | None


class Element(NamedTuple):
    """An element of the header: `rows` rows of properties."""

    name: str
    rows: int
    properties: list[Property]


class Column(NamedTuple):
    """The values of a property: one per row, or for lists `counts` values per row."""

    values: NDArray[Any]
    counts: Integers | None


def read_ply(data: bytes, where: str) -> Polygons:
    """The faces of a PLY file. Raises InputError for an invalid header, or fewer rows than it announces."""
    data = data.removeprefix(BOM_UTF8)
    end = END.search(data, 0, LONGEST_HEADER)
    if not data.startswith(b"ply") or end is None:
        raise InputError(f"{where}: is not a PLY: its header must begin with 'ply' and end with 'end_header'")
    order, elements = _header(data[: end.start()].decode("utf-8", errors="replace"), where)
    columns: dict[tuple[str, str], Column] = {}
    body, at = data[end.end() :], 0
    lines = lines_of(with_newlines(body), f"{where}: after the header") if order == "=" else None
    for element in elements:
        if lines is not None:
            rows, at = _text_rows(element, lines, at)
        else:
            rows, at = _binary_rows(element, body, at, order, where)
        columns |= {(element.name, name): column for name, column in rows.items()}
    beyond = (len(body) if lines is None else len(lines.starts)) - at
    notes = [f"{where}: {beyond} {'bytes' if lines is None else 'lines'} after its last row left out"] if beyond else []
    others = [f"{e.rows} {e.name:.20}" for e in elements if e.name not in ("vertex", "face") and e.rows]
    if others:
        notes.append(f"{where}: rows left out that are no faces: {', '.join(others[:5])}{', ...' * (len(others) > 5)}")
    return _polygons(elements, columns, notes, where)


def _polygons(
    elements: list[Element], columns: dict[tuple[str, str], Column], notes: list[str], where: str
) -> Polygons:
    rows = {element.name: element.rows for element in elements}
    if rows.get("tristrips"):
        raise InputError(f"{where}: triangle strips in a PLY cannot be read; save it with faces")
    axes = [column for axis in "xyz" if (column := columns.get(("vertex", axis))) is not None and column.counts is None]
    if len(axes) < 3:
        raise InputError(f"{where}: element vertex: the properties x, y and z are needed, a number each")
    vertices = np.stack([axis.values.astype(np.float64) for axis in axes], axis=1)
    lists = {name: c for (of, name), c in columns.items() if of == "face" and c.counts is not None}
    faces = next((lists[name] for name in (*INDICES, *lists) if name in lists), Column(np.zeros(0), None))
    if faces.counts is None and rows.get("face"):
        raise InputError(f"{where}: element face: found no list; {INDICES[0]} is needed")
    counts = np.zeros(0, dtype=np.int64) if faces.counts is None else faces.counts
    corners = check_indices(faces.values, len(vertices), where)
    return Polygons(vertices, corners, counts, np.zeros(len(counts), dtype=np.int64), (None,), notes)


def _header(text: str, where: str) -> tuple[Order, list[Element]]:
    """The byte order ("=" for text), and the elements in file order."""
    order: Order | None = None
    elements: list[Element] = []
    for number, line in enumerate(text.splitlines()[1:], 2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", kind, "1.0"] if kind in ORDERS and order is None:
                order = ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and name not in [e.name for e in elements]:
                elements.append(Element(name, int(count[:30]), []))
            case ["property", kind, name] if kind in TYPES and elements:
                elements[-1].properties.append(Property(name, np.dtype(TYPES[kind]), None))
            case ["property", "list", length, kind, name] if (
                kind in TYPES and TYPES.get(length, "f")[0] != "f" and elements
            ):
                elements[-1].properties.append(Property(name, np.dtype(TYPES[kind]), np.dtype(TYPES[length])))
            case _:
                raise InputError(f"{where}: line {number}: {line!r:.60} is not valid in the header of a PLY")
    if order is None:
        raise InputError(f"{where}: found no format; allowed: {', '.join(ORDERS)}")
    for element in elements:
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            raise InputError(f"{where}: element {element.name:.20}: two properties have one name")
    return order, elements


def _text_rows(element: Element, lines: Lines, at: int) -> tuple[dict[str, Column], int]:
    """The columns of a text element whose first row is line `at`, and the line after its last row."""
    end = at + element.rows
    if end > len(lines.starts):
        found = f"{len(lines.starts) - at} of {element.rows} {element.name:.20} rows"
        raise InputError(f"{lines.where}: cut short: {found}")
    own = lines.select(slice(at, end))
    rows = numbers(own)
    cursor, limit = rows.starts.copy(), rows.starts + rows.counts
    columns = {}
    for each in element.properties:
        short = cursor >= limit
        counts = None
        if each.length is not None and not short.any():
            lengths = rows.values[cursor]
            short = ~((lengths >= 0) & (lengths == np.floor(lengths)) & (lengths < limit - cursor))
            counts = np.where(short, 0, lengths).astype(np.int64)
            cursor = cursor + 1
        if short.any():
            break
        values = rows.values[cursor] if counts is None else gather(rows.values, cursor, counts)
        # Text floats are rounded to float32, so that a text and a binary file give the same mesh.
        columns[each.name] = Column(values.astype(each.type) if each.type.kind == "f" else values, counts)
        cursor = cursor + (1 if counts is None else counts)
    else:
        short = cursor < limit
    if short.any():
        k = int(short.argmax())
        raise own.error(k, f"found {rows.counts[k]} numbers, which do not fit the properties of {element.name:.20}")
    return columns, end


def _binary_rows(element: Element, body: bytes, at: int, order: Order, where: str) -> tuple[dict[str, Column], int]:
    """The columns of a binary element whose first row begins at byte `at`, and the byte after its last row."""
    rows, name = element.rows, f"{element.name:.20} rows"
    types = [each.type.newbyteorder(order) for each in element.properties]
    lengths = [None if each.length is None else each.length.newbyteorder(order) for each in element.properties]
    smallest = sum((own if length is None else length).itemsize for own, length in zip(types, lengths, strict=True))
    if rows * smallest > len(body) - at:
        raise InputError(f"{where}: cut short: {rows} {name} announced, room for {(len(body) - at) // smallest}")
    if not types:
        return {}, at
    steps = [
        (k, own.itemsize, None if length is None else struct.Struct(order + length.char))
        for k, (own, length) in enumerate(zip(types, lengths, strict=True))
    ]
    starts = np.empty((rows, len(types)), dtype=np.int64)
    counts = np.ones((rows, len(types)), dtype=np.int64)
    columns, first = {}, at
    for row in range(rows):
        for k, size, length in steps:
            count = 1
            if length is not None:
                count = length.unpack_from(body, at)[0] if at + length.size <= len(body) else -1
                at += length.size
                counts[row, k] = count
            starts[row, k] = at
            at += count * size
            if count < 0 or at > len(body):
                raise InputError(f"{where}: cut short in row {row + 1} of {rows} {name}")
        step = at - first
        fits = row == 0 and first + rows * step <= len(body)
        if fits and _alike(rows, step, lengths, counts[0], starts[0], body):  # usual, and far faster
            for k, (each, own) in enumerate(zip(element.properties, types, strict=True)):
                shape, strides = (rows, int(counts[0, k])), (step, own.itemsize)
                values = np.ndarray(shape, own, body, int(starts[0, k]), strides).ravel()
                columns[each.name] = Column(values, None if each.length is None else np.full(*shape))
            return columns, first + rows * step
    letters = np.frombuffer(body, dtype=np.uint8)
    for k, (each, own) in enumerate(zip(element.properties, types, strict=True)):
        values = gather(letters, starts[:, k], counts[:, k] * own.itemsize).view(own)
        columns[each.name] = Column(values, None if each.length is None else counts[:, k])
    return columns, at


def _alike(
    rows: int, step: int, lengths: list[np.dtype[Any] | None], counts: Integers, starts: Integers, body: bytes
) -> bool:
    """Whether each list has the same length in all rows, `step` bytes apart, as in the first."""
    return all(
        bool((np.ndarray((rows,), length, body, int(start) - length.itemsize, (step,)) == count).all())
        for length, start, count in zip(lengths, starts, counts, strict=True)
        if length is not None
    )
