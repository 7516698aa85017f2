"""Reports on run and sweep folders: an HTML page, Markdown tables, a CSV of all cells, or PNG charts."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.extremes.ranges import points_frame
from shadowbench.files import check_outputs, replace_file
from shadowbench.reports.data_files import replaced_folder
from shadowbench.reports.figures import figures
from shadowbench.reports.html import html_report
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.stability import Stability, analyse
from shadowbench.results.configurations import Section
from shadowbench.results.folder import Run, Sweep

FORMATS = ("html", "md", "csv", "png")


def report_target(output: Path | None, form: str, split: bool = False) -> Path:
    """The output of a report in one of FORMATS: a file, or for png a folder; by default `report` with a suffix.

    Raises InputError for other formats, for one but html that is to be split, and if the output cannot be written.
    """
    if split and form != "html":
        raise InputError(f"--split: found --format {form:.60}; allowed: html, whose pictures it writes beside the page")
    if form not in FORMATS:
        raise InputError(f"--format: found {form!r:.60}; allowed: {', '.join(FORMATS)}")
    target = output or Path("report" if form == "png" else f"report.{form}")
    if form != "png":
        check_outputs(f".{form}", target)
        folder = files_beside(target)
        if split and folder.exists() and any(file.suffix != ".js" for file in folder.iterdir()):
            raise InputError(f"{folder}: found other files; --split replaces this folder, by one with the page's data")
    elif target.exists() and not target.is_dir():
        raise InputError(f"{target}: found a file; allowed: a folder, for the charts")
    return target


def write_report(
    runs: Sequence[Run],
    scenes: Mapping[str, Sequence[Section]],
    sweeps: Sequence[Sweep],
    target: Path,
    form: str,
    split: bool = False,
) -> int:
    """Write a report on runs and sweeps in one of FORMATS; returns the number of charts for png, else 0.

    scenes: `sections` of the runs; split: write the data of an HTML page into `files_beside`. Raises InputError.
    """
    swept = [analyse(sweep) for sweep in sweeps]
    if form == "png":
        return _write_figures(target, scenes, swept)
    with replaced_folder(files_beside(target)) if split else nullcontext() as beside:
        text = html_report(runs, scenes, swept, beside) if form == "html" else _text(form, runs, scenes, swept)
    with replace_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return 0


def files_beside(page: Path) -> Path:
    """Folder of the data of a page that is split: `report.files` for `report.html`."""
    return page.with_suffix(".files")


def _text(form: str, runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    if form == "csv":
        return _all_cells(runs, swept).to_csv(index=False)
    return markdown_report(runs, scenes, swept)


def _all_cells(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: columns `run`, `processor`, `software`, then those of `table.csv`.

    Cells of a sweep also have `range`, the operating range along their axis.
    """
    tables = [(run, run.frame) for run in runs] + [(found.sweep, _points(found)) for found in swept]
    frames = [
        frame.assign(run=one.label, processor=one.about.get("machine", {}).get("processor"), software=one.software)
        for one, frame in tables
    ]
    columns = list(dict.fromkeys(name for frame in frames for name in frame))
    first = ["run", "processor", "software"]
    return pd.concat(frames)[[*first, *(name for name in columns if name not in first)]]


def _points(found: Stability) -> pd.DataFrame:
    rows = found.sweep.rows
    ranges = [found.range_at.get((row["home_spec"], row["axis"], row["light_kind"])) for row in rows]
    return points_frame(rows).assign(range=pd.Series([one and one.text for one in ranges], dtype=object))


def _write_figures(folder: Path, scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror or error})") from error
    count = 0
    for name, picture in figures(scenes, swept):
        with replace_file(folder / name) as temporary:
            temporary.write_bytes(picture)
        count += 1
    return count
