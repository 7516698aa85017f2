"""Rays per second of the truth, and of the kernel behind it.

    pytest benchmarks/test_truth.py -rP

`test_occlusion` gives the same rays to the kernel and to a loop in C over packets that are already filled, which is the
limit of any caller of Embree's packets; `ratio` is the rate of the kernel over that of the loop, both in one thread.
`test_native_packets` gives the same rays to devices for several instruction sets, in packets of each width in turn;
`ratio` is the rate of native packets over that of 16 rays, both by the processor time of one thread.
`test_hard` and `test_soft` give rays and seconds of truths; `ratio` is their seconds over those that the kernel takes
for as many rays, on as many cores.
"""

import ctypes
import os
import statistics
import subprocess
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.errors import InputError
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, View, view_of
from shadowbench.truths import embree, packets
from shadowbench.truths.embree import Tracer, default_device, load_library, make_device
from shadowbench.truths.light_samples import LightSampler, scrambles_of
from shadowbench.truths.trace import trace

HARD = ["cube-on-plane", "room-with-lamp", "statue"]
SOFT = ["post", "leaves", "fence"]
TRIANGLES = {"10k": 5, "100k": 6, "1M": 8}
"""Subdivisions of an icosahedron with about as many triangles."""
LOOP = """
void run(void (*query)(const int *, void *, char *, void *), const int *valid, void *scene, char *rays, void *arguments,
         long packets, long bytes) {
    for (long packet = 0; packet < packets; packet++) query(valid, scene, rays + packet * bytes, arguments);
}
"""


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("loop")
    (folder / "loop.c").write_text(LOOP, encoding="utf-8")
    subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", "loop.so", "loop.c"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "loop.so"))


