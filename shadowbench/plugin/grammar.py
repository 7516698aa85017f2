"""Grammar and recursive-descent parser of specs.

spec  = name [":" item {"," item}]          item = key "=" value
value = one {"+" one}        one = number | word ["(" argument {"," argument} ")"]        argument = [key "="] value
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from shadowbench.errors import InputError

WORD = r"[A-Za-z0-9][\w-]*"
_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w-]))"
    rf"|(?P<word>{WORD})|(?P<mark>[=(),:+]))"
)

LONGEST = 1000
"""Largest number of characters of a spec."""

DEEPEST = 8
"""Largest depth of nested calls."""


@dataclass(frozen=True)
class Call:
    """A word with parameters, `slope(max=0.05)`, or a sum, with the name `+` and both operands as arguments."""

    name: str
    arguments: tuple[tuple[str | None, Any], ...]

    def keywords(self, order: list[str]) -> dict[str, Any]:
        """The arguments by name, positional ones in `order`. Raises ValueError for too many or repeated ones."""
        named: dict[str, Any] = {}
        for index, (key, value) in enumerate(self.arguments):
            if key is None and index >= len(order):
                raise ValueError(f"{self.name} takes at most {len(order)} parameters: {', '.join(order) or 'none'}")
            name = order[index] if key is None else key
            if name in named:
                raise ValueError(f"{self.name}: {name} is given twice")
            named[name] = value
        return named


class Reader:
    """Parser of one spec."""

    def __init__(self, text: str) -> None:
        if len(text) > LONGEST:
            raise InputError(f"spec {text!r:.60}…: {len(text)} characters; allowed are at most {LONGEST}")
        self.text = text
        self.at = 0
        self.depth = 0

    def fail(self, wanted: str) -> InputError:
        found = self.text[self.at :].strip()
        return InputError(f"spec {self.text!r}: expected {wanted}, found {found[:20]!r}" if found else
                          f"spec {self.text!r}: expected {wanted}, found its end")  # fmt: skip

    def token(self, kind: str, text: str | None = None) -> str | None:
        """Consume and return the next token if it is of this kind (and text); None otherwise."""
        match = _TOKEN.match(self.text, self.at)
        if match is None or match.lastgroup != kind or text not in (None, match[kind]):
            return None
        self.at = match.end()
        return match[kind]

    def end(self) -> None:
        if self.text[self.at :].strip():
            raise self.fail("a comma or the end")

    def value(self) -> Any:
        first = self.operand()
        if not self.token("mark", "+"):
            return first
        with self.nested("+"):
            return Call("+", ((None, first), (None, self.value())))

    @contextmanager
    def nested(self, word: str) -> Iterator[None]:
        """Enter a nested call. Raises InputError beyond `DEEPEST`."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise InputError(f"spec {self.text!r}: {word} is nested deeper than {DEEPEST} calls")
        yield
        self.depth -= 1

    def operand(self) -> Any:
        number = self.token("number")
        if number is not None:
            return int(number) if re.fullmatch(r"[-+]?\d+", number) else float(number)
        word = self.token("word")
        if word is None:
            raise self.fail("a number or a word")
        if self.token("mark", "("):
            with self.nested(word):
                arguments = self.items(named=False)
            if not self.token("mark", ")"):
                raise self.fail("')'")
            return Call(word, arguments)
        return {"true": True, "false": False}.get(word, word)

    def items(self, named: bool) -> tuple[tuple[str | None, Any], ...]:
        items: list[tuple[str | None, Any]] = []
        while True:
            start = self.at
            key = self.token("word")
            if key is None or not self.token("mark", "="):
                if named:
                    raise self.fail("key=value")
                self.at, key = start, None
            items.append((key, self.value()))
            if not self.token("mark", ","):
                return tuple(items)


def parameters_of(spec: str) -> tuple[str, dict[str, Any]]:
    """A spec's technique and the parameters that it names: numbers, words and Calls."""
    reader = Reader(spec)
    technique = reader.token("word") or ""
    items = reader.items(named=True) if reader.token("mark", ":") else ()
    return technique, {str(key): value for key, value in items}


def parse_value(text: str) -> Any:
    """One value: a number, a word, or a Call."""
    reader = Reader(text)
    value = reader.value()
    reader.end()
    return value
