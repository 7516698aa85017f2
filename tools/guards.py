"""Run a fixed set of commands in a checkout and keep all that they yield; compare what two checkouts yielded.

    python tools/guards.py record CHECKOUT OUT [--only NAME...]
    python tools/guards.py compare A B [--only NAME...]

`record` runs the package of CHECKOUT, with this Python, two groups of `tools/guards/commands.toml` at a time, and keeps
rows, tables, masks, pictures, pages, both streams and exit codes in OUT, a folder per group; `--only` records these
groups again and keeps the others. OUT must stay where it is. Truths and compiled loops are cached inside it and begin
empty, so that nothing of another version is used.

`compare` prints each difference on a line and exits 1 if there is one. Masks and pictures are compared pixel by pixel,
under the names of their cells. Not compared: keys and files named after them, `command`, versions, times and what is
computed of times, folders, the order of rows and of lines on stderr; of `_NAME` all but its exit code; of `NAME~` the
numbers and the order of lines.
"""

import argparse
import csv
import difflib
import hashlib
import html
import json
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

INPUTS = Path(__file__).with_name("guards")
GROUPS: dict[str, dict[str, str]] = tomllib.loads((INPUTS / "commands.toml").read_text())
IDENTITY = (
    "kind", "scene", "view", "light", "phase", "full_spec", "map_size", "view_size", "coordinates", "axis",
    "axis_value", "light_kind", "step",
)  # fmt: skip
LEFT_OUT = {"key", "keys", "reference_key", "command", "finished", "build", "shadowbench"}
TIMED = re.compile(r"(^|_)(ms|ratio|iqr|quartiles|noise_worst)$|^(ratio|ms|pass)_")
HIDDEN = [
    (re.compile(r"\b[0-9a-f]{24}\b"), "KEY"),
    (re.compile(r"\b\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d)?\S*)?"), "DATE"),
    (re.compile(r"~?[\d.]+ ?(ms|s|min|h|seconds|minutes|hours)\b"), "TIME"),
]
TRANSIENT = re.compile(r"^[\w-]+: \d+ of \d+, |^note: compiling loops")
NUMBER = re.compile(r"~?[-+]?\d[\d.,]*(e[-+]?\d+)?")


def main() -> int:
    """Record or compare, as the command line says; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["record", "compare"])
    parser.add_argument("first", type=Path, metavar="CHECKOUT|A")
    parser.add_argument("second", type=Path, metavar="OUT|B")
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=list(GROUPS), metavar="NAME")
    chosen = parser.parse_args()
    first, second = chosen.first.resolve(), chosen.second.resolve()
    return record(first, second, chosen.only) if chosen.action == "record" else compare(first, second, chosen.only)


def record(checkout: Path, out: Path, groups: list[str]) -> int:
    """Run these groups, two at a time, the first ones first."""
    for folder in ("cache", "inputs", *groups):
        shutil.rmtree(out / folder, ignore_errors=True)
    shutil.copytree(INPUTS, out / "inputs")
    (out / "checkout").write_text(str(checkout))
    with ThreadPoolExecutor(2) as pool:
        for line in pool.map(lambda group: record_group(checkout, out, group), groups):
            print(line, flush=True)
    return 0


def record_group(checkout: Path, out: Path, group: str) -> str:
    """Run a group's commands one after another in a folder of its own; the time that it took."""
    folder = out / group
    folder.mkdir(parents=True)
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "FORCE_COLOR", "SHADOWBENCH_SCENES", "SHADOWBENCH_ISA")
    environment = {name: value for name, value in os.environ.items() if name not in hidden} | {
        "PYTHONPATH": str(checkout),
        "SHADOWBENCH_CACHE": str(out / "cache" / "truths"),
        "NUMBA_CACHE_DIR": str(out / "cache" / "numba"),
        "COLUMNS": "200",
        "NO_COLOR": "1",
    }
    began, processor = time.monotonic(), 0.0
    for label, command in GROUPS[group].items():
        words = command.format(checkout=checkout, inputs="../inputs").split()
        start = [] if words[0].endswith(".py") else ["-m", "shadowbench"]
        with (folder / f"{label}.stdout").open("w") as stdout, (folder / f"{label}.stderr").open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, *start, *words],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
            )
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        (folder / f"{label}.exit").write_text(str(process.returncode))
        processor += usage.ru_utime + usage.ru_stime
    return f"{group}: {time.monotonic() - began:.0f} s, {processor:.0f} s of a core"


def compare(a: Path, b: Path, groups: list[str]) -> int:
    """Print every difference between two records."""
    found = 0
    for group in groups:
        sides = dict(facts(a, group)), dict(facts(b, group))
        for name in sorted(sides[0].keys() | sides[1].keys()):
            for line in differences(sides[0].get(name), sides[1].get(name)):
                print(f"{group}/{name}: {line}")
                found += 1
        print(f"{group}: {len(sides[0])} and {len(sides[1])} facts", file=sys.stderr)
    return 1 if found else 0


