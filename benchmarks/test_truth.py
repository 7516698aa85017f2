"""Rays per second of the truth, compared with a plain single-threaded `EmbreeScene.run` over the same rays.

    pytest benchmarks/test_truth.py

`plain` passes all rays of a query to Embree at once, in one thread; `slices` runs the same queries through the tracer,
in slices, one thread per core; `trace` is the whole computation: BVHs, float64 rays and refined hits, gathered results.
`ratio` is the rays per second over those of `plain`, which runs in the same process just before.
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


class RayQuery(NamedTuple):
    """Rays traced in one Embree scene: origins (N, 3), directions (N, 3) or (1, 3), reach (N,), all float32."""

    tracer: Tracer
    query: str
    origins: np.ndarray
    directions: np.ndarray
    reach: np.ndarray

    def run_plain(self, reach: np.ndarray) -> None:
        self.tracer._scene.run(self.origins, self.directions, dists=reach, query=self.query)

    def run_sliced(self) -> None:
        def run_slice(part: slice) -> np.ndarray:
            directions = self.directions if len(self.directions) == 1 else self.directions[part]
            return METHODS[self.query](self.tracer, self.origins[part], directions, self.reach[part])

        for _ in over_slices(run_slice, len(self.origins)):
            pass


class Load(NamedTuple):
    """A view and the ray queries of its truth, with one sample per pixel for `area` (all would not fit in memory)."""

    view: View
    queries: list[RayQuery]
    rays: int


def ray_queries_of(view: View, pixel_samples: int) -> list[RayQuery]:
    """All ray queries of a trace, except the single ray with which a tracer builds its BVH."""
    queries: list[RayQuery] = []
    run_slice = Tracer._run

    def keep(tracer: Tracer, origins: Any, directions: Any, reach: Any, query: str) -> Any:
        if len(origins) > 1:
            lengths = np.full(len(origins), reach, dtype=np.float32)
            queries.append(RayQuery(tracer, query, origins, directions, lengths))
        return run_slice(tracer, origins, directions, reach, query)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tracer, "_run", keep)
        trace(view, pixel_samples)
    return queries


def merge(queries: list[RayQuery]) -> Iterator[RayQuery]:
    """The same rays in fewer queries."""

    def key(query_: RayQuery) -> tuple[int, str, bool]:
        return id(query_.tracer), query_.query, len(query_.directions) == 1

    for (_, query, one_way), group in groupby(sorted(queries, key=key), key):
        parts = list(group)
        directions = parts[0].directions if one_way else np.concatenate([part.directions for part in parts])
        origins, reach = (np.concatenate([getattr(part, name) for part in parts]) for name in ("origins", "reach"))
        yield RayQuery(parts[0].tracer, query, origins, directions, reach)


@pytest.fixture(scope="module", params=SCENES)
def load(request: pytest.FixtureRequest, scene_file: Callable[[str], str | Path]) -> Load:
    scene = load_scene(scene_file(request.param))
    view = view_of(scene, scene.cameras[0], scene.lights[0], SIZE)
    queries = list(merge(ray_queries_of(view, pixel_samples=1)))
    return Load(view, queries, sum(len(query_.origins) for query_ in queries))


@pytest.fixture(scope="module")
def plain_rate(load: Load) -> list[float]:
    """Rays per second of `plain`; empty until it has run."""
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
        return ([query_.reach.copy() for query_ in load.queries],), {}  # Embree writes into it

    def run(reaches: list[np.ndarray]) -> None:
        for query_, reach in zip(load.queries, reaches, strict=True):
            query_.run_plain(reach)

    benchmark.pedantic(run, setup=fresh_reach, rounds=ROUNDS, warmup_rounds=1)
    plain_rate.append(note(benchmark, load.rays, []))


@pytest.mark.benchmark(group="truth")
def test_slices(load: Load, plain_rate: list[float], benchmark: BenchmarkFixture) -> None:
    def run() -> None:
        for query_ in load.queries:
            query_.run_sliced()

    benchmark.pedantic(run, rounds=ROUNDS, warmup_rounds=1)
    note(benchmark, load.rays, plain_rate)


@pytest.mark.benchmark(group="truth")
def test_trace(load: Load, plain_rate: list[float], benchmark: BenchmarkFixture) -> None:
    rays = sum(len(query_.origins) for query_ in ray_queries_of(load.view, pixel_samples=4))
    benchmark.pedantic(trace, args=(load.view, 4), rounds=3, warmup_rounds=1)
    note(benchmark, rays, plain_rate)
