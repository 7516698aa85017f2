"""Width of the penumbrae in pixels, for the light's size."""

from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import SUN_RADIUS, Floats
from shadowbench.survey.footprint import longest
from shadowbench.survey.sampling import Estimate, Samples

BULB = 0.03
"""Radius of a common household bulb, in metres (A60: 60 mm across)."""


@dataclass(frozen=True)
class Penumbra:
    """Widths of the penumbrae at the shadows' edges, in pixels, in the widest direction.

    radius: of the light, in radians for a directional one, else in metres; assumed: True if the scene has none; median
    and p95: over edge pixels.
    """

    radius: float
    assumed: bool
    median: Estimate
    p95: Estimate

    @property
    def hard_is_enough(self) -> bool:
        """Whether 95% of the penumbrae are narrower than a pixel."""
        return self.p95.value < 1.0


def penumbra_of(samples: Samples) -> Penumbra | None:
    """The penumbrae for the light's radius, by default that of the sun or a bulb; None without shadow edges."""
    light, edges = samples.view.light, samples.edges
    if not len(edges):
        return None
    sun = light.kind == "directional"
    assumed = light.radius == 0.0
    radius = light.radius if not assumed else SUN_RADIUS if sun else samples.placement.length(BULB)
    width = widths(samples, radius)
    return Penumbra(
        radius=float(radius if sun else radius / samples.placement.scale),
        assumed=assumed,
        median=samples.estimate(lambda chosen: float(np.median(width[chosen])), edges),
        p95=samples.estimate(lambda chosen: float(np.percentile(width[chosen], 95)), edges),
    )


def widths(samples: Samples, radius: float) -> Floats:
    """(R,) width of the penumbra at each sample in pixels; 0 where lit.

    By similar triangles, perpendicular to the light ray: 2 tan(radius) · blocker for a sun; 2 radius ·
    blocker/(distance − blocker) otherwise, as in PCSS (Fernando 2005), with the denominator at least the radius.
    """
    if samples.view.light.kind == "directional":
        across = 2 * np.tan(radius) * samples.blocker
    else:
        blocker_to_light = np.maximum(samples.distance - samples.blocker, radius)
        across = 2 * radius * samples.blocker / blocker_to_light
    derivatives = [
        step - samples.to_light * (step * samples.to_light).sum(axis=0) for step in (samples.across, samples.down)
    ]
    with np.errstate(invalid="ignore"):
        return np.where(samples.shadowed, across * longest(*derivatives), 0.0)
