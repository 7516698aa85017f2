"""Commands over run folders: report, check, repeat."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.options import Json, Quiet

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
    """Show what accuracy costs: error against time, time to accuracy, passes, pictures of what is wrong.

    Of a sweep: operating ranges, metrics along each axis, pictures at the breaking points. Measures nothing. Times of
    different folders never share an axis.
    """
    from shadowbench.commands.report import report_command

    report_command(folders, output, format, quiet)


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update"
)
def check(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    baseline: Annotated[
        Path, typer.Option(metavar="DIR", help="What it is held against: a baseline or another run folder.")
    ],
    time: Annotated[
        bool, typer.Option("--time", help="Fail also for what has become slower, on the same machine.")
    ] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Make DIR's rows the baseline; says what changes by it.")
    ] = False,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(metavar="METRIC=X", help="How far a metric may get worse; repeatable  [the metric's own]."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fail, with exit code 1, where a run is worse than a baseline: shadows, work, or cells that are missing.

    Cells are matched by scene, view, light, phase, full spec, map and view size. Prints what regressed and what
    improved, worst first, and draws the worst into DIR/check. Work (draws, primitives, bytes exactly, shader
    invocations within 2%) is compared where the renderer is the same, times as ratios to the reference.
    """
    from shadowbench.commands.check import CheckOptions, check_command

    options = CheckOptions(folder, baseline, time, update, tuple(tolerance or ()))
    raise typer.Exit(check_command(options, as_json=json, quiet=quiet))


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench repeat results/monday results/tuesday\n"
    "  shadowbench run -s demo --time-again && shadowbench repeat results/latest"
)
def repeat(
    first: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.")],
    second: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DIR]",
            help="The same study, run again into a folder of its own; without it, the last two times of each cell in "
            "the first folder, as `run --time-again` leaves them.",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare two runs of one study on one machine: the order of cells by time, and their work.

    Measures nothing. Exit code 1 when a ranking's Kendall tau is below 0.95, over the pairs that are apart in both
    runs, or work differs.
    """
    from shadowbench.commands.repeat import repeat_command

    raise typer.Exit(repeat_command(first, second, json, quiet))
