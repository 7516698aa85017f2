"""The worker: a process that owns the GL context, under a time and memory limit, and is replaced when it dies."""

import copyreg
import ctypes
import io
import logging
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import psutil

from shadowbench.errors import ShadowbenchError, Unsupported, message, quoted
from shadowbench.files import PACKAGE
from shadowbench.measure.plugin_output import forward_output
from shadowbench.scenes.model import Scene

if TYPE_CHECKING:
    from shadowbench.measure.session import Session

P = ParamSpec("P")
R = TypeVar("R")

_POLL_S = 0.05
_START_S = 60.0

# Not multiprocessing, which imports the caller's main module: a notebook, or a script without a __main__ guard.
_PROGRAM = "import sys; sys.path[:] = sys.argv[3:]; from {} import serve; serve(*sys.argv[1:3])"


class CellFailed(ShadowbenchError):
    """Raised when a call raised an exception, crashed, hung or exceeded its memory; the message says which."""


class MemoryExceeded(CellFailed):
    """Raised when the drawing process exceeded its memory limit."""


@dataclass(frozen=True)
class Limits:
    """Limits of one call: seconds, and bytes of resident memory of the drawing process."""

    seconds: float = 120.0
    bytes: int = 8 << 30


@dataclass(frozen=True)
class DeviceInfo:
    """Facts about what draws: for OpenGL, the device."""

    renderer: str
    vendor: str
    version: int
    software: bool
    clock: str
    max_map_size: int
    subpixel_bits: int
    pipeline_statistics: bool
    clip_control: bool


