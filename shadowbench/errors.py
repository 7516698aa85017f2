"""The errors a user can meet, and the exit code of each."""

import difflib
from collections.abc import Iterable

LONGEST_QUOTE = 500
"""Characters of what somebody else's code says, such as a plug-in."""


class ShadowbenchError(Exception):
    """A failure that is told in one line of printable characters, whatever it quotes, instead of a traceback."""

    exit_code = 3

    def __init__(self, line: str = "") -> None:
        super().__init__(printable(" ".join(line.split())))


class InputError(ShadowbenchError):
    """Bad input: the line names the file or field, what was found and what is allowed."""

    exit_code = 2


class NoGLError(ShadowbenchError):
    """No OpenGL context could be made, or it is older than 4.1."""


def alternatives(found: object, names: Iterable[str], heading: str = "allowed", none: str = "none") -> str:
    """The end of a line about a name that is none of `names`: `; did you mean 'elevation'? allowed: elevation, gap`.

    The question stands there for a near miss alone; `none` stands for no names at all.
    """
    known = list(names)
    folded = {name.casefold(): name for name in reversed(known)}
    near = difflib.get_close_matches(str(found)[:100].casefold(), folded, n=1)
    question = f"; did you mean {folded[near[0]]!r}?" if near else ";"
    return f"{question} {heading}: {', '.join(known) or none}"


def message(error: BaseException) -> str:
    """What an exception of somebody else's code says, which may raise itself."""
    try:
        return str(error)
    except Exception:
        return "(no message)"


def quoted(text: str) -> str:
    """A foreign text as one printable line of at most LONGEST_QUOTE characters, the last of them … where it is cut."""
    line = printable(" ".join(text[: 10 * LONGEST_QUOTE].split()))
    return line if len(line) <= LONGEST_QUOTE else line[: LONGEST_QUOTE - 1] + "…"


def printable(line: str) -> str:
    """A line with escapes for what would steer a terminal or cannot be encoded, as names from files may."""
    return "".join(part if part.isprintable() else ascii(part)[1:-1] for part in line)
