"""Parsing of lines of numbers in text mesh files, with the line number of errors."""

import re
import warnings
from codecs import BOM_UTF8
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.polygons import Integers

BLANK = np.isin(np.arange(256), np.frombuffer(b" \t\v\f", dtype=np.uint8))
INDICES = re.compile(rb"[-+]?\d+(/([-+]?\d+)?)*")
DECIMAL = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)


class Lines(NamedTuple):
    """The non-empty lines of a text. starts, ends: (L,) byte offsets, without leading blanks.

    file: the same bytes before continued lines were joined, to count line numbers; where: the beginning of errors.
    """

    text: bytes
    file: bytes
    starts: Integers
    ends: Integers
    where: str

    def select(self, which: NDArray[np.bool_] | slice, skip: int = 0) -> "Lines":
        """The chosen lines, without their first `skip` bytes."""
        return self._replace(starts=self.starts[which] + skip, ends=self.ends[which])

    def line(self, k: int) -> str:
        """The text of a line."""
        return self.text[self.starts[k] : self.ends[k]].decode("utf-8", errors="replace")

    def begin_with(self, keyword: str) -> NDArray[np.bool_]:
        """(L,) whether the first word of each line is the keyword, in upper or lower case."""
        letters = np.frombuffer(self.text, dtype=np.uint8)
        after = letters.take(self.starts + len(keyword), mode="clip")
        matches: NDArray[np.bool_] = BLANK[after] | (after == ord("\n"))
        for k, letter in enumerate(keyword):
            matches &= (letters.take(self.starts + k, mode="clip") | 32) == ord(letter)
        return matches

    def error(self, k: int, message: str) -> InputError:
        """An error with the number of line k in the file."""
        number = 1 + self.file.count(b"\n", 0, int(self.starts[k]))
        return InputError(f"{self.where}: line {number}: {message}")

    def check(self, valid: NDArray[np.bool_], counts: Integers, needed: object) -> None:
        """Raise the error of the first line with a wrong count of numbers."""
        if not valid.all():
            k = int(valid.argmin())
            wanted = needed[k] if isinstance(needed, np.ndarray) else needed
            raise self.error(k, f"found {counts[k]} numbers; {wanted:g} are needed")


class Rows(NamedTuple):
    """The numbers of lines: (N,) values, and (L,) the index of each line's first number and their count.

    columns: (N,) how many slashes stand before each number in its word; None of numbers that are no indices.
    """

    values: NDArray[Any]
    starts: Integers
    counts: Integers
    columns: Integers | None

    @property
    def vectors(self) -> NDArray[Any]:
        """(L, 3) the first three numbers of each line."""
        return np.asarray(self.values[self.starts[:, None] + np.arange(3)])


def with_newlines(data: bytes) -> bytes:
    """The text of a file without a byte order mark, with Unix line ends, including one after the last line."""
    return data.removeprefix(BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\n"


def without_comments(text: bytes) -> bytes:
    """The text with #-comments replaced by blanks, which keeps byte offsets."""
    return re.sub(rb"#[^\n]*", lambda comment: b" " * len(comment[0]), text)


def lines_of(text: bytes, where: str, file: bytes | None = None) -> Lines:
    """The non-empty lines of a text that ends with a newline. Raises InputError for NUL bytes."""
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(letters == ord("\n"))
    starts = np.concatenate([[0], ends[:-1] + 1])
    lines = Lines(text, text if file is None else file, starts, ends, where)
    if (nul := text.find(b"\0")) >= 0:
        raise lines.error(int(np.searchsorted(ends, nul)), "found a NUL byte; allowed is text in ASCII or UTF-8")
    indented = np.flatnonzero(BLANK[letters[starts]])
    while len(indented):
        starts[indented] += 1
        indented = indented[BLANK[letters[starts[indented]]]]
    return lines.select(starts < ends)


def numbers(lines: Lines, indices: bool = False) -> Rows:
    """The float64 numbers of lines; or int64 indices, of which a word may have several, as `1/2/3` or `1//3`.

    Raises InputError with the line number and the word that is not a number.
    """
    text = b"".join([lines.text[a:b] for a, b in zip(lines.starts.tolist(), (lines.ends + 1).tolist(), strict=True)])
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = letters == ord("\n")
    separators = BLANK[letters] | ends
    begins = np.concatenate([[True], separators[:-1]])
    slashes = (letters == ord("/")) & indices
    if (slashes & begins).any():
        raise _not_a_number(lines, text, indices)
    separators |= slashes
    words = np.flatnonzero(~separators & np.concatenate([[True], separators[:-1]]))
    first = np.searchsorted(words, np.concatenate([[0], np.flatnonzero(ends)]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # NumPy's sign of a word that is not a number
            kind = np.int64 if indices else np.float64
            spaced = text.replace(b"/", b" ") if indices else text
            values = np.fromstring(spaced, kind, sep=" ") if len(words) else np.zeros(0, kind)  # blanks are none
    except (DeprecationWarning, ValueError):
        values = np.zeros(0)
    if len(values) != len(words):
        raise _not_a_number(lines, text, indices)
    return Rows(values, first[:-1], np.diff(first), _columns(words, begins, slashes) if indices else None)


def _columns(numbers: Integers, begins: NDArray[np.bool_], slashes: NDArray[np.bool_]) -> Integers:
    """(N,) how many slashes stand before each number in its word.

    numbers: (N,) where they begin; begins, slashes: whether a letter begins a word, and whether it is a slash.
    """
    first = begins[numbers]
    passed = np.cumsum(np.where(first, 0, 1 + slashes[numbers - 2]))
    of_word = np.maximum.accumulate(np.where(first, np.arange(len(numbers)), 0))
    return np.asarray(passed - passed[of_word])


def _not_a_number(lines: Lines, text: bytes, indices: bool) -> InputError:
    allowed, pattern = ("integers", INDICES) if indices else ("numbers", DECIMAL)
    for k, line in enumerate(text.split(b"\n")):
        for word in line.split():
            if not pattern.fullmatch(word):
                return lines.error(k, f"found {word.decode('utf-8', errors='replace')!r:.40}; allowed: {allowed}")
    return InputError(f"{lines.where}: a line cannot be read as {allowed}")
