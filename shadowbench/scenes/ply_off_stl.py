"""PLY, OFF and STL readers: vertices and faces, of PLY with normals and texture coordinates, of STL by solid.

Not read by trimesh, because it assumes that all lists of a binary PLY are as long as the first, triangulates polygons
as fans, searches a text STL for keywords also in names of solids, and truncates damaged files.
"""

import re
import struct
from codecs import BOM_UTF8
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.lines import Lines, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.polygons import Integers, Polygons, gather, strip_faces
from shadowbench.scenes.triangles import check_indices, unit_normals
from shadowbench.scenes.vectors import Floats

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
Order = Literal["=", "<", ">"]
Row = tuple[list[int], list[int], int]
ORDERS: dict[str, Order] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
NORMAL = ("nx", "ny", "nz")
COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
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
    columns: dict[str, dict[str, Column]] = {}
    body, at = data[end.end() :], 0
    lines = lines_of(with_newlines(body), f"{where}: after the header") if order == "=" else None
    for element in elements:
        if lines is not None:
            columns[element.name], at = _text_rows(element, lines, at)
        else:
            columns[element.name], at = _binary_rows(element, body, at, order, where)
    beyond = (len(body) if lines is None else len(lines.starts)) - at
    notes = [f"{where}: {beyond} {'bytes' if lines is None else 'lines'} after its last row left out"] if beyond else []
    others = [f"{e.rows} {e.name:.20}" for e in elements if e.name not in ("vertex", "face", "tristrips") and e.rows]
    if others:
        notes.append(f"{where}: rows left out that are no faces: {', '.join(others[:5])}{', ...' * (len(others) > 5)}")
    return _polygons(elements, columns, notes, where)


def _polygons(elements: list[Element], columns: dict[str, dict[str, Column]], notes: list[str], where: str) -> Polygons:
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    if any(axis not in vertex or vertex[axis].counts is not None for axis in "xyz"):
        raise InputError(f"{where}: element vertex: the properties x, y and z are needed, a number each")
    vertices = np.stack([vertex[axis].values for axis in "xyz"], axis=1, dtype=np.float64)
    lists = [face[name] for name in (*INDICES, *face) if name in face and face[name].counts is not None]
    if not lists and any(element.name == "face" and element.rows for element in elements):
        raise InputError(f"{where}: element face: found no list; {INDICES[0]} is needed")
    strips = _strips(columns.get("tristrips", {}))
    values = np.concatenate([strips.ravel(), *(column.values for column in lists[:1])])
    counts = np.concatenate(
        [np.full(len(strips), 3), *(column.counts for column in lists[:1] if column.counts is not None)]
    )
    corners = check_indices(values, len(vertices), where)
    normals = None
    if all(axis in vertex and vertex[axis].counts is None for axis in NORMAL):
        normals = unit_normals(np.stack([vertex[axis].values for axis in NORMAL], axis=1, dtype=np.float64))[corners]
    coordinates = None
    for pair in COORDINATES:
        if all(name in vertex and vertex[name].counts is None for name in pair):
            places = np.stack([vertex[pair[0]].values, 1.0 - vertex[pair[1]].values], axis=1, dtype=np.float64)
            coordinates = np.nan_to_num(places, posinf=0.0, neginf=0.0).astype(np.float32)[corners]
    owners = np.zeros(len(counts), dtype=np.int64)
    return Polygons(vertices, corners, counts, owners, (None,), notes, normals, coordinates)


def _strips(columns: dict[str, Column]) -> Integers:
    """(F, 3) triangles of an element tristrips, in whose lists −1 begins another strip, as each list does."""
    for column in columns.values():
        if column.counts is not None:
            ends = np.cumsum(column.counts)
            return strip_faces(np.insert(column.values.astype(np.int64), ends[:-1], -1), restart=-1)
    return np.zeros((0, 3), dtype=np.int64)


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
            case ["element", name, count] if order and count.isdecimal() and name not in [e.name for e in elements]:
                elements.append(Element(name, int(count[:30]), []))
            case ["property", *words] if elements and (added := _property(words, order)) is not None:
                if added.name in [each.name for each in elements[-1].properties]:
                    raise InputError(f"{where}: line {number}: two properties have one name")
                elements[-1].properties.append(added)
            case _:
                raise InputError(f"{where}: line {number}: {line!r:.60} is not valid in the header of a PLY")
    if order is None:
        raise InputError(f"{where}: found no format; allowed: {', '.join(ORDERS)}")
    return order, elements


