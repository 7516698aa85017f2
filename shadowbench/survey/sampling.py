"""Samples of a view: the receivers at a lattice of pixels, their blockers, and the shadows' edges.

In local coordinates, like the truth, but with one ray per pixel, and more only where its state ends, for what is
undecided: the pixel at a closed room's corner whose ray starts outside is neither lit nor beside an edge.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.model import Placement, View
from shadowbench.scenes.vectors import Floats, unit
from shadowbench.truths.embree import INFINITE, Tracer, over_slices
from shadowbench.truths.rays import EDGE_ON, GRAZING, SUBPIXEL, Indices, Mask, Receivers, dot
from shadowbench.truths.trace import OFFSET

LATTICE = 512  # largest number of sampled pixels along a side: all pixels, or every second, third, …
SAMPLE_FIELDS = ("pixel", "triangle", "point", "normal", "to_light", "distance", "across", "down", "blocker")
ROWS = 32  # rows of the lattice per task of a thread
GROUPS = 16  # random groups of samples, whose scatter gives the standard error
FACING = 1e-6  # least N·L of a receiver


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error: 0 if every pixel was sampled, None if there are too few samples."""

    value: float
    error: float | None = 0.0

    def times(self, factor: float) -> "Estimate":
        """The estimate in another unit."""
        return Estimate(self.value * factor, None if self.error is None else self.error * abs(factor))

    def plus(self, more: float) -> "Estimate":
        """The estimate plus an exact number."""
        return Estimate(self.value + more, self.error)


@dataclass(frozen=True, eq=False)
class Samples:
    """The R visible receivers at the centres of the sampled pixels, facing the light and inside its cone or panel.

    view: in local coordinates; casters: traced by shadow rays; step: pixels between samples; pixel: (R,) index in the
    lattice, row by row; triangle: (R,); point, normal (towards the camera), to_light (unit): (3, R); distance: (R,) to
    the light, inf for a directional one; across, down: (3, R) derivatives of the point, on its plane, by a pixel to the
    right and downwards; blocker: (R,) distance along L to the nearest caster, inf where lit.
    """

    view: View
    placement: Placement
    casters: Tracer
    step: int
    pixel: Indices
    triangle: Indices
    point: Floats
    normal: Floats
    to_light: Floats
    distance: Floats
    across: Floats
    down: Floats
    blocker: Floats

    @property
    def all(self) -> Indices:
        """Indices of all samples."""
        return np.arange(len(self.pixel))

    @property
    def side(self) -> int:
        """Number of sampled pixels along a side of the view."""
        return -(-self.view.size // self.step)

    @cached_property
    def cosine(self) -> Floats:
        """(R,) N·L."""
        return dot(self.normal, self.to_light)

    @cached_property
    def shadowed(self) -> Mask:
        """(R,) bool: whether each sample is in shadow."""
        return np.isfinite(self.blocker)

    @cached_property
    def neighbours(self) -> NDArray[np.int8]:
        """(4, R) state of each sample's neighbours in the lattice: 1 shadowed, 0 lit, −1 no receiver."""
        state = np.full((self.side + 2, self.side + 2), -1, dtype=np.int8)
        row, column = np.divmod(self.pixel, self.side)
        state[row + 1, column + 1] = self.shadowed
        return np.stack([state[row + y, column + x] for y, x in ((0, 1), (2, 1), (1, 0), (1, 2))])

    @cached_property
    def edges(self) -> Indices:
        """(E,) indices of the edge pixels: samples in shadow with a lit receiver among their four neighbours."""
        return np.flatnonzero(self.shadowed & (self.neighbours == 0).any(axis=0))

    def select(self, chosen: Indices) -> "Samples":
        """The chosen samples. Their `edges` differ, as neighbours may be missing."""
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in SAMPLE_FIELDS})

    @property
    def part(self) -> float:
        """Share of the view's pixels that were sampled."""
        return float(min(1.0, (self.side / self.view.size) ** 2))

    def estimate(self, statistic: Callable[[Indices], Any], chosen: Indices) -> Estimate:
        """A statistic of chosen samples, with its standard error from the scatter over random groups of them.

        The error is 0 if every pixel was sampled: it is that of the view, not of other cameras.
        """
        value = float(statistic(chosen))
        if self.step == 1 or len(chosen) < 2 * GROUPS:
            return Estimate(value, 0.0 if self.step == 1 else None)
        groups = np.array_split(np.random.default_rng(0).permutation(chosen), GROUPS)
        scatter = np.array([statistic(np.sort(group)) for group in groups])
        return Estimate(value, float(scatter.std(ddof=1) / np.sqrt(GROUPS) * np.sqrt(1 - self.part)))

    def quantile(self, values: Floats, share: float, chosen: Indices) -> Estimate:
        """A quantile of (R,) values over chosen samples."""
        return self.estimate(lambda some: np.quantile(values[some], share), chosen)

    def mean(self, values: Floats | Mask, chosen: Indices) -> Estimate:
        """The mean of (R,) values over chosen samples, for booleans a share."""
        return self.estimate(lambda some: values[some].mean(), chosen)


