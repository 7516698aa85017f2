"""The worker process, and the data sent over its pipe."""

import os
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from shadowbench.errors import InputError
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.executor import CellFailed
from shadowbench.measure.pipe import Pipe
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.views import chosen_view

SCRIPT = """
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.views import chosen_view

print("once")
at = PlacedView(chosen_view("cube-on-plane", 16))
with Worker() as worker:
    drawn = worker.call(Session.draw, at, CellRequest("unshadowed"))
print(drawn.visibility.mean())
"""


def test_a_script_without_a_guard_measures(tmp_path: Path) -> None:
    """From standard input; tests/test_python.py runs a file."""
    (tmp_path / "numpy.py").write_text("raise ImportError('somebody else's, beside which one happens to stand')\n")
    answer = subprocess.run(
        [sys.executable, "-P"], input=SCRIPT, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (answer.returncode, answer.stdout) == (0, "once\n1.0\n"), answer.stderr


COUNTING = '''
"""Notes each spec that this process reads."""

import os

from shadowbench.techniques import spec

read = spec.spec_of


def noted(technique, items, text):
    with open(os.environ["READ"], "a") as file:
        file.write(f"{os.getpid()} {text}\\n")
    return read(technique, items, text)


spec.spec_of = noted
'''


@pytest.mark.slow
def test_each_spec_is_read_once_in_a_process(start: Callable[..., Any], tmp_path: Path, half: Path) -> None:
    (tmp_path / "counting.py").write_text(COUNTING + half.read_text())
    (tmp_path / "study.toml").write_text(
        'scenes = ["cube-on-plane", "stairs"]\nview_size = 16\nrounds = 3\nphases = 2\nreference = "half"\n'
        + "".join(f'[[technique]]\nspec = "{name}"\n' for name in ("half", "shadow-map:size=16", "unshadowed"))
    )
    arguments = ["-s", tmp_path / "study.toml", "--plugin", tmp_path / "counting.py", "-o", tmp_path / "out"]
    code, _, err = start("run", *arguments, READ=tmp_path / "read").end()
    assert code == 0, err
    read = Counter((tmp_path / "read").read_text().splitlines())
    by_process: dict[str, set[str]] = {}
    for process, text in (line.split(" ", 1) for line in read):
        by_process.setdefault(process, set()).add(text.partition(":")[0])
    study = {"half", "shadow-map", "unshadowed"}
    command, worker = sorted(by_process.values(), key=len, reverse=True)
    assert worker == study and command >= study  # which also reads the presets, to print their names
    assert set(read.values()) == {1}


class Wire:
    """A connection to itself, with the data sent but not yet received."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send_bytes(self, data: memoryview) -> None:
        self.sent.append(bytes(data))

    def recv_bytes(self) -> bytes:
        return self.sent.pop(0)

    def recv_bytes_into(self, buffer: bytearray) -> None:
        buffer[:] = self.sent.pop(0)


def test_a_scene_is_sent_once_until_another_is_sent() -> None:
    wire: Any = Wire()
    here, there = Pipe(wire), Pipe(wire)
    first, second = (chosen_view(name, 16) for name in ("cube-on-plane", "stairs"))
    sizes = []
    for view in (first, first, second, first):
        before = sum(map(len, wire.sent))
        here.send(("a call", view))
        sizes.append(sum(map(len, wire.sent)) - before)
    assert sizes[1] < 1000 < min(sizes[0], sizes[2], sizes[3])
    scenes = [there.receive()[1].scene for _ in sizes]
    assert scenes[0] is scenes[1] and len(set(scenes)) == 3
    for scene, view in zip(scenes, (first, first, second, first), strict=True):
        assert scene.name == view.scene.name
        assert np.array_equal(scene.geometry.vertices, view.scene.geometry.vertices)


def test_a_replaced_worker_is_sent_the_scene_again(wild: Path) -> None:
    at = PlacedView(chosen_view("cube-on-plane", 16))
    with Worker([wild]) as worker:
        before = worker.call(Session.draw, at, CellRequest("shadow-map:size=16"))
        with pytest.raises(CellFailed, match="SIGABRT"):
            worker.call(Session.draw, at, CellRequest("does:what=abort"))
        after = worker.call(Session.draw, at, CellRequest("shadow-map:size=16"))
    assert np.array_equal(before.visibility, after.visibility)


def test_a_worker_starts_at_once_and_the_first_call_waits_for_it(tmp_path: Path) -> None:
    """A plug-in that does not exist ends the process after it has been started, so the first call says so."""
    before = psutil.Process().children()
    with Worker([tmp_path / "none.py"]) as worker:
        assert len(psutil.Process().children()) == len(before) + 1
        with pytest.raises(InputError, match=r"none\.py"):
            worker.ready()


def in_a_thread(call: Callable[[], None]) -> None:
    """Make a call in a thread that has ended afterwards, for the kernel too."""
    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    while thread.native_id in {one.id for one in psutil.Process().threads()}:
        pass


def test_a_worker_outlives_the_thread_that_started_it() -> None:
    at = PlacedView(chosen_view("cube-on-plane", 16))
    with Worker() as worker:
        worker.stop()
        in_a_thread(worker.ready)
        started = psutil.Process().children()
        in_a_thread(lambda: worker.call(Session.draw, at, CellRequest("unshadowed")))
        assert psutil.Process().children() == started


THREADED = """
import threading, time
from shadowbench.measure.worker import Worker

worker = Worker()
thread = threading.Thread(target=worker.ready)
thread.start()
thread.join()
print("ready", flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_worker_that_a_thread_started_ends_with_a_killed_process() -> None:
    with subprocess.Popen([sys.executable, "-c", THREADED], stdout=subprocess.PIPE, text=True) as script:
        assert script.stdout is not None
        assert script.stdout.readline() == "ready\n"
        family = psutil.Process(script.pid).children(recursive=True)
        assert len(family) == 2, "the worker, and the guard process in its group"
        script.kill()
        assert psutil.wait_procs(family, timeout=30)[1] == []


def test_no_process_of_a_worker_is_left_to_the_garbage_collector(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONWARNINGS", "always::ResourceWarning")
        with Worker() as worker:
            worker.ready()
    assert "ResourceWarning" not in capfd.readouterr().err


def test_a_view_is_opened_on_first_use() -> None:
    """Calls open it implicitly, in any order, and again after another view."""
    views = [PlacedView(chosen_view(name, 16)) for name in ("cube-on-plane", "stairs")]
    views.append(PlacedView(chosen_view("stairs", 16), "absolute"))
    with Worker() as worker:
        first = [worker.call(Session.surface, at) for at in views]
        again = [worker.call(Session.surface, at) for at in reversed(views)]
    assert all(np.array_equal(a, b) for a, b in zip(first, reversed(again), strict=True))
    assert not np.array_equal(first[0], first[1])
