"""Samples of a view: the receivers at a lattice of pixels, their blockers, and the shadows' edges.

In local coordinates, like the truth, but with one ray per pixel, so that no pixel is undecided.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.model import Placement, View
from shadowbench.scenes.vectors import Floats
from shadowbench.survey.rays import Indices, Mask, lighting, surfaces
from shadowbench.truths.embree import Tracer, over_slices
from shadowbench.truths.rays import GRAZING, Receivers
from shadowbench.truths.trace import OFFSET

LATTICE = 512  # largest number of sampled pixels along a side: all pixels, or every second, third, …
SAMPLE_FIELDS = ("pixel", "triangle", "point", "normal", "to_light", "distance", "across", "down", "blocker")
ROWS = 32  # rows of the lattice per task of a thread
GROUPS = 16  # random groups of samples, whose scatter gives the standard error


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
    """The R visible receivers at the centres of the sampled pixels.

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

    @cached_property
    def cosine(self) -> Floats:
        """(R,) N·L."""
        cosine: Floats = np.einsum("ij,ij->j", self.normal, self.to_light)
        return cosine

    @cached_property
    def shadowed(self) -> Mask:
        """(R,) bool: whether each sample is in shadow."""
        shadowed: Mask = np.isfinite(self.blocker)
        return shadowed

    @cached_property
    def edges(self) -> Indices:
        """(E,) indices of the edge pixels: samples in shadow with a lit receiver among their four neighbours."""
        side = -(-self.view.size // self.step)
        state = np.full((side + 2, side + 2), -1, dtype=np.int8)  # 1 shadowed, 0 lit, −1 no receiver
        inner = state[1:-1, 1:-1]
        inner[np.divmod(self.pixel, side)] = self.shadowed
        neighbours = state[:-2, 1:-1], state[2:, 1:-1], state[1:-1, :-2], state[1:-1, 2:]
        beside_lit = np.any([neighbour == 0 for neighbour in neighbours], axis=0)
        return np.flatnonzero((beside_lit & (inner == 1)).ravel()[self.pixel])

    def select(self, chosen: Indices) -> "Samples":
        """The chosen samples. Their `edges` differ, as neighbours may be missing."""
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in SAMPLE_FIELDS})

    @property
    def part(self) -> float:
        """Share of the view's pixels that were sampled."""
        return float(min(1.0, (-(-self.view.size // self.step) / self.view.size) ** 2))

    def estimate(self, statistic: Callable[[Indices], float], chosen: Indices) -> Estimate:
        """A statistic of chosen samples, with its standard error from the scatter over random groups of them.

        The error is 0 if every pixel was sampled: it is that of the view, not of other cameras.
        """
        value = statistic(chosen)
        if self.step == 1 or len(chosen) < 2 * GROUPS:
            return Estimate(value, 0.0 if self.step == 1 else None)
        groups = np.array_split(np.random.default_rng(0).permutation(chosen), GROUPS)
        scatter = np.array([statistic(np.sort(group)) for group in groups])
        return Estimate(value, float(scatter.std(ddof=1) / np.sqrt(GROUPS) * np.sqrt(1 - self.part)))


def sample_view(view: View) -> Samples:
    """The samples of a view from `view_of`. Raises InputError if no receiver is visible."""
    placed, placement = view.placed()
    geometry = placed.scene.geometry
    low, high = geometry.bounds
    above = OFFSET * float(np.linalg.norm(high - low))
    step = -(-view.size // LATTICE)
    centres = np.minimum(np.arange(0, view.size, step) + (step - 1) // 2, view.size - 1) + 0.5
    everything = Tracer(geometry.vertices, geometry.faces)
    whole = len(geometry.caster_faces) == len(geometry.faces)
    casters = everything if whole else Tracer(geometry.vertices, geometry.caster_faces)

    def trace(rows: slice) -> dict[str, NDArray[np.generic]]:
        y, x = np.meshgrid(centres[rows], centres, indexing="ij")
        hits = surfaces(placed, everything, x.ravel(), y.ravel())
        lights = lighting(placed, casters, hits, above)
        arrays = {**vars(hits), **vars(lights), "pixel": hits.ray + rows.start * len(centres)}
        return {name: arrays[name][..., lights.receives] for name in SAMPLE_FIELDS}

    parts = list(over_slices(trace, len(centres), ROWS))
    arrays = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in SAMPLE_FIELDS}
    if not len(arrays["pixel"]):
        raise InputError(
            f"view {view.camera.name!r} of {view.scene.name}: no pixel shows a receiver that {view.light.name!r} "
            "lights; needs are those of the visible receivers"
        )
    samples = Samples(view=placed, placement=placement, casters=casters, step=step, **arrays)
    return replace(samples, blocker=np.minimum(samples.blocker, _near_blockers(samples, above)))


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