def sample_view(view: View) -> Samples:
    """The samples of a view from `view_of`. Raises InputError if no receiver is visible."""
    placed, placement = view.placed()
    geometry = placed.scene.geometry
    low, high = geometry.bounds
    above = OFFSET * float(np.linalg.norm(high - low))
    step = -(-view.size // LATTICE)
    centres = np.minimum(np.arange(0, view.size, step) + (step - 1) // 2, view.size - 1) + 0.5
    everything = Tracer(geometry.vertices, geometry.faces, geometry.cutouts)
    whole = len(geometry.caster_faces) == len(geometry.faces)
    casters = everything if whole else Tracer(geometry.vertices, geometry.caster_faces, geometry.caster_cutouts)

    def trace(rows: slice) -> dict[str, NDArray[Any]]:
        y, x = np.meshgrid(centres[rows], centres, indexing="ij")
        hits = _surfaces(placed, everything, x.ravel(), y.ravel())
        hits |= _lighting(placed, casters, hits["point"], hits["normal"], above)
        hits["pixel"] += rows.start * len(centres)
        return {name: hits[name][..., hits["receives"]] for name in SAMPLE_FIELDS}

    parts = list(over_slices(trace, len(centres), ROWS))
    arrays = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in SAMPLE_FIELDS}
    if not len(arrays["pixel"]):
        raise InputError(
            f"view {view.camera.name!r} of {view.scene.name}: no pixel shows a receiver that {view.light.name!r} "
            "lights; needs are those of the visible receivers"
        )
    samples = Samples(view=placed, placement=placement, casters=casters, step=step, **arrays)
    near = _near_blockers(samples, above)
    samples = replace(samples, blocker=np.minimum(samples.blocker, near))
    return samples.select(np.flatnonzero(~_undecided(samples, above) | np.isfinite(near)))


def _surfaces(view: View, tracer: Tracer, x: Floats, y: Floats) -> dict[str, NDArray[Any]]:
    """The visible surfaces that receive shadows at (N,) image points, in pixels from the upper left corner.

    Fields as in `Samples`, but for pixel: index of the image point.
    """
    geometry, camera = view.scene.geometry, view.camera
    right, up, back = camera.basis()[:, :, None]
    eye, (near, far) = np.array(camera.position)[:, None], view.near_far
    pixel = 2 * float(np.tan(camera.fov_y / 2)) / view.size
    moves = pixel * right, -pixel * up
    rays = (x - view.size / 2) * moves[0] + (y - view.size / 2) * moves[1] - back
    low, high = geometry.bounds
    gap = float(np.linalg.norm((low + high) / 2 - eye[:, 0]) - np.linalg.norm(high - low) / 2)
    # Rays have length 1 along the view axis; those of distant cameras start near the scene, for float32 precision.
    start = np.maximum(near, gap / np.sqrt(dot(rays, rays)))
    triangle = tracer.hits((eye + rays * start).T, rays.T, far - start).triangle.astype(np.intp)
    ray = np.flatnonzero((triangle >= 0) & geometry.receives[triangle])
    triangle, rays = triangle[ray], rays[:, ray]

    a, b, c = (geometry.vertices.take(geometry.faces[triangle, k], axis=0).T for k in range(3))
    normal = np.cross(b - a, c - a, axis=0)
    normal *= -np.sign(dot(normal, rays)) / np.sqrt(dot(normal, normal))
    slant = np.minimum(dot(normal, rays), -EDGE_ON)
    depth = dot(normal, a - eye) / slant
    # Derivatives of P = eye + t·d, t = N·(A − eye)/(N·d), along the image's axes.
    across, down = (depth * (move - rays * (dot(normal, move) / slant)) for move in moves)
    point = eye + rays * depth
    return {"pixel": ray, "triangle": triangle, "point": point, "normal": normal, "across": across, "down": down}


def _lighting(view: View, casters: Tracer, point: Floats, normal: Floats, above: float) -> dict[str, NDArray[Any]]:
    """The light at surface points, by a shadow ray each from a local length `above` the surface.

    Fields as in `Samples`, and receives: (N,) bool, whether the surface faces the light and is inside its cone or
    before its panel.
    """
    source, w = view.light.homogeneous
    to_light = np.array(source)[:, None] - w * point
    length = np.sqrt(dot(to_light, to_light))
    to_light = to_light / np.maximum(length, np.finfo(float).tiny)
    cosine = dot(normal, to_light)
    receives = cosine > FACING
    if view.light.cos_half_angle > -1:
        axis = unit(view.light.direction)[:, None]
        receives &= -dot(to_light, axis) >= view.light.cos_half_angle
    ahead = above / np.maximum(cosine, FACING)
    reach = np.maximum(length - ahead, 0.0) if w else np.full(len(length), INFINITE)
    beyond = casters.hits((point + to_light * ahead).T, to_light.T, reach).distance
    blocked = receives & (beyond < reach.astype(np.float32))  # without a hit `distance` returns the reach
    distance, blocker = length if w else np.full(len(length), np.inf), np.where(blocked, ahead + beyond, np.inf)
    return {"receives": receives, "to_light": to_light, "distance": distance, "blocker": blocker}


def _undecided(samples: Samples, above: float) -> Mask:
    """(R,) whether a shadow ray that starts at another height or, on the surface, nearby has another answer.

    Those of the truth (see `hard`), of samples beside another state, as others are inside a shadow or its surroundings.
    """
    beside = np.flatnonzero((samples.neighbours == ~samples.shadowed).any(axis=0))
    at = samples.select(beside)
    source, w = samples.view.light.homogeneous
    along = at.to_light * (above / np.maximum(at.cosine, FACING))
    moves = [SUBPIXEL * (x * at.across + y * at.down) + along for x in (-1, 1) for y in (-1, 1)]
    undecided = np.zeros(len(samples.pixel), dtype=bool)
    for move in (along / 4, along * 4, at.normal * above, *moves):
        origin = at.point + move
        to_light = np.array(source)[:, None] - w * origin
        length = np.sqrt(dot(to_light, to_light))
        reach = (length if w else np.full(len(length), INFINITE)).astype(np.float32)
        directions = to_light / np.maximum(length, np.finfo(float).tiny)
        undecided[beside] |= (samples.casters.hits(origin.T, directions.T, reach).distance < reach) != at.shadowed
    return undecided


def _near_blockers(samples: Samples, height: float) -> Floats:
    """(R,) distance along L to the nearest caster before the start of the shadow ray, `height` above the surface.

    Computed, as in the truth, where the light is so low that the ray starts more than a pixel away; inf elsewhere.
    """
    distance = np.full(len(samples.pixel), np.inf)
    pixel = np.sqrt(np.minimum((samples.across**2).sum(axis=0), (samples.down**2).sum(axis=0)))
    low = np.flatnonzero((samples.cosine > GRAZING) & (height > pixel * samples.cosine))
    if len(low):
        from shadowbench.truths.near import NearCasters  # Numba takes 0.4 s to import

        at, geometry, eye = samples.select(low), samples.view.scene.geometry, np.array(samples.view.camera.position)
        receivers = Receivers(at.pixel, at.triangle, at.point, at.to_light, at.distance, at.cosine)
        distance[low], _ = NearCasters(geometry).nearest_blockers(receivers, height, eye[:, None])
    return distance
