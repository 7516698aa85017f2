"""Main loop of the worker process: answers calls over a pipe, and dies with its parent, its children included."""

import ctypes
import io
import logging
import os
import signal
import sys
import threading
import traceback
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psutil

from shadowbench.errors import ShadowbenchError, Unsupported, message, quoted
from shadowbench.files import PACKAGE
from shadowbench.gl.program import ShaderError
from shadowbench.measure.drawer import CellFailed, MemoryExceeded
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Pipe

_PR_SET_CHILD_SUBREAPER = 36


def serve(handle: str, parent: str) -> None:
    """Answer calls until the pipe is closed, whose first message lists the plug-ins.

    handle: file descriptor or handle of the inherited pipe end; parent: id of the process that started this one.
    """
    pipe = connected(handle)
    try:
        die_with(int(parent))
        plugins: list[Path] = pipe.receive()
        session = Session(plugins)
    except ShadowbenchError as error:
        pipe.send(("error", error))
        return
    pipe.send(("answer", session.info()))
    import scipy.spatial  # noqa: F401  # for hulls of casters: while the parent works on

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
