"""Throughput of Dask workers. Needs an idle machine with two cores; takes six minutes.

pytest benchmarks/test_cluster.py -s
"""

import asyncio
import os
import pickle
import random
import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import dask
import pytest
from distributed import Client
from distributed import Worker as DaskWorker
from distributed.utils import open_port

from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.dask_campaign import ClusterCampaign
from shadowbench.measure.dask_cluster import Cluster
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import Worker
from shadowbench.options import Measuring
from shadowbench.plugin.registry import techniques
from shadowbench.studies.run import measure
from shadowbench.studies.study import Study, study_from_options
from shadowbench.truths.cache import cached_truth

WORKERS, PROCESSES, JOBS_EACH = 64, 4, 15
SLEEP_S = 3.0  # mean of jobs with CELLS cells, about what they take
CELLS = 8
ROOT = Path(__file__).parents[1]


class Silent:
    def note(self, line: str) -> None:
        print(line)

    def stage(self, name: str, total: int | None, *, timed: int = 0) -> None: ...

    def step(self, what: str) -> None: ...


@pytest.fixture(scope="module")
def study() -> Study:
    """A study of about a hundred cells without times, whose truths are in the cache."""
    scenes, measuring = ["cube-on-plane", "spot-lamp", "street"], Measuring(rounds=0, phases=8)
    found = study_from_options(techniques(), scenes, map_size=[512, 1024], measuring=measuring)
    for block in found.blocks():
        cached_truth(block.view)
    return found


def throughput(study: Study, campaign: Callable[[Path], Campaign], folder: Path) -> float:
    """Cells per second, after a first phase of every cell, for which libraries are loaded."""
    first = study.with_(phases=1)
    measure(first, [campaign(folder / "first")])
    start = time.perf_counter()
    cells = len(measure(study, [campaign(folder / "all")]).run.rows)
    return cells / (time.perf_counter() - start)


@contextmanager
def on_dask(where: str, study: Study) -> Iterator[Callable[[Path], ClusterCampaign]]:
    with Cluster(where, Silent(), (), study.limits) as cluster:
        renderer = cluster.renderers()[0]
        yield partial(ClusterCampaign, cluster=cluster, reporter=Silent(), renderer=renderer)


def begin(stack: ExitStack, *command: str, **environment: str) -> None:
    """Start a program, which is killed at the end."""
    program = subprocess.Popen(command, env=os.environ | environment, stderr=subprocess.DEVNULL, cwd=ROOT)
    stack.callback(lambda: (program.kill(), program.wait()))


def scheduler(stack: ExitStack) -> str:
    """Start a scheduler; returns its address."""
    port = open_port()
    flags = ["--host", "127.0.0.1", "--port", str(port), "--dashboard-address", ":0"]
    begin(stack, sys.executable, "-m", "dask", "scheduler", *flags)
    return f"tcp://127.0.0.1:{port}"


