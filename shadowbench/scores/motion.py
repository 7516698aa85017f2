"""Scores of a sequence of masks against that of its truths: flicker, false change, pops, swimming edges, lag.

They are of points of surfaces, each of which is followed while it is in sight. What a mask shows at a point is known up
to the pixels around it. So the point's visibility stays as it was if it lies within theirs, and otherwise changes to
the nearest of them: the least change that explains what is seen. A shadow that stays where it is on its surface has
none, however the camera moves, and mask and truth are read at the same pixels in the same way.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scores.comparison import PENUMBRA, Comparison, ratio
from shadowbench.scores.masks import Mask, Single, ThresholdedMask, greatest
from shadowbench.scores.metrics import Better, Metric
from shadowbench.scores.penumbrae import FEWEST

EDGE_PX = 2  # around true and drawn edges and penumbrae, where a change is flicker
ERRORS = 3.0  # standard errors of the truth by which a mask may change more than it
SWIM_PX = 4  # to either side: the piece of an edge that has an offset
LEAST_EDGE = 0.5 / (2 * SWIM_PX + 1)  # share of a window's pixels: an edge through half of it
FEWEST_PAIRS = 3  # of frames, of which one can be unusual

Indices = NDArray[np.int32]


class Seen(NamedTuple):
    """The N points of surfaces that are followed through a frame: those kept from the frame before, then new ones.

    kept: (K,) places among the points of the frame before; pixel: (N,) the nearest pixel, row by row; right, below:
    (N,) steps from there to the other pixels around the point, 0 if it is at their centres; read: (N,) whether all
    these are decided receivers of the point's surface. still: whether light and surfaces are where they were.
    """

    kept: Indices
    pixel: Indices
    right: Indices
    below: Indices
    read: Mask
    still: bool


NUMBERS = ("mask", "truth", "error", "edge", "zone", "change", "true_change", "settled", "delay")
OFFSETS = ("offset", "times", "sum", "squares")
Numbers = dict[str, Single]
"""Of each point: visibility in mask and truth, and the truth's largest standard error; 1 on a true edge, and 1 where a
change is flicker; sums of changes; 1 if mask and truth were last both lit, −1 both dark, and the delay since then; the
offset of the true edge around it, how often it is known, its sum and that of its squares."""


class Motion:
    """Scores of a sequence of masks, fed frame by frame. It keeps some numbers of each point in sight, and no frame."""

    def __init__(self) -> None:
        self._points: Numbers = dict.fromkeys(NUMBERS + OFFSETS, np.zeros(0, np.float32))
        self._past = np.zeros(4)  # `_sums` of the points that are out of sight
        self._transitions = np.zeros((2, 2))  # to light, and to shadow: their number, and the sum of their delays
        self._edges: list[float] = []  # pixels of true edges with a point; by pair of frames, as the next two
        self._flicker: list[float] = []
        self._pop: list[float] = []
        self._moved: bool | None = None  # None before the first frame

    def add(self, comparison: Comparison, seen: Seen) -> None:
        """The next frame, and the points in it, all of them of one `Points`."""
        truth, followed = comparison.truth, len(seen.kept)
        gone = np.delete(np.arange(len(self._points["mask"])), seen.kept)
        self._past += _sums({name: values[gone] for name, values in self._points.items()})
        new = np.zeros(len(seen.pixel) - followed, np.float32)
        before = {name: np.concatenate([values[seen.kept], new]) for name, values in self._points.items()}
        true_zone = _zone(truth)
        now = self._points = dict(before)
        now["mask"] = _least_changed(before["mask"], comparison.visibility, seen)
        now["truth"] = _least_changed(before["truth"], truth.visibility, seen)
        now["error"] = np.maximum(before["error"], truth.standard_error.ravel()[seen.pixel])
        now["edge"] = truth.edge.ravel()[seen.pixel].astype(np.float32)
        now["zone"] = (true_zone | _zone(comparison)).ravel()[seen.pixel].astype(np.float32)
        self._transitions += _delays(now)
        if self._moved is not None:
            self._add_changes(*({name: values[:followed] for name, values in each.items()} for each in (before, now)))
        self._moved = self._moved is not None and (self._moved or not seen.still)
        if not self._moved:
            _add_offsets(before, now, seen, true_zone)

    def _add_changes(self, before: Numbers, now: Numbers) -> None:
        """Add what changed from frame to frame at points in both; the sums in `now` are views."""
        change, true_change = (np.abs(now[name] - before[name]) for name in ("mask", "truth"))
        zone = np.maximum(before["zone"], now["zone"])
        now["change"] += change * zone
        now["true_change"] += true_change
        excess = np.maximum(change - true_change - np.float32(ERRORS) * now["error"], 0)
        self._flicker.append(float((excess * zone).sum(dtype=np.float64)))
        self._pop.append(float(excess.sum(dtype=np.float64)))
        self._edges.append(float((before["edge"] + now["edge"]).sum(dtype=np.float64)) / 2)

    def scores(self) -> dict[str, float | None]:
        """Values of `MOTION` by name, of the frames so far, and `pop_frame`, from 0; None where undefined."""
        excess, true_change, times, variance = self._past + _sums(self._points)
        usual = float(np.median(self._pop)) if len(self._pop) >= FEWEST_PAIRS else None
        pop = None if usual is None else max(self._pop) - usual
        lag = bias = None
        if self._moved and self._transitions[:, 0].min() >= FEWEST:
            to_light, to_shadow = self._transitions[:, 1] / self._transitions[:, 0]
            lag, bias = float(to_light + to_shadow) / 2, float(to_light - to_shadow) / 2
        return {
            "flicker": ratio(excess, sum(self._edges)),
            "false_change": ratio(excess, true_change) if self._moved else None,
            "pop": pop,
            "pop_frame": 1 + int(np.argmax(self._pop)) if pop else None,
            "swim": None if self._moved or times == 0 else float(np.sqrt(variance / times)),
            "lag": lag,
            "lag_bias": bias,
        }

    def curves(self) -> dict[str, list[float]]:
        """By pair of frames: `flicker` (px) and the area that `pop` is of (px), counted within the pair alone."""
        flicker = [excess / edge if edge else 0.0 for excess, edge in zip(self._flicker, self._edges, strict=True)]
        return {"flicker": flicker, "pop": list(self._pop)}


def _zone(mask: ThresholdedMask) -> Mask:
    """(H, W) bool: pixels near a mask's edges and in or near its penumbrae."""
    grey = mask.valid & (mask.visibility > PENUMBRA[0]) & (mask.visibility < PENUMBRA[1])
    zone: Mask = greatest(mask.edge | grey, EDGE_PX)
    return zone


