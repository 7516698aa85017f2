"""Limits of time and memory: each call is timed in turn with a fixed piece of work, in one process.

    pytest benchmarks/test_limits.py

`ratio` is the fastest round of a call over the fastest round of the work it is compared with, and `most` its limit.
The test suite checks the same as far as it can be counted: rays, calls, modules, primitives.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
from pytest_benchmark.fixture import BenchmarkFixture
from scipy import ndimage
from skimage.metrics import structural_similarity

from shadowbench.maps import culling, reduction
from shadowbench.measure.doctor import MAX_NOISE, measure_noise
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import CellRequest
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import build_shape
from shadowbench.scores import loops
from shadowbench.scores.comparison import C1, C2, WEIGHTS
from shadowbench.survey.survey import needs
from shadowbench.truths.cache import cached_truth

ROUNDS = 7
Call = Callable[[], object]


@pytest.fixture
def assert_ratio(benchmark: BenchmarkFixture, request: pytest.FixtureRequest) -> Callable[..., None]:
    """Times a call in turn with another, and fails if the ratio of their times is above `most` or below `least`.

    Uses the timer of the test's benchmark mark, by default the wall clock. Checks nothing with --benchmark-disable.
    """
    timer = request.node.get_closest_marker("benchmark").kwargs.get("timer", time.perf_counter)

    def compare(call: Call, beside: Call, most: float, least: float = 0.0, rounds: int = ROUNDS) -> None:
        times: list[float] = []

        def before() -> None:
            start = timer()
            beside()
            times.append(timer() - start)

        benchmark.pedantic(call, setup=before, rounds=rounds, warmup_rounds=1)
        if benchmark.stats is None:
            return
        ratio = min(benchmark.stats.stats.data) / min(times)
        benchmark.extra_info |= {"ratio": round(ratio, 3), "least": least, "most": most, "beside_s": min(times)}
        print(f"\nratio {ratio:.3g}, allowed {least:g} to {most:g}", end=" ")
        assert least <= ratio <= most

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


@pytest.fixture
def one_core() -> Iterator[None]:
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("no way to keep to one core here")
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    yield
    os.sched_setaffinity(0, allowed)


def a_cell(scene_name: str, size: int) -> Call:
    """Scores a mask of a view; the truth is prepared."""
    scene = load_scene(scene_name)
    truth = cached_truth(view_of(scene, scene.cameras[0], scene.lights[0], size), 1)
    against, mask = prepare_truth(truth), np.roll(truth.visibility, (1, 2), axis=(0, 1))
    return lambda: mask_record(mask, truth, against, truth.triangle)


@pytest.mark.parametrize(
    ("scene", "size", "most"), [("colonnade", 1024, 2), ("window", 1024, 4), ("colonnade", 4096, 32)]
)
@pytest.mark.benchmark(group="limits", timer=time.process_time)
def test_scoring_a_cell(
    scene: str, size: int, most: float, assert_ratio: Any, fixed_work: Call, one_core: None
) -> None:
    assert_ratio(a_cell(scene, size), fixed_work, most)


def the_edges_of(image: Any) -> Any:
    return np.abs(image - 0.5) < 0.005


@pytest.mark.parametrize(
    ("new", "old", "most"),
    [
        (
            lambda image: loops.squared_distance(the_edges_of(image)),
            lambda image: ndimage.distance_transform_edt(~the_edges_of(image)),
            0.3,
        ),
        (
            lambda image: loops.ssim_map(image, image[::-1].copy(), image >= 0, WEIGHTS, C1, C2),
            lambda image: structural_similarity(
                image.astype(float),
                image[::-1].astype(float),
                gaussian_weights=True,
                use_sample_covariance=False,
                data_range=1,
            ),
            0.2,
        ),
        (lambda image: loops.greatest(image, 8), lambda image: ndimage.maximum_filter(image, 17), 0.2),
    ],
    ids=["distance", "ssim", "maximum"],
)
@pytest.mark.benchmark(group="limits", timer=time.process_time)
def test_compiled_loops_against_scipy(new: Any, old: Any, most: float, assert_ratio: Any, one_core: None) -> None:
    """What scores were computed with before: the distance transform and filters of SciPy, and scikit-image's SSIM."""
    image = np.random.default_rng(2).random((1024, 1024), dtype=np.float32)
    assert_ratio(lambda: new(image), lambda: old(image), most)


