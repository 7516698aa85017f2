"""Holds every file to the ledger: one capability each, and no capability larger than its entry.

    python tools/ledger.py            # what `make lint` runs: exits with 1 and a line for each breach
    python tools/ledger.py --record   # writes today's sizes into the entries, once a change has made some smaller
    python tools/ledger.py --files    # the files of each capability

`tools/ledger.toml` has for each capability whom it serves, why it is here, its files and its size. Sizes are lines of
code, by room, and `statements`, those of its Python; of documentation, words. Data, pictures and configuration count
nothing but belong to a capability too. A size may be at most 2% smaller than its entry says, so that what a change
wins is recorded with that change. `[total]` has the limits of the sums; against the merge base they never rise.
"""

import argparse
import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LEDGER = "tools/ledger.toml"
CODE = {
    "shadowbench": {".py", ".js", ".css", ".html", ".j2", ".json"},
    "shaders": {".glsl", ".vert", ".geom", ".frag"},
    "tests": {".py"},
    "tools": {".py", ".sh"},
    "benchmarks": {".py"},
    "examples": {".py"},
    "docs": {".md"},
}
SLACK, LEAST = 1.02, 10  # an entry of fewer than LEAST lines more than what stands is not slack


def tracked() -> list[str]:
    """Paths of the files that belong to a capability, also of those not committed yet."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *CODE]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted({name for name in names if (ROOT / name).is_file()})


def sizes(name: str) -> Counter[str]:
    """Lines (or words) of a file under the name of its room, and its statements."""
    room = name.partition("/")[0]
    if Path(name).suffix not in CODE[room]:
        return Counter()
    text = (ROOT / name).read_text(encoding="utf-8")
    count = Counter({room: len(text.split() if room == "docs" else text.splitlines())})
    if name.endswith(".py"):
        count["statements"] = sum(isinstance(node, ast.stmt) for node in ast.walk(ast.parse(text)))
    return count


def totals(names: list[str], sums: Counter[str]) -> dict[str, int]:
    """What `[total]` limits."""
    help_page = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {room: sums[room] for room in CODE} | {
        "python_files": sum(name.startswith("shadowbench/") and name.endswith(".py") for name in names),
        "commands": len(re.findall(r"^## ", help_page, re.MULTILINE)),
        "options": len(re.findall(r"^ +(?:-\w, )?--[a-z]", help_page, re.MULTILINE)),
        "dependencies": len(project["dependencies"]),
    }


def base_totals() -> dict[str, int]:
    """The limits of the sums at the merge base with main, or one commit ago on main itself; empty without a ledger."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True).stdout.strip()

    head = git("rev-parse", "HEAD")
    base = git("merge-base", "HEAD", "origin/main") or git("merge-base", "HEAD", "main")
    text = git("show", f"{git('rev-parse', 'HEAD^') if base in ('', head) else base}:{LEDGER}")
    return dict(tomllib.loads(text)["total"]) if text else {}


def breaches(
    entries: dict[str, dict[str, Any]], owners: dict[str, list[str]], found: dict[str, Counter[str]]
) -> Iterator[str]:
    """A line for each file without one owner, and for each entry that is exceeded or has slack."""
    for name, owning in owners.items():
        if len(owning) != 1:
            yield f"{name}: in {' and '.join(owning) or 'no entry'}; allowed: exactly one"
    for capability, entry in entries.items():
        for what in sorted(entry["size"].keys() | found[capability].keys()):
            limit, size = entry["size"].get(what, 0), found[capability][what]
            if size > limit:
                yield f"{capability}: {what} {size}; its entry has {limit}: take the rest from another entry"
            elif limit > max(SLACK * size, size + LEAST):
                yield f"{capability}: {what} {size}; its entry has {limit}: record what was won by --record"


def record(found: dict[str, Counter[str]]) -> None:
    """Write what stands there into the ledger's `size` lines; entries, comments and limits stay."""
    lines, capability = [], ""
    for line in (ROOT / LEDGER).read_text(encoding="utf-8").splitlines():
        if heading := re.fullmatch(r"\[(.+)\]", line):
            capability = heading[1]
        if line.startswith("size = "):
            line = f"size = {{ {', '.join(f'{what} = {size}' for what, size in sorted(found[capability].items()))} }}"
        lines.append(line)
    (ROOT / LEDGER).write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> int:
    """Check, record or list, as the command line says; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="write today's sizes into the entries")
    parser.add_argument("--files", action="store_true", help="list the files of each capability")
    chosen = parser.parse_args()
    entries = tomllib.loads((ROOT / LEDGER).read_text(encoding="utf-8"))
    limits = entries.pop("total")
    names = tracked()
    owners = {
        name: [key for key, entry in entries.items() if any(fnmatchcase(name, one) for one in entry["files"])]
        for name in names
    }
    found, sums = defaultdict[str, Counter[str]](Counter), Counter[str]()
    for name, owning in owners.items():
        size = sizes(name)
        sums += size
        for capability in owning:
            found[capability] += size
    if chosen.files:
        for capability in entries:
            print(capability, *(name for name, owning in owners.items() if capability in owning), sep="\n    ")
        return 0
    if chosen.record:
        record(found)
        return 0
    lines, base = list(breaches(entries, owners, found)), base_totals()
    for what, total in totals(names, sums).items():
        if total > limits[what]:
            lines.append(f"total: {what} {total}; allowed: {limits[what]}")
        if limits[what] > base.get(what, limits[what]):
            lines.append(f"total: {what} {limits[what]}, and {base[what]} before: totals do not rise")
    print(*lines, sep="\n", file=sys.stderr, end="\n" if lines else "")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
