"""A process that says in the terminal what ended the window: a crash or `os._exit` of a plug-in leaves no time to."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

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


@contextmanager
def crash_reporter() -> Iterator[Callable[[str], None]]:
    """Within it the window is shown. Gives a function to call with a spec's text before it is drawn, and "" after."""
    command = [sys.executable, "-I", "-S", "-X", "utf8", "-c", _PROGRAM]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, encoding="utf-8", bufsize=1)

    def tell(doing: str) -> None:
        assert process.stdin is not None
        with suppress(BrokenPipeError):  # it was killed
            process.stdin.write(f"{doing}\n")

    try:
        yield tell
    finally:
        tell(_CLOSED)
        process.communicate()
