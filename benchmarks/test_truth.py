"""The truth's rays per second beside a plain, single-threaded `EmbreeScene.run` over the same rays.

    pytest benchmarks/test_truth.py

`plain` hands Embree all rays of a question at once, in one thread; `slices` asks the same through the tracer, in
slices, one thread a core; `trace` is everything: trees built, rays made and hits refined in float64, answers gathered.
`ratio` is each one's rays per second over those of `plain`, which runs in the same process just before.
"""

import statistics
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.truths.embree import Tracer, over_slices
from shadowbench.truths.trace import trace

SIZE = 1024
ROUNDS = 7
SCENES = ["cube-on-plane", "room-with-lamp", "statue", "armadillo.obj"]
METHODS = {"INTERSECT": Tracer.nearest, "OCCLUDED": Tracer.occluded, "DISTANCE": Tracer.distance}


class Question(NamedTuple):
    """Rays asked of one Embree scene: origins (N, 3), directions (N, 3) or (1, 3), reach (N,), all float32."""

    tracer: Tracer
    query: str
    origins: np.ndarray
    directions: np.ndarray
    reach: np.ndarray

    def plain(self, reach: np.ndarray) -> None:
        self.tracer._scene.run(self.origins, self.directions, dists=reach, query=self.query)

    def sliced(self) -> None:
        def ask(part: slice) -> np.ndarray:
            directions = self.directions if len(self.directions) == 1 else self.directions[part]
            return METHODS[self.query](self.tracer, self.origins[part], directions, self.reach[part])

        for _ in over_slices(ask, len(self.origins)):
            pass


class Load(NamedTuple):
    """A view and what its truth asks, with one sample a pixel for `area` (with all, it would not fit into memory)."""

    view: View
    questions: list[Question]
    rays: int


def asked_by(view: View, pixel_samples: int) -> list[Question]:
    """All that a trace asks Embree, but the one ray with which a tracer builds its tree."""
    questions: list[Question] = []
    ask = Tracer._run

    def keep(tracer: Tracer, origins: Any, directions: Any, reach: Any, query: str) -> Any:
        if len(origins) > 1:
            lengths = np.full(len(origins), reach, dtype=np.float32)
            questions.append(Question(tracer, query, origins, directions, lengths))
        return ask(tracer, origins, directions, reach, query)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tracer, "_run", keep)
        trace(view, pixel_samples)
    return questions


def joined(questions: list[Question]) -> Iterator[Question]:
    """The same rays as few questions."""

    def key(question: Question) -> tuple[int, str, bool]:
        return id(question.tracer), question.query, len(question.directions) == 1

    for (_, query, one_way), group in groupby(sorted(questions, key=key), key):
        parts = list(group)
        directions = parts[0].directions if one_way else np.concatenate([part.directions for part in parts])
        origins, reach = (np.concatenate([getattr(part, name) for part in parts]) for name in ("origins", "reach"))
        yield Question(parts[0].tracer, query, origins, directions, reach)


@pytest.fixture(scope="module", params=SCENES)
def load(request: pytest.FixtureRequest, scene_file: Callable[[str], str | Path]) -> Load:
    scene = load_scene(scene_file(request.param))
    view = view_of(scene, scene.cameras[0], scene.lights[0], SIZE)
    questions = list(joined(asked_by(view, pixel_samples=1)))
    return Load(view, questions, sum(len(question.origins) for question in questions))


@pytest.fixture(scope="module")
def plain_rate(load: Load) -> list[float]:
    """Rays per second of `plain`, once it has run."""
    return []


def note(benchmark: BenchmarkFixture, rays: int, plain: list[float]) -> float:
    if benchmark.stats is None:  # --benchmark-disable
        return 0.0
    rate = rays / statistics.median(benchmark.stats.stats.data)
    benchmark.extra_info["rays"] = rays
    benchmark.extra_info["rays_per_second"] = round(rate)
    if plain:
        benchmark.extra_info["ratio"] = round(rate / plain[0], 3)
        print(f"\n{rate / 1e6:.1f} Mray/s, {rate / plain[0]:.2f} of plain's {plain[0] / 1e6:.1f}", end=" ")
    return rate


@pytest.mark.benchmark(group="truth")
def test_plain(load: Load, plain_rate: list[float], benchmark: BenchmarkFixture) -> None:
    def fresh_reach() -> tuple[tuple[list[np.ndarray]], dict[str, Any]]:
        return ([question.reach.copy() for question in load.questions],), {}  # Embree writes into it

    def run(reaches: list[np.ndarray]) -> None:
        for question, reach in zip(load.questions, reaches, strict=True):
            question.plain(reach)

    benchmark.pedantic(run, setup=fresh_reach, rounds=ROUNDS, warmup_rounds=1)
    plain_rate.append(note(benchmark, load.rays, []))


@pytest.mark.benchmark(group="truth")
def test_slices(load: Load, plain_rate: list[float], benchmark: BenchmarkFixture) -> None:
    def run() -> None:
        for question in load.questions:
            question.sliced()

    benchmark.pedantic(run, rounds=ROUNDS, warmup_rounds=1)
    note(benchmark, load.rays, plain_rate)


@pytest.mark.benchmark(group="truth")
def test_trace(load: Load, plain_rate: list[float], benchmark: BenchmarkFixture) -> None:
    rays = sum(len(question.origins) for question in asked_by(load.view, pixel_samples=4))
    benchmark.pedantic(trace, args=(load.view, 4), rounds=3, warmup_rounds=1)
    note(benchmark, rays, plain_rate)