def _least_changed(before: Single, visibility: Single, seen: Seen) -> Single:
    """(N,) visibility at points, as before where that is within that of the pixels around, else the nearest to it."""
    read = np.flatnonzero(seen.read)
    pixel, right, below = seen.pixel[read], seen.right[read], seen.below[read]
    around = [visibility.ravel()[place] for place in (pixel, pixel + right, pixel + below, pixel + right + below)]
    now = before.copy()
    now[read] = np.clip(before[read], np.minimum.reduce(around), np.maximum.reduce(around))
    return now


def _delays(now: Numbers) -> NDArray[np.float64]:
    """Transitions to light, and to shadow, that are over in a frame: their number, and the sum of their delays.

    One begins where mask and truth were both dark or both lit, and is over when they are both the other. Its delay is
    the sum of their difference in the frames between: for an abrupt one, by how many the mask comes later.
    """
    now["delay"] += now["truth"] - now["mask"]
    dark = np.maximum(now["mask"], now["truth"]) <= PENUMBRA[0]
    lit = np.minimum(now["mask"], now["truth"]) >= PENUMBRA[1]
    to_light, to_shadow = lit & (now["settled"] < 0), dark & (now["settled"] > 0)
    ways = ((to_light, 1.0), (to_shadow, -1.0))
    sums = [(np.count_nonzero(way), sign * now["delay"][way].sum(dtype=np.float64)) for way, sign in ways]
    now["settled"] = np.where(lit, np.float32(1), np.where(dark, np.float32(-1), now["settled"]))
    now["delay"][dark | lit] = 0
    return np.array(sums)


