"""What plug-ins print: passed on to stderr, where it does not mix with results, and cut where it is too much."""

import codecs
import io
import os
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import IO, TextIO

from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import techniques

MOST = 100_000
"""Characters of one process that are passed on."""


class Cut(io.TextIOBase):
    """A stream that passes on the first MOST characters to another, then a line that says so, then nothing."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._left = stream, MOST

    def write(self, text: str) -> int:
        """Pass on what there is room for; the length of `text`."""
        kept = text[: max(self._left, 0)]
        if len(text) > self._left >= 0:
            kept += f"…\nwhat plug-ins print is cut here, after {MOST} characters\n"
            self._left = -1  # said
        elif self._left >= 0:
            self._left -= len(text)
        if kept:
            self._stream.write(kept)
            self._stream.flush()
        return len(text)


def pass_on(pipe: IO[bytes]) -> threading.Thread:
    """Pass on what is written to the other end of a pipe, in a thread, until nobody is left who could write to it."""

    def read() -> None:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        # By its number: whatever Python calls stderr by then, this is the one that the process was given.
        with pipe, open(2, "w", encoding="utf-8", closefd=False) as stderr:
            stream = Cut(stderr)
            while data := os.read(pipe.fileno(), 1 << 16):
                stream.write(decoder.decode(data))

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    return thread


def techniques_with(plugins: Sequence[Path]) -> Mapping[str, type[Technique]]:
    """All techniques by name, those of plug-ins too: what they print while they are loaded goes to stderr, and is cut.

    Raises InputError for a plug-in that cannot be loaded.
    """
    stream = Cut(sys.stderr)
    with redirect_stdout(stream), redirect_stderr(stream):
        return techniques(plugins)