def shadow_rays(receivers: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """64 rays to a sun 6° wide from each of receivers² points below the scene."""
    across = np.linspace(-0.5, 0.5, receivers)
    x, z = (each.ravel() for each in np.meshgrid(across, across))
    points, normals = np.stack([x, np.full_like(x, -0.4), z]), np.repeat([[0.0], [1.0], [0.0]], len(x), axis=1)
    sampler = LightSampler(Light("sun", "directional", (0.3, -1.0, 0.2), radius=np.radians(3.0)))
    return sampler.rays(points, normals, scrambles_of(np.arange(len(x)), 1, 0), 64, 1e-6)[:3]


def parallel_rays(low: np.ndarray, high: np.ndarray, receivers: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One ray to a sun without size from each of receivers² points just above the lowest ones of a box."""
    x, z = np.meshgrid(np.linspace(low[0], high[0], receivers), np.linspace(low[2], high[2], receivers))
    y = np.full_like(x, low[1] + 1e-3 * (high[1] - low[1]))
    origins = np.stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float32)
    return origins, np.array([[0.3], [1.0], [0.2]], np.float32), np.full(x.size, 1e30, np.float32)


def aligned(size: int) -> np.ndarray:
    """(size,) bytes, aligned to 64 of them."""
    padded = np.zeros(size + 64, dtype=np.uint8)
    start = -padded.ctypes.data % 64
    return padded[start : start + size]


@pytest.mark.benchmark(group="occlusion")
@pytest.mark.parametrize("subdivisions", TRIANGLES.values(), ids=TRIANGLES)
def test_occlusion(subdivisions: int, loop: ctypes.CDLL, benchmark: BenchmarkFixture) -> None:
    ball = trimesh.creation.icosphere(subdivisions)
    rough = 0.35 * ball.vertices * (1 + 0.05 * np.random.default_rng(0).standard_normal((len(ball.vertices), 1)))
    scene, library, width = Tracer(rough, ball.faces.astype(np.int32)), load_library(), default_device().width
    origins, directions, reach = shadow_rays(64)
    count = len(reach) // width

    filled = np.zeros((count, packets.LANE, width), dtype=np.float32)
    for axis in range(3):
        filled[:, axis] = origins[axis].reshape(count, -1)
        filled[:, 4 + axis] = directions[axis].reshape(count, -1)
    filled[:, 8] = reach.reshape(count, -1)
    filled.view(np.uint32)[:, 9] = 0xFFFFFFFF
    rays, valid, arguments = aligned(filled.nbytes), aligned(64).view(np.int32), aligned(64).view(np.uint32)
    valid[:], arguments[:2] = -1, (packets.COHERENT, 0xFFFFFFFF)
    addresses = [ctypes.c_void_p(each.ctypes.data) for each in (valid, rays, arguments)]
    query = ctypes.cast(getattr(library, f"rtcOccluded{width}"), ctypes.c_void_p)
    sizes = ctypes.c_long(count), ctypes.c_long(filled.nbytes // count)
    limit: list[float] = []

    def run_loop() -> None:
        rays[:] = filled.view(np.uint8).ravel()
        start = time.perf_counter()
        loop.run(query, addresses[0], ctypes.c_void_p(scene.handle), addresses[1], addresses[2], *sizes)
        limit.append(time.perf_counter() - start)

    benchmark.pedantic(scene.occluded, args=(origins.T, directions.T, reach), setup=run_loop, rounds=9, warmup_rounds=1)
    blocked = scene.occluded(origins.T, directions.T, reach)
    assert (blocked == (rays.view(np.float32).reshape(filled.shape)[:, 8] < 0).ravel()).all()
    note(benchmark, len(reach), statistics.median(limit), "of the loop in C")


@pytest.mark.benchmark(group="packets")
@pytest.mark.parametrize("instructions", ["sse4.2", "avx2", "avx512"])
def test_native_packets(instructions: str, benchmark: BenchmarkFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        device = make_device(instructions)
    except InputError as error:
        pytest.skip(str(error))
    geometry = load_scene("statue").geometry
    scenes = {}
    for width in (4, 8, 16):
        monkeypatch.setattr(embree, "default_device", lambda width=width: device._replace(width=width))
        scenes[width] = Tracer(geometry.vertices, geometry.faces)
    origins, directions, reach = parallel_rays(*geometry.bounds, 512)
    seconds: dict[int, list[float]] = {width: [] for width in scenes}

    def trace_each() -> None:
        for width, scene in scenes.items():
            start = time.thread_time()
            scene.occluded(origins.T, directions.T, reach)
            seconds[width].append(time.thread_time() - start)

    benchmark.pedantic(trace_each, rounds=9, warmup_rounds=1)
    rates = {width: len(reach) / statistics.median(values) / 1e6 for width, values in seconds.items()}
    ratio = rates[device.width] / rates[16]
    benchmark.extra_info |= {"rates": rates, "native": device.width, "ratio": round(ratio, 3)}
    told = ", ".join(f"{width}: {rate:.1f} M/s" for width, rate in rates.items())
    print(f"\n{instructions}, native {device.width}: {told}; {ratio:.2f} times 16", end=" ")


def view_in(name: str, size: int) -> View:
    scene = load_scene(name)
    return view_of(scene, scene.cameras[0], scene.lights[0], size)


@pytest.mark.benchmark(group="hard truth")
@pytest.mark.parametrize("name", HARD)
def test_hard(name: str, smallest: bool, benchmark: BenchmarkFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    hard = view_in(name, 64 if smallest else 512)
    rays, kernel_seconds = count_rays(hard, monkeypatch)
    benchmark.pedantic(trace, args=(hard,), rounds=3, warmup_rounds=1)
    note(benchmark, rays, kernel_seconds / (os.cpu_count() or 1), "of the kernel's rate")


@pytest.mark.benchmark(group="soft truth")
@pytest.mark.parametrize("name", SOFT)
def test_soft(name: str, smallest: bool, benchmark: BenchmarkFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    view = view_in(name, 64 if smallest else 256)
    rays, kernel_seconds = count_rays(view, monkeypatch)
    benchmark.pedantic(trace, args=(view,), rounds=1)
    note(benchmark, rays, kernel_seconds / (os.cpu_count() or 1), "of the kernel's rate")


def count_rays(view: View, monkeypatch: pytest.MonkeyPatch) -> tuple[int, float]:
    """Rays of a view's truth, and the seconds that all threads together spend in the tracer."""
    counts: list[int] = []
    seconds: list[float] = []

    def counted(query: Callable[..., Any]) -> Callable[..., Any]:
        def call(tracer: Tracer, origins: Any, *rest: Any) -> Any:
            start = time.thread_time()
            answer = query(tracer, origins, *rest)
            seconds.append(time.thread_time() - start)
            counts.append(len(origins))
            return answer

        return call

    with monkeypatch.context() as patch:
        for name in ("hits", "occluded"):
            patch.setattr(Tracer, name, counted(getattr(Tracer, name)))
        trace(view)
    assert counts, "the truth asks the tracer"
    return sum(counts), sum(seconds)


def note(benchmark: BenchmarkFixture, rays: int, other: float, of: str) -> None:
    """Record rays per second, and the ratio of `other` seconds to those of the benchmark."""
    if benchmark.stats is None:  # --benchmark-disable
        return
    taken = statistics.median(benchmark.stats.stats.data)
    benchmark.extra_info |= {"rays": rays, "rays_per_second": round(rays / taken), "ratio": round(other / taken, 3)}
    print(f"\n{rays / 1e6:.1f} Mrays in {taken:.2f} s, {rays / taken / 1e6:.1f} M/s; {other / taken:.2f} {of}", end=" ")
