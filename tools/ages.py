"""Lists the measured figures of the documentation with what changed since they were made.

    python tools/ages.py
    python tools/ages.py --record 'shadowbench run -s filters' shadow-map cascades

A record is a comment above tables and pictures. It holds for what follows it, until a heading of its section's level:

    <!-- measured by 'COMMAND' of TECHNIQUE …; draw 1, trace 1, score 2, shaders 1a2b3c4d, 2026-11-26 -->

The versions are those of shadowbench/versions.py, and the digest is of all shaders of these techniques, with each of
their filters and biases; without a technique, of all. A figure of times has the word `times` in place of them, since
every change may show in it; one that was made before there were records, the word `unrecorded`. The second form prints
a record of today.
"""

import argparse
import hashlib
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from shadowbench import versions
from shadowbench.measure.keys import glsl, shader_names
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques

ROOT = Path(__file__).resolve().parent.parent
START = "<!-- measured by "
RECORD = re.compile(
    START + r"'(?P<command>[^']+)'(?: of (?P<techniques>[^;]+))?; (?P<state>.+), (?P<date>\d{4}-\d\d-\d\d) -->"
)
DRAWING = ("shaders", "shadowbench/gl", "shadowbench/maps", "shadowbench/techniques")


@dataclass(frozen=True)
class Record:
    """A record in a page, and the lines that it holds for, counted from 0; state: versions, or one word."""

    page: Path
    lines: range
    command: str
    techniques: tuple[str, ...]
    state: tuple[str, ...]
    date: str

    @property
    def changes(self) -> str:
        """What changed since the figure was made; empty if nothing did."""
        if self.state == ("unrecorded",):
            return "made before versions were recorded"
        if self.state == ("times",):
            since = ["git", "rev-list", "--count", "--no-merges", f"--since={self.date} 23:59", "HEAD", "--", *DRAWING]
            count = subprocess.run(since, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
            return "" if count == "0" else f"{count} later commits to what draws"
        now = dict(one.split(" ") for one in _state(self.techniques))
        then = dict(one.split(" ") for one in self.state)
        return ", ".join(f"{key} {then[key]}, now {now[key]}" for key in then if then[key] != now[key])


def record(command: str, techniques: Sequence[str] = (), *, state: Sequence[str] = ()) -> str:
    """The comment for a figure made now; state: a word in place of versions."""
    of = f" of {' '.join(techniques)}" if techniques else ""
    return f"{START}'{command}'{of}; {', '.join(state or _state(techniques))}, {datetime.now(UTC):%Y-%m-%d} -->"


def records(page: Path) -> Iterator[Record]:
    """The records of a page. Raises SystemExit for one that is malformed."""
    lines, level = prose(page).splitlines(), 1
    for number, line in enumerate(lines):
        level = _level(line) or level
        if not line.startswith(START):
            continue
        found = RECORD.fullmatch(line)
        if not found:
            raise SystemExit(f"{page}:{number + 1}: found {line!r}; allowed: what ages.py --record prints")
        ends = (at for at in range(number, len(lines)) if 0 < _level(lines[at]) <= level)
        scope, techniques = range(number, next(ends, len(lines))), tuple((found["techniques"] or "").split())
        yield Record(page, scope, found["command"], techniques, tuple(found["state"].split(", ")), found["date"])


def prose(page: Path) -> str:
    """The text of a page, fenced blocks being empty lines."""
    text = page.read_text(encoding="utf-8")
    return re.sub(r"(?ms)^```.*?^```$", lambda block: "\n" * block[0].count("\n"), text)


def renew(page: Path, command: str, techniques: Sequence[str] = (), *, state: Sequence[str] = ()) -> None:
    """Replace the record of a command in a page by one of today."""
    text = page.read_text(encoding="utf-8")
    made, count = re.subn(
        rf"(?m)^{re.escape(START)}'{re.escape(command)}'.*$", record(command, techniques, state=state), text
    )
    if count != 1:
        raise SystemExit(f"{page}: found {count} records of {command!r}; allowed: 1")
    page.write_text(made, encoding="utf-8")


def _level(line: str) -> int:
    """Level of a heading, 0 for other lines."""
    return len(line) - len(line.lstrip("#")) if re.match("#+ ", line) else 0


def _state(techniques: Sequence[str]) -> tuple[str, ...]:
    known = {one.name: one for one in own_techniques()}
    digest = hashlib.sha256()
    for one in (known[name] for name in techniques or sorted(known)):
        defaults = [info.default for info in one.Params.model_fields.values()]
        components = [row for each in defaults if isinstance(each, Component) for row in each.family().table.values()]
        for name in sorted(set(shader_names([one], components, plugged=False))):
            digest.update(glsl(name)[0].encode())
    numbers = {"draw": versions.DRAW, "trace": versions.TRACE, "score": versions.SCORE}
    return (*(f"{key} {value}" for key, value in numbers.items()), f"shaders {digest.hexdigest()[:8]}")


def pages() -> list[Path]:
    """The README and the pages of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main() -> int:
    """Print a line for each record, or a record of today."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", metavar="COMMAND")
    parser.add_argument("techniques", metavar="TECHNIQUE", nargs="*")
    asked = parser.parse_args()
    if asked.record:
        print(record(asked.record, asked.techniques))
        return 0
    for one in (each for page in pages() for each in records(page)):
        place = f"{one.page.relative_to(ROOT)}:{one.lines[0] + 1}"
        print(f"{place:46} {one.date}  {one.changes or 'current'}  ({one.command})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
