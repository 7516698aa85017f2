"""Materials of an OBJ, from the MTL files beside it: their colour, and where they are cut out.

`map_d` is the alpha of its image, as in Blender, or if no texel is transparent its luminance, as in the format's
specification and about in three.js; of an image that is `map_Kd` too, the alpha alone. `d` is a factor of it. As an MTL
has no cutoff, a surface is cut out where that is below BLEND_CUTOFF, like the blended materials of a glTF.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.files import read_beside
from shadowbench.scenes.cutouts import Alphas, Cutout, Wrap, cut_out
from shadowbench.scenes.images import mask_of, read_image
from shadowbench.scenes.looks import BLEND_CUTOFF, MOST_MASKED, OPAQUE, Look
from shadowbench.scenes.model import GREY, WHITE
from shadowbench.scenes.textures import MOST_BYTES, Texture
from shadowbench.scenes.vectors import vec3

_KEYS = ("kd", "d", "tr", "map_kd", "map_d")
_MOVES = {"-o": 0.0, "-s": 1.0, "-t": 0.0}
"""Options of a map, of up to three numbers, and the value without effect."""


class _Map(NamedTuple):
    file: str
    wrap: Wrap


class MaterialFiles:
    """The materials of MTL files. names: what follows each mtllib; notes: on what was simplified or not read."""

    def __init__(self, names: Iterable[str], folder: Path, where: str) -> None:
        self._folder, self._where = folder, where
        self._told: dict[str, None] = {}
        self._cut: set[str] = set()
        self._files: dict[str, bytes | None] = {}
        self._looks: dict[tuple[object, ...], Look] = {}
        self._cutouts: dict[tuple[object, ...], Cutout] = {}
        self._masks: dict[tuple[str, bool], Alphas] = {}
        self._textures: dict[tuple[_Map, bool], Texture] = {}
        self._fields: dict[str, dict[str, str]] = {}
        for file in dict.fromkeys(file for name in names for file in self._separate(name)):
            text = (self._read("mtllib", file) or b"").decode("utf-8", errors="replace")
            for material, key, value in _statements(text):
                self._fields.setdefault(material, {})[key] = value

    @property
    def notes(self) -> list[str]:
        """A line for each."""
        cut = f"{self._where}: {len(self._cut)} material(s) cut out where d · map_d is below {BLEND_CUTOFF:g}"
        return [*self._told, *([cut] if self._cut else [])]

    def look(self, name: str) -> Look | None:
        """What a material looks like, one object for all alike, grey if no file has it; None if opaque nowhere."""
        fields = self._fields.get(name, {})
        alpha, colors = self._map("map_d", fields), self._map("map_kd", fields)
        dissolve = _numbers(fields.get("d"), 1) or [1.0 - one for one in _numbers(fields.get("tr"), 1)] or [1.0]
        mask = OPAQUE
        if alpha is not None:
            mask = self._mask(alpha.file, colored=colors is not None and colors.file == alpha.file)
        wrap: Wrap = "repeat" if alpha is None else alpha.wrap
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
        texture = None if colors is None else self._texture(colors, opaque)
        if texture is not None:
            color = color if any(color) else list(WHITE)  # black where exporters mean: see the texture
        look = Look(vec3(np.clip(color or GREY, 0.0, 1.0)), None if opaque else cutout, texture)
        return self._looks.setdefault((look.color, id(look.cutout), id(texture)), look)

    def _map(self, key: str, fields: dict[str, str]) -> _Map | None:
        """An image of a material."""
        words = fields.get(key, "").split()
        wrap: Wrap = "repeat"
        while len(words) > 1 and words[0].startswith("-"):
            option = words.pop(0).lower()
            if option in _MOVES:
                moves = list(takewhile(len, (_numbers(word, 1) for word in words[: min(3, len(words) - 1)])))
                words = words[len(moves) :]
                if any(move != [_MOVES[option]] for move in moves):
                    self._told[f"{self._where}: {key} {option}: left out"] = None
            else:
                value = words.pop(0).lower()
                words = words[1:] if option == "-mm" else words
                wrap = "clamp" if option == "-clamp" and value == "on" else wrap
        return _Map(" ".join(words), wrap) if words else None

    def _texture(self, colors: _Map, opaque: bool) -> Texture | None:
        if (content := self._read("map_Kd", colors.file)) is None:
            return None
        where, wrap = f"{self._where}: map_Kd {colors.file!r:.60}", (colors.wrap, colors.wrap)
        return self._textures.setdefault((colors, opaque), Texture(content, where, wrap, opaque))

    def _mask(self, file: str, colored: bool) -> Alphas:
        """Alphas of an image, read once; opaque, with a note, if not read. colored: whether it is map_Kd."""
        if (file, colored) not in self._masks:
            mask = OPAQUE
            if (content := self._read("map_d", file)) is not None:
                try:
                    image = read_image(content, f"{self._where}: map_d {file!r:.60}")
                    total = sum(each.size for each in self._masks.values()) + image.size // 4
                    if total > MOST_MASKED:
                        found = f"{total} texels of masks by now; a file may have {MOST_MASKED}"
                        raise InputError(f"{self._where}: map_d {file!r:.60}: {found}")
                    mask = np.ascontiguousarray(image[..., 3]) if colored else mask_of(image)
                except InputError as error:
                    self._told[f"{error}: left out"] = None
            self._masks[file, colored] = mask
        return self._masks[file, colored]

    def _read(self, what: str, file: str) -> bytes | None:
        """A file in the folder, read once; None, with a note, for one that is not there or too large."""
        if file not in self._files:
            self._files[file] = None
            try:
                self._files[file] = read_beside(file, self._folder, f"{self._where}: {what} {file!r:.60}", self._room)
            except InputError as error:
                self._told[f"{error}: left out"] = None
        return self._files[file]

    @property
    def _room(self) -> int:
        """How many bytes may still be read."""
        return MOST_BYTES - sum(len(content or b"") for content in self._files.values())

    def _separate(self, names: str) -> list[str]:
        """The files of a statement: one whose name may have blanks, or several."""
        if len(names.split()) < 2:
            return [names]
        try:
            read_beside(names, self._folder, "")
        except InputError:
            return names.split()
        return [names]


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
        found = [float(word) for word in (text or "").split()[:count]]
    except ValueError:
        return []
    return found if len(found) == count and all(map(math.isfinite, found)) else []