class Pipe:
    """One end of a connection. The other end keeps the last scene sent, which is then referred to, not sent again."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._scene: Scene | None = None

    def send(self, thing: object) -> None:
        """Pickle and send a thing. Raises BrokenPipeError or ConnectionResetError if the other end is closed."""
        buffer = io.BytesIO()
        pickler = pickle.Pickler(buffer, pickle.HIGHEST_PROTOCOL)
        pickler.dispatch_table = copyreg.dispatch_table | {Scene: self._reduced}
        pickler.dump(thing)
        self.connection.send_bytes(buffer.getbuffer())

    def receive(self) -> Any:
        """Wait for the next thing and return it. Raises EOFError if the other end is closed."""
        return self.connection.recv()

    def _reduced(self, scene: Scene) -> tuple[Any, ...]:
        """What a scene is pickled as: its bytes, or nothing if the other end has it."""
        if scene is self._scene:
            return _last_scene, ()
        self._scene = scene
        return _last_scene, (pickle.dumps(scene, pickle.HIGHEST_PROTOCOL),)


_received: dict[str, Scene] = {}  # the last scene


def _last_scene(pickled: bytes | None = None) -> Scene:
    if pickled is not None:
        _received["scene"] = pickle.loads(pickled)
    return _received["scene"]


class Worker:
    """A session in a separate process; after a failure the next call starts a new one.

    As a context manager it starts the process at once, without waiting until that has imported what it needs.
    Calls from several threads are serialised. A fork of the calling process does not share the session: it starts its
    own.
    """

    def __init__(self, plugins: Sequence[Path] = (), limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._plugins = [Path(plugin).resolve() for plugin in plugins]
        self._process: subprocess.Popen[bytes] | None = None
        self._output_thread: threading.Thread | None = None
        self._info: DeviceInfo | None = None
        self._owner = os.getpid()
        self._turn = threading.RLock()

    def __enter__(self) -> "Worker":
        try:
            self._begin()
        except BaseException:  # such as KeyboardInterrupt
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def info(self) -> DeviceInfo:
        """Device facts from the start of the process. Raises as `call` does."""
        if self._info is None:
            self.ready()
        assert self._info is not None
        return self._info

    def call(self, method: "Callable[Concatenate[Session, P], R]", *arguments: P.args, **options: P.kwargs) -> R:
        """Result of `method(session, …)`. Raises Unsupported, CellFailed, or ShadowbenchError if it cannot start."""
        with self._turn:
            self.ready()
            answer: R = self._request(self.limits.seconds, (method, arguments, options))
            return answer

    def ready(self) -> None:
        """Start the process unless it runs, and wait until it can draw."""
        with self._turn:
            if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
                self._begin()
            if self._info is None:
                self._info = self._request(_START_S)

    def _begin(self) -> None:
        """Start the process, which answers with its DeviceInfo."""
        self.stop()
        ours, theirs = multiprocessing.Pipe()
        with theirs, sigint_blocked():
            self._pipe = Pipe(ours)
            self._process = spawn(theirs, "shadowbench.measure.worker")
            assert self._process.stdout is not None
            self._output_thread = forward_output(self._process.stdout)
        self._owner, self._info = os.getpid(), None
        with suppress(BrokenPipeError, ConnectionResetError):  # it has ended; waiting for the answer tells
            self._pipe.send(self._plugins)

    def _request(self, seconds: float, *messages: object) -> Any:
        """Send messages and wait for an answer. Raises the answer if it is an error, CellFailed if there is none."""
        try:
            for message in messages:
                self._pipe.send(message)
            kind, value = self._answer(seconds)
        except (BrokenPipeError, ConnectionResetError, EOFError):
            raise CellFailed(self._exit_reason()) from None
        except BaseException:  # such as KeyboardInterrupt: the pending answer must not be read by the next call
            self.stop()
            raise
        if kind == "error":
            raise value
        return value

    def _answer(self, seconds: float) -> tuple[str, Any]:
        assert self._process is not None
        watched, most = psutil.Process(self._process.pid), self.limits.bytes
        end = time.monotonic() + seconds
        while not self._pipe.connection.poll(_POLL_S):
            used = 0
            with suppress(psutil.NoSuchProcess):  # it died; the next read of the pipe reports that
                used = watched.memory_info().rss
            late = time.monotonic() > end
            if used > most or late:
                self.stop()
            if used > most:
                raise MemoryExceeded(f"ate memory: {used / 2**30:.2f} GiB, allowed are {most / 2**30:g}")
            if late:
                raise CellFailed(f"hung: no answer within {seconds:g} s")
        answer: tuple[str, Any] = self._pipe.receive()
        return answer

    def _exit_reason(self) -> str:
        assert self._process is not None
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5)
        code = self._process.returncode
        self.stop()
        if code is not None and code < 0:
            return f"crashed: {signal.Signals(-code).name}"
        return f"crashed: the worker ended with code {code}"

    def stop(self) -> None:
        """Kill the process and all processes that its plug-ins started."""
        if self._process is None or self._owner != os.getpid():
            self._process = None
            return
        family: list[psutil.Process] = []
        with suppress(psutil.NoSuchProcess):
            family = psutil.Process(self._process.pid).children(recursive=True)
        with suppress(ProcessLookupError):  # no process group yet, or no longer
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        for process in family:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        if self._output_thread is not None:
            self._output_thread.join(1)  # forwards the last output
        self._pipe.connection.close()
        self._process = None


def spawn(pipe: Connection, module: str) -> subprocess.Popen[bytes]:
    """Start `serve` of a module in a process that inherits its end of the pipe.

    Its stdout also takes the output of plug-ins. Called within `sigint_blocked`, since Ctrl-C is for the caller.
    """
    handle = pipe.fileno()
    return subprocess.Popen(
        # -P: the current folder is not searched for modules, unless this process's sys.path has it
        [sys.executable, "-P", "-c", _PROGRAM.format(module), str(handle), str(os.getpid()), *sys.path],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        pass_fds=[handle],
    )


@contextmanager
def sigint_blocked() -> Iterator[None]:
    """Blocks SIGINT in a process started in this block, even while it imports; this process handles it afterwards."""
    with _sigint_deferred():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by the new process
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _sigint_deferred() -> Iterator[None]:
    """Defers SIGINT to the end of the block, so that no half-registered process is left behind.

    Blocking the signal is not enough: another thread would receive it, and Python would still interrupt the main one.
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


