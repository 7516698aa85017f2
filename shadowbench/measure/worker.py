"""The worker: a process that alone owns a GL context, under a time and a memory limit, and is replaced when it dies."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any, Concatenate

import psutil

from shadowbench.measure.executor import CellFailed, Limits, MemoryExceeded, P, R
from shadowbench.measure.pipe import Pipe
from shadowbench.measure.printed import pass_on
from shadowbench.measure.session import DeviceInfo, Session

_POLL_S = 0.05
_START_S = 60.0

# A program of its own, so that it asks nothing of the one that starts it: a script without a guard, a notebook.
_PROGRAM = "import sys; sys.path[:] = sys.argv[3:]; from shadowbench.measure.serve import serve; serve(*sys.argv[1:3])"


class Worker:
    """A session in a process of its own; after a failure the next call finds a fresh one. Use as a context manager.

    Threads take turns. A fork of this process has no part in the session: it starts one of its own.
    """

    def __init__(self, plugins: Sequence[Path] = (), limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._plugins = [Path(plugin).resolve() for plugin in plugins]
        self._process: subprocess.Popen[bytes] | None = None
        self._info: DeviceInfo | None = None
        self._owner = os.getpid()
        self._turn = threading.RLock()

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def info(self) -> DeviceInfo:
        """The device and its clock, as the process found them when it started; raises as `call` does."""
        if self._info is None:
            self.ready()
        assert self._info is not None
        return self._info

    def call(self, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs) -> R:
        """The answer of `method(session, …)`; raises Unsupported, CellFailed, or the start's ShadowbenchError."""
        with self._turn:
            self.ready()
            answer: R = self._asked((method, arguments, options), self.limits.seconds)
            return answer

    def ready(self) -> None:
        """Start the process where there is none."""
        with self._turn:
            if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
                self._start()

    def _start(self) -> None:
        self.stop()
        ours, theirs = multiprocessing.Pipe()
        with theirs, _deaf_to_ctrl_c():
            self._process = _started(theirs)
            assert self._process.stdout is not None
            self._printed = pass_on(self._process.stdout)
            self._pipe = Pipe(ours)
        self._owner = os.getpid()
        self._info = self._asked(self._plugins, _START_S)

    def _asked(self, message: object, seconds: float) -> Any:
        """The answer to a message; raises it where it is an error, and CellFailed where there is none."""
        try:
            self._pipe.send(message)
            kind, value = self._answer(seconds)
        except (BrokenPipeError, ConnectionResetError, EOFError):
            raise CellFailed(self._obituary()) from None
        except BaseException:  # Ctrl-C, say: the answer that is still to come is not the next call's
            self.stop()
            raise
        if kind == "error":
            raise value
        return value

    def _answer(self, seconds: float) -> tuple[str, Any]:
        assert self._process is not None
        watched = psutil.Process(self._process.pid)
        end = time.monotonic() + seconds
        while not self._pipe.connection.poll(_POLL_S):
            if time.monotonic() > end:
                self.stop()
                raise CellFailed(f"hung: no answer within {seconds:g} s")
            self._check_memory(watched)
        answer: tuple[str, Any] = self._pipe.receive()
        return answer

    def _check_memory(self, watched: psutil.Process) -> None:
        try:
            held = watched.memory_info().rss
        except psutil.NoSuchProcess:
            return  # it died; the pipe says so next
        if held > self.limits.bytes:
            self.stop()
            raise MemoryExceeded(f"ate memory: {held / 2**30:.2f} GiB, allowed are {self.limits.bytes / 2**30:g}")

    def _obituary(self) -> str:
        assert self._process is not None
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5)
        code = self._process.returncode
        self.stop()
        if code is not None and code < 0:
            return f"crashed: {signal.Signals(-code).name}"
        return f"crashed: the worker ended with code {code}"

    def stop(self) -> None:
        """End the process and what its plug-ins started, by force."""
        if self._process is None or self._owner != os.getpid():
            self._process = None
            return
        family = _family(self._process.pid)
        if os.name == "posix":
            with suppress(ProcessLookupError):  # it has not made its group yet, or all of it is gone
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        for process in family:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self._printed.join(1)  # what was printed last
        self._pipe.connection.close()
        self._process = None


def _started(pipe: Connection) -> subprocess.Popen[bytes]:
    """The process, which inherits its end of the pipe; what it and its plug-ins print is its stdout."""
    handle = pipe.fileno()
    inherits: dict[str, Any] = {"pass_fds": [handle]}
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        inherits = {"startupinfo": subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]})}
    return subprocess.Popen(
        # -P: no module is found in the folder where somebody happens to stand, unless this process would find it there
        [sys.executable, "-P", "-c", _PROGRAM, str(handle), str(os.getpid()), *sys.path],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        **inherits,
    )


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
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the process inherits it
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Ctrl-C interrupts nothing within, where a process might be left behind that nobody knows; then it does.

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
