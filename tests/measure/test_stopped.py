"""Runs that are killed or interrupted: the next one resumes, measures nothing twice, and no worker is left behind."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from shadowbench.measure import worker as worker_module
from shadowbench.measure.worker import Worker
from tests.samples import sampled

Records = Callable[..., list[dict[str, Any]]]

GATE = "does:what=gate"
LATE_GATE = "does:what=gate,after=2"  # drawn twice to be scored, so it waits when it is timed
OTHERS = ["unshadowed", "shadow-map:size=64", "half"]

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@pytest.fixture
def arguments(tmp_path: Path, half: Path, wild: Path) -> Callable[..., list[str | Path]]:
    """Arguments of a run with a technique that waits until a file exists, at this position among the techniques."""

    def make(place: int, gate: str = GATE, folder: str = "out") -> list[str | Path]:
        specs = [*OTHERS[:place], gate, *OTHERS[place:]]
        flags = [argument for spec in specs for argument in ("-t", spec)]
        plugins = ["--plugin", half, "--plugin", wild]
        return [
            "run", "cube-on-plane", *flags, *plugins, "--view-size", "64", "--rounds", "2", "-o", tmp_path / folder,
        ]  # fmt: skip

    return make


@pytest.fixture
def undisturbed(start: Any, arguments: Any, tmp_path: Path, records: Records) -> Callable[..., list[dict[str, Any]]]:
    """The score records of the same run without interruption."""

    def run(place: int, gate: str) -> list[dict[str, Any]]:
        (tmp_path / "open").touch()
        code, _, err = start(*arguments(place, gate, "whole"), GATE=tmp_path / "open").end()
        assert code == 0, err
        return records(tmp_path / "whole", "score")

    return run


def by_whomever(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows without their `command`."""
    return [{name: value for name, value in row.items() if name != "command"} for row in rows]


def assert_gone(family: list[psutil.Process]) -> None:
    assert family
    _, alive = psutil.wait_procs(family, timeout=30)
    assert alive == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "gate", "rows"),
    sampled(
        [(0, GATE, 0), (1, GATE, 1), (3, GATE, 3), (1, LATE_GATE, 4), (3, LATE_GATE, 4)],
        [(0, GATE, 0), (3, GATE, 3), (1, LATE_GATE, 4)],
    ),
)
def test_a_killed_run_resumes_with_the_same_results(
    start: Any,
    arguments: Any,
    undisturbed: Any,
    records: Records,
    tmp_path: Path,
    place: int,
    gate: str,
    rows: int,
) -> None:
    out = tmp_path / "out"
    killed = start(*arguments(place, gate), GATE=tmp_path / "shut")
    killed.until(lambda: len(records(out)) == rows and (out / "truth").is_dir())
    family = killed.family()
    killed.process.kill()
    killed.end()
    assert_gone(family)
    before = (out / "rows.jsonl").read_text()
    assert len(before.splitlines()) == rows

    code, _, err = start(*arguments(place, gate), GATE=tmp_path).end()  # a folder exists too: the gate is open
    assert code == 0, err
    assert (out / "rows.jsonl").read_text().startswith(before)
    keys = [(record["kind"], record["key"]) for record in records(out)]
    assert len(keys) == len(set(keys)) == 8
    assert by_whomever(records(out, "score")) == by_whomever(undisturbed(place, gate))


@pytest.mark.slow
def test_a_worker_deep_in_c_does_not_outlive_its_run(
    start: Any, arguments: Any, records: Records, tmp_path: Path
) -> None:
    killed = start(*arguments(1, "does:what=hold"))
    killed.until(lambda: len(records(tmp_path / "out")) == 1)
    family = killed.family()
    killed.process.kill()
    killed.end()
    assert_gone(family)


@pytest.mark.parametrize("gate", [pytest.param(GATE, marks=pytest.mark.slow), LATE_GATE])
def test_ctrl_c_stops_without_a_word_too_many(
    start: Any, arguments: Any, records: Records, tmp_path: Path, gate: str
) -> None:
    out, rows = tmp_path / "out", 1 if gate == GATE else 4
    stopped = start(*arguments(1, gate), GATE=tmp_path / "shut")
    stopped.until(lambda: len(records(out)) == rows)
    family = stopped.family()
    os.killpg(stopped.process.pid, signal.SIGINT)
    code, printed, err = stopped.end()
    assert code == 130
    assert err.splitlines() == ["shadowbench: stopped; repeat the command to resume"]
    assert printed == ""
    assert_gone(family)
    assert len(records(out)) == rows
    code, _, err = start(*arguments(1, gate), "--json", GATE=tmp_path).end()
    assert code == 0, err
    assert len(records(out)) == 8


@pytest.mark.slow
def test_ctrl_c_while_the_worker_starts_is_silent_too(start: Any, arguments: Any) -> None:
    stopped = start(*arguments(1), GATE="shut")

    def spawned() -> bool:
        commands = [" ".join(process.cmdline()) for process in stopped.family() if process.is_running()]
        return any("measure.serve" in command for command in commands)

    stopped.until(spawned)
    os.killpg(stopped.process.pid, signal.SIGINT)
    code, _, err = stopped.end()
    assert code == 130
    assert err.splitlines() == ["shadowbench: stopped; repeat the command to resume"]


def test_ctrl_c_waits_until_the_worker_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a second thread, as of a progress bar: it receives a signal that the main thread blocks."""
    started = []
    start = worker_module.spawn

    def interrupted(pipe: Any, module: str) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)  # Python interrupts here, if anywhere
        started.append(start(pipe, module))
        return started[-1]

    monkeypatch.setattr(worker_module, "spawn", interrupted)
    done = threading.Event()
    other = threading.Thread(target=done.wait)
    other.start()
    try:
        with pytest.raises(KeyboardInterrupt), Worker() as worker:
            worker.ready()
    finally:
        done.set()
        other.join()
    assert [process.returncode for process in started] == [-signal.SIGKILL], "none is left behind"


@pytest.mark.slow
def test_a_row_that_was_torn_is_measured_again(
    start: Any, arguments: Any, undisturbed: Any, records: Records, tmp_path: Path
) -> None:
    whole = undisturbed(1, GATE)
    file = tmp_path / "whole" / "rows.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:2]) + lines[2][:50])
    code, out, err = start(*arguments(1, GATE, "whole"), "--json", GATE=tmp_path).end()
    assert code == 0, err
    assert list(json.loads(out)) == ["cube-on-plane"]
    assert by_whomever(records(tmp_path / "whole", "score")) == by_whomever(whole)
