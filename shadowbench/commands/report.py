"""`report`: folders of runs and of sweeps to HTML, Markdown, CSV or figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from shadowbench.commands.console import ConsoleReporter, check_outputs, err, out
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.reports.analysis import Section, sections
from shadowbench.reports.figures import figures
from shadowbench.reports.folder import Run, read_folders
from shadowbench.reports.html import html_report
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.stability import Stability, stability
from shadowbench.reports.words import counted
from shadowbench.stress.ranges import points_frame

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
    with ConsoleReporter(quiet) as reporter:
        reporter.stage("reading", 1, ", ".join(map(str, folders)))
        runs, sweeps = read_folders(folders)
        scenes, swept = sections(runs), [stability(sweep) for sweep in sweeps]
        reporter.stage("charts and pictures", 1, str(target))
        if form == "png":
            what = counted(_write_figures(target, scenes, swept), "chart")
        else:
            text = _text(form, runs, scenes, swept)
            with replace_file(target) as beside:
                beside.write_text(text, encoding="utf-8")
    if form != "png":
        what = f"{counted(sum(len(one.rows) for one in (*runs, *sweeps)), 'cell')}, {_size(target.stat().st_size)}"
    if not quiet:
        for run in runs:
            if run.earlier:
                which = f"{len(run.earlier)} of {len(run.rows)} cells are of earlier commands"
                err.print(f"note: {run.folder}: {which}", markup=False, soft_wrap=True)
        out.print(f"{target}: {what}", markup=False, soft_wrap=True)


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.0f} kB"


def _text(form: str, runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    if form == "csv":
        return _joined(runs, swept).to_csv(index=False)
    return html_report(runs, scenes, swept) if form == "html" else markdown_report(runs, scenes, swept)


def _joined(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: `run`, `processor`, `software`, then the columns of each `table.csv`.

    Those of a sweep have `range` too, the operating range that a cell is part of.
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
    ranges = [found.at.get((row["home_spec"], row["axis"], row["light_kind"])) for row in rows]
    return points_frame(rows).assign(range=pd.Series([one and one.text for one in ranges], dtype=object))


def _write_figures(folder: Path, scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error})") from error
    count = 0
    for name, picture in figures(scenes, swept):
        with replace_file(folder / name) as beside:
            beside.write_bytes(picture)
        count += 1
    return count
