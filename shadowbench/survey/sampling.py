"""What a view shows, sampled: receivers on a lattice of pixels, what shadows them, and where shadows end.

In local coordinates, as the truth, but with a ray a pixel: nothing is undecided here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.model import Floats, Placement, View
from shadowbench.survey.rays import Indices, Mask, lighting, surfaces
from shadowbench.truths.embree import Tracer, over_slices
from shadowbench.truths.trace import OFFSET

LATTICE = 512  # pixels along a side that are looked at at most: all, or every second, third, …
OF_EACH = ("pixel", "triangle", "point", "normal", "to_light", "distance", "across", "down", "blocker")
ROWS = 32  # of the lattice, that a thread looks at in one go
GROUPS = 16  # random parts of a sample, whose scatter tells its error


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error: 0 where every pixel was looked at, None where too few to tell."""

    value: float
    error: float | None = 0.0

    def times(self, factor: float) -> "Estimate":
        """In another unit."""
        return Estimate(self.value * factor, None if self.error is None else self.error * abs(factor))

    def plus(self, more: float) -> "Estimate":
        """Moved by what is known."""
        return Estimate(self.value + more, self.error)


@dataclass(frozen=True, eq=False)
class Samples:
    """The receivers of a view at the centres of sampled pixels, R of them, and its edges, E of them.

    view: in local coordinates; casters: what shadow rays meet; step: pixels from one sample to the next; pixel: (R,)
    index in the lattice, row by row; triangle: (R,); point, normal (turned to the camera), to_light (unit): (3, R);
    distance: (R,) to the light, inf for a directional one; across, down: (3, R) how the point moves on its plane for a
    pixel to the right and downwards; blocker: (R,) distance along L to the nearest caster, inf where lit.
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
        """(R,) bool."""
        shadowed: Mask = np.isfinite(self.blocker)
        return shadowed

    @cached_property
    def edges(self) -> Indices:
        """(E,) the samples in shadow that have a lit receiver beside them: one of the four next in the lattice."""
        side = -(-self.view.size // self.step)
        of = np.full((side + 2, side + 2), -1, dtype=np.int8)  # 1 shadowed, 0 lit, −1 no receiver
        inner = of[1:-1, 1:-1]
        inner[np.divmod(self.pixel, side)] = self.shadowed
        beside = (of[:-2, 1:-1] == 0) | (of[2:, 1:-1] == 0) | (of[1:-1, :-2] == 0) | (of[1:-1, 2:] == 0)
        return np.flatnonzero((beside & (inner == 1)).ravel()[self.pixel])

    def select(self, chosen: Indices) -> "Samples":
        """The chosen samples, whose edges are other ones."""
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in OF_EACH})

    @property
    def part(self) -> float:
        """The share of the view's pixels that were looked at."""
        return float(min(1.0, (-(-self.view.size // self.step) / self.view.size) ** 2))

    def estimate(self, statistic: Callable[[Indices], float], of: Indices) -> Estimate:
        """A statistic of some samples, and its error from how it scatters over random groups of them.

        Nothing scatters where every pixel was looked at; what is left is what another camera would show.
        """
        value = statistic(of)
        if self.step == 1 or len(of) < 2 * GROUPS:
            return Estimate(value, 0.0 if self.step == 1 else None)
        groups = np.array_split(np.random.default_rng(0).permutation(of), GROUPS)
        scatter = np.array([statistic(np.sort(group)) for group in groups])
        return Estimate(value, float(scatter.std(ddof=1) / np.sqrt(GROUPS) * np.sqrt(1 - self.part)))


def sample_view(view: View) -> Samples:
    """The samples of a view that `view_of` made; raises InputError where no pixel shows a receiver."""
    placed, placement = view.placed()
    geometry = placed.scene.geometry
    low, high = geometry.bounds
    above = OFFSET * float(np.linalg.norm(high - low))
    step = -(-view.size // LATTICE)
    centres = np.minimum(np.arange(0, view.size, step) + (step - 1) // 2, view.size - 1) + 0.5
    everything = Tracer(geometry.vertices, geometry.faces)
    whole = len(geometry.caster_faces) == len(geometry.faces)
    casters = everything if whole else Tracer(geometry.vertices, geometry.caster_faces)

    def look(rows: slice) -> dict[str, NDArray[np.generic]]:
        y, x = np.meshgrid(centres[rows], centres, indexing="ij")
        met = surfaces(placed, everything, x.ravel(), y.ravel())
        lit = lighting(placed, casters, met, above)
        arrays = {**vars(met), **vars(lit), "pixel": met.ray + rows.start * len(centres)}
        return {name: arrays[name][..., lit.receives] for name in OF_EACH}

    parts = list(over_slices(look, len(centres), ROWS))
    arrays = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in OF_EACH}
    if not len(arrays["pixel"]):
        raise InputError(
            f"view {view.camera.name!r} of {view.scene.name}: no pixel shows a receiver that {view.light.name!r} "
            "shines on; needs are those of what is seen"
        )
    return Samples(view=placed, placement=placement, casters=casters, step=step, **arrays)
