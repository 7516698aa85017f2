"""Grammar and recursive-descent parser of specs.

spec  = name [":" item {"," item}]          item = key "=" value
value = one {"+" one}        one = number | word ["(" argument {"," argument} ")"]        argument = [key "="] value
"""

import re
from dataclasses import dataclass
from typing import Any

from shadowbench.errors import InputError

Items = tuple[tuple[str | None, Any], ...]
"""(key, value) pairs; the key of a positional argument is None."""
WORD = r"[A-Za-z0-9][\w-]*"
LONGEST = 1000
"""Largest number of characters of a spec."""
DEEPEST = 8
"""Largest depth of nested calls."""
_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w-]))"
    rf"|(?P<word>{WORD})|(?P<mark>[=(),:+]))"
)


@dataclass(frozen=True)
class Call:
    """A word with parameters, `slope(max=0.05)`, or a sum, with the name `+` and both operands as arguments."""

    name: str
    arguments: Items = ()

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

    def __str__(self) -> str:
        return f"{self.name}(…)" if self.arguments else self.name


class Reader:
    """Parser of one spec."""

    def __init__(self, text: str) -> None:
        if len(text) > LONGEST:
            raise InputError(f"spec {text!r:.60}…: {len(text)} characters; allowed are at most {LONGEST}")
        self.text, self.at = text, 0

    def fail(self, wanted: str) -> InputError:
        found = self.text[self.at :].strip()
        return InputError(f"spec {self.text!r}: expected {wanted}, found {repr(found[:20]) if found else 'its end'}")

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

    def value(self, depth: int = 0) -> Any:
        """A number, a word, or a Call. depth: number of calls around it."""
        if depth > DEEPEST:
            raise InputError(f"spec {self.text!r}: nested deeper than {DEEPEST} calls")
        first = self._operand(depth)
        return Call("+", ((None, first), (None, self.value(depth + 1)))) if self.token("mark", "+") else first

    def _operand(self, depth: int) -> Any:
        number = self.token("number")
        if number is not None:
            return int(number) if re.fullmatch(r"[-+]?\d+", number) else float(number)
        word = self.token("word")
        if word is None:
            raise self.fail("a number or a word")
        if not self.token("mark", "("):
            return {"true": True, "false": False}.get(word, word)
        arguments = self.items(named=False, depth=depth + 1)
        if not self.token("mark", ")"):
            raise self.fail("')'")
        return Call(word, arguments)

    def items(self, named: bool = True, depth: int = 0) -> Items:
        """Items separated by commas; named: whether each must have a key."""
        items: list[tuple[str | None, Any]] = []
        while True:
            start = self.at
            key = self.token("word")
            if key is None or not self.token("mark", "="):
                if named:
                    raise self.fail("key=value")
                self.at, key = start, None
            items.append((key, self.value(depth)))
            if not self.token("mark", ","):
                return tuple(items)


def parameters_of(spec: str) -> tuple[str, dict[str, Any]]:
    """A spec's technique and the parameters that it names: numbers, words and Calls."""
    reader = Reader(spec)
    technique = reader.token("word") or ""
    items = reader.items() if reader.token("mark", ":") else ()
    return technique, {str(key): value for key, value in items}


def parse_value(text: str) -> Any:
    """One value: a number, a word, or a Call."""
    reader = Reader(text)
    value = reader.value()
    reader.end()
    return value
