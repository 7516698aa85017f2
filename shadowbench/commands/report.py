"""`report`: run folders to HTML, Markdown, CSV or figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from shadowbench.commands.console import check_outputs, out
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.reports.analysis import Section, sections
from shadowbench.reports.figures import figures
from shadowbench.reports.folder import Run, read_runs
from shadowbench.reports.html import html_report
from shadowbench.reports.markdown import markdown_report

FORMATS = ("html", "md", "csv", "png")


def report_command(folders: Sequence[Path], output: Path | None, form: str, quiet: bool) -> None:
    """Read the folders, write the report, say where it is; `output` is `report` with the format's suffix if None."""
    if form not in FORMATS:
        raise InputError(f"--format: found {form!r:.60}; allowed: {', '.join(FORMATS)}")
    target = output or Path("report" if form == "png" else f"report.{form}")
    if form != "png":
        check_outputs(f".{form}", target)
    elif target.exists() and not target.is_dir():
        raise InputError(f"{target}: found a file; allowed: a folder, for the charts")
    runs = read_runs(folders)
    scenes = sections(runs)
    if form == "png":
        what = f"{_write_figures(target, scenes)} charts"
    else:
        text = _text(form, runs, scenes)
        with replace_file(target) as beside:
            beside.write_text(text, encoding="utf-8")
        what = f"{sum(len(run.results) for run in runs)} cells, {_size(target.stat().st_size)}"
    if not quiet:
        out.print(f"{target}: {what}", markup=False, soft_wrap=True)


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.0f} kB"


def _text(form: str, runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]]) -> str:
    if form == "csv":
        return _joined(runs).to_csv(index=False)
    return html_report(runs, scenes) if form == "html" else markdown_report(runs, scenes)


def _joined(runs: Sequence[Run]) -> pd.DataFrame:
    """The cells of all runs: `run`, `processor`, `software`, then the columns of `table.csv`."""
    frames = [
        run.frame.assign(run=run.label, processor=run.about.get("machine", {}).get("processor"), software=run.software)
        for run in runs
    ]
    columns = list(dict.fromkeys(name for frame in frames for name in frame))
    first = ["run", "processor", "software"]
    return pd.concat(frames)[[*first, *(name for name in columns if name not in first)]]


def _write_figures(folder: Path, scenes: Mapping[str, Sequence[Section]]) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error})") from error
    count = 0
    for name, picture in figures(scenes):
        with replace_file(folder / name) as beside:
            beside.write_bytes(picture)
        count += 1
    return count
