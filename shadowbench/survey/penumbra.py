"""Penumbrae for the light's size: their width in pixels, their share of the shadow, and the error of hard shadows."""

from dataclasses import dataclass, replace

import numpy as np

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import SUN_RADIUS, Light, View
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import rmse
from shadowbench.survey.maps import longest
from shadowbench.survey.sampling import LATTICE, Estimate, Samples
from shadowbench.truths.cache import cached_truth

BULB = 0.03
"""Radius of a common household bulb, in metres (A60: 60 mm across)."""
HARD_RMSE = 0.02
"""RMSE up to which hard shadows suffice: what `recommend` asks of soft shadows by default."""


@dataclass(frozen=True)
class Penumbra:
    """The penumbrae of a view. Widths are in pixels, at the shadows' edges, in the widest direction.

    radius: of the light, in radians for a directional one, else in metres; half the longer side of a rectangle;
    assumed: True if the scene has none; median and p95: widths over edge pixels; share: of the scored pixels that see
    less than all of the light, those that see some of it; hard_rmse: the metric `rmse` of exact hard shadows, those of
    the light's centre. The last two are of the truths of the view, of at most LATTICE² pixels.
    """

    radius: float
    assumed: bool
    median: Estimate
    p95: Estimate
    share: Estimate
    hard_rmse: Estimate

    @property
    def hard_is_enough(self) -> bool:
        """Whether their error is at most HARD_RMSE.

        Widths do not tell: narrow penumbrae are a large error where they cover much of the view, wide ones a small
        error where they cover little.
        """
        return self.hard_rmse.value <= HARD_RMSE


def penumbra_of(view: View, samples: Samples) -> Penumbra | None:
    """The penumbrae for the light's size, by default that of the sun or a bulb; None without shadow edges.

    None also if no pixel is scored. samples: of the view, from `sample_view`.
    """
    edges, light = samples.edges, sized_light(view.light)
    softness = _softness(replace(view, size=min(view.size, LATTICE)), light, samples.part) if len(edges) else None
    if softness is None:
        return None
    radius = light.radius or max(light.size) / 2
    width = widths(samples, radius if light.kind == "directional" else samples.placement.length(radius))
    median, p95 = samples.estimate(lambda chosen: np.median(width[chosen]), edges), samples.quantile(width, 0.95, edges)
    return Penumbra(float(radius), not view.light.soft, median, p95, *softness)


def sized_light(light: Light) -> Light:
    """The light, with the size of the sun or a bulb if it has none."""
    if light.soft:
        return light
    if light.kind == "rectangle":
        return replace(light, size=(2 * BULB, 2 * BULB))
    return replace(light, radius=SUN_RADIUS if light.kind == "directional" else BULB)


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
    steps = samples.across, samples.down
    derivatives = (step - samples.to_light * (step * samples.to_light).sum(axis=0) for step in steps)
    with np.errstate(invalid="ignore"):
        return np.where(samples.shadowed, across * longest(*derivatives), 0.0)


def _softness(view: View, light: Light, part: float) -> tuple[Estimate, Estimate] | None:
    """Share of the shadow that is penumbra, and the RMSE of exact hard shadows, by truths; None without scored pixels.

    part: of the pixels that were asked for, for the standard errors.
    """
    truth = prepare_truth(cached_truth(replace(view, light=light)))
    hard = Comparison(cached_truth(replace(view, light=replace(light, radius=0.0, size=(0.0, 0.0)))).visibility, truth)
    error = rmse(hard)
    if error is None:
        return None
    shadow = truth.visibility[truth.valid & (truth.visibility < 1)]
    share = float((shadow > 0).mean()) if len(shadow) else 0.0
    squared, unseen = hard.signed_error[truth.valid] ** 2, float(np.sqrt(1 - part))
    spread = float(np.sqrt(squared.var() / len(squared)))
    return (
        Estimate(share, float(np.sqrt(share * (1 - share) / max(len(shadow), 1))) * unseen),
        Estimate(error, spread / (2 * error) * unseen if error else 0.0),
    )
