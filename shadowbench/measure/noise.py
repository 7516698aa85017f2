"""What timing finds where there is nothing to find: one cell timed as if it were two."""

from dataclasses import dataclass

import numpy as np

from shadowbench.gl.clock import Sample
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.executor import Executor
from shadowbench.measure.session import Session
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of

CELL = "shadow-map:size=1024"  # the usual reference, as a study of the usual size times it
SCENE, VIEW_SIZE, ROUNDS = "cube-on-plane", 512, 9
SERIES = 5
ALLOWED = 1.05


@dataclass(frozen=True)
class Noise:
    """Ratios of a cell to itself, medians over interleaved rounds, as 1 or more: 1 is no noise.

    `ratio` is over all `n` rounds, `worst` the largest of the series of ROUNDS that they fall into.
    """

    ratio: float
    worst: float
    n: int
    frame_ms: float
    clock: str


def noise(executor: Executor) -> Noise:
    """Hold one cell twice, and time the two in turn; raises CellFailed."""
    scene = load_scene(SCENE)
    at = PlacedView(view_of(scene, scene.cameras[0], scene.lights[0], VIEW_SIZE))
    for _ in range(2):
        executor.call(Session.hold, at, CellRequest(CELL))
    samples: list[list[Sample]] = []
    while len(samples) < SERIES * ROUNDS:
        samples.append([executor.call(Session.time_frame, held) for held in range(2)])
        if len({sample.clock for pair in samples for sample in pair}) > 1:
            samples = []  # queries were given up, and for good: by two clocks there is no ratio
    executor.call(Session.let_go)
    ms = np.array([[sample.ms for sample in pair] for pair in samples])
    ratios = ms[:, 0] / ms[:, 1]
    series = [_apart(part) for part in np.split(ratios, SERIES)]
    return Noise(_apart(ratios), max(series), len(ratios), float(np.median(ms)), samples[0][0].clock)


def _apart(ratios: np.ndarray) -> float:
    """The median of ratios, or its inverse where that is larger."""
    median = float(np.median(ratios))
    return max(median, 1 / median)
