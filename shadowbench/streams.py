"""Standard output and error in any encoding, closed, full or without a reader: printing never stops the work."""

import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class SafeStream(io.RawIOBase):
    """Binary stream that writes to another, and drops what cannot be written; error: the first reason."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.error: OSError | None = None
        self.fileno, self.isatty = stream.fileno, stream.isatty  # type: ignore[method-assign]

    def writable(self) -> bool:
        """True."""
        return True

    def write(self, data: Any, /) -> int | None:
        """Write as the other stream does, or drop the data."""
        try:
            written: int | None = self._stream.write(data)
            return written
        except OSError as error:
            self.error = self.error or error
            return len(data)


@contextmanager
def safe_output() -> Iterator[Callable[[], OSError | None]]:
    """Within the block, writing to sys.stdout and sys.stderr raises nothing.

    Yields a function that says why stdout could not be written. That a pipe's reader ended, as `| head`, is no reason.
    """
    for descriptor, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(descriptor)
        except OSError:  # closed: the next file that is opened would get its number; stdout remains one to read
            os.open(os.devnull, mode)
    before = sys.stdout, sys.stderr
    stdout, stderr = (_raw(stream, descriptor) for descriptor, stream in enumerate(before, 1))
    sys.stdout = _text(stdout, before[0], stdout.isatty())
    sys.stderr = _text(stderr, before[1], True)

    def error() -> OSError | None:
        sys.stdout.flush()
        return None if isinstance(stdout.error, BrokenPipeError) else stdout.error

    try:
        yield error
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        sys.stdout, sys.stderr = before


def _raw(stream: TextIO | None, descriptor: int) -> SafeStream:
    if stream is None:  # it was closed when the program began
        return SafeStream(io.FileIO(descriptor, "w", closefd=False))
    stream.flush()
    return SafeStream(getattr(stream.buffer, "raw", stream.buffer))  # a console of Windows takes no bytes of UTF-8


def _text(binary: SafeStream, like: TextIO | None, lines: bool) -> TextIO:
    encoding = like.encoding if like else None
    return io.TextIOWrapper(io.BufferedWriter(binary), encoding, "replace", line_buffering=lines)
