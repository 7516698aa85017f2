"""Timing noise: the ratio of a cell's time to its own, measured as if it were two cells."""

from dataclasses import dataclass

import numpy as np

from shadowbench.gl.clock import Sample
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of

SPEC = "shadow-map:size=1024"  # the default reference, in the default view size of a study
SCENE, VIEW_SIZE, ROUNDS = "cube-on-plane", 512, 9
SERIES = 5
MAX_NOISE = 1.05


@dataclass(frozen=True)
class Noise:
    """Median ratio of a cell's time to its own over interleaved rounds, inverted if below 1; 1 means no noise.

    ratio: over all `n` rounds; worst: largest ratio over the SERIES series of ROUNDS rounds.
    """

    ratio: float
    worst: float
    n: int
    frame_ms: float
    clock: str


def measure_noise(worker: Worker) -> Noise:
    """Prepare one cell twice and time the two in turn. Raises CellFailed."""
    scene = load_scene(SCENE)
    view = view_of(scene, scene.cameras[0], scene.lights[0], VIEW_SIZE)
    for _ in range(2):
        worker.call(Session.prepare_timing, view, CellRequest(SPEC))
    samples: list[list[Sample]] = []
    while len(samples) < SERIES * ROUNDS:
        samples.append([worker.call(Session.time_frame, index) for index in range(2)])
        if len({sample.clock for pair in samples for sample in pair}) > 1:
            samples = []  # the clock changed from queries to the wall, for good: times of two clocks have no ratio
    worker.call(Session.release_timed)
    ms = np.array([[sample.ms for sample in pair] for pair in samples])
    ratios = ms[:, 0] / ms[:, 1]
    series = [_at_least_one(part) for part in np.split(ratios, SERIES)]
    return Noise(_at_least_one(ratios), max(series), len(ratios), float(np.median(ms)), samples[0][0].clock)


def _at_least_one(ratios: np.ndarray) -> float:
    """Median of the ratios, or its inverse if that is larger."""
    median = float(np.median(ratios))
    return max(median, 1 / median)
