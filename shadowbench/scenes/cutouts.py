"""Surfaces cut out by alpha, as leaves are: bitmaps, made once when a scene is loaded, that say where one is opaque.

A sub-texel is opaque where α₈ / 255 · factor ≥ cutoff at its centre, but for rounding. α₈ is that of the
texel, or mixed bilinearly of the four around, as the texture's sampler says for magnification; always of the base
level, without mip maps, and never decoded from sRGB. Truth, techniques and exported files all take the nearest
sub-texel, so that all of them see the same surface.

A texel has one sub-texel where the sampler takes the nearest, else SUBTEXELS², fewer in images of more than MOST_SIDE /
SUBTEXELS. Texture coordinates are interpolated linearly across the triangle; u = v = 0 is the corner of the first
texel, v downwards, as in glTF.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Wrap = Literal["repeat", "mirror", "clamp"]
Wraps = tuple[Wrap, Wrap]
Alphas = NDArray[np.uint8]
Bits = NDArray[np.bool_]
Single = NDArray[np.float32]
WRAPS: tuple[Wrap, ...] = ("repeat", "mirror", "clamp")
SUBTEXELS = 8  # along a side of a texel
MOST_SIDE = 4096  # sub-texels along a side of an image, above which a texel has fewer
ROUNDED = 1e-3  # of a step of 8 bits: several times what mixing alphas in float32 rounds


@dataclass(frozen=True, eq=False)
class Cutout:
    """Where a surface is opaque: one bit a sub-texel.

    words: (height, ⌈width / 32⌉) uint32, the lowest bit first; wrap: of places in u and v outside the bitmap; share: of
    the sub-texels that are opaque.
    """

    words: NDArray[np.uint32] = field(repr=False)
    width: int
    wrap: Wraps
    share: float

    @classmethod
    def of(cls, bits: Bits, wrap: Wraps = ("clamp", "clamp")) -> Self:
        """The cut-out of a (height, width) bitmap."""
        packed = np.packbits(bits, axis=1, bitorder="little")
        padded = np.pad(packed, ((0, 0), (0, -packed.shape[1] % 4)))
        return cls(padded.view("<u4").astype(np.uint32), bits.shape[1], wrap, float(bits.mean()))

    @property
    def bits(self) -> Bits:
        """(height, width) whether each sub-texel is opaque."""
        octets = self.words.astype("<u4").view(np.uint8)
        return np.unpackbits(octets, axis=1, count=self.width, bitorder="little").astype(bool)

    @property
    def size(self) -> tuple[int, int]:
        """Sub-texels across and down."""
        return self.width, len(self.words)

    def places(self, coordinates: NDArray[np.floating]) -> Single:
        """(F, 3, 2) places in sub-texels of texture coordinates; shifted by whole periods, so that float32 suffices."""
        places = coordinates * np.array(self.size, dtype=np.float64)
        for axis, wrap in enumerate(self.wrap):
            if wrap != "clamp":
                period = self.size[axis] * (2 if wrap == "mirror" else 1)
                places[..., axis] -= period * np.floor(places[:, :1, axis] / period)
        return places.astype(np.float32)

    def opaque(self, places: NDArray[np.floating]) -> Bits:
        """(…,) whether (…, 2) places are opaque."""
        column, row = (wrapped(np.floor(places[..., axis]), self.size[axis], self.wrap[axis]) for axis in range(2))
        bits: Bits = (self.words[row, column >> 5] >> (column & 31).astype(np.uint32)) & 1 != 0
        return bits


def cut_out(
    alpha: Alphas, factor: float = 1.0, cutoff: float = 0.5, nearest: bool = False, wrap: Wraps = ("repeat", "repeat")
) -> Cutout:
    """The cut-out of (H, W) texels; factor: of their alphas."""
    return Cutout.of(_subtexels(alpha, nearest, wrap) * factor >= 255.0 * cutoff - ROUNDED * factor, wrap)


def _subtexels(alpha: Alphas, nearest: bool, wrap: Wraps) -> Single:
    """(height, width) α₈ at the centres of sub-texels."""
    each = 1 if nearest else max(1, min(SUBTEXELS, MOST_SIDE // max(alpha.shape)))
    values = alpha.astype(np.float32)
    for axis in (0, 1) if each > 1 else ():
        count = alpha.shape[axis]
        at = (np.arange(count * each) + 0.5) / each - 0.5
        first, second = (wrapped(np.floor(at) + step, count, wrap[1 - axis]) for step in (0, 1))
        share = np.expand_dims((at - np.floor(at)).astype(np.float32), 1 - axis)
        values = values.take(first, axis) * (1 - share) + values.take(second, axis) * share
    return values


def wrapped(index: NDArray[np.floating], size: int, wrap: Wrap) -> NDArray[np.intp]:
    """Whole numbers as indices from 0 to size − 1."""
    if wrap == "clamp":
        index = np.clip(index, 0, size - 1)
    elif wrap == "repeat":
        index = np.mod(index, size)
    else:
        index = np.mod(index, 2 * size)
        index = np.minimum(index, 2 * size - 1 - index)
    return np.asarray(index, dtype=np.intp)


class PackedCutouts(NamedTuple):
    """Cut-outs as arrays for compiled code and shaders.

    words: (N,) uint32 of all cut-outs in turn; table: (M, 4) int32, for each the first of its words, width, height, and
    3 · the number in WRAPS of u + that of v.
    """

    words: NDArray[np.uint32]
    table: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class CutoutFaces:
    """The K cut-out triangles among the F of a scene.

    faces: (K,) int32 ascending indices of triangles; places: (K, 3, 2) float32 of their corners in the cut-out, in
    sub-texels; number: (K,) int32 index of each triangle's cut-out in `cutouts`.
    """

    faces: NDArray[np.int32]
    places: Single
    number: NDArray[np.int32]
    cutouts: tuple[Cutout, ...]

    def among(self, kept: NDArray[np.bool_]) -> Self | None:
        """The cut-out triangles among those that are kept, (F,) bool, numbered as these are; None without any."""
        chosen = kept[self.faces]
        if not chosen.any():
            return None
        faces = (np.cumsum(kept)[self.faces[chosen]] - 1).astype(np.int32)
        return type(self)(faces, self.places[chosen], self.number[chosen], self.cutouts)

    def opaque(self, cut: NDArray[np.integer], weights: NDArray[np.floating]) -> Bits:
        """(N,) whether points of triangles are opaque; cut: (N,) indices into `faces`; weights: (N, 3) barycentric."""
        places = np.einsum("nk,nkj->nj", weights, self.places[cut].astype(np.float64))
        opaque = np.zeros(len(cut), dtype=bool)
        for number, cutout in enumerate(self.cutouts):
            own = self.number[cut] == number
            opaque[own] = cutout.opaque(places[own])
        return opaque

    @cached_property
    def packed(self) -> PackedCutouts:
        """The cut-outs as arrays."""
        first = np.cumsum([0, *(cutout.words.size for cutout in self.cutouts)])
        rows = [
            (start, *cutout.size, 3 * WRAPS.index(cutout.wrap[0]) + WRAPS.index(cutout.wrap[1]))
            for start, cutout in zip(first, self.cutouts, strict=False)
        ]
        words = np.concatenate([cutout.words.ravel() for cutout in self.cutouts])
        return PackedCutouts(words, np.array(rows, dtype=np.int32))

    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that decides where these triangles are opaque."""
        return self.faces, self.places, self.number, *self.packed


def cutout_faces(parts: Sequence[tuple[int, Cutout | None, Single | None]]) -> CutoutFaces | None:
    """The cut-out triangles of meshes in turn, None without any.

    parts: of each mesh the number of triangles, its cut-out, and the places of its corners there, by default 0.
    """
    cutouts = list({id(cutout): cutout for _, cutout, _ in parts if cutout is not None}.values())
    if not cutouts:
        return None
    faces, corners, numbers, first = [], [], [], 0
    for count, cutout, places in parts:
        if cutout is not None:
            faces.append(np.arange(first, first + count, dtype=np.int32))
            corners.append(np.zeros((count, 3, 2), np.float32) if places is None else places)
            numbers.append(np.full(count, cutouts.index(cutout), dtype=np.int32))
        first += count
    return CutoutFaces(np.concatenate(faces), np.concatenate(corners), np.concatenate(numbers), tuple(cutouts))
