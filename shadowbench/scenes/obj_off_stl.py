"""OBJ, OFF and STL readers: vertices and faces, of OBJ and STL by object, of OBJ with normals.

Materials and groups do not split meshes. Not read by trimesh, which searches a text STL for keywords also in names of
solids, and truncates damaged files.
"""

import re
from collections import Counter

import numpy as np

from shadowbench.errors import InputError, printable
from shadowbench.scenes.geometry import check_indices
from shadowbench.scenes.lines import Lines, Rows, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.normals import Singles, unit_normals
from shadowbench.scenes.polygons import Integers, Polygons, gather
from shadowbench.scenes.tables import MOST_COPIES
from shadowbench.scenes.vectors import Floats

NO_SHAPE = {"vp", "g", "s", "mg", "mtllib", "usemtl", "o"}
"""Statements that do not affect the shape, or are handled elsewhere, besides v, vn, vt and f."""
KIND = re.compile(rb"\s*(?:ST)?C?N?OFF(?=\s)")
COUNTS = re.compile(r"(\d{1,18})\s+(\d{1,18})(\s+\d+)?\s*")
HEADER, TRIANGLE = 84, 50  # bytes
KEYWORDS = ("solid", "endsolid", "facet", "endfacet", "outer", "endloop", "vertex")
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_obj(data: bytes, where: str) -> Polygons:
    """The faces of an OBJ file. Raises InputError for invalid numbers and vertex indices.

    A vertex's weight and colour are not read; a note says so.
    """
    raw = with_newlines(data)
    # Joining continued lines keeps byte offsets; the last line may end with a backslash.
    lines = lines_of(without_comments(raw).replace(b"\\\n", b"  ") + b"\n", where, raw)
    is_a = {keyword: lines.begin_with(keyword) for keyword in ("v", "f", "o", "vn", "vt")}
    vertex_lines, face_lines = lines.select(is_a["v"], skip=1), lines.select(is_a["f"], skip=1)
    vertices = numbers(vertex_lines)
    vertex_lines.check(vertices.counts >= 3, vertices.counts, 3)
    corners, counts = _corners(face_lines, vertex_lines)
    owners, names = _objects(lines.select(is_a["o"], skip=1), face_lines)
    others = lines.select(~(is_a["v"] | is_a["f"] | is_a["vn"] | is_a["vt"]))
    notes = [f"{where}: {note}" for note in (_more_numbers(vertices), _left_out(others)) if note]
    normals = _normals(face_lines, lines.select(is_a["vn"], skip=2), counts)
    return Polygons(vertices.vectors, corners, counts, owners, names, notes, normals)


def _more_numbers(vertices: Rows) -> str:
    """A note on numbers of vertices after x y z, which are left out; empty without.

    A fourth is the weight of a rational curve, not of a polygon: as in Blender and tinyobjloader, no coordinate is
    divided by it.
    """
    more = vertices.counts > 3
    more[more] = (vertices.counts[more] > 4) | (vertices.values[vertices.starts[more] + 3] != 1)
    found = int(np.count_nonzero(more))
    return f"weights or colours of {found} vertices left out: the first three numbers are x y z" if found else ""


def _corners(faces: Lines, vertices: Lines) -> tuple[Integers, Integers]:
    """(C,) zero-based vertex indices of all faces, and (P,) the number of each face's corners."""
    rows = numbers(faces, integers=True, dropped=rb"/(?<=\d/)[^ \t\v\f\n]*")
    return _counted_from_0(rows, faces, vertices, "vertex"), rows.counts


def _normals(faces: Lines, normals: Lines, counts: Integers) -> Singles | None:
    """(C, 3) unit normals of the corners, zero in faces of which not every corner has one; None without any."""
    letters = np.frombuffer(faces.text, dtype=np.uint8)
    slashes = np.concatenate([[0], np.cumsum(letters == ord("/"))])
    smooth = slashes[faces.ends] - slashes[faces.starts] == 2 * counts
    if not smooth.any() or not len(normals.starts):
        return None
    own = faces.select(smooth)
    rows = numbers(own, integers=True, dropped=rb"[^ \t\v\f\n]*/(?=[-+\d])")
    given = numbers(normals)
    normals.check(given.counts >= 3, given.counts, 3)
    found = np.zeros((int(counts.sum()), 3), dtype=np.float32)
    found[np.repeat(smooth, counts)] = unit_normals(given.vectors)[_counted_from_0(rows, own, normals, "normal")]
    return found


def _counted_from_0(rows: Rows, faces: Lines, things: Lines, what: str) -> Integers:
    """The indices of lines of faces, counted from 0. Raises InputError for one that is none of the things."""
    indices = rows.values.astype(np.int64)
    before = np.repeat(np.searchsorted(things.starts, faces.starts), rows.counts)
    found = np.where(indices > 0, indices - 1, indices + before)
    wrong = (indices == 0) | (found < 0) | (found >= len(things.starts))
    if wrong.any():
        k = int(wrong.argmax())
        count = f"the file has {len(things.starts)}, {before[k]} before this line"
        line = int(np.searchsorted(rows.starts, k, side="right")) - 1
        raise faces.error(line, f"a face uses {what} {indices[k]}; an OBJ counts from 1 or -1, {count}")
    return found


def _objects(objects: Lines, faces: Lines) -> tuple[Integers, tuple[str | None, ...]]:
    """(P,) index of each face's object, and the distinct object names; statements with the same name are one object."""
    if len(objects.starts) > MOST_COPIES:
        raise InputError(f"{objects.where}: {len(objects.starts)} objects; allowed are at most {MOST_COPIES}")
    named = objects._replace(text=objects.file)  # a name may have a number sign
    names = [None, *(named.line(k).strip() or None for k in range(len(objects.starts)))]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    owners = np.array([number[name] for name in names])
    return owners[np.searchsorted(objects.starts, faces.starts)], tuple(number)


def _left_out(others: Lines) -> str:
    """A note with the numbers of unsupported statements, such as curves or damaged lines; empty without."""
    words = (printable(others.line(k).split(None, 1)[0]) for k in range(len(others.starts)))
    found = Counter(word for word in words if word.lower() not in NO_SHAPE)
    counts = ", ".join(f"{count} {word:.20}" for word, count in found.most_common(5)) + ", ..." * (len(found) > 5)
    return f"{found.total()} statement(s) left out that make no face: {counts}" if found else ""


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
    if len(solids) > MOST_COPIES:
        raise InputError(f"{where}: {len(solids)} solids; allowed are at most {MOST_COPIES}, or a binary file")
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
