"""`report`: run and stress folders as a page, tables or figures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from shadowbench.commands import console, options
from shadowbench.errors import counted
from shadowbench.options import option


@dataclass(frozen=True)
class ReportOptions:
    """What is made of folders, and where it goes."""

    output: Path | None = options.output(
        "Output file, or folder for figures  [report.html, report.md, report.csv, report.tex, or report/].",
        metavar="FILE",
    )
    format: str = option(
        "html: a single page that needs no network; md, tex: tables; csv: one row per cell. png, svg, pdf: figures, "
        "SCENE.VIEW-SIZE.front (error against time), .sizes (error against map size), .passes (time of each pass), "
        "from `stress` stability.AXIS; captions.md has their captions, which only png charts also show.",
        "FORMAT",
        default="html",
    )
    plugin: list[Path] = options.plugins()


@options.command(
    "\b\nFor example\n"
    "  shadowbench report results/latest\n"
    "  shadowbench report laptop/ server/ -o both.html\n"
    "  shadowbench report results/latest --format pdf -o figures/"
)
def report(
    folders: Annotated[
        list[Path],
        options.argument("DIR...", "Folders written by `run` or `stress`, on one machine or several."),
    ],
    asked: ReportOptions,
    quiet: options.Quiet = False,
) -> None:
    """Make charts, tables and pictures from run folders.

    From `run` folders: error against time, the fastest setting for each accuracy, time of each pass, pictures beside
    the truth. From `stress` folders: operating ranges, metrics along each axis, pictures at the breaking points.
    Nothing is measured. Times of different folders are never drawn on one axis.

    Of each `run` folder it prints the cheapest setting over all scenes. Accuracy is an IoU, or for soft shadows (lights
    with a size) an RMSE.
    """
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.reports.report import FIGURES, report_target, write_report
    from shadowbench.reports.texts import verdict
    from shadowbench.results.frame import read_folders
    from shadowbench.results.law import law_on_record
    from shadowbench.results.summary import by_kind, over_scenes, summaries, title_of_all

    target = report_target(asked.output, asked.format)
    techniques_with(asked.plugin)  # whose metrics are columns too
    with console.Reporter(quiet) as reporter:
        reporter.stage("reading", 1)
        runs, sweeps = read_folders(folders)
        reporter.stage("charts and pictures", 1)
        law = law_on_record()
        summarised = [(run, summaries(run, law)) for run in runs]
        count = write_report(summarised, sweeps, target, asked.format)
    if quiet:
        return
    for run, scenes in summarised:
        if run.earlier:
            which = f"{len(run.earlier)} of {len(run.rows)} cells are of earlier commands"
            console.print_error(f"note: {run.folder}: {which}")
        if len(runs) > 1:
            console.print_line(f"{run.label}, on {run.renderer}")
        for kind in by_kind(scenes):
            for line in verdict(kind[0] if len(kind) == 1 else over_scenes(kind, title_of_all(kind, len(kind)))):
                console.print_line(line)
    if asked.format in FIGURES:
        console.print_line(f"{target}: {counted(count, 'figure')}")
        return
    size = target.stat().st_size
    cells = counted(sum(len(one.rows) for one in (*runs, *sweeps)), "cell")
    console.print_line(f"{target}: {cells}, {f'{size / 1e6:.1f} MB' if size >= 1e6 else f'{size / 1e3:.0f} kB'}")
