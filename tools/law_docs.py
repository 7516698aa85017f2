"""Generates docs/explanation/laws.md from the table checked by tests/laws; --check reports a stale one."""

import argparse
import difflib
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "explanation" / "laws.md"
sys.path.insert(0, str(ROOT))  # `tests` is not installed

from tests.laws.changes import LAWS  # noqa: E402
from tests.laws.table import KINDS, LIGHTS, RAYS, TABLE, Claim, claims, subjects  # noqa: E402

HEAD = """\
# Laws

```console
$ shadowbench stress -t shadow-map --axis distance --axis distance-absolute
shadow-map
axis               sun                         spot
distance           0…1e7 m                     0…1e7 m
distance-absolute  breaks at 1e5 m: IoU 0.937  breaks at 1e6 m: leak 6.23%
…
```

The first line is the first law below, the second what becomes of it with raw float32 coordinates.

Changes of a scene that must not change its shadows, and which techniques satisfy them. `python tools/law_docs.py` makes
this page from the table that `tests/laws` checks on small random scenes. Every claim follows from an argument and is
tested; `–` means that nothing is claimed. Techniques are at their defaults except for the parameters named. Exact ones
follow the geometry alone, as the truth does; `count=1024` exceeds the number of planes, since rounding decides which of
several equal ones are among the 32 largest.
"""
DECIDED = """\
Decided pixels: for the truth, those that are not undecided. For a technique, those whose visibility stays on the same
side of ½ when the image grid is shifted by 1/256 pixel along its diagonals, and when the map's grid is shifted by 1/256
texel, or the lamp by as much if there is no map.
"""


def word(claim: Claim) -> str:
    """Text of a table cell."""
    if claim.kind == "none":
        return "–"
    return claim.kind if claim.lights == frozenset(LIGHTS) else f"{claim.kind} ({lights(claim)})"


def lights(claim: Claim) -> str:
    """Names of the lights that a claim is restricted to."""
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
    yield "| claim | meaning |\n|---|---|"
    yield from (f"| {'–' if kind == 'none' else kind} | {what} |" for kind, what in KINDS.items())
    yield f"\n{DECIDED}"


def _laws() -> Iterator[str]:
    for number, (name, change) in enumerate(LAWS.items(), start=1):
        yield f"## {number}. {name[0].upper()}{name[1:]}\n\n{' '.join((change.__doc__ or '').split())}\n"
        for names, kind, why, *lights in TABLE[name]:
            claim = Claim(kind, why, frozenset(*lights or [LIGHTS]))
            others = "others" if len(TABLE[name]) > 1 else "all"
            subjects_named = "exact ones" if names == RAYS else ", ".join(f"`{one}`" for one in names) or others
            yield f"- **{word(claim)}**, {subjects_named}: {why}"
        yield ""


def anchor(number: int, name: str) -> str:
    """Anchor of a law's heading."""
    return f"{number}-{name.lower().replace(' ', '-')}"


def main() -> int:
    """Run the command; returns 1 with --check and a stale page, else 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--check", action="store_true", help="exit with 1 if docs/explanation/laws.md is stale; write nothing"
    )
    made = page().rstrip("\n") + "\n"
    if parser.parse_args().check:
        found = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
        sys.stdout.writelines(difflib.unified_diff(found.splitlines(True), made.splitlines(True), "found", "made"))
        return int(found != made)
    PAGE.write_text(made, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
