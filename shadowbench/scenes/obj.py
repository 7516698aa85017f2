"""OBJ reader: vertices, faces, normals and texture coordinates, by object and by what its materials look like.

Groups do not split meshes. Not read by trimesh, which truncates damaged files. Of the MTL files beside it, `map_d` is
the alpha of its image, as in Blender, or if no texel is transparent its luminance, as in the format's specification and
about in three.js; of an image that is `map_Kd` too, the alpha alone. `d` is a factor of it. As an MTL has no cutoff, a
surface is cut out where that is below BLEND_CUTOFF, like the blended materials of a glTF.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shadowbench.errors import InputError, printable
from shadowbench.files import read_beside
from shadowbench.scenes.cutouts import Alphas, Cutout, Wrap, cut_out
from shadowbench.scenes.file_contents import BLEND_CUTOFF, OPAQUE, Look
from shadowbench.scenes.images import mask_of, read_image
from shadowbench.scenes.lines import Lines, Rows, lines_of, numbers, with_newlines, without_comments
from shadowbench.scenes.model import GREY
from shadowbench.scenes.polygons import Integers, Polygons
from shadowbench.scenes.triangles import Singles, unit_normals
from shadowbench.scenes.vectors import vec3

_KEYS = ("kd", "d", "tr", "map_kd", "map_d")
_MOVES = {"-o": 0.0, "-s": 1.0, "-t": 0.0}
"""Options of a map that move or scale it, and the value without effect."""


class MaterialFiles:
    """The materials of MTL files. names: what follows each mtllib; notes: on what was simplified or not read."""

    def __init__(self, names: Iterable[str], folder: Path, where: str) -> None:
        self._folder, self._where = folder, where
        self._lines: dict[str, None] = {}
        self._cut: set[str] = set()
        self._looks: dict[tuple[object, ...], Look] = {}
        self._cutouts: dict[tuple[object, ...], Cutout] = {}
        self._masks: dict[tuple[str, bool], Alphas] = {}
        self._fields: dict[str, dict[str, str]] = {}
        for file in dict.fromkeys(file for name in names for file in self._separate(name)):
            text = (self._read("mtllib", file) or b"").decode("utf-8", errors="replace")
            for material, key, value in _statements(text):
                self._fields.setdefault(material, {})[key] = value

    @property
    def notes(self) -> list[str]:
        """A line for each."""
        cut = f"{self._where}: {len(self._cut)} material(s) cut out where d · map_d is below {BLEND_CUTOFF:g}"
        return [*self._lines, *([cut] if self._cut else [])]

    def look(self, name: str) -> Look | None:
        """What a material looks like, one object for all alike, grey if no file has it; None if opaque nowhere."""
        fields = self._fields.get(name, {})
        (file, wrap), (colored, _) = self._map("map_d", fields), self._map("map_kd", fields)
        dissolve = _numbers(fields.get("d"), 1) or [1.0 - one for one in _numbers(fields.get("tr"), 1)] or [1.0]
        mask = self._mask(file, colored == file) if file else OPAQUE
        factor = min(max(dissolve[0], 0.0), 1.0)
        key = id(mask), factor, wrap
        if key not in self._cutouts:
            self._cutouts[key] = cut_out(mask, factor, BLEND_CUTOFF, wrap=(wrap, wrap))
        cutout = self._cutouts[key]
        opaque = cutout.share == 1.0
        if not opaque:
            self._cut.add(name)
        if cutout.share == 0.0:
            return None
        color = _numbers(fields.get("kd"), 3)
        if colored and not any(color):  # black where exporters mean: see the texture
            color = []
        look = Look(vec3(np.clip(color or GREY, 0.0, 1.0)), None if opaque else cutout)
        return self._looks.setdefault((look.color, id(look.cutout)), look)

    def _map(self, key: str, fields: dict[str, str]) -> tuple[str, Wrap]:
        """The file of a material's image, empty without one, and its wrap."""
        words = fields.get(key, "").split()
        wrap: Wrap = "repeat"
        while len(words) > 1 and words[0].startswith("-"):
            option, numbers_after = words.pop(0).lower(), list(takewhile(lambda word: _numbers(word, 1), words[:-1]))
            if option in _MOVES and any(float(number) != _MOVES[option] for number in numbers_after):
                self._lines[f"{self._where}: {key} {option}: left out"] = None
            wrap = "clamp" if [option, words[0].lower()] == ["-clamp", "on"] else wrap
            words = words[len(numbers_after) or 1 :]
        return " ".join(words), wrap

    def _mask(self, file: str, colored: bool) -> Alphas:
        """Alphas of an image, read once; opaque, with a note, if not read. colored: whether it is map_Kd."""
        if (file, colored) not in self._masks:
            mask = OPAQUE
            if (content := self._read("map_d", file)) is not None:
                try:
                    image = read_image(content, f"{self._where}: map_d {file!r:.60}")
                    mask = np.ascontiguousarray(image[..., 3]) if colored else mask_of(image)
                except InputError as error:
                    self._lines[f"{error}: left out"] = None
            self._masks[file, colored] = mask
        return self._masks[file, colored]

    def _read(self, what: str, file: str) -> bytes | None:
        """A file in the folder; None, with a note, for one that is not there."""
        try:
            return read_beside(file, self._folder, f"{self._where}: {what} {file!r:.60}")
        except InputError as error:
            self._lines[f"{error}: left out"] = None
            return None

    def _separate(self, names: str) -> list[str]:
        """The files of a statement: one whose name may have blanks, or several."""
        return [names] if (self._folder / names).is_file() else names.split() or [names]


