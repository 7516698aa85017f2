"""What PLY, OFF and OBJ files declare about themselves, against what was read: trimesh cuts short in silence."""

import re
from pathlib import Path

import numpy as np
import trimesh

from shadowbench.errors import InputError

LONGEST_LINE = 100_000
"""Bytes in a text file: a polygon of thousands of corners. trimesh takes 200 bytes for each of them."""
MOST_SOLIDS = 1000
"""In a text STL: trimesh looks for a name that is free among all before it."""
MOST_WORK = 5_000_000_000
"""Objects of an OBJ times its vertices: trimesh goes over all vertices for each object."""


def check_text(path: Path, where: str) -> None:
    """Raises InputError for contents that trimesh would read as something else, or in part."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        header = _ply_header(path)
        if "tristrips" in header:
            raise InputError(f"{where}: triangle strips in a PLY cannot be read; save it with faces")
    data = path.read_bytes()
    binary = (suffix == ".stl" and _is_binary_stl(data)) or (suffix == ".ply" and b"format ascii" not in data[:100])
    if not binary and re.search(rb"[^\r\n]{%d}" % (LONGEST_LINE + 1), data):
        raise InputError(f"{where}: a line of more than {LONGEST_LINE} bytes; allowed are shorter ones")
    if suffix == ".stl":
        _check_stl(data, where)
    if suffix == ".obj":
        text = data
        objects, vertices = len(re.findall(rb"^o[ \t]", text, re.MULTILINE)), text.count(b"\nv ")
        if objects * vertices > MOST_WORK:
            told = f"{objects} objects over {vertices} vertices"
            raise InputError(f"{where}: {told}; allowed are at most {MOST_WORK} of one times the other")
        if re.search(rb"^f[ \t](?:[^\n]*[ \t])?[-+]?0+(?:[/\s]|$)", text, re.MULTILINE):
            raise InputError(f"{where}: a face uses vertex 0; an OBJ counts from 1")
        relative = re.search(rb"^f[ \t](?:[^\n]*[ \t])?-\d", text, re.MULTILINE)
        last = text.rfind(b"\nv ")
        if relative is not None and relative.start() < last:
            raise InputError(
                f"{where}: faces with relative (negative) indices stand between vertices; save it absolute"
            )


def in_utf8(path: Path) -> bytes:
    """The file, its text in UTF-8: names and comments may be in any code, and trimesh reads only this one."""
    data = path.read_bytes()
    if path.suffix.lower() == ".stl" and _is_binary_stl(data):
        return data
    mark = b"end_header" if path.suffix.lower() == ".ply" and b"format ascii" not in data[:100] else b""
    text, mark, rest = data.partition(mark) if mark else (data, b"", b"")
    return text.decode("utf-8", errors="replace").encode() + mark + rest


def _is_binary_stl(data: bytes) -> bool:
    return len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _check_stl(data: bytes, where: str) -> None:
    """A binary STL is as long as its count says; a text one ends what it begins."""
    if _is_binary_stl(data):
        return
    count = int.from_bytes(data[80:84], "little")
    text = data.lower()
    if not text.lstrip().startswith(b"solid"):
        raise InputError(f"{where}: cut short: {count} triangles announced, room for {max(len(data) - 84, 0) // 50}")
    if (solids := text.count(b"endsolid")) > MOST_SOLIDS:
        raise InputError(f"{where}: {solids} solids; allowed are at most {MOST_SOLIDS}, or a binary file")
    if text.rfind(b"vertex") > text.rfind(b"endsolid"):
        raise InputError(f"{where}: cut short: a solid without its endsolid")


def check_counts(path: Path, scene: trimesh.Scene, where: str) -> None:
    """Raises InputError if a PLY or OFF file announces more vertices or faces than it holds."""
    suffix = path.suffix.lower()
    read = sum(len(mesh.faces) for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh))
    if suffix == ".ply":
        announced = {
            name: int(count) for name, count in re.findall(r"^element (\w+) (\d+)", _ply_header(path), re.MULTILINE)
        }
        raw = [mesh.metadata.get("_ply_raw", {}) for mesh in scene.geometry.values()]
        for elements in raw:
            for name in ("vertex", "face"):
                held = _held(elements.get(name, {}).get("data"))
                if held is not None and held < announced.get(name, 0):
                    raise InputError(f"{where}: cut short: {held} of {announced[name]} {name} rows")
        if read < announced.get("face", 0):
            raise InputError(f"{where}: {announced['face']} faces announced, {read} triangles read")
    if suffix == ".off":
        counts = re.search(r"^\s*C?OFF\s+(\d+)\s+(\d+)", re.sub(r"#.*", "", path.read_text(errors="replace")))
        if counts is not None and read < int(counts[2]):
            raise InputError(f"{where}: cut short: {counts[2]} faces announced, {read} triangles read")


def notes_on(path: Path) -> list[str]:
    """A line for what an OBJ holds beside faces."""
    if path.suffix.lower() != ".obj":
        return []
    found = re.findall(rb"^(l|p|curv|surf)[ \t]", path.read_bytes(), re.MULTILINE)
    return [f"{path.name}: {len(found)} point, line or free-form elements left out"] if found else []


def _held(data: object) -> int | None:
    """Rows of an element as trimesh keeps them: an array, or a dictionary of columns."""
    if isinstance(data, dict):
        return min((len(column) for column in data.values()), default=0)
    return len(data) if isinstance(data, np.ndarray | list) else None


def _ply_header(path: Path) -> str:
    """The header of a PLY file as text."""
    with path.open("rb") as file:
        return file.read(65536).split(b"end_header")[0].decode("latin-1")
