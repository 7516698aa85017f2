"""Measures the studies of benchmarks/published/ and keeps what the site shows of them in results/published/.

    python tools/publish.py
    python tools/publish.py engines DIR...

Without arguments it measures what is not there yet, into build/published/NAME, where an interrupted run goes on. Given
run folders, such as one of `shadowbench engines measure`, it takes their rows as NAME; of a cell that several have, the
row of the last.

Kept are rows without undefined metrics, `run.json`, and images of fewer grey levels and colours. Rows get the commit
with which they were measured: this checkout's, or the one that --commit names. SHA256SUMS has the digest of each file.
"""

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from shadowbench.measure.rows import Record
from shadowbench.results.frame import identity, read_runs, view_name
from shadowbench.scores.masks import read_mask
from shadowbench.scores.metrics import is_soft

ROOT = Path(__file__).resolve().parent.parent
STUDIES, PUBLISHED, WORK = (ROOT / name for name in ("benchmarks/published", "results/published", "build/published"))
SHOWN = (None, 1024)
"""Map sizes of techniques whose masks are kept."""
GREYS, SOFT_GREYS, COLORS = 4, 32, 32
"""Steps between black and white of masks, also of soft ones, and colours of pictures: for compression."""


def main() -> int:
    """Measure the studies, or take the folders that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", metavar="NAME", nargs="?")
    parser.add_argument("folders", metavar="DIR", type=Path, nargs="*")
    parser.add_argument("--commit", help="of the code that measured rows which name none")
    asked = parser.parse_args()
    commit = asked.commit or _git("rev-parse", "--short=10", "HEAD")
    if asked.name:
        condense(asked.folders, PUBLISHED / asked.name, commit)
    else:
        for study in sorted(STUDIES.glob("*.toml")):
            measure(study)
            condense([WORK / study.stem], PUBLISHED / study.stem, commit)
    (PUBLISHED / "SHA256SUMS").write_text("".join(digests(PUBLISHED)), encoding="utf-8")
    return 0


def measure(study: Path) -> None:
    """Measure what a study lacks, into a copy of what is published of it."""
    folder, published = WORK / study.stem, PUBLISHED / study.stem
    if not folder.exists() and published.exists():
        shutil.copytree(published, folder)
    command = ["run", "-s", study.relative_to(ROOT), "-o", folder.relative_to(ROOT), "--quiet"]
    subprocess.run([sys.executable, "-m", "shadowbench", *command], cwd=ROOT, check=True)


def condense(folders: Sequence[Path], target: Path, commit: str) -> None:
    """Write what is kept of run folders into `target`, in place of what is there."""
    runs = read_runs(folders)
    rows = {identity(row): row for run in runs for row in run.rows}
    source = {row["key"]: (run, row) for run in runs for row in run.rows}
    times = {key: time for run in runs for key, time in run.times.items()}
    beside = target.with_name(f".{target.name}")
    shutil.rmtree(beside, ignore_errors=True)
    (beside / "masks").mkdir(parents=True)
    found = {name for run in runs for name in (str(run.folder), _place(run.folder))}
    names = dict.fromkeys(sorted(found, key=len, reverse=True), _place(target))  # one may begin with another
    lines: list[dict[str, Any]] = []
    for row in rows.values():
        lines.append(_kept(row, names) | {"commit": row.get("commit", commit)})
        lines += [dict(times[row["key"]])] if row["key"] in times else []
    _write(
        beside / "rows.jsonl",
        "".join(json.dumps(line, ensure_ascii=False, separators=(",", ":")) + "\n" for line in lines),
    )
    about = dict(next(run.about for run in runs if run.about))
    about["command"] = "; ".join(dict.fromkeys(line["command"] for line in lines if "command" in line))
    about["keys"] = [row["key"] for row in rows.values()]
    # The release of a kernel names the host that built it.
    about["machine"] = about["machine"] | {"system": re.sub(r" \S*-\S* ", " ", about["machine"]["system"])}
    _write(beside / "run.json", json.dumps(about, indent=1, ensure_ascii=False) + "\n")
    for key in _pictured(beside):
        run, row = source[key]
        _keep_truth(run.folder, beside, row)
        _grey(run.folder / "masks" / f"{key}.png", beside / "masks" / f"{key}.png", row)
    shutil.rmtree(target, ignore_errors=True)
    beside.rename(target)


def digests(folder: Path) -> Iterator[str]:
    """Lines of `sha256sum` on all files of a folder but SHA256SUMS."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name != "SHA256SUMS":
            yield f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.relative_to(folder).as_posix()}\n"


def _kept(row: Record, names: dict[str, str]) -> dict[str, Any]:
    """A row without undefined metrics; its command names the published folder."""
    kept = dict(row)
    if "metrics" in row:
        kept["metrics"] = {name: value for name, value in row["metrics"].items() if value is not None or name == "iou"}
    for found, name in names.items():
        kept["command"] = kept["command"].replace(found, name)
    return kept


def _pictured(folder: Path) -> list[str]:
    """Keys of the rows whose masks are kept: of techniques at SHOWN, of engines as shipped."""
    (run,) = read_runs([folder])
    drawn = [row for row in run.rows if row["status"] == "ok"]
    return [
        row["key"]
        for row in drawn
        if (row["spec"] == row["technique"] if "engine" in row else row["map_size"] in SHOWN)
    ]


def _keep_truth(folder: Path, target: Path, row: Record) -> None:
    """Keep the images of a row's view that are not kept yet."""
    view = view_name(row)
    grey = dict.fromkeys((".png", ".undecided.png", ".facets.png"), _grey)
    ends = grey | {".lit.png": _color, ".ambient.png": _color}
    for end, keep in ends.items():
        before, after = folder / "truth" / f"{view}{end}", target / "truth" / f"{view}{end}"
        if before.exists() and not after.exists():
            after.parent.mkdir(exist_ok=True)
            keep(before, after, row)


def _grey(before: Path, after: Path, row: Record) -> None:
    steps = SOFT_GREYS if is_soft(row["metrics"]) else GREYS
    levels = np.rint(np.rint(read_mask(before) * steps) * (255 / steps)).astype(np.uint8)
    Image.fromarray(levels).save(after, optimize=True)


def _color(before: Path, after: Path, _: Record) -> None:
    with Image.open(before) as image:
        image.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE).save(after, optimize=True)


def _place(folder: Path) -> str:
    """A folder as a command in the repository's root names it."""
    return str(folder.relative_to(ROOT)) if folder.is_relative_to(ROOT) else str(folder)


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def _write(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
