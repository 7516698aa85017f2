"""The program `shadowbench`, also run by `python -m shadowbench`: the command line, and Ctrl-C that is never lost."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_AGAIN_S = 0.02


def main() -> None:
    """Entry point: the command line, which Ctrl-C interrupts as soon as it can be neither lost nor do damage."""
    with _interruptible():
        from shadowbench.commands import main as command_line

        command_line()


@contextmanager
def _interruptible() -> Iterator[None]:
    """Within the block, Ctrl-C raises KeyboardInterrupt where no import and no callback can swallow it.

    Not where SIGINT is ignored, as in a script's background job.
    """
    if os.name != "posix" or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    # Sent again, rather than raised: the start of a worker has a handler of its own.
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    sys.unraisablehook = _ignored
    try:
        yield
    except KeyboardInterrupt:  # before the command line or after it, which prints a line
        sys.exit(130)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)  # as Python exits, it would kill


def _interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, but while modules are imported only afterwards.

    Some packages take any exception of an import for a missing package, and go on without it (trimesh); others are left
    half imported, and crash.
    """
    while frame is not None and frame.f_code.co_name != "_find_and_load":  # of importlib
        frame = frame.f_back
    if frame is None:
        raise KeyboardInterrupt
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)


def _ignored(told: Any) -> None:
    """Interrupt again where Python only prints and ignores what was raised: in `__del__`, and in callbacks of C."""
    if issubclass(told.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
    else:
        sys.__unraisablehook__(told)


if __name__ == "__main__":
    main()
