"""Generates docs/explanation/laws.md from the table checked by tests/laws; --check reports a stale one."""

import argparse
import sys
from pathlib import Path

from pages import compare

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "explanation" / "laws.md"
sys.path.insert(0, str(ROOT))  # `tests` is not installed

from tests.laws.changes import LAWS  # noqa: E402
from tests.laws.table import KINDS, RAYS, TABLE  # noqa: E402

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
follow the geometry alone: {exact}.
"""
DECIDED = """\
Decided pixels: for the truth, those that are not undecided. For a technique, those whose visibility stays on the same
side of ½ when the image grid is shifted by 1/256 pixel along its diagonals, and when the map's grid is shifted by 1/256
texel, or the lamp by as much if there is no map.
"""


def page() -> str:
    """The whole page: the kinds of claims, then each law with its reason and with what is claimed of whom."""
    lines = [HEAD.format(exact=", ".join(f"`{name}`" for name in RAYS)), "| claim | meaning |", "|---|---|"]
    lines += [f"| {'–' if kind == 'none' else kind} | {meaning} |" for kind, meaning in KINDS.items()]
    lines += ["", DECIDED]
    for number, (name, change) in enumerate(LAWS.items(), start=1):
        lines += [f"## {number}. {name[0].upper()}{name[1:]}", "", " ".join((change.__doc__ or "").split()), ""]
        for names, kind, why, *restricted in TABLE[name]:
            others = "others" if len(TABLE[name]) > 1 else "all"
            subjects = "exact ones" if names == RAYS else ", ".join(f"`{one}`" for one in names) or others
            claim = ("–" if kind == "none" else kind) + (" (sun)" if restricted else "")
            lines.append(f"- **{claim}**, {subjects}: {why}")
        lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


def main() -> int:
    """Run the command; returns 1 with --check and a stale page, else 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if docs/explanation/laws.md is stale")
    if parser.parse_args().check:
        return compare(PAGE, page(), Path(__file__).name)
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