def _add_offsets(before: Numbers, now: Numbers, seen: Seen, true_zone: Mask) -> None:
    """Add the offset of the edge around each point near a true one: the area of the error there by the edge's length.

    From where it was when the point was first seen.
    """
    from scipy import ndimage  # the import takes 0.2 s

    followed = slice(len(seen.kept))
    pixel = seen.pixel[followed]
    error = (now["mask"] - before["mask"]) - (now["truth"] - before["truth"])
    means = np.zeros((2, *true_zone.shape), np.float32)
    for mean, values in zip(means, (error, now["edge"]), strict=True):
        mean.ravel()[pixel] = values[followed]
        ndimage.uniform_filter(mean, 2 * SWIM_PX + 1, mean, mode="constant")
    area, length = means.reshape(2, -1)[:, pixel]
    now["offset"][followed] += np.divide(area, length, out=np.zeros_like(area), where=length > LEAST_EDGE)
    known = true_zone.ravel()[seen.pixel]
    now["times"] += known
    now["sum"] += known * now["offset"]
    now["squares"] += known * now["offset"] ** 2


def _sums(points: Numbers) -> NDArray[np.float64]:
    """Sums over points: change beyond the truth's, the truth's, times, and times by the offset's variance."""
    excess = points["change"] - points["true_change"] - np.float32(ERRORS) * points["error"]
    times, sums = points["times"], points["sum"].astype(np.float64)
    variance = points["squares"] - np.divide(sums**2, times, out=np.zeros_like(sums), where=times > 0)
    each = np.maximum(excess, 0), points["true_change"], times, np.maximum(variance, 0)
    return np.array([values.sum(dtype=np.float64) for values in each])


def _metric(name: str, better: Better, tolerance: float, help: str) -> Metric:
    return Metric(name, lambda _: None, better, "both", " ".join(help.split()), tolerance)  # one mask does not move


_TABLE = (
    _metric("flicker", "lower", 0.005, """
        By how many pixels edges move to and fro from frame to frame without cause: the area by which each point of a
        surface changes more in all than in the truth, within 2 px of true and drawn edges and penumbrae, per pixel of
        true edge and pair of frames. A shadow that stays on its surface has none, nor one that is displaced or late.
        While the camera moves by parts of pixels, movements below a pixel and noise count less.
    """),
    _metric("false_change", "lower", 0.01, """
        The area of `flicker` as a share of what the truth changes. Empty where light and casters are still; without
        bound as they slow down.
    """),
    _metric("pop", "lower", 1.0, """
        The largest area in pixels that changes more than the truth from one frame to the next, less that of the median
        pair of frames: a cascade that switches, a shadow lost. `pop_frame` is the second of the two. Does not see what
        changes in most frames, nor whether the area is in one piece. Empty below 4 frames.
    """),
    _metric("swim", "lower", 0.01, """
        Standard deviation over time of the distance in pixels of drawn edges from true ones, each by its mean over 9 ×
        9 px: edges that crawl as the camera moves. Does not see a displacement that lasts, nor noise and thin shadows
        that move sideways, which average out. Empty unless light and casters are still.
    """),
    _metric("lag", "near 0", 0.05, """
        Frames by which points of surfaces turn lit or dark later than in the truth, mean of both ways. Does not see
        points that never turn as in the truth, to within 0.02 of lit or dark. Empty below 30 points either way.
    """),
    _metric("lag_bias", "near 0", 0.05, """
        Half of the frames by which turning lit comes later than turning dark: above 0 where the shadow is too large. A
        displaced edge counts more, the slower it moves.
    """),
)  # fmt: skip
MOTION: Mapping[str, Metric] = {metric.name: metric for metric in _TABLE}
"""The scores of a sequence by name, in the order of the columns."""