def _property(words: list[str], order: Order | None) -> Property | None:
    """The property of a line of the header; None if it is not valid."""
    match words:
        case [kind, name] if kind in TYPES:
            return Property(name, np.dtype(f"{order}{TYPES[kind]}"), None)
        case ["list", length, kind, name] if kind in TYPES and TYPES.get(length, "f")[0] != "f":
            return Property(name, np.dtype(f"{order}{TYPES[kind]}"), np.dtype(f"{order}{TYPES[length]}"))
    return None


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
    rows, where = element.rows, f"{where}: cut short: {element.rows} {element.name:.20} rows announced"
    properties = element.properties
    smallest = sum((own if length is None else length).itemsize for _, own, length in properties)
    if rows * smallest > len(body) - at:
        raise InputError(f"{where}, room for {(len(body) - at) // smallest}")
    if not rows or not properties:
        none = np.zeros(0, dtype=np.int64)
        return {name: Column(none, None if length is None else none) for name, _, length in properties}, at
    steps = [
        (own.itemsize, None if length is None else struct.Struct(order + length.char)) for _, own, length in properties
    ]
    first = _row(steps, body, at, where)
    end = at + rows * (first[2] - at)
    if end <= len(body) and (columns := _alike(element, first, first[2] - at, body)) is not None:
        return columns, end  # usual, and far faster
    starts, counts = [], []
    for _ in range(rows):
        row, own_counts, at = _row(steps, body, at, where)
        starts += row
        counts += own_counts
    letters, columns = np.frombuffer(body, dtype=np.uint8), {}
    table = np.array([starts, counts]).reshape(2, rows, -1).transpose(0, 2, 1)
    for (name, own, length), start, count in zip(properties, *table, strict=True):
        values = gather(letters, start, count * own.itemsize).view(own)
        columns[name] = Column(values, None if length is None else count)
    return columns, at


def _row(steps: list[tuple[int, struct.Struct | None]], body: bytes, at: int, where: str) -> Row:
    """The byte at which each property's values begin in a row, their number, and the byte after the row.

    steps: size of a value, and the format of a list's length.
    """
    starts, counts = [], []
    for size, length in steps:
        count = 1
        if length is not None:
            count = length.unpack_from(body, at)[0] if at + length.size <= len(body) else -1
            at += length.size
        starts.append(at)
        counts.append(count)
        at += count * size
        if count < 0 or at > len(body):
            raise InputError(f"{where}, and a list that the file has no room for")
    return starts, counts, at


def _alike(element: Element, first: Row, step: int, body: bytes) -> dict[str, Column] | None:
    """The columns of rows of `step` bytes, if each list has the same length in all rows as in the first; else None."""
    columns, rows = {}, element.rows
    for (name, own, length), start, count in zip(element.properties, *first[:2], strict=True):
        if length is not None:
            lengths = np.ndarray((rows,), length, body, start - length.itemsize, (step,))
            if (lengths != count).any():
                return None
        values = np.ndarray((rows, count), own, body, start, (step, own.itemsize)).ravel()
        columns[name] = Column(values, None if length is None else np.full(rows, count))
    return columns


