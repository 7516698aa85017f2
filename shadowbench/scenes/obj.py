"""OBJ: vertices, faces, and the objects that they belong to; materials and groups do not split a closed body.

Read here, because trimesh cuts every polygon as a fan and loses the faces of lines that it does not expect.
"""

from collections import Counter

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.lines import Lines, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.polygons import Integers, Polygons
from shadowbench.scenes.tables import MOST_COPIES

NO_SHAPE = {"vn", "vt", "vp", "g", "s", "mg", "mtllib", "usemtl", "o"}
"""Statements that add nothing to a shape, or are honoured."""


def read_obj(data: bytes, where: str) -> Polygons:
    """The faces of an OBJ file; InputError for numbers that are none and vertices that are not there."""
    raw = with_newlines(data)
    # Joined lines keep their length; the last may be joined to nothing.
    lines = lines_of(without_comments(raw).replace(b"\\\n", b"  ") + b"\n", where, raw)
    letters = np.frombuffer(lines.text, dtype=np.uint8)
    first, second = letters[lines.starts], letters[lines.starts + 1]
    apart = np.isin(second, np.frombuffer(b" \t\v\f\n", dtype=np.uint8))
    is_vertex, is_face, is_object = (apart & (first == ord(letter)) for letter in "vfo")
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
    notes = _left_out(lines.select(~(is_vertex | is_face | normals)), where)
    return Polygons(vertices, corners, counts, owners, names, notes)


def _corners(faces: Lines, vertices: Lines, where: str) -> tuple[Integers, Integers]:
    """(C,) corners of all faces, from 0, and (P,) how many each has; texture and normal numbers are left out."""
    rows = numbers(faces, where, integers=True, dropped=rb"/(?<=\d/)[^ \t\v\f\n]*")
    said = rows.values
    if len(said) == 0:
        return said.astype(np.int64), rows.counts
    before = np.repeat(np.searchsorted(vertices.starts, faces.starts), rows.counts)
    corners = np.where(said > 0, said - 1, said + before)
    wrong = (said == 0) | (corners < 0) | (corners >= len(vertices.starts))
    if wrong.any():
        k = int(wrong.argmax())
        line = faces.number(int(np.searchsorted(rows.starts, k, side="right")) - 1)
        held = f"the file has {len(vertices.starts)}, {before[k]} before this line"
        raise InputError(f"{where}: line {line}: a face uses vertex {said[k]}; an OBJ counts from 1 or -1, {held}")
    return corners, rows.counts


def _objects(objects: Lines, faces: Lines, raw: bytes, where: str) -> tuple[Integers, tuple[str | None, ...]]:
    """(P,) the object of each face, and the names, each once: an object that is named again goes on."""
    if len(objects.starts) > MOST_COPIES:
        raise InputError(f"{where}: {len(objects.starts)} objects; allowed are at most {MOST_COPIES}")
    bounds = zip(objects.starts.tolist(), objects.ends.tolist(), strict=True)
    said = [None, *(raw[a:b].decode("utf-8", errors="replace").strip() or None for a, b in bounds)]
    number = {name: k for k, name in enumerate(dict.fromkeys(said))}
    owners = np.array([number[name] for name in said])
    return owners[np.searchsorted(objects.starts, faces.starts)], tuple(number)


def _left_out(others: Lines, where: str) -> list[str]:
    """A line that counts the statements of a shape that is not made of faces, or of no meaning here."""
    words = (others.line(k).split(None, 1)[0].decode("utf-8", errors="replace") for k in range(len(others.starts)))
    found = Counter(word for word in words if word not in NO_SHAPE)
    if not found:
        return []
    told = ", ".join(f"{count} {word:.20}" for word, count in found.most_common(5)) + ", ..." * (len(found) > 5)
    return [f"{where}: {found.total()} statement(s) left out that make no face: {told}"]
