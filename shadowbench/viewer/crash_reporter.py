"""A process beside the window, which says in the terminal what ended the window, if it was neither closed nor stopped.

The window's own process cannot: plug-ins draw in it, and `os._exit` or a crash of the driver leave it no time.
"""

import subprocess
import sys
from contextlib import suppress

_CLOSED = "closed"
_PROGRAM = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
doing = ""
for line in sys.stdin:
    doing = line.strip()
if doing != "{_CLOSED}":
    print("shadowbench: the window ended unexpectedly" + (doing and " while drawing " + doing), file=sys.stderr)
"""


class CrashReporter:
    """Is told of each technique before it is called. A context manager, in which the window is shown."""

    def __init__(self) -> None:
        command = [sys.executable, "-I", "-S", "-X", "utf8", "-c", _PROGRAM]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, encoding="utf-8", bufsize=1
        )
        self._last = ""

    def tell(self, doing: str) -> None:
        """Say which spec is about to be drawn; empty if none is."""
        if doing != self._last:
            self._last = doing
            assert self._process.stdin is not None
            with suppress(BrokenPipeError):  # it was killed
                self._process.stdin.write(f"{doing}\n")

    def __enter__(self) -> "CrashReporter":
        return self

    def __exit__(self, *_: object) -> None:
        self.tell(_CLOSED)
        self._process.communicate()
