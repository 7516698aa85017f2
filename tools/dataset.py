"""Makes a data set of run folders: truths, masks, scenes, rows, licence and digests, to be used without shadowbench.

    python tools/dataset.py RUN... -o FOLDER

RUN are folders of `shadowbench run` on built-in scenes, with the masks that it wrote. The README of the data set is
made of `tools/dataset.md`.
"""

import argparse
import hashlib
import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from publish import digests

from shadowbench.errors import InputError, counted
from shadowbench.files import check_folder
from shadowbench.masks.export import export_view
from shadowbench.masks.inputs import write_stored_truth
from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.reports.site_data import write_data
from shadowbench.results.folder import Run, read_runs, view_name
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import View, view_of
from shadowbench.scores.masks import mask_sha256, read_mask
from shadowbench.truths.cache import cached_truth
from shadowbench.versions import VERSION
from shadowbench.viewer.state_files import cell_state

ROOT = Path(__file__).resolve().parent.parent
PACKAGE, SUMS = "datapackage.json", "SHA256SUMS"
TITLE = "Ray-traced shadows and masks of real-time shadow techniques"
MEDIA = {
    ".csv": "text/csv",
    ".glb": "model/gltf-binary",
    ".json": "application/json",
    ".npz": "application/zip",
    ".parquet": "application/vnd.apache.parquet",
    ".png": "image/png",
}


def main() -> int:
    """Make the data set that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="RUN", type=Path, nargs="+")
    parser.add_argument("-o", dest="target", metavar="FOLDER", type=Path, default=ROOT / "build" / "dataset")
    asked = parser.parse_args()
    try:
        files = write_dataset(asked.folders, asked.target)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    size = sum(file.stat().st_size for file in files)
    print(f"{asked.target}: {counted(len(files), 'file')}, {size / 1e6:.1f} MB")
    return 0


def write_dataset(folders: Sequence[Path], target: Path) -> list[Path]:
    """Write the data set of the last commands of run folders in place of `target`, and return its files.

    Raises InputError for cells whose owner is not known, and for truths or masks other than those that were scored.
    """
    check_folder(target, SUMS)
    runs = [run.last for run in read_runs(folders)]
    beside = target.with_name(f".{target.name}")
    shutil.rmtree(beside, ignore_errors=True)
    (beside / "masks").mkdir(parents=True)
    views = {view_name(row): (run, row) for run in runs for row in run.rows}
    for name, (run, row) in views.items():
        _write_view(run, row, beside / "views" / name)
    for run in runs:
        for row in run.rows:
            _copy_mask(run.folder, row, beside / "masks")
    write_data(runs, beside)
    shutil.copyfile(ROOT / "LICENSE", beside / "LICENSE")
    counts = {
        "VIEWS": counted(len(views), "view"),
        "MASKS": counted(len(list((beside / "masks").iterdir())), "mask"),
        "VERSION": VERSION,
    }
    text = (ROOT / "tools" / "dataset.md").read_text(encoding="utf-8")
    for name, value in counts.items():
        text = text.replace(f"@{name}@", value)
    _write(beside / "README.md", text)
    _complete_package(beside)
    year = max(run.about["finished"] for run in runs)[:4]
    _write(beside / "cite.bib", _bibtex(year, _sha256(beside / PACKAGE)))
    _write(beside / SUMS, "".join(digests(beside)))
    shutil.rmtree(target, ignore_errors=True)
    beside.rename(target)
    return _files(target)


def _write_view(run: Run, row: Record, folder: Path) -> None:
    """Write scene, matrices and truth of a row's view."""
    view = _view(run, row)
    truth = cached_truth(view)
    stored = run.folder / "truth" / f"{view.name}.png"
    if mask_sha256(read_mask(stored)) != mask_sha256(truth.visibility):
        raise InputError(f"{stored}: another truth than that of {view.name} now; allowed: runs of this version")
    export_view(view, truth, folder, view.scene.name, colours=True)
    write_stored_truth(folder / "truth.npz", truth, view)
    for name in ("undecided", "facets"):
        Image.fromarray(np.uint8(255) * getattr(truth, name)).save(folder / f"{name}.png", optimize=True)


def _view(run: Run, row: Record) -> View:
    """The view of a row of a technique and a scene that are ours. Raises InputError for others."""
    state = cell_state(run.folder, row["key"], techniques())
    source = state.origin and state.origin.source
    if source not in builtin_names():
        raise InputError(f"{run.folder}: found the scene {source}; allowed: built-in scenes, whose licence is known")
    return view_of(state.scene, state.camera, state.light, row["view_size"])


def _copy_mask(folder: Path, row: Record, target: Path) -> None:
    """Copy a row's mask, if it has one. Raises InputError for one that is not the scored one, or not ours."""
    if row["technique"] not in {technique.name for technique in own_techniques()}:
        raise InputError(
            f"{folder}: found {row['technique']}; allowed: techniques of shadowbench, whose licence is known"
        )
    if row["status"] != "ok":
        return
    mask = folder / "masks" / f"{row['key']}.png"
    if mask_sha256(read_mask(mask)) != row["mask_sha256"]:
        raise InputError(f"{mask}: not the mask that was scored; allowed: the folder that `shadowbench run` wrote")
    shutil.copyfile(mask, target / mask.name)


def _complete_package(folder: Path) -> None:
    """Add all files to `datapackage.json`, with sizes and digests."""
    package: dict[str, Any] = json.loads((folder / PACKAGE).read_text(encoding="utf-8"))
    tables = {table["path"]: table for table in package["resources"]}
    resources = []
    for file in _files(folder):
        path = file.relative_to(folder).as_posix()
        if file.name != PACKAGE and file.suffix in MEDIA:
            plain = {"name": path.lower().replace(" ", "-"), "path": path, "mediatype": MEDIA[file.suffix]}
            facts = {"bytes": file.stat().st_size, "hash": f"sha256:{_sha256(file)}"}
            resources.append(tables.get(path, plain) | facts)
    package |= {
        "name": "shadowbench-dataset",
        "title": TITLE,
        "licenses": [{"name": "MIT", "path": "LICENSE"}],
        "contributors": [{"title": "The shadowbench authors", "role": "author"}],
        "resources": resources,
    }
    _write(folder / PACKAGE, json.dumps(package, indent=1, ensure_ascii=False) + "\n")


def _bibtex(year: str, digest: str) -> str:
    return f"""@misc{{shadowbench-dataset-{digest[:8]},
  author = {{{{The shadowbench authors}}}},
  title = {{{{{TITLE}}}}},
  year = {{{year}}},
  note = {{Data set made by shadowbench {VERSION}; SHA-256 of its {PACKAGE}: {digest}}},
}}
"""


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.rglob("*") if file.is_file())


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _write(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
