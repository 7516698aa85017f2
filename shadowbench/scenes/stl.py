"""STL reader, of binary and text files.

Not read by trimesh, which searches a text for its keywords, also in the names of solids, and truncates damaged files.
"""

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.lines import BLANK, Lines, lines_of, numbers, with_newlines
from shadowbench.scenes.polygons import Integers, Polygons
from shadowbench.scenes.tables import MOST_COPIES
from shadowbench.scenes.vectors import Floats

HEADER, TRIANGLE = 84, 50  # bytes
KEYWORDS = ("solid", "endsolid", "facet", "endfacet", "outer", "endloop", "vertex")
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


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
    is_a = {keyword: _begin_with(lines, keyword) for keyword in KEYWORDS}
    solids, ends = (np.flatnonzero(is_a[keyword]) for keyword in ("solid", "endsolid"))
    if len(solids) > MOST_COPIES:
        raise InputError(f"{where}: {len(solids)} solids; allowed are at most {MOST_COPIES}, or a binary file")
    vertex, facet = np.flatnonzero(is_a["vertex"]), np.flatnonzero(is_a["facet"])
    outside = np.searchsorted(solids, facet) != np.searchsorted(ends, facet) + 1
    if len(solids) != len(ends) or (solids > ends).any() or (solids[1:] < ends[:-1]).any() or outside.any():
        raise InputError(f"{where}: cut short: a solid without its endsolid")
    unknown = np.flatnonzero(~np.any(list(is_a.values()), axis=0))
    if len(unknown) and unknown[0] < ends[-1]:
        found = f"{lines.line(int(unknown[0])).decode('utf-8', errors='replace')!r:.40}"
        raise InputError(f"{where}: line {lines.number(unknown[0])}: found {found}; allowed: {', '.join(KEYWORDS)}")
    vertex_lines = lines.select(is_a["vertex"], skip=len("vertex"))
    rows = numbers(vertex_lines, where)
    if (wrong := rows.counts != 3).any():
        k = int(wrong.argmax())
        line = vertex_lines.number(k)
        raise InputError(f"{where}: line {line}: found a vertex of {rows.counts[k]} numbers; allowed: 3")
    following = np.append(facet[1:], len(lines.starts))
    corners = np.searchsorted(vertex, following) - np.searchsorted(vertex, facet)
    if (wrong := corners != 3).any() or len(vertex) != 3 * len(facet):
        k = int(wrong.argmax())
        at = (
            f"line {lines.number(facet[k])}: found a facet of {corners[k]} vertices" if len(facet) else "found no facet"
        )
        raise InputError(f"{where}: {at}; allowed: facets of 3 vertices, each on a line")
    names = tuple(_name(lines.line(line)) for line in solids.tolist())
    return _triangles(rows.values, np.searchsorted(solids, facet) - 1, names, [])


def _triangles(corners: Floats, owners: Integers, names: tuple[str | None, ...], notes: list[str]) -> Polygons:
    corners, count = corners.reshape(-1, 3), len(owners)
    return Polygons(corners, np.arange(3 * count), np.full(count, 3), owners, names, notes)


def _begin_with(lines: Lines, keyword: str) -> NDArray[np.bool_]:
    """(L,) whether the first word of each line is a keyword, in upper or lower case."""
    letters = np.frombuffer(lines.text + bytes(len(keyword)), dtype=np.uint8)
    after = letters[lines.starts + len(keyword)]
    found: NDArray[np.bool_] = BLANK[after] | (after == ord("\n"))
    for k, letter in enumerate(keyword):
        found &= (letters[lines.starts + k] | 32) == ord(letter)
    return found


def _name(line: bytes) -> str | None:
    return line[len("solid") :].decode("utf-8", errors="replace").strip() or None