def _statements(text: str) -> Iterator[tuple[str, str, str]]:
    """Material, keyword in lower case and value of each statement that is read; a later one counts."""
    material = ""
    for line in text.splitlines():
        key, _, value = line.strip().replace("\t", " ").partition(" ")
        if key.lower() == "newmtl":
            material = value.strip()
        elif material and key.lower() in _KEYS:
            yield material, key.lower(), value.strip()


def _numbers(text: str | None, count: int) -> list[float]:
    """The first `count` numbers; none if there are fewer, or other words among them."""
    try:
        values = [float(word) for word in (text or "").split()[:count]]
    except ValueError:
        return []
    return values if len(values) == count and all(map(math.isfinite, values)) else []


NO_SHAPE = {"vp", "g", "s", "mg", "mtllib", "usemtl", "o"}
"""Statements that do not affect the shape, or are handled elsewhere, besides v, vn, vt and f."""

NAME_ENDS = re.compile(
    rb"^[ \t]*(?:usemtl|mtllib|g|o)[ \t][^\n]*\\(?=\n[ \t]*(?:[fglops]|v[npt]?|usemtl|mtllib)[ \t])",
    re.MULTILINE | re.IGNORECASE,
)
"""A name that ends with a backslash, as of a folder of Windows, where another statement begins the next line."""


def read_obj(data: bytes, where: str, folder: Path, coordinates: bool = False) -> Polygons:
    """The faces of an OBJ file, of which those are left out whose material is opaque nowhere.

    folder: where its MTL files and their images are; coordinates: whether texture coordinates are read even if no
    material needs them. Raises InputError for invalid numbers and indices. A vertex's weight and colour are not read; a
    note says so.
    """
    raw = with_newlines(data)
    # Joining continued lines keeps byte offsets; the last line may end with a backslash, as may a name.
    text = NAME_ENDS.sub(lambda name: name[0][:-1] + b" ", without_comments(raw))
    lines = lines_of(text.replace(b"\\\n", b"  ") + b"\n", where, raw)
    is_a = {keyword: lines.begin_with(keyword) for keyword in ("v", "f", "o", "vn", "vt")}
    vertex_lines, face_lines = lines.select(is_a["v"], skip=1), lines.select(is_a["f"], skip=1)
    vertices = numbers(vertex_lines)
    vertex_lines.check(vertices.counts >= 3, vertices.counts, 3)
    faces = _Faces(face_lines, numbers(face_lines, indices=True))
    corners = faces.references(0, vertex_lines, "vertex")[1]
    others = lines.select(~(is_a["v"] | is_a["f"] | is_a["vn"] | is_a["vt"]))
    parts, notes = _parts(lines.select(is_a["o"], skip=1), others, face_lines, folder)
    notes = [*_left_out(others), *notes]
    normals = _normals(faces, lines.select(is_a["vn"], skip=2))
    needed = coordinates or any(look is not None and look.cutout is not None for look in parts.looks)
    places = _coordinates(faces, lines.select(is_a["vt"], skip=2)) if needed else None
    seen = np.array([look is not None for look in parts.looks])[parts.owners]
    counts, owners = faces.counts[seen], parts.owners[seen]
    if not seen.all():
        at_corners = np.repeat(seen, faces.counts)
        corners = corners[at_corners]
        normals, places = (None if each is None else each[at_corners] for each in (normals, places))
        notes.append(f"{where}: {len(seen) - len(counts)} face(s) left out whose material is opaque nowhere")
    looks = tuple(look or Look() for look in parts.looks)
    return Polygons(vertices.vectors, corners, counts, owners, parts.names, notes, normals, places, looks)


class _Faces:
    """The lines of faces and their indices. counts: (P,) number of each face's corners."""

    def __init__(self, lines: Lines, rows: Rows) -> None:
        assert rows.columns is not None
        self._lines, self._values, self._columns = lines, rows.values, rows.columns
        self._line = np.repeat(np.arange(len(rows.counts)), rows.counts)
        self._corner = np.cumsum(rows.columns == 0) - 1
        self.counts = np.bincount(self._line[rows.columns == 0], minlength=len(rows.counts))

    def references(self, column: int, things: Lines, what: str) -> tuple[Integers, Integers]:
        """(N,) corners with an index in a column, and (N,) the thing that each means. Raises InputError."""
        chosen = self._columns == column
        indices, line = self._values[chosen], self._line[chosen]
        before = np.searchsorted(things.starts, self._lines.starts)[line]
        meant = np.where(indices > 0, indices - 1, indices + before)
        wrong = (indices == 0) | (meant < 0) | (meant >= len(things.starts))
        if wrong.any():
            k = int(wrong.argmax())
            count = f"the file has {len(things.starts)}, {before[k]} before this line"
            message = f"a face uses {what} {indices[k]}; an OBJ counts from 1 or -1, {count}"
            raise self._lines.error(int(line[k]), message)
        return self._corner[chosen], meant


