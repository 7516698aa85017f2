"""How soft shadows would be: the penumbra's width in pixels, for a light of some size."""

from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import longest
from shadowbench.survey.sampling import Estimate, Samples

SUN = np.radians(0.533 / 2)
"""The sun's mean angular radius, seen from the Earth."""
BULB = 0.03
"""Metres: radius of a common household bulb (A60: 60 mm across)."""


@dataclass(frozen=True)
class Penumbra:
    """How wide penumbras are in pixels, across the edge's worst direction, over the shadows' edges.

    radius: of the light, radians for a directional one, else metres; assumed: whether the scene left it out; median and
    p95: over edge pixels.
    """

    radius: float
    assumed: bool
    median: Estimate
    p95: Estimate

    @property
    def hard_is_enough(self) -> bool:
        """Whether 95% of the penumbras are narrower than a pixel."""
        return self.p95.value < 1.0


def penumbra_of(samples: Samples) -> Penumbra | None:
    """The penumbras of the light's own radius, or where it has none of a sun's or bulb's; None without an edge."""
    light, edges = samples.view.light, samples.edges
    if not len(edges):
        return None
    sun = light.kind == "directional"
    assumed = light.radius == 0.0
    radius = light.radius if not assumed else SUN if sun else samples.placement.length(BULB)
    width = widths(samples, radius)
    return Penumbra(
        radius=float(radius if sun else radius / samples.placement.scale),
        assumed=assumed,
        median=samples.estimate(lambda chosen: float(np.median(width[chosen])), edges),
        p95=samples.estimate(lambda chosen: float(np.percentile(width[chosen], 95)), edges),
    )


def widths(samples: Samples, radius: float) -> Floats:
    """(R,) pixels; 0 where lit.

    By similar triangles, across the ray: 2 tan(radius) · blocker for a sun; 2 radius · blocker/(distance − blocker) for
    a lamp, as for PCSS (Fernando 2005), at most what reaches the lamp itself.
    """
    if samples.view.light.kind == "directional":
        across = 2 * np.tan(radius) * samples.blocker
    else:
        left = np.maximum(samples.distance - samples.blocker, radius)
        across = 2 * radius * samples.blocker / left
    moves = [move - samples.to_light * (move * samples.to_light).sum(axis=0) for move in (samples.across, samples.down)]
    with np.errstate(invalid="ignore"):
        return np.where(samples.shadowed, across * longest(*moves), 0.0)
