"""Errors along a parameter: slopes over the map size, and acne against contact over the factors of a bias sweep."""

from dataclasses import dataclass

import numpy as np

from shadowbench.results.frame import SweepPositions, positions_of
from shadowbench.results.summary import Interval, Setting, Summary, interval


@dataclass(frozen=True)
class Slope:
    """Convergence of a spec's error with its map size: d log(error) / d log(size), and the number of phases."""

    spec: str
    sizes: tuple[int, ...]
    slope: Interval
    phases: int


def slopes(summary: Summary) -> list[Slope]:
    """Convergence slope of every spec with two or more map sizes, fitted per view, light and phase."""
    metric, cells = summary.ranked_by, summary.cells
    value = cells[metric.name].astype(float)
    errors = 1 - value if metric.better == "higher" else value
    # log 0 is undefined
    sized = cells[(cells["status"] == "ok") & cells["map_size"].notna() & (errors > 0)]
    logs = sized.assign(log_size=np.log(sized["map_size"].astype(float)), log_error=np.log(errors[sized.index]))
    fitted = []
    for spec, group in logs.groupby("spec", sort=False):
        fits = [
            float(np.polyfit(one["log_size"], one["log_error"], 1)[0])
            for _, one in group.groupby(["view", "light", "phase"])
            if one["map_size"].nunique() > 1
        ]
        slope = interval(fits)
        if slope is not None:
            drawn = tuple(sorted(map(int, group["map_size"].unique())))
            fitted.append(Slope(str(spec), drawn, slope, group["phase"].nunique()))
    return fitted


@dataclass(frozen=True)
class Curve:
    """Bias sweep of a spec at one map size in one scene.

    points: (factor, setting) pairs by increasing factor; best: the factor that minimises the error, 1 − IoU or RMSE,
    times 1 − SSIM.
    """

    base: str
    map_size: int | None
    points: tuple[tuple[float, Setting], ...]
    best: float


def curves(summary: Summary, swept: SweepPositions) -> list[Curve]:
    """Curves of a scene, by base spec and map size; settings without a successful cell are left out."""
    points: dict[tuple[str, int | None], list[tuple[float, Setting]]] = {}
    for one in summary.shown:
        if one.ssim == one.ssim:  # not NaN
            for base, factor in positions_of(swept, one.spec, one.map_size):
                points.setdefault((base, one.map_size), []).append((factor, one))
    bases = list(dict.fromkeys(base for several in swept.values() for base, _ in several))
    swept_curves = []
    for base, size in sorted(points, key=lambda key: (bases.index(key[0]), key[1] or 0)):
        at_size = sorted(points[base, size], key=lambda point: point[0])
        best, _ = min(at_size, key=lambda point: point[1].error * (1 - point[1].ssim))
        swept_curves.append(Curve(base, size, tuple(at_size), best))
    return swept_curves
