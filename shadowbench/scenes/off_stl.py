"""OFF and STL readers: vertices and faces, of STL by solid.

Not read by trimesh, which searches a text STL for keywords also in names of solids, and truncates damaged files.
"""

import re

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import check_indices
from shadowbench.scenes.lines import lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.polygons import Integers, Polygons, gather
from shadowbench.scenes.tables import MOST_COPIES
from shadowbench.scenes.vectors import Floats

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
