"""Misbehaving plug-ins: their output is truncated, and their processes end with the worker."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from shadowbench.errors import LONGEST_QUOTE
from shadowbench.measure import plugin_output
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.executor import CellFailed, Limits, Unsupported
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.views import chosen_view

pytestmark = pytest.mark.skipif(os.name != "posix", reason="process groups, and stderr by its number")


@pytest.fixture
def worker(wild: Path) -> Iterator[Worker]:
    """A worker with these limits of time and memory."""
    with Worker([wild], Limits(20.0, 1 << 30)) as worker:
        yield worker


AT = PlacedView(chosen_view("cube-on-plane", 16))


def draw(worker: Worker, items: str) -> Any:
    return worker.call(Session.draw, AT, CellRequest(f"does:{items}"))


@pytest.mark.parametrize("what", ["shout", "shout-in-one-word", "long-fact"])
def test_a_message_without_end_is_cut(worker: Worker, what: str) -> None:
    with pytest.raises(CellFailed) as failure:
        draw(worker, f"what={what}")
    line = str(failure.value)
    assert line.startswith("ValueError: ") and line.isprintable() and len(line) < LONGEST_QUOTE + 100
    assert "…" in line
    assert "(wild.py:" in line or "(rendering.py:" in line


def test_a_reason_without_end_is_cut(worker: Worker) -> None:
    with pytest.raises(Unsupported) as reason:
        draw(worker, "what=decline")
    line = worker.call(Session.unsupported, AT, CellRequest("does:what=decline"))
    assert line == str(reason.value)
    assert line.startswith("reasons reasons ") and line.endswith("…") and len(line) == LONGEST_QUOTE


def test_worker_output_goes_to_stderr_truncated(worker: Worker, capfd: pytest.CaptureFixture[str]) -> None:
    draw(worker, "what=print-much")
    draw(worker, "what=print")
    worker.stop()
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("first words\n") == 2, "of the first draw, on both streams"
    assert err.count("what plug-ins print is cut here, after 100000 characters\n") == 1
    assert "last words" not in err and "loud" not in err
    assert plugin_output.MAX_CHARACTERS <= len(err) <= plugin_output.MAX_CHARACTERS + 100


def test_plug_ins_print_any_character(
    wild: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    with Worker([wild]) as worker:
        draw(worker, "what=print-foreign")
    assert "≥ 影\n" in capfd.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_plug_ins_print_on_where_stderr_is_full(wild: Path) -> None:
    stderr, full = os.dup(2), os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, 2)
    try:
        with Worker([wild]) as worker:
            for what in ("print-much", "print-much", "print"):
                draw(worker, f"what={what}")
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(full)


def test_output_before_a_crash_is_read(worker: Worker, capfd: pytest.CaptureFixture[str]) -> None:
    draw(worker, "what=print")
    with pytest.raises(CellFailed, match="SIGABRT"):
        draw(worker, "what=abort")
    assert "loud\nlouder\n" in capfd.readouterr().err


def test_plug_in_output_while_loading_is_truncated(shadowbench: Callable[..., Any], tmp_path: Path, half: Path) -> None:
    file = tmp_path / "loud.py"
    file.write_text("import sys\nprint('x' * 50_000_000)\nsys.stderr.write('y' * 50_000_000)\n" + half.read_text())
    answer = shadowbench("list", "techniques", "--plugin", file)
    assert answer.code == 0 and "half" in answer.out and "xxx" not in answer.out
    assert answer.err.startswith("x" * 1000) and len(answer.err) < plugin_output.MAX_CHARACTERS + 100
    assert "what plug-ins print is cut here" in answer.err


def test_a_plugin_that_cannot_be_loaded_says_so_in_a_line_that_ends(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    file = tmp_path / "broken.py"
    file.write_text("raise ValueError('why ' * 10_000_000)\n")
    answer = shadowbench("run", "cube-on-plane", "-t", "half", "--plugin", file)
    assert answer.code == 2 and answer.err.count("\n") == 1
    assert len(answer.err) < LONGEST_QUOTE + 200


def sleepers(file: Path) -> list[psutil.Process]:
    """Processes with the environment of this test, whatever their parent."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.pid != os.getpid() and process.environ().get("PIDS") == str(file):
                found.append(process)
        except psutil.Error:
            continue
    return found


def end(file: Path) -> bool:
    """Whether all processes with the environment of this test end soon."""
    for _ in range(200):
        if not sleepers(file):
            return True
        time.sleep(0.1)
    return False


@pytest.fixture
def pids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PIDS", str(tmp_path / "pids"))
    return tmp_path / "pids"


@pytest.mark.parametrize(
    ("misdeed", "reason"),
    [("-and-abort", "SIGABRT"), ("-and-hang", "hung"), ("-and-eat", "ate memory"), ("", None)],
    ids=["it crashes", "it hangs", "it eats memory", "all is well"],
)
def test_processes_of_a_plugin_end_with_the_worker(pids: Path, wild: Path, misdeed: str, reason: str | None) -> None:
    with Worker([wild], Limits(5.0 if reason == "hung" else 100.0, 1 << 30)) as worker:
        if reason is None:
            draw(worker, "what=leave-processes")
            assert len(sleepers(pids)) >= 4, "they run as long as the worker does"
        else:
            with pytest.raises(CellFailed, match=reason):
                draw(worker, f"what=leave-processes{misdeed}")
    assert end(pids)


def test_processes_of_a_plugin_end_when_the_whole_run_is_killed(
    start: Callable[..., Any], pids: Path, wild: Path, tmp_path: Path
) -> None:
    specs = ["-t", "does:what=leave-processes", "-t", "does:what=hang", "--plugin", wild]
    run = start("run", "cube-on-plane", *specs, "--view-size", "16", "-o", tmp_path / "out", PIDS=pids)
    run.until(lambda: pids.exists() and len(pids.read_text().split()) == 2)
    run.process.kill()
    run.process.communicate()
    assert end(pids)
