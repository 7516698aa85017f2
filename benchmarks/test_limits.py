"""Calls beside work that they are compared with, timed in turn in one process; memory of large views and masks.

    pytest benchmarks/test_limits.py -rP

`ratio` is the fastest round of a call over the fastest round of the work it is compared with.
The test suite checks what of this can be counted: rays, calls, modules, primitives.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.machine import MAX_NOISE, measure_noise
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import build_shape
from shadowbench.survey.survey import needs
from shadowbench.truths.cache import cached_truth

ROUNDS = 5
Call = Callable[[], object]


@pytest.fixture
def compare(benchmark: BenchmarkFixture, request: pytest.FixtureRequest) -> Callable[..., None]:
    """Times a call in turn with another, by the timer of the test's benchmark mark, by default the wall clock."""
    timer = request.node.get_closest_marker("benchmark").kwargs.get("timer", time.perf_counter)

    def compare(call: Call, beside: Call, rounds: int = ROUNDS) -> None:
        times: list[float] = []

        def before() -> None:
            start = timer()
            beside()
            times.append(timer() - start)

        benchmark.pedantic(call, setup=before, rounds=rounds, warmup_rounds=1)
        if benchmark.stats is None:  # --benchmark-disable
            return
        ratio = min(benchmark.stats.stats.data) / min(times)
        benchmark.extra_info |= {"ratio": round(ratio, 3), "beside_s": min(times)}
        print(f"\nratio {ratio:.3g}", end=" ")

    return compare


@pytest.fixture
def fixed_work() -> Call:
    """Fixed reference work: sorting a million numbers, and passes over 64 MiB."""
    numbers = np.random.default_rng(0).random(1 << 20)
    large = np.ones(1 << 23)

    def work() -> None:
        np.sort(numbers)
        np.sqrt(large).sum()

    return work


def a_cell(scene_name: str, size: int) -> Call:
    """Scores a mask of a view; the truth is prepared."""
    scene = load_scene(scene_name)
    truth = cached_truth(view_of(scene, scene.cameras[0], scene.lights[0], size), 1)
    against, mask = prepare_truth(truth), np.roll(truth.visibility, (1, 2), axis=(0, 1))
    return lambda: mask_record(mask, truth, against, truth.triangle)


@pytest.mark.benchmark(group="limits", timer=time.process_time)
def test_needs_of_a_million_triangles(smallest: bool, compare: Any, fixed_work: Call) -> None:
    made, plane = trimesh.creation.icosphere(3 if smallest else 7), build_shape("plane", {}, "limits")
    faces = np.asarray(made.faces, dtype=np.int32)
    balls = [Mesh(f"ball {k}", made.vertices * 0.4 + (k - 1.0, 0.4, 0.0), faces) for k in range(3)]
    camera = Camera("camera", (2.3, 4.0, 3.4), (0.0, 0.0, 0.0), 0.87)
    sun = Light("sun", "directional", (0.5, -1.0, -0.3))
    scene = Scene("balls", (Mesh("plate", plane.vertices * 8, plane.faces), *balls), (camera,), (sun,))

    def first() -> View:
        return view_of(Scene(scene.name, scene.meshes, scene.cameras, scene.lights), camera, sun, 512)

    compare(lambda: needs(first()), fixed_work, rounds=1)


def python(*arguments: str) -> Call:
    return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True)


@pytest.mark.parametrize(
    ("code", "beside"),
    [
        ("import shadowbench", "import typing"),
        ("import sys; sys.argv[1:] = ['--help']; from shadowbench.commands import main; main()", "import asyncio"),
        ("import pytest, shadowbench.pytest_plugin", "import pytest"),
    ],
    ids=["package", "help", "plugin"],
)
@pytest.mark.benchmark(group="limits")
def test_start(code: str, beside: str, compare: Any) -> None:
    compare(python("-c", code), python("-c", beside))


@pytest.mark.benchmark(group="limits")
def test_one_cell_timed_as_two(benchmark: BenchmarkFixture) -> None:
    with Worker() as worker:
        ratio, _ = benchmark.pedantic(measure_noise, args=(worker,), rounds=1)
    benchmark.extra_info |= {"ratio": ratio, "most": MAX_NOISE}
    print(f"\nratio {ratio:.3g}, too noisy above {MAX_NOISE:g}", end=" ")


@pytest.mark.benchmark(group="memory")
def test_a_run_of_large_views(tmp_path: Path, smallest: bool, cost: Any, benchmark: BenchmarkFixture) -> None:
    size, specs = 64 if smallest else 2048, ["shadow-map:size=4096", "ray-traced", "unshadowed"]
    words = ["run", "cube-on-plane", "-q", "--view-size", str(size), "--rounds", "1", "-o", tmp_path / "run"]
    words += [f"--technique={spec}" for spec in specs]
    spent = benchmark.pedantic(cost, args=("-m", "shadowbench", *words), rounds=1)
    assert spent.returncode == 0
    assert len((tmp_path / "run" / "table.csv").read_text().splitlines()) == 1 + len(specs)
    note_peak(benchmark, spent.peak_bytes)


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process's memory is reset by Linux alone")
@pytest.mark.benchmark(group="memory")
def test_scoring_a_large_cell(smallest: bool, benchmark: BenchmarkFixture) -> None:
    """Beyond the truth, what is prepared of it, and the mask."""
    score = a_cell("cube-on-plane", 64 if smallest else 4096)
    score()
    before = psutil.Process().memory_info().rss
    Path("/proc/self/clear_refs").write_text("5")
    benchmark.pedantic(score, rounds=1)
    (peak,) = (line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line[:5] == "VmHWM")
    note_peak(benchmark, 1024 * int(peak) - before)


def note_peak(benchmark: BenchmarkFixture, peak: int) -> None:
    benchmark.extra_info["peak_bytes"] = peak
    print(f"\npeak {peak / 2**20:.0f} MiB", end=" ")