@contextmanager
def pinned(cores: Sequence[int], folder: Path) -> Iterator[str]:
    """Address of a scheduler with a worker on each of these cores."""
    alone = {"LP_NUM_THREADS": "1", "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
    flags = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
    with ExitStack() as stack:
        address = scheduler(stack)
        for core in cores:
            worker = [sys.executable, "-m", "dask", "worker", address, *flags]
            begin(stack, "taskset", "-c", str(core), *worker, **alone)
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(len(cores), timeout=60)
        yield address


def test_two_workers_with_a_core_each_measure_1_6_times_as_fast_as_one(study: Study, tmp_path: Path) -> None:
    found: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(2):
        for count in found:
            folder = tmp_path / f"{turn}-{count}"
            with pinned(range(count), tmp_path / "dask") as address, on_dask(address, study) as campaign:
                found[count].append(throughput(study, campaign, folder))
    ratio = max(found[2]) / max(found[1])
    print(f"\ncells per second: {found}; two workers are {ratio:.2f} × as fast as one")
    assert ratio >= 1.6


def test_local_workers_are_no_slower_than_a_plain_run(study: Study, tmp_path: Path) -> None:
    found: dict[str, list[float]] = {"plain": [], "local:2": []}
    for turn in range(2):
        with Worker((), study.limits) as worker:
            worker.ready()
            plain = partial(Campaign, drawer=GLDrawer(worker), reporter=Silent())
            found["plain"].append(throughput(study, plain, tmp_path / f"{turn}-plain"))
        with on_dask("local:2", study) as campaign:
            found["local:2"].append(throughput(study, campaign, tmp_path / f"{turn}-local"))
    print(f"\ncells per second: {found}")
    assert max(found["local:2"]) >= max(found["plain"])


def sleeping(row: Record, sizes: Mapping[str, int]) -> Callable[..., tasks.Outcome]:
    """A task that takes as long as CELLS cells took, and makes as many rows and images; sizes: bytes of the images."""

    def measure(*_: object) -> tasks.Outcome:
        seconds = random.uniform(0.5, 1.5) * SLEEP_S
        end = time.monotonic() + seconds
        keys = [secrets.token_hex(12) for _ in range(CELLS)]
        rows = [{**row, "key": key, "seconds": seconds / CELLS} for key in keys]
        files = {f"{kind}/{key}.png": os.urandom(size) for key in keys for kind, size in sizes.items()}
        time.sleep(max(end - time.monotonic(), 0))
        return tasks.Outcome(rows, files, [])

    return measure


async def simulated_workers(address: str, info: DeviceInfo, row: Record, sizes: Mapping[str, int]) -> None:
    """Serve some of the workers, which start no worker processes, until the scheduler ends."""

    def describe(*_: object) -> tasks.WorkerFacts:
        return tasks.WorkerFacts("host", {}, info, {"renderer": info.renderer})

    tasks.do, tasks.describe, tasks.measure = lambda setup, function, packed: function(), describe, sleeping(row, sizes)
    # What processes of their own would do beside each other; the memory is that of all together.
    dask.config.set({"distributed.worker.profile.enabled": False, "distributed.admin.system-monitor.interval": "10s"})
    count = WORKERS // PROCESSES
    begun = [await DaskWorker(address, nthreads=1, memory_limit=0, dashboard=False) for _ in range(count)]
    await asyncio.gather(*(one.finished() for one in begun))


def test_the_scheduler_and_the_writer_keep_up_with_64_workers(study: Study, tmp_path: Path) -> None:
    """The workers are in a few processes, and share the lock of Python with the others there."""
    with Worker((), study.limits) as worker:
        one = study.with_(scenes=("cube-on-plane",), technique=study.technique[:1])
        row = measure(one, [Campaign(tmp_path / "one", GLDrawer(worker), Silent())]).run.rows[0]
        info = worker.info
    files = {kind: tmp_path / "one" / kind / f"{row['key']}.png" for kind in ("masks", "pictures")}
    sizes = {kind: file.stat().st_size for kind, file in files.items()}
    block = next(one.blocks())
    given = pickle.dumps((info, row, sizes))
    code = f"from {__name__} import *; asyncio.run(simulated_workers(sys.argv[1], *pickle.loads({given})))"
    with ExitStack() as stack:
        address = scheduler(stack)
        for _ in range(PROCESSES):
            begin(stack, sys.executable, "-c", code, address)
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(WORKERS, timeout=60)
        campaign = stack.enter_context(stack.enter_context(on_dask(address, study))(tmp_path / "many"))
        list(campaign.measure([replace(block) for _ in range(WORKERS)]))  # warm up
        warm = len(campaign.store.scores)
        start, cpu = time.perf_counter(), time.process_time()
        list(campaign.measure([replace(block) for _ in range(WORKERS * JOBS_EACH)]))
        took, spent = time.perf_counter() - start, time.process_time() - cpu
    rows = list(campaign.store.scores.values())[warm:]
    assert len(rows) == WORKERS * JOBS_EACH * CELLS
    share = sum(row["seconds"] for row in rows) / WORKERS / took
    print(
        f"\n{WORKERS * JOBS_EACH} blocks on {WORKERS} workers in {took:.1f} s, {share:.3f} of linear; the client took "
        f"{1e3 * spent / (WORKERS * JOBS_EACH):.1f} ms of CPU per block of {CELLS} rows"
    )
    assert share >= 0.9
