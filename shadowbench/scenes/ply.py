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
    lines = lines_of(with_newlines(body), where) if order == "=" else None
    for element in elements:
        if lines is not None:
            rows, at = _text_rows(element, lines, at, where)
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
    by_name = {element.name: element for element in elements}
    if "tristrips" in by_name and by_name["tristrips"].rows:
        raise InputError(f"{where}: triangle strips in a PLY cannot be read; save it with faces")
    axes = [columns.get(("vertex", axis)) for axis in "xyz"]
    if any(axis is None or axis.counts is not None for axis in axes):
        raise InputError(f"{where}: element vertex: the properties x, y and z are needed, a number each")
    vertices = np.stack([axis.values.astype(np.float64) for axis in axes if axis is not None], axis=1)
    count = by_name["face"].rows if "face" in by_name else 0
    lists = {name: c for (of, name), c in columns.items() if of == "face" and c.counts is not None}
    name = next((name for name in (*INDICES, *lists) if name in lists), None)
    if name is None and count:
        raise InputError(f"{where}: element face: found no list; {INDICES[0]} is needed")
    values, counts = lists[name] if name is not None else Column(np.zeros(0), None)
    counts = np.zeros(0, dtype=np.int64) if counts is None else counts
    owners = np.zeros(count, dtype=np.int64)
    return Polygons(vertices, check_indices(values, len(vertices), where), counts, owners, (None,), notes)


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


def _text_rows(element: Element, lines: Lines, at: int, where: str) -> tuple[dict[str, Column], int]:
    """The columns of a text element whose first row is line `at`, and the line after its last row."""
    end = at + element.rows
    if end > len(lines.starts):
        raise InputError(f"{where}: cut short: {len(lines.starts) - at} of {element.rows} {element.name:.20} rows")
    own = lines.select(slice(at, end))
    rows = numbers(own, where)
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
        found = f"{rows.counts[k]} numbers, which do not fit the properties of {element.name:.20}"
        raise InputError(f"{where}: line {own.number(k)} after the header: found {found}")
    return columns, end


def _binary_rows(element: Element, body: bytes, at: int, order: Order, where: str) -> tuple[dict[str, Column], int]:
    """The columns of a binary element whose first row begins at byte `at`, and the byte after its last row."""
    types = [each.type.newbyteorder(order) for each in element.properties]
    lengths = [None if each.length is None else each.length.newbyteorder(order) for each in element.properties]
    smallest = sum((own if length is None else length).itemsize for own, length in zip(types, lengths, strict=True))
    if element.rows * smallest > len(body) - at:
        raise InputError(
            f"{where}: cut short: {element.rows} {element.name:.20} rows announced, "
            f"room for {(len(body) - at) // smallest}"
        )
    rows = _uniform_rows(element.rows, types, lengths, body, at)
    if rows is not None:
        columns = {}
        for k, each in enumerate(element.properties):
            values = rows[f"value {k}"]
            counts = None if each.length is None else np.full(element.rows, values.shape[1])
            columns[each.name] = Column(values.ravel(), counts)
        return columns, at + rows.nbytes
    starts = np.empty((len(types), element.rows), dtype=np.int64)
    counts = np.ones((len(types), element.rows), dtype=np.int64)
    steps = [
        (k, own.itemsize, None if length is None else struct.Struct(order + length.char))
        for k, (own, length) in enumerate(zip(types, lengths, strict=True))
    ]
    for row in range(element.rows):
        for k, size, length in steps:
            count = 1
            if length is not None:
                count = length.unpack_from(body, at)[0] if at + length.size <= len(body) else -1
                at += length.size
                counts[k, row] = count
            starts[k, row] = at
            at += count * size
            if count < 0 or at > len(body):
                raise InputError(f"{where}: cut short in row {row + 1} of {element.rows} {element.name:.20} rows")
    letters = np.frombuffer(body, dtype=np.uint8)
    columns = {}
    for k, (each, own) in enumerate(zip(element.properties, types, strict=True)):
        size = own.itemsize
        values = gather(letters, starts[k], counts[k] * size).view(own)
        columns[each.name] = Column(values, None if each.length is None else counts[k])
    return columns, at


def _uniform_rows(
    count: int, types: list[np.dtype[Any]], lengths: list[np.dtype[Any] | None], body: bytes, at: int
) -> NDArray[Any] | None:
    """The rows as a structured array if each list has the same length in all rows; None otherwise."""
    fields: list[tuple[Any, ...]] = []
    end = at
    for k, (own, length) in enumerate(zip(types, lengths, strict=True)):
        if length is None:
            fields.append((f"value {k}", own))
            end += own.itemsize
            continue
        count_of_first = int(
            np.frombuffer(body[end : end + length.itemsize].ljust(length.itemsize, b"\0"), dtype=length)[0]
        )
        end += length.itemsize + count_of_first * own.itemsize
        if count_of_first < 0 or end > len(body):
            return None
        fields += [(f"length {k}", length), (f"value {k}", own, (count_of_first,))]
    layout = np.dtype(fields)
    if count * layout.itemsize > len(body) - at:
        return None
    rows = np.frombuffer(body, layout, count, at)
    uniform = all((rows[name] == rows[name][:1]).all() for name in layout.names or () if name.startswith("length"))
    return rows if uniform else None