KIND = re.compile(rb"\s*(?:ST)?C?N?OFF(?=[\s\d])")  # in ModelNet40 the counts follow without a blank
COUNTS = re.compile(r"(\d{1,18})\s+(\d{1,18})(\s+\d+)?\s*")
HEADER, TRIANGLE = 84, 50  # bytes
KEYWORDS = ("solid", "endsolid", "facet", "endfacet", "outer", "endloop", "vertex")
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_off(data: bytes, where: str) -> Polygons:
    """The faces of a text OFF file. Raises InputError for invalid data, or fewer lines than its header announces."""
    text = without_comments(with_newlines(data))
    kind = KIND.match(text)
    if kind is None:
        found = text[:20].decode("utf-8", errors="replace")
        raise InputError(f"{where}: found {found!r}; allowed: OFF, COFF, NOFF, STOFF")
    lines = lines_of(b" " * kind.end() + text[kind.end() :], where)
    first = lines.line(0) if len(lines.starts) else ""
    counts = COUNTS.fullmatch(first)
    if counts is None:
        raise InputError(f"{where}: found {first!r:.40} after OFF; allowed: the numbers of vertices, faces and edges")
    lines = lines.select(slice(1, None))
    vertex_count, face_count = int(counts[1]), int(counts[2])
    beyond = len(lines.starts) - vertex_count - face_count
    if beyond < 0:
        announced = f"{vertex_count} vertices and {face_count} faces announced"
        raise InputError(f"{where}: cut short: {announced}, {len(lines.starts)} lines follow")
    vertex_lines = lines.select(slice(vertex_count))
    face_lines = lines.select(slice(vertex_count, vertex_count + face_count))
    vertices, faces = numbers(vertex_lines), numbers(face_lines)
    vertex_lines.check(vertices.counts >= 3, vertices.counts, 3)
    sizes = faces.values[faces.starts]
    valid = (sizes >= 0) & (sizes == np.floor(sizes))
    if not valid.all():
        k = int(valid.argmin())
        raise face_lines.error(k, f"a face of {sizes[k]:g} corners; allowed: 0, 1, 2, ...")
    face_lines.check(faces.counts > sizes, faces.counts, sizes + 1)
    sizes = sizes.astype(np.int64)
    corners = check_indices(gather(faces.values, faces.starts + 1, sizes), vertex_count, where)
    notes = [f"{where}: {beyond} line(s) after the {face_count} faces that it announces left out"] if beyond else []
    return Polygons(vertices.vectors, corners, sizes, np.zeros(face_count, dtype=np.int64), (None,), notes)


def read_stl(data: bytes, where: str) -> Polygons:
    """The triangles of an STL file; its solids are the objects.

    A file is binary if it is long enough for the triangles that it announces, which no text is. Raises InputError for
    one that is cut short, and for a text with other lines or numbers than an STL has.
    """
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    more = len(data) - HEADER - TRIANGLE * count
    if len(data) < HEADER or more < 0:
        text = with_newlines(data)
        if text.lstrip()[:5].lower() != b"solid":
            room = max(len(data) - HEADER, 0) // TRIANGLE
            raise InputError(f"{where}: cut short: {count} triangles announced, room for {room}")
        return _solids(text, where)
    if count == 0 and more:
        raise InputError(f"{where}: announces 0 triangles, and {more} bytes follow; at least 1 is needed")
    notes = [f"{where}: {more} byte(s) after the last of {count} triangles left out"] if more else []
    corners = np.frombuffer(data, _RECORD, count, HEADER)["corners"].astype(np.float64)
    return _triangles(corners, np.zeros(count, dtype=np.int64), (None,), notes)


def _solids(text: bytes, where: str) -> Polygons:
    """The triangles of a text STL."""
    lines = lines_of(text, where)
    is_a = {keyword: lines.begin_with(keyword) for keyword in KEYWORDS}
    solids, ends, facet, vertex = (np.flatnonzero(is_a[kind]) for kind in ("solid", "endsolid", "facet", "vertex"))
    outside = np.searchsorted(solids, facet) != np.searchsorted(ends, facet) + 1
    if len(solids) != len(ends) or (solids > ends).any() or (solids[1:] < ends[:-1]).any() or outside.any():
        raise InputError(f"{where}: cut short: a solid without its endsolid")
    unknown = np.flatnonzero(~np.any(list(is_a.values()), axis=0))
    if len(unknown) and unknown[0] < ends[-1]:
        found = f"found {lines.line(unknown[0])!r:.40}"
        raise lines.error(unknown[0], f"{found}; allowed: {', '.join(KEYWORDS)}")
    vertex_lines = lines.select(is_a["vertex"], skip=len("vertex"))
    rows = numbers(vertex_lines)
    vertex_lines.check(rows.counts == 3, rows.counts, 3)
    corners = np.diff(np.searchsorted(vertex, facet), append=len(vertex))
    if (wrong := corners != 3).any() or len(vertex) != 3 * len(facet):
        if not len(facet):
            raise InputError(f"{where}: found no facet; at least one is needed")
        k = int(wrong.argmax())
        raise lines.error(facet[k], f"found a facet of {corners[k]} vertices; allowed: 3, each on a line")
    names = tuple(lines.line(k)[len("solid") :].strip() or None for k in solids.tolist())
    return _triangles(rows.values, np.searchsorted(solids, facet) - 1, names, [])


def _triangles(corners: Floats, owners: Integers, names: tuple[str | None, ...], notes: list[str]) -> Polygons:
    corners, count = corners.reshape(-1, 3), len(owners)
    return Polygons(corners, np.arange(3 * count), np.full(count, 3), owners, names, notes)
