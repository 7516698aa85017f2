"""Main loop of the worker process: answers calls over a pipe, and dies with its parent, its children included."""

import ctypes
import io
import logging
import os
import signal
import subprocess
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

import psutil

import shadowbench
from shadowbench.errors import ShadowbenchError, message, quoted
from shadowbench.gl.program import ShaderError
from shadowbench.measure.executor import CellFailed, MemoryExceeded, Unsupported
from shadowbench.measure.pipe import Pipe
from shadowbench.measure.session import Session

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as Connection
else:
    from multiprocessing.connection import Connection

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


def serve(handle: str, parent: str) -> None:
    """Answer calls until the pipe is closed, whose first message lists the plug-ins; arguments: see `connected`."""
    pipe = connected(handle, parent)
    _make_process_group()
    try:
        plugins: list[Path] = pipe.receive()
        session = Session(plugins)
    except ShadowbenchError as error:
        pipe.send(("error", error))
        return
    pipe.send(("answer", session.info()))
    import scipy.spatial  # noqa: F401  # for hulls of casters: while the parent works on, and in no build that is timed

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


def connected(handle: str, parent: str) -> Pipe:
    """The pipe to the process that started this one, and that decides when this one ends.

    handle: file descriptor or handle of the inherited pipe end; parent: id of that process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _die_with(int(parent))
    if os.name == "posix":
        os.set_inheritable(int(handle), False)
    logging.getLogger("shadowbench").setLevel(logging.ERROR)  # the parent has logged the same warnings
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # this process is killed in the end, which flushes nothing
    return Pipe(Connection(int(handle)))


def _error_line(error: Exception) -> str:
    """One line for an exception, with its location in the plug-in if there is one. Prints shader errors in full."""
    if isinstance(error, ShaderError):
        print(error, file=sys.stderr)
    frames = traceback.extract_tb(error.__traceback__)
    package = str(Path(shadowbench.__file__).parent)
    ours = [frame for frame in frames if not frame.filename.startswith(package)]
    place = (ours or frames)[-1]
    first_line = quoted((message(error).splitlines() or [""])[0])
    return f"{type(error).__name__}: {first_line} ({os.path.basename(place.filename)}:{place.lineno})"


def _die_with(parent: int) -> None:
    """Kill this process when its parent dies; a hanging technique would never notice the closed pipe."""
    if sys.platform == "linux":
        # By the kernel, which works even while a driver call holds the GIL.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before the prctl call
            os._exit(1)
    else:
        threading.Thread(target=lambda: (psutil.Process(parent).wait(), os._exit(1)), daemon=True).start()


_GUARD = """
import os, signal, sys, time
while os.getppid() == int(sys.argv[1]):
    time.sleep(0.2)
os.killpg(0, signal.SIGKILL)
"""


def _make_process_group() -> None:
    """Make processes that plug-ins start die with this one, by a process group with a guard process in it.

    A process that leaves the group (setsid) is killed only if `Worker.stop` still finds it among the descendants of
    this one: on Linux even if its own parent is gone, but not if this process crashes or the whole run is killed.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)  # adopt orphans in place of init
    if os.name == "posix":
        os.setpgid(0, 0)
        quiet = subprocess.DEVNULL
        guard = [sys.executable, "-I", "-S", "-c", _GUARD, str(os.getpid())]
        subprocess.Popen(guard, stdin=quiet, stdout=quiet, stderr=quiet)