@pytest.mark.benchmark(group="limits", timer=time.process_time)
def test_needs_of_a_million_triangles(assert_ratio: Any, fixed_work: Call) -> None:
    made, plane = trimesh.creation.icosphere(7), build_shape("plane", {}, "limits")
    faces = np.asarray(made.faces, dtype=np.int32)
    balls = [Mesh(f"ball {k}", made.vertices * 0.4 + (k - 1.0, 0.4, 0.0), faces) for k in range(3)]
    camera = Camera("camera", (2.3, 4.0, 3.4), (0.0, 0.0, 0.0), 0.87)
    sun = Light("sun", "directional", (0.5, -1.0, -0.3))
    scene = Scene("balls", (Mesh("plate", plane.vertices * 8, plane.faces), *balls), (camera,), (sun,))

    def first() -> View:
        return view_of(Scene(scene.name, scene.meshes, scene.cameras, scene.lights), camera, sun, 512)

    assert len(scene.geometry.faces) == 2 + 3 * 327_680
    assert_ratio(lambda: needs(first()), fixed_work, most=110)


def python(*arguments: str) -> Call:
    return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True)


@pytest.mark.parametrize(
    ("code", "beside", "most"),
    [
        ("import shadowbench", "import typing", 1.2),
        ("import sys; sys.argv[1:] = ['--help']; from shadowbench.commands import main; main()", "import asyncio", 3.0),
        ("import pytest, shadowbench.pytest_plugin", "import pytest", 1.2),
    ],
    ids=["package", "help", "plugin"],
)
@pytest.mark.benchmark(group="limits")
def test_start(code: str, beside: str, most: float, assert_ratio: Any) -> None:
    assert_ratio(python("-c", code), python("-c", beside), most, rounds=15)


FIRST_CELL = """
import os
from shadowbench.measure.worker import Worker
call = Worker.call
def until_drawn(self, method, *arguments, **options):
    answer = call(self, method, *arguments, **options)
    if method.__name__ == "draw":
        self.stop()
        os._exit(0)
    return answer
Worker.call = until_drawn
from shadowbench.commands import main
main()
"""


@pytest.mark.benchmark(group="limits")
def test_start_of_a_run_until_its_first_cell_is_drawn(tmp_path: Path, assert_ratio: Any) -> None:
    """At most 1.5 s where importing NumPy takes 0.08 s, once the truth is in the cache.

    Parent and worker import at the same time: this needs two idle cores.
    """
    run = python(
        "-c", FIRST_CELL, "run", "street", "-t", "shadow-map", "-q", "--rounds", "0", "-o", str(tmp_path / "run")
    )
    assert_ratio(run, python("-c", "import numpy"), most=19)


@pytest.mark.benchmark(group="limits")
def test_the_passes_add_up_to_the_frame(cells: Any, assert_ratio: Any) -> None:
    scene = load_scene("stairs")
    session, view = cells.session, view_of(scene, scene.cameras[0], scene.lights[0], 512)
    session.prepare_timing(view, CellRequest("shadow-map:size=2048"))
    try:
        passes, frames = lambda: session.time_passes(0), lambda: session.time_frame(0)
        assert_ratio(passes, frames, least=0.7, most=1.3, rounds=15)
    finally:
        session.release_timed()


