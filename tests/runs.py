"""A pytest plugin with fixtures for studies, for plug-ins, correct and misbehaving, and for runs of both."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import psutil
import pytest

from shadowbench.measure.campaign import Campaign
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.rows import Result
from shadowbench.measure.worker import Worker
from shadowbench.plugin.base import Technique
from shadowbench.plugin.registry import techniques
from shadowbench.results.frame import Run
from shadowbench.results.summary import Summary, summaries

SMALL = """
scenes = ["cube-on-plane"]
view_size = 64
rounds = 1
reference = "unshadowed"
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "shadow-map:size=64"
"""

# A scene file whose box tests move.
CHANGING = """
name = "changing"
[camera]
position = [3.0, 3.0, 4.0]
target = [0.0, 0.3, 0.0]
fov_y = 36.0
[[light]]
name = "sun"
kind = "directional"
direction = [0.5, -1.0, -0.3]
[[mesh]]
shape = "plane"
scale = 8.0
[[mesh]]
shape = "box"
translate = [0.0, 0.5, 0.0]
"""

HALF = '''
"""A technique in one file, its shader inline."""

from shadowbench.plugin.base import Technique, TechniqueParams, param

SHADER = """
uniform float level;
out float visibility;
void main() { visibility = level; }
"""


class Half(Technique):
    """The same half-light everywhere."""

    name = "half"

    class Params(TechniqueParams):
        """Parameters of half."""

        level: float = param(0.5, "visibility of every pixel", ge=0, le=1)

    def build(self, stage):
        self.program = stage.program("fullscreen.vert", SHADER)
        self.program.set(level=self.params.level)
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame):
        with frame.timed("fill"):
            self.fullscreen.draw(self.target, frame.surface.inputs)
        return self.visibility
'''

WILD = (
    HALF.replace("Half", "Wild").replace('"half"', '"wild"')
    + '''
import ctypes
import os
import subprocess
import sys
import time

import numpy as np

LEAKED = []


class Does(Wild):
    """Half-light, and whatever a plug-in can do wrong, after so many draws that went well."""

    name = "does"

    class Params(Wild.Params):
        """Parameters of does."""

        what: str = param("nothing", "the misdeed")
        after: int = param(0, "draws that go well")

    @classmethod
    def unsupported(cls, params, view, device):
        return "reasons\\n" * 2 if params.what == "decline" else None

    def build(self, stage):
        super().build(stage)
        if self.params.what == "leak-memory":
            LEAKED.append(np.ones(64 << 20))
            time.sleep(0.3)

    def draw(self, frame):
        self.draws = getattr(self, "draws", 0) + 1
        texture = super().draw(frame)
        if self.draws <= self.params.after:
            return texture
        returned = getattr(self, "do_" + self.params.what.replace("-", "_"))(texture)
        return texture if returned is None else returned

    def do_nothing(self, texture):
        return texture

    do_leak_memory = do_nothing

    def do_abort(self, texture):
        os.abort()

    def do_leave(self, texture):
        os._exit(0)

    def do_exit(self, texture):
        sys.exit(0)

    def do_hang(self, texture):
        while True:
            time.sleep(1)

    def do_eat(self, texture):
        held = [np.ones(8 << 20) for _ in range(20)]  # more than the limit of 1 GiB
        while held:
            time.sleep(1)

    def do_raise(self, texture):
        raise ZeroDivisionError("as planned\\non two lines")

    def do_nan(self, texture):
        texture.write(np.full(texture.size, np.nan, dtype=np.float32))

    def do_bright(self, texture):
        texture.write(np.full(texture.size, 2.0, dtype=np.float32))

    def do_small(self, texture):
        return texture.ctx.texture((8, 8), 1, data=bytes(256), dtype="f4")

    def do_gl_error(self, texture):
        self.fullscreen.program.device.raw("glUniform1i", 12345, 0)

    def do_litter(self, texture):
        # State that OpenGL keeps: the next to draw must not inherit it.
        context = texture.ctx
        context.enable(context.BLEND | context.CULL_FACE | context.DEPTH_TEST | context.RASTERIZER_DISCARD)
        context.blend_func = context.ZERO, context.ZERO
        context.depth_func = ">"
        context.front_face = "cw"
        context.viewport = context.scissor = (0, 0, 3, 3)
        context.polygon_offset = 100.0, 100.0
        context.wireframe = True
        self.target.color_mask = False, False, False, False
        self.target.depth_mask = False

    def do_print(self, texture):
        print("loud")
        os.write(1, b"louder\\n")

    def do_print_foreign(self, texture):
        print("≥ 影")

    def do_print_much(self, texture):
        for stream in (1, 2):
            os.write(stream, b"first words\\n")
        for _ in range(50):
            sys.stdout.write("much " * 200_000)
        sys.stderr.write("\\nlast words\\n")

    def do_leave_processes(self, texture):
        # A child; a grandchild whose parent is gone; one that was forked.
        sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
        orphan = "import subprocess, sys; subprocess.Popen(sys.argv[1:]).pid"
        pids = [subprocess.Popen(sleep).pid]
        subprocess.run([sys.executable, "-c", orphan, *sleep], check=True)
        forked = os.fork()
        if forked == 0:
            time.sleep(600)
            os._exit(0)
        with open(os.environ["PIDS"], "w") as file:
            file.write(" ".join(map(str, [*pids, forked])))

    def do_leave_processes_and_abort(self, texture):
        self.do_leave_processes(texture)
        os.abort()

    def do_leave_processes_and_hang(self, texture):
        self.do_leave_processes(texture)
        # In a session of its own, where no signal to the worker's group reaches it.
        sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
        subprocess.Popen(sleep, start_new_session=True)
        if sys.platform == "linux":  # nor is it found below its parent, which is gone
            orphan = "import subprocess, sys; subprocess.Popen(sys.argv[1:], start_new_session=True)"
            subprocess.run([sys.executable, "-c", orphan, *sleep], check=True)
        time.sleep(600)

    def do_leave_processes_and_eat(self, texture):
        self.do_leave_processes(texture)
        self.do_eat(texture)

    def facts(self):
        return {"odd": float("nan") if self.params.what == "odd-facts" else 1.0}

    def do_odd_facts(self, texture):
        return texture

    def do_gate(self, texture):
        while not os.path.exists(os.environ["GATE"]):
            time.sleep(0.01)

    def do_lack(self, texture):
        open(os.path.join(os.path.dirname(__file__), "needed")).close()

    def do_hold(self, texture):
        # A call into C that never returns, and keeps Python's lock all the time.
        ctypes.PyDLL(None).sleep(600)
'''
)


@dataclass
class Bench:
    """A worker with plug-ins; runs studies on it in this process."""

    worker: Worker
    plugins: Sequence[Path]
    calls: list[str] = field(default_factory=list)

    @cached_property
    def techniques(self) -> Mapping[str, type[Technique]]:
        return techniques(self.plugins)

    def campaign(self, folder: Path, reporter: Any, **options: Any) -> Campaign:
        """A campaign of the worker."""
        return Campaign(folder, GLDrawer(self.worker), reporter, **options)


@pytest.fixture(scope="session")
def plugin_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plugins")
    (folder / "half.py").write_text(HALF)
    (folder / "wild.py").write_text(WILD)
    return folder


@pytest.fixture(scope="session")
def half(plugin_folder: Path) -> Path:
    """A file that defines one technique, `half`."""
    return plugin_folder / "half.py"


@pytest.fixture(scope="session")
def wild(plugin_folder: Path) -> Path:
    """A file that defines `does:what=…`, which misbehaves."""
    return plugin_folder / "wild.py"


@pytest.fixture(scope="session")
def bench(half: Path, wild: Path) -> Iterator[Bench]:
    """One worker for all tests."""
    plugins = (half, wild)
    with Worker(plugins) as worker:
        bench = Bench(worker, plugins)
        call = worker.call

        def noted(method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
            bench.calls.append(method.__name__)
            return call(method, *arguments, **options)

        worker.call = noted  # type: ignore[method-assign]
        yield bench


@dataclass
class Started:
    """A `shadowbench` process in its own session, so that Ctrl-C reaches only it and its worker."""

    process: subprocess.Popen[str]

    def family(self) -> list[psutil.Process]:
        return psutil.Process(self.process.pid).children(recursive=True)

    def until(self, reached: Callable[[], bool]) -> None:
        """Wait until a condition is true; fails if the process ends before."""
        while not reached():
            assert self.process.poll() is None, self.process.communicate()
            time.sleep(0.005)

    def end(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=120)
        return self.process.returncode, out, err


@contextmanager
def starting() -> Iterator[Callable[..., Started]]:
    """Starts `shadowbench …`; processes that are left at the end are killed."""
    started: list[Started] = []

    def begin(*arguments: str | Path, **environment: str | Path) -> Started:
        process = subprocess.Popen(
            [sys.executable, "-m", "shadowbench", *map(str, arguments)],
            env=os.environ | {name: str(value) for name, value in environment.items()},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(Started(process))
        return started[-1]

    yield begin
    for one in started:
        if one.process.poll() is None:
            for process in [*one.family(), psutil.Process(one.process.pid)]:
                process.kill()
            one.process.communicate()


@pytest.fixture
def start() -> Iterator[Callable[..., Started]]:
    """Starts `shadowbench …` for a test."""
    with starting() as begin:
        yield begin


@pytest.fixture(scope="module")
def start_any() -> Iterator[Callable[..., Started]]:
    """Starts `shadowbench …` for all tests of a file."""
    with starting() as begin:
        yield begin


@pytest.fixture(scope="session")
def records() -> Callable[..., list[dict[str, Any]]]:
    """The records of a run folder in the order of the file, of one kind if asked."""

    def read(folder: Path, kind: str | None = None) -> list[dict[str, Any]]:
        file = folder / "rows.jsonl"
        lines = file.read_text(encoding="utf-8").split("\n")[:-1] if file.exists() else []
        return [record for record in map(json.loads, lines) if kind in (None, record["kind"])]

    return read


def summaries_of(*results: Result) -> dict[str, Summary]:
    """The summaries of a run with these cells, by scene."""
    keyed = [({**one.score, "key": str(number)}, one.last_time) for number, one in enumerate(results)]
    times = {score["key"]: time for score, time in keyed if time is not None}
    run = Run("run", Path("run"), {}, tuple(score for score, _ in keyed), times, frozenset(), 0, 0, False)
    return {summary.scene: summary for summary in summaries(run)}
