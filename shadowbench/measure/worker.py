"""The worker process: it alone owns a GL context, under a time and a memory limit, and is replaced when it dies."""

import ctypes
import io
import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import psutil

import shadowbench
from shadowbench.errors import ShadowbenchError, message, quoted
from shadowbench.gl.program import ShaderError
from shadowbench.measure.printed import pass_on
from shadowbench.measure.session import Session, Unsupported

_POLL_S = 0.05
_START_S = 60.0
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


class CellFailed(ShadowbenchError):
    """A call that the worker did not answer: it raised, crashed, hung or ate memory; the text says which."""


class AteMemory(CellFailed):
    """The worker grew past its limit."""


@dataclass(frozen=True)
class Limits:
    """Of one call: seconds, and bytes of resident memory of the worker."""

    seconds: float = 120.0
    bytes: int = 8 << 30


class Worker:
    """A handle on the worker. `call` names a method of Session; after a failure the next call finds a fresh process.

    Use as a context manager. After `generation` has changed, scene and view must be loaded again.
    """

    def __init__(self, plugins: Sequence[Path] = (), limits: Limits = Limits()) -> None:
        self.limits = limits
        self.generation = 0
        self._plugins = [Path(plugin).resolve() for plugin in plugins]
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._printed: threading.Thread | None = None

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def call(self, method: str, *arguments: Any) -> Any:
        """The answer of Session.method(*arguments); raises Unsupported, CellFailed, or the start's ShadowbenchError."""
        self.ready()
        assert self._pipe is not None
        try:
            self._pipe.send((method, arguments))
            return self._answer(self.limits.seconds)
        except (BrokenPipeError, ConnectionResetError, EOFError):
            raise CellFailed(self._obituary()) from None

    def ready(self) -> None:
        """Start the process where there is none; `generation` counts the starts."""
        if self._process is None or not self._process.is_alive():
            self._start()

    def _start(self) -> None:
        # Spawned, not forked: a GL context or Embree's threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        printed, printing = context.Pipe(duplex=False)
        self._process = context.Process(target=_serve, args=(theirs, printing, self._plugins), daemon=True)
        with _deaf_to_ctrl_c():
            self._process.start()
        theirs.close()
        printing.close()
        self._printed = pass_on(printed) if os.name == "posix" else None
        self.generation += 1
        try:
            self._answer(_START_S)
        except (EOFError, ConnectionResetError):
            raise CellFailed(self._obituary()) from None

    def _answer(self, seconds: float) -> Any:
        assert self._process is not None and self._pipe is not None
        watched = psutil.Process(self._process.pid)
        end = time.monotonic() + seconds
        while not self._pipe.poll(_POLL_S):
            if time.monotonic() > end:
                self.stop()
                raise CellFailed(f"hung: no answer within {seconds:g} s")
            self._check_memory(watched)
        kind, value = self._pipe.recv()
        if kind == "error":
            raise value
        return value

    def _check_memory(self, watched: psutil.Process) -> None:
        try:
            held = watched.memory_info().rss
        except psutil.NoSuchProcess:
            return  # it died; the pipe says so next
        if held > self.limits.bytes:
            self.stop()
            raise AteMemory(f"ate memory: {held / 2**30:.2f} GiB, allowed are {self.limits.bytes / 2**30:g}")

    def _obituary(self) -> str:
        assert self._process is not None
        self._process.join(5)
        code = self._process.exitcode
        self.stop()
        if code is not None and code < 0:
            return f"crashed: {signal.Signals(-code).name}"
        return f"crashed: the worker ended with code {code}"

    def stop(self) -> None:
        """End the worker and what its plug-ins started, by force."""
        if self._process is not None and self._process.pid is not None:
            family = _family(self._process.pid)
            if os.name == "posix":
                with suppress(ProcessLookupError):  # it has not made its group yet, or all of it is gone
                    os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()
            self._process.join()
            for process in family:
                with suppress(psutil.NoSuchProcess):
                    process.kill()
        if self._printed is not None:
            self._printed.join(1)  # what was printed last
        if self._pipe is not None:
            self._pipe.close()
        self._process = self._pipe = self._printed = None


def _family(worker: int) -> list[psutil.Process]:
    """The processes below a worker."""
    try:
        return psutil.Process(worker).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """A process started within never hears Ctrl-C, not even while it imports; this one hears it afterwards."""
    with _ctrl_c_later():
        if not hasattr(signal, "pthread_sigmask"):  # Windows: the worker says so itself, a little later
            yield
            return
        resource_tracker.ensure_running()  # starting it unblocks the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the process inherits it
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Ctrl-C interrupts nothing within, where this process hands over what the new one waits for; then it does.

    Blocking the signal is not enough: another thread takes it, and Python interrupts the main one all the same.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[tuple[int, FrameType | None]] = []
    handler = signal.signal(signal.SIGINT, lambda *call: heard.append(call))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if heard and callable(handler):
        handler(*heard[0])


def _die_with_parent() -> None:
    """End this process when its parent is killed: while a technique hangs, nobody reads the closed pipe."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    if sys.platform == "linux":
        # The kernel does it even when a driver's call never gives Python's lock back.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent.pid:  # it was killed before the kernel knew
            os._exit(1)
    else:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


_GUARD = """
import os, signal, sys, time
while os.getppid() == int(sys.argv[1]):
    time.sleep(0.2)
os.killpg(0, signal.SIGKILL)
"""


def _take_children_along() -> None:
    """Have what plug-ins start end with this process, however it ends: by a group of its own, and a guard in that.

    What leaves the group for a session of its own ends only where `Worker.stop` still finds it below this process: on
    Linux also when its own parent is gone, but not when this process crashes or the whole run is killed.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)  # orphans become children of this process, not of init
    if os.name == "posix":
        os.setpgid(0, 0)
        quiet = subprocess.DEVNULL
        guard = [sys.executable, "-I", "-S", "-c", _GUARD, str(os.getpid())]
        subprocess.Popen(guard, stdin=quiet, stdout=quiet, stderr=quiet)


def _serve(pipe: Connection, printing: Connection, plugins: list[Path]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _die_with_parent()
    _take_children_along()
    logging.getLogger("shadowbench").setLevel(logging.ERROR)  # the parent has said what it left out
    if os.name == "posix":
        # What a plug-in prints must not get between the parent's results, and there may be much of it.
        os.dup2(printing.fileno(), 2)
    os.dup2(2, 1)
    printing.close()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # this process ends by force, which flushes nothing
    try:
        session = Session(plugins)
    except ShadowbenchError as error:
        pipe.send(("error", error))
        return
    pipe.send(("ready", None))
    while True:
        try:
            method, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = ("answer", getattr(session, method)(*arguments))
        except Unsupported as reason:
            answer = ("error", reason)
        except MemoryError:
            answer = ("error", AteMemory("ate memory: an allocation failed"))
        except Exception as error:  # whatever a technique raises costs its own cell only
            answer = ("error", CellFailed(_told(error)))
        pipe.send(answer)


def _told(error: Exception) -> str:
    """An exception in one line, with the place in the plug-in where it has one; the whole of it goes to stderr."""
    if isinstance(error, ShaderError):
        print(error, file=sys.stderr)
    frames = traceback.extract_tb(error.__traceback__)
    package = str(Path(shadowbench.__file__).parent)
    ours = [frame for frame in frames if not frame.filename.startswith(package)]
    place = (ours or frames)[-1]
    first_line = quoted((message(error).splitlines() or [""])[0])
    return f"{type(error).__name__}: {first_line} ({os.path.basename(place.filename)}:{place.lineno})"
