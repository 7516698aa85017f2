"""Errors shown to users, with their exit codes."""

import difflib
from collections.abc import Iterable
from importlib import import_module
from typing import Any

NOT_INSTALLED = "{} is not installed; docs/how-to/install.md lists the platforms that have it"
NOT_EVERYWHERE = ("embreex", "moderngl", "numba")
"""Modules that some platforms lack; what can do without them imports them where it calls them."""


class ShadowbenchError(Exception):
    """A failure reported as one line of printable characters instead of a traceback."""

    exit_code = 3

    def __init__(self, line: str = "") -> None:
        super().__init__(printable(" ".join(line.split())))


class InputError(ShadowbenchError):
    """Invalid input; the message names the file or field, what was found and what is allowed."""

    exit_code = 2


class MetricError(ShadowbenchError):
    """A metric raised an exception, or returned no number."""


class NoGLError(ShadowbenchError):
    """No OpenGL context of version 4.1 or later could be created."""


class Unsupported(Exception):
    """Raised when a technique does not support a view; the message is one line that says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(quoted(reason))


def how_to_install(extra: str) -> str:
    """End of a message about a missing package: what installs an extra. The name on the package index is another's."""
    return f"pip install '.[{extra}]' in a checkout of shadowbench installs it"


def module_of_extra(module: str, extra: str, what: str) -> Any:
    """A module that an extra installs. Raises InputError that begins with `what` if it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise InputError(f"{what} {module}, which is not installed: {how_to_install(extra)}") from error


def alternatives(found: object, names: Iterable[str], heading: str = "allowed", none: str = "none") -> str:
    """End of a message about an unknown name: `; did you mean 'elevation'? allowed: elevation, gap`.

    The question is included only for a near miss; none: text in place of an empty list of names.
    """
    known = list(names)
    folded = {name.casefold(): name for name in reversed(known)}
    near = difflib.get_close_matches(str(found)[:100].casefold(), folded, n=1)
    question = f"; did you mean {folded[near[0]]!r}?" if near else ";"
    return f"{question} {heading}: {', '.join(known) or none}"


def counted(count: int, what: str) -> str:
    """A count with its noun: `1 cell`, `2 cells`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def number(value: float | None) -> str:
    """Four significant digits, without an exponent from 1e-4 up; – for None. More if below 1, but 1 with four."""
    if value is None:
        return "–"
    if 0.99995 <= value < 1:
        return next(text for places in range(5, 18) if float(text := f"{value:.{places}g}") < 1)
    return f"{value:.4g}" if value == 0 or abs(value) >= 1e-4 else f"{value:.2e}"


def message(error: BaseException) -> str:
    """Message of an exception of foreign code, whose `__str__` may raise."""
    try:
        return str(error)
    except Exception:
        return "(no message)"


def quoted(text: str) -> str:
    """Foreign text as one printable line."""
    return printable(" ".join(text.split()))


def printable(line: str) -> str:
    """The line with unprintable characters escaped: control sequences, and what cannot be encoded."""
    return "".join(part if part.isprintable() else ascii(part)[1:-1] for part in line)
