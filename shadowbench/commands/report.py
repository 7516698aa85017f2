"""`report`: folders of runs and of sweeps to HTML, Markdown, CSV or figures."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Quiet

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench report results/latest\n"
    "  shadowbench report laptop/ server/ -o both.html\n"
    "  shadowbench report results/latest --format png -o charts/"
)
def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folders of run and of stress, of one machine or of several."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Where it goes; a folder for png  [report.html, .md, .csv, or the folder report].",
        ),
    ] = None,
    format: Annotated[
        str,
        typer.Option(
            metavar="FORMAT",
            help="html: one page, which opens without a network; md: tables; csv: the cells of all folders; "
            "png: a file for each chart, SCENE.VIEW-SIZE.front.png, .sizes.png, .passes.png, of a sweep "
            "stability.png, stability.AXIS.png.",
        ),
    ] = "html",
    quiet: Quiet = False,
) -> None:
    """Show what accuracy costs: the cheapest for each accuracy, error against time, pictures of what is wrong.

    Of a sweep: operating ranges, metrics along each axis, pictures at the breaking points. Measures nothing. Times of
    different folders never share an axis.
    """
    from shadowbench.reports.report import report_target, write_report
    from shadowbench.reports.words import counted
    from shadowbench.studies.folder import read_folders

    target = report_target(output, format)
    with console.Reporter(quiet) as reporter:
        reporter.stage("reading", 1, ", ".join(map(str, folders)))
        runs, sweeps = read_folders(folders)
        reporter.stage("charts and pictures", 1, str(target))
        charts = write_report(runs, sweeps, target, format)
    if quiet:
        return
    for run in runs:
        if run.earlier:
            which = f"{len(run.earlier)} of {len(run.rows)} cells are of earlier commands"
            console.complain(f"note: {run.folder}: {which}")
    if format == "png":
        what = counted(charts, "chart")
    else:
        size = target.stat().st_size
        cells = counted(sum(len(one.rows) for one in (*runs, *sweeps)), "cell")
        what = f"{cells}, {f'{size / 1e6:.1f} MB' if size >= 1e6 else f'{size / 1e3:.0f} kB'}"
    console.say(f"{target}: {what}")
