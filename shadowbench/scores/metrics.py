"""The table of metrics, all of them at once, and what is wrong with a shadow by their values.

A metric is a function of a Comparison that returns a number, or None if its denominator is 0. Its docstring is its help
in `list` and in the documentation. The truth of a soft shadow is sampled: its mean variance is taken off.
"""

import inspect
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from shadowbench.errors import MetricError, message, quoted
from shadowbench.scores.comparison import (
    PENUMBRA,
    Comparison,
    PreparedTruth,
    mean_of,
    overlap,
    ratio,
    share,
    total_of,
)
from shadowbench.scores.masks import Mask, Single, greatest

Function = Callable[[Comparison], float | None]
Better = Literal["higher", "lower", "near 0", "near 1"]
Kind = Literal["hard", "soft", "both"]

FLAT_STEP = 0.1  # share of the truth's step, and of the mask's own nearby, below which a mask is flat
KINDS_OF_ERROR = ("acne", "leak", "contact")
LEADING = 0.01  # least share of its region of a kind of error that is named first
NEARBY_PX = 8  # along rows and columns, how far a flat step may be from the edge to the next
LEAST = 0.01  # visibility: smaller mean errors are not named
WIDTH_FACTOR = 1.25  # between drawn and true penumbrae
SLOPE = 0.25  # distance of `hardening` from 1
NOISY = 0.5  # share of `rmse_pen`: a hard edge has noise too, and its error is another
BANDED = 0.1  # share of the penumbra


@dataclass(frozen=True)
class Metric:
    """A row of the table of metrics.

    kind: the shadows it suits, hard-edged, soft or both; tolerance: change against a baseline that is not reported;
    resolution: field of a row with the truth's own error, below which a value means nothing, None if there is none;
    label: its name in sentences and headings; targets: the values that reports ask for, from easy to hard.
    """

    name: str
    function: Function
    better: Better
    kind: Kind
    help: str
    tolerance: float = 0.001
    resolution: Literal["truth_error", "truth_error_pen"] | None = None
    label: str = ""
    targets: tuple[float, ...] = ()

    @property
    def error_label(self) -> str:
        """Heading of its error, such as `1 − IoU`."""
        return f"1 − {self.label}" if self.better == "higher" else self.label

    def suits(self, soft: bool) -> bool:
        """Whether it is shown of hard shadows, or of soft ones: of those, what recommendations may ask for too."""
        return not soft or self.kind != "hard" or bool(self.targets)

    def error(self, value: float) -> float:
        """The error of a value: 1 − x of a similarity, else the value."""
        return 1 - value if self.better == "higher" else value

    def meets(self, value: float, limit: float) -> bool:
        """Whether a value is as good as a limit."""
        return value >= limit if self.better == "higher" else value <= limit

    def text(self, value: float | None, digits: Callable[[float], str], fields: Mapping[str, Any]) -> str:
        """Text of a value, – for None; `<0.0012` for one below the truth's own error, one of the fields of its row."""
        least = None if self.resolution is None else fields.get(self.resolution)
        if value is None:
            return "–"
        return f"<{digits(least)}" if least is not None and value < least else digits(value)

    def digits_beside(self, limit: float, digits: Callable[[float], str]) -> Callable[[float], str]:
        """Formats a value by `digits`, or longer where that rounds it across a limit, or to a similarity of 1."""

        def side(value: float) -> tuple[bool, bool]:
            return self.meets(value, limit), self.better == "higher" and value == 1

        def text(value: float) -> str:
            longer = (f"{value:.{places}g}" for places in range(4, 18))
            return next(one for one in (digits(value), *longer) if side(float(one)) == side(value))

        return text

    def worse(self, before: float, after: float) -> float:
        """By how much a value has become worse; below 0 if it has become better."""
        if self.better == "higher":
            return before - after
        if self.better == "lower":
            return after - before
        ideal = 0.0 if self.better == "near 0" else 1.0
        return abs(after - ideal) - abs(before - ideal)