@pytest.mark.benchmark(group="limits")
def test_casters_in_an_order_that_reuses_vertices_against_the_files(
    scene_file: Any, cells: Any, assert_ratio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load_scene(scene_file("armadillo.obj"))
    session, view = cells.session, view_of(scene, scene.cameras[0], scene.lights[0], 64)
    for few in (culling._FEW, sys.maxsize):
        monkeypatch.setattr(culling, "_FEW", few)
        session.prepare_timing(view, CellRequest("shadow-map:fit=scene,size=1024"))
    try:
        assert_ratio(lambda: session.time_frame(0), lambda: session.time_frame(1), most=0.75)
    finally:
        session.release_timed()


@pytest.mark.benchmark(group="limits")
def test_a_fit_that_reads_few_receivers_against_one_that_reads_all(
    cells: Any, assert_ratio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load_scene("street")
    session, view = cells.session, view_of(scene, scene.cameras[0], scene.lights[0], 1024)
    session.prepare_timing(view, CellRequest("shadow-map:size=16,filter=hard,cull=false"))

    def frame(rounding: float) -> None:
        monkeypatch.setattr(reduction, "_ROUNDING", rounding)
        session.time_frame(0)

    try:
        assert_ratio(lambda: frame(1e-5), lambda: frame(1e12), most=0.8)
    finally:
        session.release_timed()


@pytest.mark.benchmark(group="limits")
def test_silhouettes_against_all_triangles(scene_file: Any, cells: Any, assert_ratio: Any) -> None:
    scene = load_scene(scene_file("armadillo.obj"))
    session, view = cells.session, view_of(scene, scene.cameras[0], scene.lights[0], 1024)
    for spec in ("shadow-volume", "shadow-volume:faces=triangle"):
        session.prepare_timing(view, CellRequest(spec))
    try:
        assert_ratio(lambda: session.time_frame(0), lambda: session.time_frame(1), most=0.2, rounds=5)
    finally:
        session.release_timed()


@pytest.mark.benchmark(group="limits")
def test_one_cell_timed_as_two(benchmark: BenchmarkFixture) -> None:
    with Worker() as worker:
        found = benchmark.pedantic(measure_noise, args=(worker,), rounds=1)
    benchmark.extra_info |= {"ratio": found.ratio, "worst": found.worst, "most": MAX_NOISE}
    assert found.ratio <= MAX_NOISE


STUDY = """
scenes = ["cube-on-plane"]
map_size = [64, 1024]
view_size = 64
rounds = 9
reference = "shadow-map:size=64"
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "shadow-map"
[[technique]]
spec = "ray-traced"
"""


@pytest.mark.benchmark(group="limits")
def test_one_study_run_twice(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    folders = [str(tmp_path / name) for name in "ab"]

    def run() -> None:
        for folder in folders:
            python("-m", "shadowbench", "run", "-s", str(tmp_path / "study.toml"), "-o", folder, "-q")()

    benchmark.pedantic(run, rounds=1)
    first, second = folders
    command = [sys.executable, "-m", "shadowbench", "check", second, "--baseline", first, "--repeat", "--json"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    (ranking,) = json.loads(answer.stdout)["rankings"]
    benchmark.extra_info |= {"tau": ranking["tau"], "sharp": ranking["sharp"]}
    assert answer.returncode == 0 and ranking["tau"] == 1 and ranking["sharp"] >= 3


def peak_bytes(process: subprocess.Popen[bytes]) -> int:
    """Peak of the summed resident bytes of a process and its descendants, until it ends."""
    parent, peak = psutil.Process(process.pid), 0
    while process.poll() is None:
        total = 0
        for one in [parent, *parent.children(recursive=True)]:
            try:
                total += one.memory_info().rss
            except psutil.NoSuchProcess:
                continue
        peak = max(peak, total)
        time.sleep(0.02)
    return peak


@pytest.mark.timeout(1200)
@pytest.mark.benchmark(group="memory")
def test_views_of_4096_pixels_a_side_work_in_8_gib(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    specs = ["shadow-map:size=4096", "ray-traced", "unshadowed"]
    command = [
        sys.executable,
        "-m",
        "shadowbench",
        "run",
        "cube-on-plane",
        "colonnade",
        "-q",
        "--view-size",
        "4096",
    ]
    command += ["--rounds", "3", "-o", str(tmp_path / "run"), *(f"--technique={spec}" for spec in specs)]

    def run() -> int:
        with (tmp_path / "complaints").open("w") as complaints:
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=complaints)
            peak = peak_bytes(process)
        assert process.returncode == 0, (tmp_path / "complaints").read_text()
        return peak

    peak = benchmark.pedantic(run, rounds=1)
    benchmark.extra_info["peak_bytes"] = peak
    assert len((tmp_path / "run" / "table.csv").read_text().splitlines()) == 1 + 2 * 3
    assert peak < 8 << 30, f"{peak / 2**30:.2f} GiB"


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process's memory is reset by Linux alone")
@pytest.mark.benchmark(group="memory")
def test_a_cell_of_4096_pixels_a_side_is_scored_in_400_mib(benchmark: BenchmarkFixture) -> None:
    """Beyond the truth, what is prepared of it, and the mask."""
    score = a_cell("colonnade", 4096)
    score()
    before = psutil.Process().memory_info().rss
    Path("/proc/self/clear_refs").write_text("5")
    benchmark.pedantic(score, rounds=1)
    (peak,) = (line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line[:5] == "VmHWM")
    benchmark.extra_info["peak_bytes"] = 1024 * int(peak) - before
    assert benchmark.extra_info["peak_bytes"] < 400 << 20


@pytest.mark.benchmark(group="memory")
def test_the_largest_mask_is_scored_in_3_gib(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    from PIL import Image

    Image.new("L", (4096, 4096), 255).save(tmp_path / "mask.png")
    command = [sys.executable, "-m", "shadowbench", "score", "cube-on-plane", str(tmp_path / "mask.png"), "-q"]
    peak = benchmark.pedantic(lambda: peak_bytes(subprocess.Popen(command, stdout=subprocess.DEVNULL)), rounds=1)
    benchmark.extra_info["peak_bytes"] = peak
    assert peak < 3 << 30, f"{peak / 2**30:.2f} GiB"
