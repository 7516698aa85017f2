"""OBJ and OFF readers: vertices and faces, of OBJ by object. Materials and groups do not split meshes."""

import re
from collections import Counter

import numpy as np

from shadowbench.errors import InputError, printable
from shadowbench.scenes.geometry import check_indices
from shadowbench.scenes.lines import Lines, Rows, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.polygons import Integers, Polygons, gather
from shadowbench.scenes.tables import MOST_COPIES

NO_SHAPE = {"vn", "vt", "vp", "g", "s", "mg", "mtllib", "usemtl", "o"}
"""Statements that do not affect the shape, or are handled elsewhere."""


def read_obj(data: bytes, where: str) -> Polygons:
    """The faces of an OBJ file. Raises InputError for invalid numbers and vertex indices.

    Statements in upper case are read, a vertex's weight and colour are not; notes say so.
    """
    raw = with_newlines(data)
    # Joining continued lines keeps byte offsets; the last line may end with a backslash.
    lines = lines_of(without_comments(raw).replace(b"\\\n", b"  ") + b"\n", where, raw)
    letters = np.frombuffer(lines.text, dtype=np.uint8)
    given, second = letters[lines.starts], letters[lines.starts + 1] | 32
    first = given | 32  # in lower case
    single = np.isin(letters[lines.starts + 1], np.frombuffer(b" \t\v\f\n", dtype=np.uint8))  # statements of one letter
    is_vertex, is_face, is_object = (single & (first == ord(letter)) for letter in "vfo")
    vertex_lines, face_lines = lines.select(is_vertex, skip=1), lines.select(is_face, skip=1)
    rows = numbers(vertex_lines, where)
    if len(rows.counts) and rows.counts.min() < 3:
        k = int(rows.counts.argmin())
        line = vertex_lines.number(k)
        raise InputError(f"{where}: line {line}: found a vertex of {rows.counts[k]} numbers; at least 3 are needed")
    vertices = rows.values[rows.starts[:, None] + np.arange(3)]
    corners, counts = _corners(face_lines, vertex_lines, where)
    owners, names = _objects(lines.select(is_object, skip=1), face_lines, raw, where)
    normals = (first == ord("v")) & np.isin(second, np.frombuffer(b"nt", dtype=np.uint8))
    upper = int(np.count_nonzero((is_vertex | is_face) & (given != first)))
    notes = [f"{where}: {upper} statement(s) V or F in upper case read as v or f"] if upper else []
    notes += _more_numbers(rows, where) + _left_out(lines.select(~(is_vertex | is_face | normals)), where)
    return Polygons(vertices, corners, counts, owners, names, notes)


def _more_numbers(vertices: Rows, where: str) -> list[str]:
    """Notes on the numbers of vertices after x y z: a weight w, or red, green and blue.

    Weights are of rational curves, not of polygons: as in Blender and tinyobjloader, no coordinate is divided by them.
    """
    weighted, colored = vertices.counts == 4, vertices.counts == 6
    weights = np.count_nonzero(vertices.values[vertices.starts[weighted] + 3] != 1)
    others = np.count_nonzero((vertices.counts > 3) & ~weighted & ~colored)
    found = [
        (weights, "vertex weight(s) w other than 1 left out: only curves have weights"),
        (np.count_nonzero(colored), "vertex colour(s) left out"),
        (others, "vertices of 5, 7 or more numbers: the first three are x y z, the others are left out"),
    ]
    return [f"{where}: {count} {line}" for count, line in found if count]


def _corners(faces: Lines, vertices: Lines, where: str) -> tuple[Integers, Integers]:
    """(C,) zero-based vertex indices of all faces, and (P,) the number of each face's corners."""
    rows = numbers(faces, where, integers=True, dropped=rb"/(?<=\d/)[^ \t\v\f\n]*")
    indices = rows.values
    if len(indices) == 0:
        return indices.astype(np.int64), rows.counts
    before = np.repeat(np.searchsorted(vertices.starts, faces.starts), rows.counts)
    corners = np.where(indices > 0, indices - 1, indices + before)
    wrong = (indices == 0) | (corners < 0) | (corners >= len(vertices.starts))
    if wrong.any():
        k = int(wrong.argmax())
        line = faces.number(int(np.searchsorted(rows.starts, k, side="right")) - 1)
        count = f"the file has {len(vertices.starts)}, {before[k]} before this line"
        raise InputError(f"{where}: line {line}: a face uses vertex {indices[k]}; an OBJ counts from 1 or -1, {count}")
    return corners, rows.counts