METRICS: dict[str, Metric] = {}
"""All metrics by name, in the order of the columns."""


def metric(better: Better, kind: Kind, **given: Any) -> Callable[[Function], Function]:
    """Decorator: add a function to METRICS, with its docstring as help; given: further fields of `Metric`."""

    def add(function: Function) -> Function:
        name, help = function.__name__, " ".join((inspect.getdoc(function) or "").split())
        METRICS[name] = Metric(name, function, better, kind, help, **given)
        return function

    return add


@metric("higher", "hard", label="IoU", targets=(0.95, 0.99, 0.999))
def iou(comparison: Comparison) -> float | None:
    """Intersection over union of the shadows (visibility < 0.5). Errors are given as 1 − IoU."""
    return overlap(comparison.shadow, comparison.truth.shadow)  # Jaccard 1901


@metric("higher", "soft")
def iou_soft(comparison: Comparison) -> float | None:
    """Intersection over union of the shadows, with pixels weighted by their darkness (1 − visibility)."""
    # Ruzicka 1958
    images = comparison.truth.valid, comparison.visibility, comparison.truth.visibility
    greater = total_of(lambda mask, truth: 1 - np.minimum(mask, truth), *images)
    lesser = total_of(lambda mask, truth: 1 - np.maximum(mask, truth), *images)
    return ratio(lesser, greater)


@metric("higher", "hard")
def boundary_iou(comparison: Comparison) -> float | None:
    """Intersection over union of the strips inside the shadows' edges, 2% of the image's diagonal wide. Comparable
    across shadow sizes (Cheng et al. 2021).
    """
    # Cheng et al. 2021, "Boundary IoU". The strip's width is Euclidean, where their code erodes with a square; both
    # agree on edges along rows and columns.
    return overlap(comparison.boundary, comparison.truth.boundary)


@metric("higher", "both")
def ssim(comparison: Comparison) -> float | None:
    """Structural similarity (σ = 1.5 px) over scored pixels. Large lit areas raise it, and it prefers a displaced edge
    to a blurred one: read it beside ssim_edge and edge_px (Wang et al. 2004).
    """
    return comparison.mean_ssim[0]  # of the pixels whose window is inside the image


@metric("higher", "both")
def ssim_edge(comparison: Comparison) -> float | None:
    """Structural similarity within 8 px of a true edge: independent of the size of lit areas."""
    return comparison.mean_ssim[1]


@metric("lower", "both")
def mae(comparison: Comparison) -> float | None:
    """Mean absolute error of visibility, against the truth at pixel centres."""
    return mean_of(_error, comparison.truth.valid, comparison.visibility, comparison.truth.visibility)


@metric("lower", "both")
def mae_area(comparison: Comparison) -> float | None:
    """Mean absolute error of visibility, against the truth averaged over each pixel: correct antialiasing is not an
    error.
    """
    return mean_of(_error, comparison.truth.valid, comparison.visibility, comparison.truth.area)


@metric("lower", "both")
def mae_lit(comparison: Comparison) -> float | None:
    """Mean absolute error of visibility, weighted by N·L, as in diffuse shading."""
    truth = comparison.truth
    images = comparison.visibility, truth.visibility, truth.cosine
    weighted = total_of(lambda mask, exact, cosine: _error(mask, exact) * cosine, truth.valid, *images)
    return ratio(weighted, truth.cosine_sum)


@metric("lower", "hard")
def acne(comparison: Comparison) -> float | None:
    """Of the lit interior (at least 4 px from shadow and undecided pixels), the share that is in shadow."""
    return share(comparison.shadow, comparison.truth.lit_interior)


