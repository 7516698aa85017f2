"""Makes docs/laws.md from the table that tests/laws checks; --check says whether it is stale."""

import argparse
import difflib
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "laws.md"
sys.path.insert(0, str(ROOT))  # `tests` is no package that is installed

from tests.laws.changes import LAWS  # noqa: E402
from tests.laws.table import KINDS, LIGHTS, Claim, claims, subjects  # noqa: E402

HEAD = """\
# Laws

What may be done to a scene without moving a shadow, and which technique keeps it. Made by `python tools/law_docs.py`
from the table that `tests/laws` checks on little random scenes with hypothesis; `make test-slow` takes more of them.

A claim stands only where something argues for it, and is checked there; `–` is not claimed, for the reason given below.
Techniques are at their defaults but for what is named; `count=1024` is more planes than there are, since which of
several equal ones are the 32 largest hangs on rounding.
"""
DECIDED = """\
Decided: for the truth, what it does not call undecided. For a technique, what stays on its side of ½ when the
picture's grid is nudged by 1/256 pixel along its diagonals, and then the map's by 1/256 texel, or the lamp by as much
where there is no such map.
"""


def word(claim: Claim) -> str:
    """A cell of the table."""
    if claim.kind == "none":
        return "–"
    return claim.kind if claim.lights == frozenset(LIGHTS) else f"{claim.kind} ({lights(claim)})"


def lights(claim: Claim) -> str:
    """The lights that a claim is restricted to."""
    names = {"directional": "sun", "point": "lamp", "spot": "spot"}
    return ", ".join(names[kind] for kind in LIGHTS if kind in claim.lights)


def page() -> str:
    """The whole page."""
    return "\n".join([HEAD, *_table(), "", *_kinds(), *_laws()])


def _table() -> Iterator[str]:
    cells = {(law, name): claim for law, name, claim in claims()}
    links = (f"[{number}](#{anchor(number, name)})" for number, name in enumerate(LAWS, start=1))
    yield "|  | " + " | ".join(links) + " |"
    yield "|---" * (len(LAWS) + 1) + "|"
    for name in subjects():
        yield f"| `{name}` | " + " | ".join(word(cells[law, name]) for law in LAWS) + " |"


def _kinds() -> Iterator[str]:
    yield "| claim | what holds |\n|---|---|"
    yield from (f"| {'–' if kind == 'none' else kind} | {what} |" for kind, what in KINDS.items())
    yield f"\n{DECIDED}"


def _laws() -> Iterator[str]:
    for number, (name, law) in enumerate(LAWS.items(), start=1):
        yield f"## {number}. {name[0].upper()}{name[1:]}\n\n{law.says} {law.why}\n"
        grounds: dict[tuple[str, str], list[str]] = {}
        for one, subject, claim in claims():
            if one == name:
                grounds.setdefault((word(claim), claim.why), []).append(subject)
        yield from (f"- **{kind}**, {named(names)}: {why}" for (kind, why), names in grounds.items())
        yield ""


def named(chosen: list[str]) -> str:
    """Some of the subjects, by whatever is shorter."""
    others = [name for name in subjects() if name not in chosen]
    if not others:
        return "all"
    some, words = (others, "all but ") if len(others) < len(chosen) else (chosen, "")
    return words + ", ".join(f"`{name}`" for name in some)


def anchor(number: int, name: str) -> str:
    """Of a law's heading."""
    return f"{number}-{name.lower().replace(' ', '-')}"


def main() -> int:
    """0, or 1 with --check and a stale page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="say whether docs/laws.md is stale, and change nothing")
    made = page().rstrip("\n") + "\n"
    if parser.parse_args().check:
        found = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
        sys.stdout.writelines(difflib.unified_diff(found.splitlines(True), made.splitlines(True), "found", "made"))
        return int(found != made)
    PAGE.write_text(made, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