def _objects(objects: Lines, faces: Lines, raw: bytes, where: str) -> tuple[Integers, tuple[str | None, ...]]:
    """(P,) index of each face's object, and the distinct object names; statements with the same name are one object."""
    if len(objects.starts) > MOST_COPIES:
        raise InputError(f"{where}: {len(objects.starts)} objects; allowed are at most {MOST_COPIES}")
    bounds = zip(objects.starts.tolist(), objects.ends.tolist(), strict=True)
    names = [None, *(raw[a:b].decode("utf-8", errors="replace").strip() or None for a, b in bounds)]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    owners = np.array([number[name] for name in names])
    return owners[np.searchsorted(objects.starts, faces.starts)], tuple(number)


def _left_out(others: Lines, where: str) -> list[str]:
    """A note with the numbers of unsupported statements, such as curves."""
    # The line may be a damaged one: no control sequences for the terminal.
    words = (printable(others.line(k).split(None, 1)[0].decode(errors="replace")) for k in range(len(others.starts)))
    found = Counter(word for word in words if word.lower() not in NO_SHAPE)
    if not found:
        return []
    counts = ", ".join(f"{count} {word:.20}" for word, count in found.most_common(5)) + ", ..." * (len(found) > 5)
    return [f"{where}: {found.total()} statement(s) left out that make no face: {counts}"]


KIND = re.compile(rb"\s*(?:ST)?C?N?OFF(?=\s)")
COUNTS = re.compile(rb"(\d{1,18})\s+(\d{1,18})(\s+\d+)?\s*")


def read_off(data: bytes, where: str) -> Polygons:
    """The faces of a text OFF file. Raises InputError for invalid data, or fewer lines than its header announces."""
    text = without_comments(with_newlines(data))
    kind = KIND.match(text)
    if kind is None:
        raise InputError(
            f"{where}: found {text[:20].decode('utf-8', errors='replace')!r}; allowed: OFF, COFF, NOFF, STOFF"
        )
    lines = lines_of(b" " * kind.end() + text[kind.end() :], where)
    counts = COUNTS.fullmatch(lines.line(0)) if len(lines.starts) else None
    if counts is None:
        found = lines.line(0).decode("utf-8", errors="replace") if len(lines.starts) else ""
        raise InputError(f"{where}: found {found!r:.40} after OFF; allowed: the numbers of vertices, faces and edges")
    lines = lines.select(slice(1, None))
    vertex_count, face_count = int(counts[1]), int(counts[2])
    if vertex_count + face_count > len(lines.starts):
        counts_found = f"{vertex_count} vertices and {face_count} faces announced, {len(lines.starts)} lines follow"
        raise InputError(f"{where}: cut short: {counts_found}")
    end = vertex_count + face_count
    vertex_rows = numbers(lines.select(slice(vertex_count)), where)
    face_lines = lines.select(slice(vertex_count, end))
    face_rows = numbers(face_lines, where)
    _check_width(vertex_rows.counts, np.full(vertex_count, 3), lines, where)
    sizes = face_rows.values[face_rows.starts]
    if ((sizes < 0) | (sizes != np.floor(sizes))).any():
        k = int(((sizes < 0) | (sizes != np.floor(sizes))).argmax())
        raise InputError(f"{where}: line {face_lines.number(k)}: a face of {sizes[k]:g} corners; allowed: 0, 1, 2, ...")
    _check_width(face_rows.counts, sizes + 1, face_lines, where)
    sizes = sizes.astype(np.int64)
    corners = check_indices(gather(face_rows.values, face_rows.starts + 1, sizes), vertex_count, where)
    beyond = len(lines.starts) - end
    notes = [f"{where}: {beyond} line(s) after the {face_count} faces that it announces left out"] if beyond else []
    vertices = vertex_rows.values[vertex_rows.starts[:, None] + np.arange(3)]
    return Polygons(vertices, corners, sizes, np.zeros(face_count, dtype=np.int64), (None,), notes)


def _check_width(found: np.ndarray, needed: np.ndarray, lines: Lines, where: str) -> None:
    short = found < needed
    if short.any():
        k = int(short.argmax())
        raise InputError(f"{where}: line {lines.number(k)}: found {found[k]} numbers; {needed[k]:g} are needed")