@metric("lower", "both")
def acne_soft(comparison: Comparison) -> float | None:
    """Mean of how much darker the lit interior is than it should be: includes acne that a filter lightens beyond
    half.
    """
    images = comparison.truth.visibility, comparison.visibility
    return mean_of(lambda truth, mask: np.maximum(truth - mask, 0), comparison.truth.lit_interior, *images)


@metric("lower", "hard")
def leak(comparison: Comparison) -> float | None:
    """Of the shadow's interior (at least 4 px from light and undecided pixels), the share that is lit."""
    return share(comparison.lit, comparison.truth.shadow_interior)


@metric("lower", "hard")
def contact(comparison: Comparison) -> float | None:
    """Of the shadow within 2% of the scene's diagonal of its occluder, the share that is lit (peter-panning)."""
    return share(comparison.lit, comparison.truth.contact)


@metric("lower", "hard")
def terminator(comparison: Comparison) -> float | None:
    """Of the light on smooth surfaces, by N·L of their smooth normals, the share that shadows of their own triangles
    take: dark facets along the terminator. The truth has them too. None without smooth surfaces.
    """
    # The facets are those that are lit once rays start on the smooth surface, Hanika 2021.
    truth = comparison.truth
    images = comparison.visibility, truth.shading_cosine
    return ratio(total_of(lambda mask, cosine: (1 - mask) * cosine, truth.facet_shadow, *images), truth.smooth_light)


@metric("lower", "hard", tolerance=0.05, label="edge", targets=(1.0, 0.5, 0.25))
def edge_px(comparison: Comparison) -> float | None:
    """Mean distance in pixels between the edges of mask and truth, averaged over both directions; the image's diagonal
    if only one of them has edges.
    """
    distances = comparison.edge_distances
    return None if distances is None else float(distances.mean())


@metric("lower", "hard", tolerance=0.5)
def edge_p95(comparison: Comparison) -> float | None:
    """95th percentile of the distances in pixels between the edges of mask and truth: the worst parts."""
    distances = comparison.edge_distances
    return None if distances is None else float(np.percentile(distances, 95))


@metric("lower", "both", resolution="truth_error", label="RMSE", targets=(0.05, 0.02, 0.01))
def rmse(comparison: Comparison) -> float | None:
    """Root mean square error of visibility, the truth's own error taken off. Ranks soft shadows."""
    return _rmse(comparison, comparison.truth.valid, comparison.truth.mean_variance)


@metric("lower", "soft", resolution="truth_error_pen")
def rmse_pen(comparison: Comparison) -> float | None:
    """Root mean square error of visibility in the penumbra, the truth's own error taken off. The penumbra is where the
    true visibility is between 0.02 and 0.98, and 2 px around it.
    """
    return _rmse(comparison, comparison.truth.penumbra, comparison.truth.mean_variance_pen)


@metric("near 0", "soft")
def bias_pen(comparison: Comparison) -> float | None:
    """Mean error of visibility in the penumbra, above 0 where the mask is too light."""
    truth = comparison.truth
    return mean_of(np.subtract, truth.penumbra, comparison.visibility, truth.visibility)


@metric("lower", "both")
def bleed(comparison: Comparison) -> float | None:
    """Mean visibility of the umbra (true visibility below 0.01, at least 8 px from lighter and undecided pixels): light
    bleeding. A blur that reaches farther counts too.
    """
    return mean_of(np.positive, comparison.truth.umbra, comparison.visibility)


@metric("lower", "both")
def false_dark(comparison: Comparison) -> float | None:
    """Mean darkness (1 − visibility) of full light (true visibility above 0.99, at least 8 px from darker and undecided
    pixels): acne of wide kernels.
    """
    return mean_of(lambda mask: 1 - mask, comparison.truth.full_light, comparison.visibility)


@metric("lower", "soft", resolution="truth_error_pen")
def noise(comparison: Comparison) -> float | None:
    """Standard deviation of the error of visibility along 7 px of the truth's isolines in the penumbra, where they are
    straight, the truth's own error taken off: dither, too few samples.
    """
    truth = comparison.truth
    if not truth.soft:
        return None
    variance = truth.isolines.variance(comparison.signed_error, truth.valid, truth.variance)
    return None if variance is None else math.sqrt(max(variance, 0.0))