_PR_SET_CHILD_SUBREAPER = 36


def serve(handle: str, parent: str) -> None:
    """Answer calls until the pipe is closed, whose first message lists the plug-ins.

    handle: file descriptor or handle of the inherited pipe end; parent: id of the process that started this one.
    """
    from shadowbench.measure.session import Session

    pipe = connected(handle)
    try:
        die_with(int(parent))
        plugins: list[Path] = pipe.receive()
        session = Session(plugins)
    except ShadowbenchError as error:
        pipe.send(("error", error))
        return
    pipe.send(("answer", session.info()))
    while True:
        try:
            method, arguments, options = pipe.receive()
        except EOFError:
            return
        answer: tuple[str, Any]
        try:
            answer = "answer", method(session, *arguments, **options)
        except Unsupported as reason:
            answer = "error", reason
        except MemoryError:
            answer = "error", MemoryExceeded("ate memory: an allocation failed")
        except Exception as error:  # any exception of a technique fails its own cell only
            answer = "error", CellFailed(_error_line(error))
        pipe.send(answer)


def connected(handle: str) -> Pipe:
    """The pipe to the process that started this one, and that decides when this one ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.set_inheritable(int(handle), False)
    logging.getLogger("shadowbench").setLevel(logging.ERROR)  # the parent has logged the same warnings
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # As `forward_output` decodes; by lines, since this process is killed in the end, which flushes nothing.
            stream.reconfigure(encoding="utf-8", errors="backslashreplace", line_buffering=True)
    return Pipe(Connection(int(handle)))


def _error_line(error: Exception) -> str:
    """One line for an exception, with its location in the plug-in if there is one. Prints shader errors in full."""
    from shadowbench.gl.program import ShaderError

    if isinstance(error, ShaderError):
        print(error, file=sys.stderr)
    frames = traceback.extract_tb(error.__traceback__)
    package = str(PACKAGE)
    ours = [frame for frame in frames if not frame.filename.startswith(package)]
    place = (ours or frames)[-1]
    first_line = quoted((message(error).splitlines() or [""])[0])
    return f"{type(error).__name__}: {first_line} ({os.path.basename(place.filename)}:{place.lineno})"


_GUARD = """
import os, select, signal, sys
worker, *parent = map(int, sys.argv[1:])
while os.getppid() == worker and not select.select(parent, [], [], 0.2)[0]:
    pass
os.killpg(0, signal.SIGKILL)
"""


def die_with(parent: int) -> None:
    """End this process when its parent ends, and the processes that plug-ins start when this one ends.

    By a process group with a guard process in it, which works even while a driver call holds the GIL. Not by the
    kernel's parent-death signal: it is sent when the thread that started this process ends. A process that leaves the
    group (setsid) is killed only if `Worker.stop` still finds it among the descendants of this one: on Linux even if
    its own parent is gone, but not if this process crashes or the whole run is killed. Raises ShadowbenchError.
    """
    watched = _process_file(parent)
    if os.getppid() != parent:  # it ended before it was watched
        os._exit(1)
    if not watched:
        threading.Thread(target=lambda: (psutil.Process(parent).wait(), os._exit(1)), daemon=True).start()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)  # adopt orphans in place of init
    os.setpgid(0, 0)
    guard = [sys.executable, "-I", "-S", "-c", _GUARD, str(os.getpid()), *map(str, watched)]
    quiet = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_RDWR, 0) for stream in range(3)]
    os.posix_spawn(sys.executable, guard, os.environ, file_actions=quiet)  # Popen would warn that nobody waits
    for file in watched:
        os.close(file)


def _process_file(process: int) -> list[int]:
    """An inheritable file descriptor that is readable once a process has ended; none where the system has no such."""
    try:
        file = os.pidfd_open(process)
    except (AttributeError, OSError):  # not Linux, or before 5.3
        return []
    os.set_inheritable(file, True)
    return [file]
