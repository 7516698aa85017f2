"""Standard output and error in any encoding, closed, full or without a reader: printing never stops the work."""

import codecs
import io
import os
import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TextIO

_ASCII = dict(zip("−–━╸╺×✕·≈", "-----xx.~", strict=True))
_ASCII |= {"…": "...", "→": "->", "≥": ">=", "≤": "<=", "±": "+-", "√": "sqrt", "°": " deg"}
_ASCII |= {"²": "^2", "³": "^3", "½": "1/2", "¼": "1/4", "⅙": "1/6"}
_ASCII |= {"δ": "delta", "θ": "theta", "λ": "lambda", "π": "pi", "σ": "sigma", "τ": "tau", "ω": "omega"}


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Error handler of codecs: what the encoding lacks in ASCII, ? if there is nothing like it."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_ASCII.get(one) or _without_accent(one) or "?" for one in lacking), error.end


def _without_accent(letter: str) -> str:
    return unicodedata.normalize("NFD", letter).encode("ascii", "ignore").decode()


ASCII = "shadowbench.ascii"
codecs.register_error(ASCII, _in_ascii)


class _Binary(Protocol):
    def write(self, data: Any, /) -> int | None: ...
    def fileno(self) -> int: ...
    def isatty(self) -> bool: ...


class SafeStream(io.RawIOBase):
    """Binary stream that writes to another, and drops what cannot be written; error: the first reason."""

    def __init__(self, stream: _Binary) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def writable(self) -> bool:
        """True."""
        return True

    def write(self, data: Any, /) -> int | None:
        """Write as the other stream does, or drop the data."""
        try:
            return self._stream.write(data)
        except OSError as error:
            self.error = self.error or error
            return len(data)

    def fileno(self) -> int:
        """The other stream's."""
        return self._stream.fileno()

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream.isatty()


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
    stdout = SafeStream(_binary(sys.stdout, 1))
    sys.stdout = _text(stdout, before[0])
    sys.stderr = _text(SafeStream(_binary(sys.stderr, 2)), before[1])

    def error() -> OSError | None:
        sys.stdout.flush()
        return None if isinstance(stdout.error, BrokenPipeError) else stdout.error

    try:
        yield error
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        sys.stdout, sys.stderr = before


def _binary(stream: TextIO | None, descriptor: int) -> _Binary:
    if stream is None:  # it was closed when the program began
        return io.FileIO(descriptor, "w", closefd=False)
    stream.flush()
    return getattr(stream.buffer, "raw", stream.buffer)


def _text(binary: SafeStream, like: TextIO | None) -> TextIO:
    lines = binary.isatty() or like is sys.stderr
    return io.TextIOWrapper(io.BufferedWriter(binary), like.encoding if like else None, ASCII, line_buffering=lines)