@metric("lower", "soft")
def banding(comparison: Comparison) -> float | None:
    """Share of the penumbra in which the mask is grey and its gradient below a tenth of the truth's and of its own
    within 8 px: flat steps, few levels.
    """
    # The mask's own step tells a staircase from a smooth ramp that is much wider than the truth's: that is nowhere as
    # steep as the truth, but everywhere about as steep as nearby. (A Gaussian blur of an edge is an eighth as steep at
    # visibility 0.02 as at its middle.)
    truth, mask = comparison.truth, comparison.visibility
    if not truth.soft:
        return None
    from shadowbench.scores import loops

    step, true_step = loops.step_squared(mask, truth.valid), truth.step_squared
    steepest = greatest(np.where(truth.penumbra, step, 0), NEARBY_PX)
    np.minimum(true_step, steepest, out=steepest)
    flat = step < np.multiply(steepest, np.float32(FLAT_STEP**2), out=steepest)
    grey = (mask > PENUMBRA[0]) & (mask < PENUMBRA[1])
    return share(grey & truth.resolved & flat, truth.penumbra)


@metric("lower", "soft", tolerance=0.02)
def width(comparison: Comparison) -> float | None:
    """Median of |log₂| of the drawn over the true width of penumbrae: 1 for half or twice the width. From visibility
    0.1 to 0.9 in metres, where the true one is at least 3 px wide and lies on one plane.
    """
    ratios = comparison.width_ratios
    return None if ratios is None else float(np.median(np.abs(ratios)))


@metric("near 1", "soft", tolerance=0.02)
def hardening(comparison: Comparison) -> float | None:
    """Slope of the drawn over the true width of penumbrae: 1 if shadows harden towards contact as they should, 0 for a
    blur of fixed width. Over true widths above 4 px; none if they vary by less than a factor of 3.
    """
    fit = comparison.hardening
    return None if fit is None else fit[0]


@metric("near 0", "soft", tolerance=0.02)
def hardening_intercept(comparison: Comparison) -> float | None:
    """Drawn width where the true one is 0, on the line of `hardening`, as a share of the median true width."""
    fit = comparison.hardening
    return None if fit is None else fit[1]


def _error(mask: Single, truth: Single) -> Single:
    error: Single = np.abs(mask - truth)
    return error


def _rmse(comparison: Comparison, where: Mask, variance: float) -> float | None:
    """Root of the mean squared error over a set of pixels less a known variance, at least 0; None if it is empty."""
    images = comparison.visibility, comparison.truth.visibility
    squared = mean_of(lambda mask, truth: (mask - truth) ** 2, where, *images)
    return None if squared is None else math.sqrt(max(squared - variance, 0.0))


_OWN = frozenset(METRICS)


def score(visibility: ArrayLike, prepared: PreparedTruth) -> dict[str, float | None]:
    """Values of all metrics by name, in the order of the table.

    visibility: (H, W) in [0, 1], 1 lit and 0 in shadow, quantised before scoring; values at invalid pixels are ignored,
    but must be finite. Raises ValueError for NaN, infinity, values out of range, or another shape.
    """
    return values_of(Comparison(visibility, prepared))


def values_of(comparison: Comparison) -> dict[str, float | None]:
    """Values of all metrics by name, in the order of the table.

    Raises MetricError, as the function of a plug-in may raise, or return, anything.
    """
    values = {}
    for name, one in METRICS.items():
        try:
            value = one.function(comparison)
            finite = value is None or math.isfinite(value)
        except Exception as error:
            raise MetricError(f"metric {name}: {type(error).__name__}: {quoted(message(error))}") from error
        if not finite:
            raise MetricError(f"metric {name}: found {value}; allowed: a finite number, or None")
        values[name] = None if value is None else float(value)
    return values


