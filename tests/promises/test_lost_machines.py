"""Workers, schedulers and clients that are killed: no row is lost or doubled, and none is made again."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pandas as pd
import psutil
import pytest
from distributed import Client, Future
from distributed.utils import open_port

from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Reporter
from shadowbench.measure.dask_cluster import Cluster

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")]

Records = Callable[..., list[dict[str, Any]]]
SPECS = ["unshadowed", "shadow-map", "shadow-map:bias=slope", "shadow-map:bias=constant", "shadow-map:filter=pcf"]
LIGHTS = 12
CELLS = LIGHTS * (1 + 3 * (len(SPECS) - 1))
SCENE = (
    """
camera = { position = [3, 2, 3], target = [0, 0, 0] }
mesh = [{ shape = "plane", scale = 8 }, { shape = "box", translate = [0, 0.5, 0] }]
light = ["""
    + "".join(f'{{ name = "{n}", kind = "directional", direction = [{n / 10}, -1, -0.5] }},' for n in range(LIGHTS))
    + "]"
)


def command(folder: Path) -> list[str | Path]:
    """A study of as many blocks as lights."""
    scene = folder / "lights.toml"
    scene.write_text(SCENE)
    specs = [argument for spec in SPECS for argument in ("-t", spec)]
    return ["run", scene, "--view-size", "96", "--rounds", "0", "--phases", "3", *specs]


class Processes:
    """A scheduler and two workers as programs."""

    def __init__(self, stack: ExitStack, folder: Path, protocol: str = "tcp") -> None:
        self._stack, self._folder, self.protocol, self.port = stack, folder, protocol, open_port()
        self.address = f"{protocol}://127.0.0.1:{self.port}"
        self.start()

    def start(self) -> None:
        self.scheduler = self._begin(
            "scheduler", "--protocol", self.protocol, "--host", "127.0.0.1", "--port", str(self.port),
            "--dashboard-address", ":0",
        )  # fmt: skip
        self.workers = [self.start_worker() for _ in range(2)]

    def start_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        places = ["--local-directory", str(self._folder), "--no-dashboard"]
        return self._begin("worker", self.address, "--nthreads", "1", "--no-nanny", *places, **environment)

    def wait_for(self, count: int) -> None:
        """Wait until a number of workers have joined."""
        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=60)

    def _begin(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "100"}
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
    return [*command(tmp_path), "--dask", processes.address, "-o", tmp_path / "out"]


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
    assert len(keys := [row["key"] for row in records(out)]) == len(set(keys)) == CELLS
    assert {row["status"] for row in records(out)} == {"ok"}


def test_a_worker_that_dies_before_its_result_is_fetched_is_not_waited_for(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes.wait_for(2)
    fetch = Future.result
    with Cluster(processes.address, Mock(spec=Reporter)) as cluster:
        pids = cluster.client.run(os.getpid)

        def die_first(future: Any, timeout: float | None = None) -> Any:
            monkeypatch.setattr(Future, "result", fetch)
            (place,) = cluster.client.who_has([future])[future.key]
            os.kill(pids[place], signal.SIGKILL)
            return fetch(future, timeout)

        monkeypatch.setattr(Future, "result", die_first)
        answers = dict(cluster.run(lambda: [*cluster.facts], [(tasks.describe, tasks.own_versions())] * 4))
    assert sorted(answers) == [0, 1, 2, 3]
    assert {type(one) for one in answers.values()} == {tasks.WorkerFacts}


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
    assert len({row["key"] for row in after}) == len(after) == CELLS


def test_ctrl_c_leaves_no_process(start: Any, records: Records, tmp_path: Path) -> None:
    run = start(*command(tmp_path), "--dask", "local:2", "-o", tmp_path / "out")
    run.until(lambda: len(records(tmp_path / "out")) > 4)
    family = run.family()
    assert len(family) >= 4  # two workers, and the processes that draw
    os.killpg(run.process.pid, signal.SIGINT)
    code, _, err = run.end()
    assert code == 130
    assert "Traceback" not in err
    assert psutil.wait_procs(family, timeout=5)[1] == []


def test_a_worker_of_another_renderer_is_left_out_unless_asked_for(
    processes: Processes, start: Any, records: Records, tmp_path: Path
) -> None:
    processes.wait_for(2)
    kill(processes.workers[0])
    narrow, out = processes.start_worker(LP_NATIVE_VECTOR_WIDTH="128"), tmp_path / "out"
    specs = ["-t", "unshadowed", "-t", "shadow-map"]
    run = ["run", "cube-on-plane", *specs, "--view-size", "48", "--rounds", "0", "--dask", processes.address, "-o", out]
    processes.wait_for(2)
    code, _, err = start(*run).end()
    assert code == 0, err
    (renderer,) = {row["renderer"] for row in records(out)}
    assert f"that of the study {renderer}; --renderer chooses another" in err
    assert err.count("is left out: its renderer is") == 1
    assert len(records(out)) == 2
    code, shown, err = start(*run, "--any-renderer").end()
    assert code == 0, err
    rows = records(out)
    assert len(rows) == len({row["key"] for row in rows}) == 4
    both = {row["renderer"] for row in rows}
    assert len(both) == 2
    assert [one for one in both if f"cube-on-plane, {one}, best first" not in " ".join(shown.split())] == []
    table = pd.read_csv(out / "table.csv")
    assert sorted(table["renderer"]) == sorted(row["renderer"] for row in rows)
    (other,) = both - {renderer}
    kill(narrow if "128 bits" in renderer else processes.workers[1])
    code, _, err = start(*run, "--renderer", renderer).end()
    assert code == 2
    assert f"its renderer is {other}, that of the study {renderer}" in err


@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes the certificate")
def test_tls_is_dask_s_own(tmp_path: Path, start: Any, records: Records, monkeypatch: pytest.MonkeyPatch) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=shadowbench"]
    subprocess.run([*make, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    pair = {"cert": str(certificate), "key": str(key)}
    tls = {"ca-file": str(certificate), "scheduler": pair, "worker": pair, "client": pair}
    settings = {"distributed": {"comm": {"require-encryption": True, "tls": tls}}}
    (tmp_path / "dask.json").write_text(json.dumps(settings))  # JSON is YAML
    (tmp_path / "dask.json").rename(tmp_path / "dask.yaml")
    monkeypatch.setenv("DASK_CONFIG", str(tmp_path / "dask.yaml"))
    run = ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "48", "--rounds", "0", "-o", tmp_path / "out"]
    with ExitStack() as stack:
        processes = Processes(stack, tmp_path / "dask", "tls")
        code, _, err = start(*run, "--dask", processes.address).end()
        assert code == 0, err
        assert len(records(tmp_path / "out")) == 1
        code, _, err = start(*run, "--dask", processes.address.replace("tls", "tcp")).end()
        assert (code, err.count("\n")) == (2, 1), err
