"""Errors along a parameter: slopes over the map size, and acne against contact over the factors of a bias sweep."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shadowbench.results.configurations import Configuration, Interval, Section, interval
from shadowbench.results.tables import SweepPositions, positions_of


@dataclass(frozen=True)
class Slope:
    """Convergence of a spec's error with its map size: d log(error) / d log(size), and the number of phases."""

    spec: str
    sizes: tuple[int, ...]
    slope: Interval
    phases: int


def slopes(section: Section) -> list[Slope]:
    """Convergence slope of every spec with two or more map sizes, fitted per view, light and phase."""
    metric, frame = section.ranked_by, section.frame
    value = frame[metric.name].astype(float)
    errors = 1 - value if metric.better == "higher" else value
    # log 0 is undefined
    sized = frame[(frame["status"] == "ok") & frame["map_size"].notna() & (errors > 0)]
    logs = sized.assign(log_size=np.log(sized["map_size"].astype(float)), log_error=np.log(errors[sized.index]))
    found = []
    for spec, group in logs.groupby("spec", sort=False):
        fits = [
            float(np.polyfit(one["log_size"], one["log_error"], 1)[0])
            for _, one in group.groupby(["view", "light", "phase"])
            if one["map_size"].nunique() > 1
        ]
        slope = interval(fits)
        if slope is not None:
            drawn = tuple(sorted(map(int, group["map_size"].unique())))
            found.append(Slope(str(spec), drawn, slope, group["phase"].nunique()))
    return found


@dataclass(frozen=True)
class Curve:
    """Bias sweep of a spec at one map size in one scene.

    points: (factor, configuration) pairs by increasing factor; best: the factor that minimises the error, 1 − IoU or
    RMSE, times 1 − SSIM.
    """

    base: str
    map_size: int | None
    points: tuple[tuple[float, Configuration], ...]
    best: float


def curves(scored: Sequence[Configuration], swept: SweepPositions) -> list[Curve]:
    """Curves of a scene's table, by base spec and map size; specs without a successful cell are left out."""
    points: dict[tuple[str, int | None], list[tuple[float, Configuration]]] = {}
    for one in scored:
        if one.cells and one.error is not None and one.value("ssim") is not None:
            for base, factor in positions_of(swept, one.spec, one.map_size):
                points.setdefault((base, one.map_size), []).append((factor, one))
    bases = list(dict.fromkeys(base for several in swept.values() for base, _ in several))
    found = []
    for base, size in sorted(points, key=lambda key: (bases.index(key[0]), key[1] or 0)):
        at_size = sorted(points[base, size], key=lambda point: point[0])
        best, _ = min(at_size, key=lambda point: _product(point[1]))
        found.append(Curve(base, size, tuple(at_size), best))
    return found


def _product(one: Configuration) -> float:
    error, ssim = one.error, one.value("ssim")
    return math.inf if error is None or ssim is None else error.median * (1 - ssim)
