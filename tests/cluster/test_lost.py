"""Workers, schedulers and clients that are killed: no row is lost or doubled, and none is made again."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import psutil
import pytest
from distributed.utils import open_port

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")]

Records = Callable[..., list[dict[str, Any]]]
SPECS = ["unshadowed", "shadow-map", "shadow-map:bias=slope", "shadow-map:bias=constant", "shadow-map:filter=pcf"]
STUDY = ["run", "cube-on-plane", "spot-lamp", "--view-size", "96", "--rounds", "0", "--phases", "8"]


class Processes:
    """A scheduler and two workers as programs."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._stack, self._folder = stack, folder
        self.port = open_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.start()

    def start(self) -> None:
        self.scheduler = self._begin("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        self.workers = [self.start_worker() for _ in range(2)]

    def start_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        places = ["--local-directory", str(self._folder), "--no-dashboard"]
        return self._begin("worker", self.address, "--nthreads", "1", "--no-nanny", *places, **environment)

    def _begin(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        settings = {
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "100",
            "DASK_DISTRIBUTED__SCHEDULER__DASHBOARD__STATUS__TASK_STREAM_LENGTH": "10",
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            env=os.environ | settings | environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._stack.callback(kill, process)
        return process


def kill(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with ExitStack() as stack:
        yield Processes(stack, tmp_path / "dask")


@pytest.fixture
def study(processes: Processes, tmp_path: Path) -> list[str | Path]:
    specs = [argument for spec in SPECS for argument in ("-t", spec)]
    return [*STUDY, *specs, "--dask", processes.address, "-o", tmp_path / "out"]


def test_killed_workers_and_a_restarted_scheduler_lose_no_row(
    processes: Processes, study: list[str | Path], start: Any, records: Records, tmp_path: Path
) -> None:
    run = start(*study)
    out = tmp_path / "out"
    run.until(lambda: len(records(out)) > 4)
    for n in random.Random(0).choices(range(2), k=2):
        kill(processes.workers[n])
        processes.workers[n] = processes.start_worker()
        count = len(records(out))
        run.until(lambda: len(records(out)) > count)  # noqa: B023
    kill(processes.scheduler)
    processes.start()
    code, _, err = run.end()
    assert code == 0, err
    assert len(keys := [row["key"] for row in records(out)]) == len(set(keys)) == 2 * (1 + 8 * (len(SPECS) - 1))
    assert {row["status"] for row in records(out)} == {"ok"}


def test_a_killed_client_goes_on_without_measuring_again(
    processes: Processes, study: list[str | Path], start: Any, records: Records, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    first = start(*study)
    first.until(lambda: len(records(out)) > 10)
    first.process.kill()
    first.process.communicate()
    kept = records(out)
    code, _, err = start(*study).end()
    assert code == 0, err
    after = records(out)
    assert after[: len(kept)] == kept
    assert len({row["key"] for row in after}) == len(after) == 2 * (1 + 8 * (len(SPECS) - 1))


def test_ctrl_c_leaves_no_process(start: Any, records: Records, tmp_path: Path) -> None:
    specs = [argument for spec in SPECS for argument in ("-t", spec)]
    run = start(*STUDY, *specs, "--dask", "local:2", "-o", tmp_path / "out")
    run.until(lambda: len(records(tmp_path / "out")) > 4)
    family = run.family()
    assert len(family) >= 4  # two workers, and the processes that draw
    os.killpg(run.process.pid, signal.SIGINT)
    code, _, err = run.end()
    assert code == 130
    assert "Traceback" not in err
    assert psutil.wait_procs(family, timeout=5)[1] == []


def test_a_worker_of_another_renderer_is_left_out_unless_asked_for(
    processes: Processes, study: list[str | Path], start: Any, records: Records, tmp_path: Path
) -> None:
    kill(processes.workers[0])
    processes.start_worker(LP_NATIVE_VECTOR_WIDTH="128")
    out, unshadowed = tmp_path / "out", ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "48", "--rounds", "0"]
    arguments = [*unshadowed, "--dask", processes.address, "-o", out]
    only = start(*arguments)
    code, _, err = only.end()
    ...
