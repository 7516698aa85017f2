"""Surfaces cut out by alpha, as leaves are: where one is opaque. One definition for the truth and all techniques.

A point of a triangle is opaque where α₈ / 255 · factor · vertex alpha ≥ cutoff, or falls short of it by no more than
float32 may round it: equality counts as opaque wherever it is computed. α₈ is that of the nearest texel, or mixed
bilinearly of the four around, as the texture's sampler says for magnification; always of the base level, without mip
maps, and never decoded from sRGB. Texture coordinates are float32 and interpolated linearly across the triangle;
u = v = 0 is the corner of the first texel, v downwards, as in glTF.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Wrap = Literal["repeat", "mirror", "clamp"]
WRAPS: tuple[Wrap, ...] = ("repeat", "mirror", "clamp")
ROUNDED = 1e-3  # of a step of 8 bits: several times what mixing alphas and vertex alphas in float32 rounds


@dataclass(frozen=True, eq=False)
class Cutout:
    """How a surface is cut out. alpha: (H, W) uint8 texels, read-only; wrap: of u and v outside 0 to 1.

    levels: lowest and highest alpha, which `replace` keeps, as many materials may share an image.
    """

    alpha: NDArray[np.uint8] = field(repr=False)
    factor: float = 1.0
    cutoff: float = 0.5
    nearest: bool = False
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    levels: tuple[int, int] = (-1, -1)

    def __post_init__(self) -> None:
        alpha = self.alpha.view()
        alpha.flags.writeable = False
        object.__setattr__(self, "alpha", alpha)
        if self.levels[0] < 0:
            object.__setattr__(self, "levels", (int(alpha.min()), int(alpha.max())))

    @cached_property
    def least(self) -> float:
        """The least α₈ · vertex alpha that is opaque."""
        if self.factor <= 0.0:
            return 0.0 if self.cutoff <= 0.0 else float("inf")
        return 255.0 * self.cutoff / self.factor - ROUNDED

    def is_whole(self, least: float = 1.0) -> bool:
        """Whether every texel is opaque, with vertex alphas of at least `least`."""
        return self.levels[0] * least >= self.least

    def is_clear(self, most: float = 1.0) -> bool:
        """Whether no texel is opaque, with vertex alphas of at most `most`."""
        return self.levels[1] * most < self.least

    def opaque(
        self, coordinates: NDArray[np.floating], vertex_alpha: NDArray[np.floating] | float = 1.0
    ) -> NDArray[np.bool_]:
        """(…,) bool at (…, 2) texture coordinates, in float64."""
        opaque: NDArray[np.bool_] = self._mixed(np.asarray(coordinates, np.float64)) * vertex_alpha >= self.least
        return opaque

    def _mixed(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """(…,) α₈ at (…, 2) texture coordinates."""
        places = coordinates * self.alpha.shape[::-1]
        if self.nearest:
            return self._texels(np.floor(places))
        first = np.floor(places - 0.5)
        right, down = np.moveaxis(places - 0.5 - first, -1, 0)
        above, below = (
            self._texels(first + np.array([0, row])) * (1 - right) + self._texels(first + np.array([1, row])) * right
            for row in (0, 1)
        )
        mixed: NDArray[np.float64] = above * (1 - down) + below * down
        return mixed

    def _texels(self, index: NDArray[np.float64]) -> NDArray[np.float64]:
        """(…,) texels at (…, 2) whole numbers, column then row, wrapped."""
        sizes = self.alpha.shape[::-1]
        column, row = (wrapped(index[..., axis], sizes[axis], self.wrap[axis]).astype(np.int64) for axis in range(2))
        return self.alpha[row, column].astype(np.float64)


def wrapped(index: NDArray[np.float64], size: int, wrap: Wrap) -> NDArray[np.float64]:
    """Whole numbers as those of texels, from 0 to size − 1."""
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    if wrap == "repeat":
        return np.mod(index, size)
    mirrored: NDArray[np.float64] = np.mod(index, 2 * size)
    return np.minimum(mirrored, 2 * size - 1 - mirrored)


class PackedCutouts(NamedTuple):
    """Cut-outs as arrays for compiled code and shaders.

    texels: (N,) uint8, all different alphas in turn, row by row; table: (M, 6) int32, for each the first of its texels,
    width, height, whether the nearest texel is taken, and the number in WRAPS of u and of v; least: (M,) float64.
    """

    texels: NDArray[np.uint8]
    table: NDArray[np.int32]
    least: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CutoutFaces:
    """The K cut-out triangles among the F of a scene.

    faces: (K,) int32 ascending indices of triangles; coordinates: (K, 3, 2) float32 texture coordinates of the corners;
    alpha: (K, 3) float32 vertex alphas; number: (K,) int32 index of each triangle's cut-out in `cutouts`.
    """

    faces: NDArray[np.int32]
    coordinates: NDArray[np.float32]
    alpha: NDArray[np.float32]
    number: NDArray[np.int32]
    cutouts: tuple[Cutout, ...]

    def among(self, kept: NDArray[np.bool_]) -> Self | None:
        """Those of the triangles kept, (F,) bool, with their indices among these; None without any."""
        chosen = kept[self.faces]
        if not chosen.any():
            return None
        faces = (np.cumsum(kept)[self.faces[chosen]] - 1).astype(np.int32)
        coordinates, alpha, number = self.coordinates[chosen], self.alpha[chosen], self.number[chosen]
        return type(self)(faces, coordinates, alpha, number, self.cutouts)

    def opaque(self, cut: NDArray[np.integer], weights: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) whether points of triangles are opaque; cut: (N,) indices into `faces`; weights: (N, 3) barycentric."""
        places = np.einsum("nk,nkj->nj", weights, self.coordinates[cut].astype(np.float64))
        vertex = self.alpha[cut].astype(np.float64)
        alpha = vertex[:, 0] + np.einsum("nk,nk->n", weights, vertex - vertex[:, :1])  # if equal, exactly they
        result = np.zeros(len(cut), dtype=bool)
        for number, cutout in enumerate(self.cutouts):
            its = self.number[cut] == number
            result[its] = cutout.opaque(places[its], alpha[its])
        return result

    @cached_property
    def packed(self) -> PackedCutouts:
        """The cut-outs as arrays."""
        keys = [(cutout.alpha.ctypes.data, cutout.alpha.shape) for cutout in self.cutouts]
        alphas = {key: cutout.alpha for key, cutout in zip(keys, self.cutouts, strict=True)}
        first = dict(zip(alphas, np.cumsum([0, *(alpha.size for alpha in alphas.values())]), strict=False))
        rows = [
            (first[key], *cutout.alpha.shape[::-1], cutout.nearest, *(WRAPS.index(wrap) for wrap in cutout.wrap))
            for key, cutout in zip(keys, self.cutouts, strict=True)
        ]
        texels = np.concatenate([alpha.ravel() for alpha in alphas.values()])
        return PackedCutouts(texels, np.array(rows, dtype=np.int32), np.array([each.least for each in self.cutouts]))

    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that decides where these triangles are opaque."""
        return self.faces, self.coordinates, self.alpha, self.number, *self.packed


Part = tuple[int, Cutout | None, NDArray[np.float32] | None, NDArray[np.float32] | None]


def cutout_faces(parts: Sequence[Part]) -> CutoutFaces | None:
    """The cut-out triangles of meshes in turn, None without any.

    parts: of each mesh the number of triangles, its cut-out, and its texture coordinates and vertex alphas by corner.
    """
    cutouts = list({id(cutout): cutout for _, cutout, _, _ in parts if cutout is not None}.values())
    number_of = {id(cutout): number for number, cutout in enumerate(cutouts)}
    if not cutouts:
        return None
    faces, corners, alphas, numbers, first = [], [], [], [], 0
    for count, cutout, coordinates, alpha in parts:
        if cutout is not None:
            faces.append(np.arange(first, first + count, dtype=np.int32))
            corners.append(np.zeros((count, 3, 2), np.float32) if coordinates is None else coordinates)
            alphas.append(np.ones((count, 3), np.float32) if alpha is None else alpha)
            numbers.append(np.full(count, number_of[id(cutout)], dtype=np.int32))
        first += count
    arrays = np.concatenate(faces), np.concatenate(corners), np.concatenate(alphas), np.concatenate(numbers)
    return CutoutFaces(*arrays, tuple(cutouts))
