"""Shader texts composed from includes and defines, so that no combination is ever written out.

`#include "bias/slope.glsl"` takes a file from the first root that has it, `#include <bias>` the file that the caller
put into that slot. A file is taken once, wherever it is asked for first. After either, `with bias = bias_first` takes
it under another name: `bias_` and `BIAS_` in it, and in what it includes, become `bias_first_` and `BIAS_FIRST_`, and
`<bias>` the slot `<bias_first>`.
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
    """The whole text of one shader stage; `source` is a file below a root, or the text itself when it has lines.

    Raises FileNotFoundError for an include that no root has, KeyError for a slot that is not filled.
    """
    taken: set[tuple[Path, str]] = set()

    def expand(text: str, old: str = "", new: str = "") -> str:
        text = _renamed(text, old, new) if old else text
        return _INCLUDE.sub(lambda match: include(match[1] or slots[match[2]], match[3] or old, match[4] or new), text)

    def include(name: str, old: str = "", new: str = "") -> str:
        path = _find(name, roots)
        if (path, new) in taken:
            return ""
        taken.add((path, new))
        return expand(path.read_text(encoding="utf-8"), old, new)

    text = source if isinstance(source, str) and "\n" in source else include(str(source))
    body = expand(text)
    return "\n".join([VERSION, *(f"#define {name} {value}" for name, value in defines.items()), body])


def _renamed(text: str, old: str, new: str) -> str:
    text = re.sub(rf"\b{old}(?=[_>])", new, text)
    return re.sub(rf"\b{old.upper()}(?=_)", new.upper(), text)


def numbered(text: str) -> str:
    """The text with line numbers, for the message of a shader that does not compile."""
    return "\n".join(f"{number:4d}  {line}" for number, line in enumerate(text.splitlines(), start=1))


def _find(name: str, roots: Sequence[Path]) -> Path:
    for root in roots:
        if (root / name).is_file():
            return root / name
    raise FileNotFoundError(f"no shader file {name!r} in {', '.join(str(root) for root in roots)}")
