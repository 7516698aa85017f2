"""Throughput of Dask workers. Needs an idle machine with two cores; takes three minutes.

pytest benchmarks/test_cluster.py -s
"""

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import dask
import pytest
from distributed import LocalCluster
from distributed.utils import open_port

from shadowbench.cluster import tasks, workers
from shadowbench.cluster.cluster import Cluster
from shadowbench.cluster.connect import Connection
from shadowbench.cluster.executor import DaskExecutor
from shadowbench.cluster.parcel import Setup
from shadowbench.measure.bench import Bench, Job
from shadowbench.measure.executor import Executor
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record
from shadowbench.measure.session import DeviceInfo
from shadowbench.measure.worker import Worker
from shadowbench.studies.measure import study_from_options
from shadowbench.studies.run import run_study
from shadowbench.studies.study import Study
from shadowbench.techniques.registry import techniques
from shadowbench.truths.cache import cached_truth

WORKERS, JOBS_EACH = 64, 6
SLEEP_S = 3.0  # of a job with CELLS cells, about what they take
CELLS = 8


class Silent:
    def note(self, line: str) -> None:
        print(line)

    def stage(self, name: str, total: int | None) -> None: ...

    def step(self, what: str) -> None: ...


@pytest.fixture(scope="module")
def study() -> Study:
    """A study of about a hundred cells without times, whose truths are in the cache."""
    found = study_from_options(
        techniques(), ["cube-on-plane", "spot-lamp", "street"], map_size=[512, 1024], phases=1, rounds=0
    )
    for block in found.blocks():
        cached_truth(block.view)
    return found


def throughput(study: Study, folder: Path, executor: Executor) -> float:
    """Cells per second."""
    start = time.perf_counter()
    cells = len(run_study(study, folder, executor, Silent()).results)
    return cells / (time.perf_counter() - start)


@contextmanager
def on_dask(where: str, study: Study) -> Iterator[DaskExecutor]:
    with Connection(where) as connection, Cluster(connection, Silent(), (), study.limits) as cluster:
        yield DaskExecutor(cluster, cluster.renderers()[0])


@contextmanager
def pinned(cores: Sequence[int], folder: Path) -> Iterator[str]:
    """Address of a scheduler with a worker on each of these cores."""
    address = f"tcp://127.0.0.1:{open_port()}"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    alone = {"LP_NUM_THREADS": "1", "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
    with ExitStack() as stack:
        host, port = address.removeprefix("tcp://").split(":")
        begin = [*dask, "scheduler", "--host", host, "--port", port, "--dashboard-address", ":0"]
        programs = [subprocess.Popen(begin, **quiet)]
        flags = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)]
        for core in cores:
            begin = ["taskset", "-c", str(core), *dask, "worker", address, *flags]
            programs.append(subprocess.Popen(begin, env=os.environ | alone, **quiet))
        for program in programs:
            stack.callback(lambda program=program: (program.kill(), program.wait()))
        time.sleep(5)  # until all have joined
        yield address


def test_two_workers_with_a_core_each_measure_1_6_times_as_fast_as_one(study: Study, tmp_path: Path) -> None:
    found: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(2):
        for count in found:
            folder = tmp_path / f"{turn}-{count}"
            with pinned(range(count), tmp_path / "dask") as address, on_dask(address, study) as executor:
                assert executor.jobs_at_once == count
                found[count].append(throughput(study, folder, executor))
    ratio = max(found[2]) / max(found[1])
    print(f"\ncells per second: {found}; two workers are {ratio:.2f} × as fast as one")
    assert ratio >= 1.6


def test_local_workers_are_no_slower_than_a_plain_run(study: Study, tmp_path: Path) -> None:
    found: dict[str, list[float]] = {"plain": [], "local:2": []}
    for turn in range(2):
        with Worker((), study.limits) as worker:
            worker.ready()
            found["plain"].append(throughput(study, tmp_path / f"{turn}-plain", worker))
        with on_dask("local:2", study) as executor:
            found["local:2"].append(throughput(study, tmp_path / f"{turn}-local", executor))
    print(f"\ncells per second: {found}")
    assert max(found["local:2"]) >= max(found["plain"])


