"""Parsing of lines of numbers in text mesh files, with the line number of errors."""

import re
import warnings
from codecs import BOM_UTF8
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.polygons import Integers

LONGEST_LINE = 100_000
"""Limit in bytes: enough for a polygon of thousands of corners."""
BLANKS = b" \t\v\f"
BLANK = np.isin(np.arange(256), np.frombuffer(BLANKS, dtype=np.uint8))
INTEGER = re.compile(rb"[-+]?\d+")
DECIMAL = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)


class Lines(NamedTuple):
    """The non-empty lines of a text. starts, ends: (L,) byte offsets, without leading blanks.

    file: the same bytes before continued lines were joined, to count line numbers.
    """

    text: bytes
    file: bytes
    starts: Integers
    ends: Integers

    def select(self, which: NDArray[np.bool_] | slice, skip: int = 0) -> "Lines":
        """The chosen lines, without their first `skip` bytes."""
        return self._replace(starts=self.starts[which] + skip, ends=self.ends[which])

    def line(self, k: int) -> bytes:
        """The text of a line."""
        return self.text[self.starts[k] : self.ends[k]]

    def number(self, k: int) -> int:
        """The line's number in the file, from 1."""
        return 1 + self.file.count(b"\n", 0, int(self.starts[k]))


class Rows(NamedTuple):
    """The numbers of lines: (N,) values, and (L,) the index of each line's first number and their count."""

    values: NDArray[Any]
    starts: Integers
    counts: Integers


def with_newlines(data: bytes) -> bytes:
    """The text of a file without a byte order mark, with Unix line ends, including one after the last line."""
    return data.removeprefix(BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\n"


def without_comments(text: bytes) -> bytes:
    """The text with #-comments replaced by blanks, which keeps byte offsets."""
    return re.sub(rb"#[^\n]*", lambda found: b" " * len(found[0]), text)


def lines_of(text: bytes, where: str, file: bytes | None = None) -> Lines:
    """The non-empty lines of a text that ends with a newline. Raises InputError for too long lines and NUL bytes."""
    file = text if file is None else file
    nul = text.find(b"\0")
    if nul >= 0:
        line = 1 + file.count(b"\n", 0, nul)
        raise InputError(f"{where}: line {line}: found a NUL byte; allowed is text in ASCII or UTF-8")
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(letters == ord("\n"))
    starts = np.concatenate([[0], ends[:-1] + 1])
    if len(ends) and int((ends - starts).max()) > LONGEST_LINE:
        raise InputError(f"{where}: a line of more than {LONGEST_LINE} bytes; allowed are shorter ones")
    indented = np.flatnonzero(BLANK[letters[starts]])
    while len(indented):
        starts[indented] += 1
        indented = indented[BLANK[letters[starts[indented]]]]
    nonempty = starts < ends
    return Lines(text, file, starts[nonempty], ends[nonempty])


def numbers(lines: Lines, where: str, integers: bool = False, dropped: bytes = b"") -> Rows:
    """The float64 or int64 numbers of lines, after removing matches of the pattern `dropped`.

    Raises InputError with the line number and the word that is not a number.
    """
    text = b"".join([lines.text[a:b] for a, b in zip(lines.starts.tolist(), (lines.ends + 1).tolist(), strict=True)])
    if dropped:
        text = re.sub(dropped, b"", text)
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = letters == ord("\n")
    separators = BLANK[letters] | ends
    words = np.flatnonzero(~separators & np.concatenate([[True], separators[:-1]]))
    first = np.searchsorted(words, np.concatenate([[0], np.flatnonzero(ends)]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # NumPy's sign of a word that is not a number
            kind = np.int64 if integers else np.float64
            values = np.fromstring(text, kind, sep=" ") if len(words) else np.zeros(0, kind)  # blanks are none
    except (DeprecationWarning, ValueError):
        values = np.zeros(0)
    if len(values) != len(words):
        raise _not_a_number(lines, text, INTEGER if integers else DECIMAL, where)
    return Rows(values, first[:-1], np.diff(first))


def _not_a_number(lines: Lines, text: bytes, pattern: re.Pattern[bytes], where: str) -> InputError:
    allowed = "integers" if pattern is INTEGER else "numbers"
    for k, line in enumerate(text.split(b"\n")):
        for word in line.split():
            if not pattern.fullmatch(word):
                found = f"found {word.decode('utf-8', errors='replace')!r:.40}"
                return InputError(f"{where}: line {lines.number(k)}: {found}; allowed: {allowed}")
    return InputError(f"{where}: a line cannot be read as {allowed}")
