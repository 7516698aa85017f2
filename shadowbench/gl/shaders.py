"""Shader source texts composed from includes and defines.

`#include "bias/slope.glsl"` includes a file of the first root that has it, `#include <bias>` the file or text that the
caller assigned to this slot, `#include "projection/<projection>.glsl"` the file of the name assigned. Each file is
included once, at its first include. Followed by `with bias = bias_first`, an include renames: `bias_`, `BIAS_` and
`bias(` in the file and its includes become `bias_first_`, `BIAS_FIRST_` and `bias_first(`, and `<bias_scale>` becomes
the slot `<bias_first_scale>`.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

VERSION = "#version 410 core"
_WITH = r"(?:[ \t]+with[ \t]+(\w+)[ \t]*=[ \t]*(\w+))?"
_LINE = re.compile(r"#line (\d+) // (.+)")
FILE_LINES = 100_000  # of each file of a traced text; Mesa forgets the number of the file that #line may have
_SLOT = re.compile(r"<(\w+)>")
_INCLUDE = re.compile(rf'^[ \t]*#include[ \t]+(?:"([^"]+)"|<([^>]+)>){_WITH}[ \t]*$', re.MULTILINE)


def compose(
    source: Path | str,
    roots: Sequence[Path],
    defines: Mapping[str, str] = {},
    slots: Mapping[str, str] = {},
    *,
    traced: bool = False,
) -> str:
    """The complete source text of one shader stage.

    source, and each slot's: a file relative to a root, or the source itself if it has several lines. traced: with #line
    directives, from which `places` knows the file and line of each line. Of the defines, those that the text has words
    for. Raises FileNotFoundError for an include that no root has, KeyError for a slot without a file.
    """
    taken: set[tuple[Path | str, str]] = set()

    def expand(text: str, old: str, new: str, line: Callable[[int], str]) -> str:
        def included(match: re.Match[str]) -> str:
            name = _SLOT.sub(lambda slot: slots[slot[1]], match[1]) if match[1] else slots[match[2]]
            inner = include(name, match[3] or old, match[4] or new)
            return f"{inner}\n{line(text.count(chr(10), 0, match.end()) + 1)}" if traced else inner

        return _INCLUDE.sub(included, text)

    def include(name: str, old: str = "", new: str = "") -> str:
        found = name if "\n" in name else _find(name, roots)
        text = found.read_text(encoding="utf-8") if isinstance(found, Path) else found
        text = _renamed(text, old, new) if old else text
        if (found, text) in taken:
            return ""
        taken.add((found, text))
        number = len(taken)
        if not traced:
            return expand(text, old, new, str)
        label, first = (name, 1) if isinstance(found, Path) else _inline_place(found, roots)

        def line(after: int) -> str:
            """The directive that numbers the next line, after so many lines of the file."""
            return f"#line {number * FILE_LINES + first + after} // {label}"

        return f"{line(0)}\n{expand(text, old, new, line)}"

    body = include(str(source))
    used = set(re.findall(r"\w+", body))
    return "\n".join([VERSION, *(f"#define {name} {value}" for name, value in defines.items() if name in used), body])


def _renamed(text: str, old: str, new: str) -> str:
    text = re.sub(rf"\b{old}(?=[_>(])", new, text)
    return re.sub(rf"\b{old.upper()}(?=_)", new.upper(), text)


def places(text: str) -> list[tuple[int, str]]:
    """The number by which a driver calls each line of a text, and its file; none without #line directives.

    In a file it is the line of the number modulo FILE_LINES.
    """
    found, number, name = [], 1, ""
    for line in text.splitlines():
        found.append((number, name))
        number += 1
        if directive := _LINE.match(line):
            number, name = int(directive[1]), directive[2]
    return found


def _inline_place(source: str, roots: Sequence[Path]) -> tuple[str, int]:
    """The Python file beside the shaders that has a source in it, and the source's first line there."""
    for file in (file for root in roots for file in sorted(root.glob("*.py"))):
        before, found, _ = file.read_text(encoding="utf-8").partition(source)
        if found:
            return file.name, before.count("\n") + 1
    return "inline source", 1


def _find(name: str, roots: Sequence[Path]) -> Path:
    for root in roots:
        if (root / name).is_file():
            return root / name
    raise FileNotFoundError(f"no shader file {name!r} in {', '.join(str(root) for root in roots)}")
