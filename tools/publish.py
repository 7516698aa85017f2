"""Measures the studies of benchmarks/published/ and keeps what their reports show in results/published/.

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
"""Map sizes of techniques whose masks are kept; of engines, those of the settings that they ship with."""
GREYS, SOFT_GREYS, COLORS = 4, 32, 32
"""Steps between black and white of masks, also of soft ones, and colours of pictures: for compression."""


def main() -> None:
    """Measure the studies, or take the folders that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", metavar="NAME", nargs="?")
    parser.add_argument("folders", metavar="DIR", type=Path, nargs="*")
    parser.add_argument("--commit", help="of the code that measured rows which name none")
    options = parser.parse_args()
    head = ["git", "rev-parse", "--short=10", "HEAD"]
    commit = options.commit or subprocess.run(head, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    if options.name:
        condense(options.folders, PUBLISHED / options.name, commit)
    for study in () if options.name else sorted(STUDIES.glob("*.toml")):
        folder, published = WORK / study.stem, PUBLISHED / study.stem
        if not folder.exists() and published.exists():
            shutil.copytree(published, folder)
        command = ["run", "-s", study.relative_to(ROOT), "-o", folder.relative_to(ROOT), "--quiet"]
        subprocess.run([sys.executable, "-m", "shadowbench", *command], cwd=ROOT, check=True)
        condense([folder], published, commit)
    (PUBLISHED / "SHA256SUMS").write_text("".join(digests(PUBLISHED)), encoding="utf-8")


def condense(folders: Sequence[Path], target: Path, commit: str) -> None:
    """Write what is kept of run folders into `target`, in place of what is there."""
    runs = read_runs(folders)
    rows = {identity(row): (run, row) for run in runs for row in run.rows}
    beside = target.with_name(f".{target.name}")
    shutil.rmtree(beside, ignore_errors=True)
    for name in ("masks", "truth"):
        (beside / name).mkdir(parents=True)
    paths = {text for run in runs for text in (str(run.folder), _place(run.folder))}
    lines: list[dict[str, Any]] = []
    for run, row in rows.values():
        kept = {**row, "commit": row.get("commit", commit)}
        for path in sorted(paths, key=len, reverse=True):  # one may begin with another
            kept["command"] = kept["command"].replace(path, _place(target))
        if "metrics" in row:
            metrics = row["metrics"].items()
            kept["metrics"] = {name: value for name, value in metrics if value is not None or name == "iou"}
        lines += [kept, *([dict(run.times[row["key"]])] if row["key"] in run.times else [])]
        shipped = row["spec"] == row["technique"] if "engine" in row else row["map_size"] in SHOWN
        if row["status"] == "ok" and shipped:
            _keep_images(run.folder, beside, row)
    text = "".join(json.dumps(line, ensure_ascii=False, separators=(",", ":")) + "\n" for line in lines)
    (beside / "rows.jsonl").write_text(text, encoding="utf-8")
    about = dict(next(run.about for run in runs if run.about))
    about["command"] = "; ".join(dict.fromkeys(line["command"] for line in lines if "command" in line))
    about["keys"] = [row["key"] for _, row in rows.values()]
    # The release of a kernel names the host that built it.
    about["machine"] = about["machine"] | {"system": re.sub(r" \S*-\S* ", " ", about["machine"]["system"])}
    (beside / "run.json").write_text(json.dumps(about, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    shutil.rmtree(target, ignore_errors=True)
    beside.rename(target)


def digests(folder: Path) -> Iterator[str]:
    """Lines of `sha256sum` on all files of a folder but SHA256SUMS."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name != "SHA256SUMS":
            yield f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.relative_to(folder).as_posix()}\n"


def _keep_images(folder: Path, target: Path, row: Record) -> None:
    """Keep a row's mask, and the images of its view that are not kept yet."""
    view, steps = view_name(row), SOFT_GREYS if is_soft(row["metrics"]) else GREYS
    grey = [f"truth/{view}.png", f"truth/{view}.undecided.png", f"truth/{view}.facets.png", f"masks/{row['key']}.png"]
    for name in (*grey, f"truth/{view}.lit.png", f"truth/{view}.ambient.png"):
        if not (folder / name).exists() or (target / name).exists():
            continue
        if name in grey:
            levels = np.rint(np.rint(read_mask(folder / name) * steps) * (255 / steps))
            image = Image.fromarray(levels.astype(np.uint8))
        else:
            image = Image.open(folder / name).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
        image.save(target / name, optimize=True)


def _place(folder: Path) -> str:
    """A folder as a command in the repository's root names it."""
    return str(folder.relative_to(ROOT)) if folder.is_relative_to(ROOT) else str(folder)


if __name__ == "__main__":
    main()