@dataclass(frozen=True, eq=False)
class SleepingJob(Job[None]):
    """Job that takes as long as its cells took, and makes as many rows and images."""

    number: int
    row: Record
    images: Sequence[bytes]

    def __call__(self, bench: Bench) -> None:
        end = time.monotonic() + SLEEP_S
        for cell in range(CELLS):
            key = f"{self.number * CELLS + cell:024x}"
            bench.store.append({**self.row, "key": key})
            for kind, image in zip(("masks", "pictures"), self.images, strict=True):
                bench.pictures.write(f"{kind}/{key}.png", image)
            bench.reporter.step(key)
        time.sleep(max(end - time.monotonic(), 0))


def simulated_workers(port: str, info: DeviceInfo) -> None:
    """Serve a scheduler and workers without worker processes, until stdin is closed."""

    async def describe(setup: Setup, expected: object, dask_worker: Any) -> workers.WorkerFacts:
        return workers.WorkerFacts(dask_worker.address, "host", {}, {}, info, None)

    @contextmanager
    def station(setup: Setup) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(techniques={}, worker=None)

    workers.describe, tasks.station = describe, station
    # What 64 processes would do beside each other; the memory is that of all together.
    quiet = {"distributed.worker.profile.enabled": False, "distributed.admin.system-monitor.interval": "10s"}
    settings: dict[str, Any] = {"threads_per_worker": 1, "processes": False, "memory_limit": 0, "host": "127.0.0.1"}
    with (
        dask.config.set(quiet),
        LocalCluster(n_workers=WORKERS, scheduler_port=int(port), protocol="tcp", dashboard_address=":0", **settings),
    ):
        print("ready", flush=True)
        sys.stdin.read()


def test_the_scheduler_and_the_writer_keep_up_with_64_workers(study: Study, tmp_path: Path) -> None:
    """The workers are threads of one process, which share its lock of Python with each other and the scheduler."""
    with Worker((), study.limits) as worker:
        one = study.with_(scenes=("cube-on-plane",), technique=study.technique[:1])
        results = run_study(one, tmp_path / "one", worker, Silent()).results
        info = worker.info
    row = results[0].score
    images = [(tmp_path / "one" / kind / f"{row['key']}.png").read_bytes() for kind in ("masks", "pictures")]
    jobs = [SleepingJob(number, row, images) for number in range(WORKERS * JOBS_EACH)]
    port = open_port()
    code = f"import pickle; from {__name__} import *; simulated_workers('{port}', pickle.loads({pickle.dumps(info)}))"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=Path(__file__).parents[1]
    ) as simulation:
        simulation.stdout.readline()
        with on_dask(f"tcp://127.0.0.1:{port}", study) as executor, closing(RowStore(tmp_path / "many")) as store:
            bench = Bench(executor, store, Silent(), Pictures(tmp_path / "many"))
            list(bench.run([replace(job, number=job.number + len(jobs)) for job in jobs[:WORKERS]]))  # warm up
            start, cpu = time.perf_counter(), time.process_time()
            list(bench.run(jobs))
            seconds, spent = time.perf_counter() - start, time.process_time() - cpu
        simulation.stdin.close()
    assert len(store.scores) == (len(jobs) + WORKERS) * CELLS
    share = JOBS_EACH * SLEEP_S / seconds
    print(
        f"\n{len(jobs)} jobs on {WORKERS} workers in {seconds:.1f} s, {share:.3f} of linear; the client took "
        f"{1e3 * spent / len(jobs):.1f} ms of CPU per job of {CELLS} rows"
    )
    assert share >= 0.9