def plug_in(added: Sequence[Metric]) -> None:
    """Add metrics to the table, in place of those added before. Raises ValueError for a name that is taken."""
    for one in plugged_in():
        del METRICS[one.name]
    for one in added:
        if one.name in METRICS:
            raise ValueError(f"two metrics are called {one.name!r}")
        METRICS[one.name] = one


def plugged_in() -> list[Metric]:
    """The metrics that were added."""
    return [one for name, one in METRICS.items() if name not in _OWN]


def is_soft(metrics: Mapping[str, Any]) -> bool:
    """Whether values of metrics are of soft shadows: whether the truth has a penumbra."""
    return metrics.get("rmse_pen") is not None


def ranking(soft: bool) -> Metric:
    """The metric that ranks hard shadows, or soft ones."""
    return METRICS["rmse" if soft else "iou"]


def leading_error(metrics: Mapping[str, Any], among: Collection[str] = KINDS_OF_ERROR) -> str | None:
    """The metric of the kind of error of hard shadows that takes the largest share of its region; None below 1%.

    It is named before metrics of the whole mask, which follow from it: the edges of acne count in edge_px too. among:
    the metrics to choose from.
    """
    kinds = () if is_soft(metrics) else [name for name in KINDS_OF_ERROR if name in among]
    shares = {name: share for name in kinds if (share := metrics.get(name) or 0.0) >= LEADING}
    return max(shares, key=lambda name: shares[name], default=None)


def soft_faults(metrics: Mapping[str, float | None], wider: float | None) -> dict[str, str]:
    """Lines on the faults of a soft shadow that stand out, by name, causes first, then the largest mean error first.

    metrics: values of `score`, of a truth with a penumbra; wider: median log₂ of the drawn over the true width of
    penumbrae, None if unknown.
    """
    names = ("rmse_pen", "bias_pen", "bleed", "false_dark", "noise", "banding", "width")
    rmse, bias, bleed, dark, noise, banding, width = (metrics.get(name) or 0.0 for name in names)
    hardening = metrics.get("hardening")
    slope = 1.0 if hardening is None else hardening
    way = "wide" if (wider or 0.0) > 0 else "narrow"
    wrong_width = f"penumbra too {way}", f"{2**width:.2g} times too {way} (median; width)"
    if wider is None or abs(wider) < width / 2:  # the metric is unsigned
        line = f"half of those drawn are at least {2**width:.2g} times too wide or too narrow (width)"
        wrong_width = "penumbra width", line
    light = f"penumbra too {'light' if bias > 0 else 'dark'}"
    faults = [  # whether each stands out, its mean error, name and line
        (width >= math.log2(WIDTH_FACTOR), math.inf, *wrong_width),
        (abs(slope - 1) >= SLOPE, math.inf, "contact hardening",
         f"drawn penumbrae widen {slope:.2g} times as much as true ones (hardening)"),
        (abs(bias) >= LEAST, abs(bias), light, f"by {abs(bias):.2g} on average, where 1 is full light (bias_pen)"),
        (bleed >= LEAST, bleed, "light bleeding", f"the umbra's mean visibility is {bleed:.2g}, not 0 (bleed)"),
        (dark >= LEAST, dark, "false shadow", f"full light is too dark by {dark:.2g} on average (false_dark)"),
        (noise >= max(LEAST, NOISY * rmse), noise, "noise",
         f"the error varies by {noise:.2g} where visibility should be equal (noise)"),
        (banding >= BANDED, LEAST, "banding", f"{banding:.0%} of the penumbra is flat steps of grey (banding)"),
    ]  # fmt: skip
    ordered = sorted((fault for fault in faults if fault[0]), key=lambda fault: -fault[1])
    return {name: line for _, _, name, line in ordered}