def _normals(faces: _Faces, lines: Lines) -> Singles | None:
    """(C, 3) unit normals of the corners, zero in faces of which not every corner has one; None without any."""
    if not len(lines.starts):
        return None
    corners, numbers_of = faces.references(2, lines, "normal")
    given = numbers(lines)
    lines.check(given.counts >= 3, given.counts, 3)
    normals = np.zeros((int(faces.counts.sum()), 3), dtype=np.float32)
    normals[corners] = unit_normals(given.vectors)[numbers_of]
    has_one = np.zeros(len(normals), dtype=bool)
    has_one[corners] = True
    of_face = np.repeat(np.arange(len(faces.counts)), faces.counts)
    normals[np.isin(of_face, of_face[~has_one])] = 0.0
    return normals if normals.any() else None


def _coordinates(faces: _Faces, lines: Lines) -> Singles | None:
    """(C, 2) texture coordinates of the corners with v downwards, zero at those without; None without any."""
    corners, numbers_of = faces.references(1, lines, "texture coordinate")
    if not len(corners):
        return None
    given = numbers(lines)
    lines.check(given.counts >= 2, given.counts, 2)
    places = given.values[given.starts[:, None] + np.arange(2)] * [1.0, -1.0] + [0.0, 1.0]  # v upwards in an OBJ
    coordinates = np.zeros((int(faces.counts.sum()), 2), dtype=np.float32)
    coordinates[corners] = np.nan_to_num(places, posinf=0.0, neginf=0.0)[numbers_of]
    return coordinates


class _Parts(NamedTuple):
    """What faces belong to: (P,) the number of each one's object and look; names and looks, None if opaque nowhere."""

    owners: Integers
    names: tuple[str | None, ...]
    looks: tuple[Look | None, ...]


def _parts(objects: Lines, others: Lines, faces: Lines, folder: Path) -> tuple[_Parts, list[str]]:
    """The parts of an OBJ: its objects, split where materials look different; and notes on those."""
    owners, names = _objects(objects, faces)
    named = others._replace(text=others.file)  # a name may have a number sign
    libraries, uses = (named.select(others.begin_with(word), skip=len(word)) for word in ("mtllib", "usemtl"))
    files = MaterialFiles(_values(libraries), folder, others.where)
    materials = ["", *_values(uses)]
    looks = {name: files.look(name) for name in dict.fromkeys(materials)}
    kinds = {id(look): look for look in looks.values()}  # materials that look alike are one, of the first one's name
    titles = {id(look): name for name, look in reversed(looks.items())}
    number = {kind: k for k, kind in enumerate(kinds)}
    statement = np.searchsorted(uses.starts, faces.starts)
    pairs = owners * len(kinds) + np.array([number[id(looks[name])] for name in materials])[statement]
    distinct, parts = np.unique(pairs, return_inverse=True)
    if not len(distinct):
        return _Parts(parts, (None,), (Look(),)), files.notes
    keys = list(kinds)
    objects_of, kinds_of = distinct // len(kinds), [keys[k] for k in (distinct % len(kinds)).tolist()]
    several = np.bincount(objects_of, minlength=len(names)) > 1
    called = tuple(
        " ".join(filter(None, (names[k], titles[kind]))) or None if several[k] else names[k]
        for k, kind in zip(objects_of.tolist(), kinds_of, strict=True)
    )
    return _Parts(parts, called, tuple(kinds[kind] for kind in kinds_of)), files.notes


def _values(statements: Lines) -> list[str]:
    """What follows the keyword in each line."""
    return [statements.line(k).strip() for k in range(len(statements.starts))]


def _objects(objects: Lines, faces: Lines) -> tuple[Integers, tuple[str | None, ...]]:
    """(P,) index of each face's object, and the distinct object names; statements with the same name are one object."""
    # A name may have a number sign.
    names = [None, *(name or None for name in _values(objects._replace(text=objects.file)))]
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    owners = np.array([number[name] for name in names])
    return owners[np.searchsorted(objects.starts, faces.starts)], tuple(number)


def _left_out(others: Lines) -> list[str]:
    """A note on unsupported statements, such as curves or damaged lines, if there are any."""
    words = Counter(printable(others.line(k).split(None, 1)[0]) for k in range(len(others.starts)))
    counts = [f"{count} {word:.20}" for word, count in words.most_common() if word.lower() not in NO_SHAPE]
    return [f"{others.where}: left out, as they make no face: {', '.join(counts[:5])}"] if counts else []
