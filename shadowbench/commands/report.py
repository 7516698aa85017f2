"""`report`: run and stress folders as a page, tables or figures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from shadowbench.commands import console, options
from shadowbench.errors import counted
from shadowbench.options import option

_LARGE = 20e6  # bytes of a page


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
        ".strip.png (pictures beside the truth, the worst place enlarged), from `stress` stability and "
        "stability.AXIS; captions.md has their captions, which only png charts also show.",
        "FORMAT",
        default="html",
        words=("html", "md", "csv", "tex", "png", "svg", "pdf"),
    )
    picture: list[str] = option(
        'What strips show beside the truth, as tables name it, such as "shadow-map at 1024"; repeatable  [the cheapest '
        "real-time setting for each accuracy].",
        "SETTING",
        default=(),
    )
    split: bool = options.flag(
        "Write pictures, charts and tables into files beside the page (report.files/), which it loads when it shows "
        "them: for thousands of cells."
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

    Of each `run` folder it prints the cheapest setting for each accuracy in each scene, and what each technique costs
    over all scenes; – if no setting reaches it wherever the technique is supported. Accuracy is an IoU, or for soft
    shadows (lights with a size) an RMSE.
    """
    from shadowbench.commands.study_tables import print_verdict
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.reports.report import FIGURES, report_target, write_report
    from shadowbench.results.configurations import sections
    from shadowbench.results.folder import read_folders
    from shadowbench.results.law import law_on_record

    target = report_target(asked.output, asked.format, asked.split)
    techniques_with(asked.plugin)  # whose metrics are columns too
    with console.Reporter(quiet) as reporter:
        reporter.stage("reading", 1)
        runs, sweeps = read_folders(folders)
        reporter.stage("charts and pictures", 1)
        scenes = sections(runs, law_on_record())
        count = write_report(runs, scenes, sweeps, target, asked.format, asked.split, asked.picture)
    if quiet:
        return
    for run in runs:
        if run.earlier:
            which = f"{len(run.earlier)} of {len(run.rows)} cells are of earlier commands"
            console.print_error(f"note: {run.folder}: {which}")
        if len(runs) > 1:
            console.print_line(f"{run.label}, on {run.renderer}")
        print_verdict([section for parts in scenes.values() for section in parts if section.run is run])
    if asked.format in FIGURES:
        console.print_line(f"{target}: {counted(count, 'figure')}")
        return
    size = target.stat().st_size
    if asked.format == "html" and not asked.split and size > _LARGE:
        console.print_error(
            f"note: {target}: {size / 1e6:.0f} MB are slow to open; with --split the pictures are files beside it"
        )
    cells = counted(sum(len(one.rows) for one in (*runs, *sweeps)), "cell")
    console.print_line(f"{target}: {cells}, {f'{size / 1e6:.1f} MB' if size >= 1e6 else f'{size / 1e3:.0f} kB'}")
