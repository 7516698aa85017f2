"""Shader source texts composed from includes and defines.

`#include "bias/slope.glsl"` includes a file of the first root that has it, `#include <bias>` the file or text that the
caller assigned to this slot. Each file is included once, at its first include. Followed by `with bias = bias_first`, an
include renames: `bias_` and `BIAS_` in the file and its includes become `bias_first_` and `BIAS_FIRST_`, and `<bias>`
becomes the slot `<bias_first>`.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

VERSION = "#version 410 core"
_WITH = r"(?:[ \t]+with[ \t]+(\w+)[ \t]*=[ \t]*(\w+))?"
_INCLUDE = re.compile(rf'^[ \t]*#include[ \t]+(?:"([^"]+)"|<([^>]+)>){_WITH}[ \t]*$', re.MULTILINE)


def compose(
    source: Path | str, roots: Sequence[Path], defines: Mapping[str, str] = {}, slots: Mapping[str, str] = {}
) -> str:
    """The complete source text of one shader stage.

    source, and each slot's: a file relative to a root, or the source itself if it has several lines. Raises
    FileNotFoundError for an include that no root has, KeyError for a slot without a file.
    """
    taken: set[tuple[Path | str, str]] = set()

    def expand(text: str, old: str = "", new: str = "") -> str:
        text = _renamed(text, old, new) if old else text
        return _INCLUDE.sub(lambda match: include(match[1] or slots[match[2]], match[3] or old, match[4] or new), text)

    def include(name: str, old: str = "", new: str = "") -> str:
        found = name if "\n" in name else _find(name, roots)
        if (found, new) in taken:
            return ""
        taken.add((found, new))
        return expand(found.read_text(encoding="utf-8") if isinstance(found, Path) else found, old, new)

    body = include(str(source))
    return "\n".join([VERSION, *(f"#define {name} {value}" for name, value in defines.items()), body])


def _renamed(text: str, old: str, new: str) -> str:
    text = re.sub(rf"\b{old}(?=[_>])", new, text)
    return re.sub(rf"\b{old.upper()}(?=_)", new.upper(), text)


def numbered(text: str) -> str:
    """The source text with line numbers, for error messages."""
    return "\n".join(f"{number:4d}  {line}" for number, line in enumerate(text.splitlines(), start=1))


def _find(name: str, roots: Sequence[Path]) -> Path:
    for root in roots:
        if (root / name).is_file():
            return root / name
    raise FileNotFoundError(f"no shader file {name!r} in {', '.join(str(root) for root in roots)}")
