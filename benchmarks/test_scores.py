"""Cost of scoring: all metrics of a mask, and the quantities computed once per view.

pytest benchmarks/test_scores.py
"""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.scores.metrics import score
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

SIZES = (256, 512, 1024)


@lru_cache
def truth_of(size: int) -> Truth:
    scene = load_scene("colonnade")
    return cached_truth(view_of(scene, scene.cameras[0], scene.lights[0], size))


def note(size: int, what: str, growth: Any, benchmark: BenchmarkFixture) -> None:
    if benchmark.stats is not None:  # --benchmark-disable
        ms = 1e3 * benchmark.stats.stats.median / (size * size / 2**20)
        benchmark.extra_info["ms_per_megapixel"] = round(ms, 1)
    growth.add(f"{what} over pixels", size * size, benchmark)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.benchmark(group="scores")
def test_a_cell(size: int, growth: Any, benchmark: BenchmarkFixture) -> None:
    truth = truth_of(size)
    prepared = prepare_truth(truth)
    mask = np.roll(truth.visibility, (1, 2), axis=(0, 1))
    score(mask, prepared)  # computes the quantities of the truth
    benchmark.pedantic(mask_record, args=(mask, truth, prepared, truth.triangle), rounds=5, warmup_rounds=1)
    note(size, "scoring a cell", growth, benchmark)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.benchmark(group="scores")
def test_a_view(size: int, growth: Any, benchmark: BenchmarkFixture) -> None:
    """The first cell of a view also pays for the truth's edges, distances, and interiors."""
    truth = truth_of(size)
    mask = np.roll(truth.visibility, (1, 2), axis=(0, 1))
    benchmark.pedantic(lambda: score(mask, prepare_truth(truth)), rounds=5, warmup_rounds=1)
    note(size, "a view's first cell", growth, benchmark)