def differences(a: Any, b: Any) -> Iterator[str]:
    """Each difference between two values of a fact: fields, lines, pixels or one text."""
    if a is None or b is None:
        yield "only in " + ("B" if a is None else "A")
    elif isinstance(a, dict) and isinstance(b, dict):
        for field in sorted(a.keys() | b.keys()):
            if a.get(field) != b.get(field):
                yield f"{field}: {a.get(field, 'none')} -> {b.get(field, 'none')}"
    elif isinstance(a, list) and isinstance(b, list):
        lines = difflib.unified_diff(a, b, lineterm="", n=0)
        yield from (line for line in lines if not line.startswith(("---", "+++", "@@")))
    elif isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        if a.shape != b.shape or a.dtype != b.dtype:
            yield f"{a.shape} {a.dtype} -> {b.shape} {b.dtype}"
        elif not np.array_equal(a, b, equal_nan=a.dtype.kind == "f"):
            apart = np.abs(a.astype(float) - b.astype(float))
            yield f"{np.count_nonzero(a != b)} of {a.size} values differ, by up to {np.nanmax(apart):g}"
    elif a != b:
        yield f"{a} -> {b}"


def facts(store: Path, group: str) -> Iterator[tuple[str, Any]]:
    """What a group yielded, by name, without what may differ."""
    folder, checkout = store / group, (store / "checkout").read_text()
    cells = {rows.parent: cells_of(rows) for rows in folder.rglob("rows.jsonl")}
    seen: Counter[str] = Counter()
    for file in sorted(folder.rglob("*")):
        path = str(file.relative_to(folder))
        if not file.is_file() or (path.startswith("_") and file.suffix != ".exit"):
            continue
        if re.fullmatch("[0-9a-f]{24}", file.stem):
            path = f"{file.parent.relative_to(folder)}/{cells.get(file.parent.parent, {}).get(file.stem, 'no cell')}"
        for part, value in read(file, cells.get(file.parent, {}), Texts(store, checkout, "~" in path)):
            name = f"{path}{part}"
            seen[name] += 1
            yield name + (f" ({seen[name]})" if seen[name] > 1 else ""), value


def cells_of(rows: Path) -> dict[str, str]:
    """The cell of each key in a folder's rows."""
    records = [json.loads(line) for line in rows.read_text().splitlines()]
    return {record["key"]: identity(record) for record in records if record["kind"] == "score"}


def identity(record: Mapping[str, Any]) -> str:
    """The fields that identify a row's cell, without its key."""
    return " ".join(str(record[name]) for name in IDENTITY if record.get(name) not in (None, ""))


def read(file: Path, cells: dict[str, str], texts: "Texts") -> Iterator[tuple[str, Any]]:
    """A file's facts: the name of each within the file, and its value."""
    if file.suffix == ".png":
        yield "", np.asarray(Image.open(file))
    elif file.suffix == ".npz":
        with np.load(file) as arrays:
            yield from ((f" {name}", arrays[name]) for name in arrays)
    elif file.suffix == ".glb":
        yield "", hashlib.sha256(file.read_bytes()).hexdigest()
    elif file.suffix == ".jsonl":
        for line in file.read_text().splitlines():
            record = json.loads(line)
            cell = (
                identity(record) if record["kind"] == "score" else f"time of {cells.get(record['key'], 'a reference')}"
            )
            yield f" {cell}", dict(texts.flat(record))
    elif file.suffix == ".csv":
        with file.open(newline="") as stream:
            reader = csv.DictReader(stream)
            yield " columns", list(reader.fieldnames or [])
            for number, row in enumerate(reader, 1):
                yield f" {identity(row) if 'full_spec' in row else number}", dict(texts.flat(row))
    else:
        text = file.read_text()
        try:
            yield "", dict(texts.flat(json.loads(text)))
        except json.JSONDecodeError:
            page = re.sub(r"(?s)<(script|style)\b.*?</\1>|<[^>]*>", "\n", text) if file.suffix == ".html" else text
            lines = texts.lines(html.unescape(page) if page is not text else page)
            yield "", sorted(lines) if texts.words or file.suffix == ".stderr" else lines


class Texts:
    """Hides what may differ between two records: folders, keys, dates, times; with `words` every number."""

    def __init__(self, store: Path, checkout: str, words: bool) -> None:
        self.folders = {str(store): "STORE", checkout: "CHECKOUT"}
        self.words = words

    def plain(self, text: str) -> str:
        """A text with names in place of what is hidden."""
        for folder, name in self.folders.items():
            text = text.replace(folder, name)
        for pattern, name in HIDDEN:
            text = pattern.sub(name, text)
        return re.sub(r"[ ─-]+", " ", NUMBER.sub("#", text)).strip() if self.words else text.rstrip()

    def lines(self, text: str) -> list[str]:
        """The lines of a stream or page, without progress."""
        return [self.plain(line) for line in text.splitlines() if line.strip() and not TRANSIENT.match(line)]

    def flat(self, value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
        """Every leaf of nested JSON by its path; a time is only there or not."""
        field = name.rpartition(".")[2]
        if field in LEFT_OUT:
            return
        if TIMED.search(field) and not isinstance(value, dict):
            yield name, "none" if value in (None, "") else "a time"
        elif isinstance(value, dict):
            for inner, part in value.items():
                yield from self.flat(part, f"{name}.{inner}" if name else inner)
        elif isinstance(value, list):
            for number, part in enumerate(value):
                yield from self.flat(part, f"{name}.{number}")
        else:
            yield name, self.plain(value) if isinstance(value, str) else value


if __name__ == "__main__":
    sys.exit(main())
