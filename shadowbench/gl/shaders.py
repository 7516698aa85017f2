"""Shader source texts composed from includes and defines.

`#include "bias/slope.glsl"` includes a file of the first root that has it, `#include <bias>` the file or text that the
caller assigned to this slot, `#include "projection/<projection>.glsl"` the file of the name assigned. Each file is
included once, at its first include. Followed by `with bias = bias_first`, an include renames: `bias_`, `BIAS_` and
`bias(` in the file and its includes become `bias_first_`, `BIAS_FIRST_` and `bias_first(`, and `<bias_scale>` becomes
the slot `<bias_first_scale>`.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from shadowbench.files import data_folder

VERSION = "#version 410 core"
SHADERS = (data_folder("shaders"),)
"""The roots of what is drawn by no technique."""
_WITH = r"(?:[ \t]+with[ \t]+(\w+)[ \t]*=[ \t]*(\w+))?"
_SLOT = re.compile(r"<(\w+)>")
_INCLUDE = re.compile(rf'[ \t]*#include[ \t]+(?:"([^"]+)"|<([^>]+)>){_WITH}[ \t]*')


class Composed(str):
    """A composed text; places: the file and the number of each of its lines there, "" and 0 for those of no file."""

    places: Sequence[tuple[str, int]]


def compose(
    source: Path | str, roots: Sequence[Path], defines: Mapping[str, str] = {}, slots: Mapping[str, str] = {}
) -> Composed:
    """The complete source text of one shader stage.

    source, and each slot's: a file relative to a root, or the source itself if it has several lines. Of the defines,
    those that the text has words for. Raises FileNotFoundError for an include that no root has, KeyError for a slot
    without a file.
    """
    lines: list[str] = []
    places: list[tuple[str, int]] = []
    taken: set[tuple[str, str]] = set()

    def include(name: str, old: str = "", new: str = "") -> None:
        """Append the lines of a file or text, with names that begin with `old` renamed to `new`."""
        text, label, first = _found(name, roots)
        text = _renamed(text, old, new) if old else text
        if (label, text) in taken:
            lines.append("")
            places.append(("", 0))
            return
        taken.add((label, text))
        for number, line in enumerate(text.split("\n"), first):
            if match := _INCLUDE.fullmatch(line):
                inner = _SLOT.sub(lambda slot: slots[slot[1]], match[1]) if match[1] else slots[match[2]]
                include(inner, match[3] or old, match[4] or new)
            else:
                lines.append(line)
                places.append((label, number))

    include(str(source))
    used = set(re.findall(r"\w+", "\n".join(lines)))
    head = [VERSION, *(f"#define {name} {value}" for name, value in defines.items() if name in used)]
    composed = Composed("\n".join([*head, *lines]))
    composed.places = [("", 0)] * len(head) + places
    return composed


def _renamed(text: str, old: str, new: str) -> str:
    text = re.sub(rf"\b{old}(?=[_>(])", new, text)
    return re.sub(rf"\b{old.upper()}(?=_)", new.upper(), text)


def _found(name: str, roots: Sequence[Path]) -> tuple[str, str, int]:
    """A text by its file's name, or the text itself; the file, for a text a Python file beside the shaders that has it.

    Last, the number of the text's first line in the file.
    """
    if "\n" not in name:
        for root in roots:
            if (root / name).is_file():
                return (root / name).read_text(encoding="utf-8"), name, 1
        raise FileNotFoundError(f"no shader file {name!r} in {', '.join(str(root) for root in roots)}")
    for file in (file for root in roots for file in sorted(root.glob("*.py"))):
        before, found, _ = file.read_text(encoding="utf-8").partition(name)
        if found:
            return name, file.name, before.count("\n") + 1
    return name, "inline source", 1
