"""The worker's own side: a session that answers calls over a pipe, and ends with its parent, its children too."""

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
from shadowbench.measure.executor import CellFailed, MemoryExceeded
from shadowbench.measure.pipe import Pipe
from shadowbench.measure.session import Session, Unsupported

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as Connection
else:
    from multiprocessing.connection import Connection

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


def serve(handle: str, parent: str) -> None:
    """Answer calls until nobody is left to make them.

    handle: of the inherited end of the pipe, on which the plug-ins come first; parent: the id of the process that
    started this one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _die_with(int(parent))
    _take_children_along()
    if os.name == "posix":
        os.set_inheritable(int(handle), False)
    logging.getLogger("shadowbench").setLevel(logging.ERROR)  # the parent has said what it left out
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # this process ends by force, which flushes nothing
    pipe = Pipe(Connection(int(handle)))
    try:
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
        except Exception as error:  # whatever a technique raises costs its own cell only
            answer = "error", CellFailed(_told(error))
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


def _die_with(parent: int) -> None:
    """End this process when its parent is killed: while a technique hangs, nobody reads the closed pipe."""
    if sys.platform == "linux":
        # The kernel does it even when a driver's call never gives Python's lock back.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it was killed before the kernel knew
            os._exit(1)
    else:
        threading.Thread(target=lambda: (psutil.Process(parent).wait(), os._exit(1)), daemon=True).start()


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
