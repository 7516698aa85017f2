"""OFF reader: vertices and faces; colours and normals are ignored."""

import re

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.lines import Lines, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.polygons import Polygons, gather
from shadowbench.scenes.triangles import check_indices

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
