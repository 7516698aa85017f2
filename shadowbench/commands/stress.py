"""`stress`: techniques along axes until they break, and the table of operating ranges."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import SPEC, Json, Plugins, Quiet

if TYPE_CHECKING:
    from shadowbench.extremes.ranges import OperatingRange
    from shadowbench.measure.rows import Record

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench stress --quick\n"
    "  shadowbench stress -t shadow-map -t 'shadow-map:bias=slope' --axis elevation"
)
def stress(
    techniques: Annotated[
        list[str] | None,
        typer.Option(
            "-t", "--technique", metavar="SPEC", help=f"What to walk: {SPEC}; repeatable  [all at their defaults]."
        ),
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option("--axis", metavar="NAME", help="An axis to walk along; repeatable  [all].")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few values of each axis.")] = False,
    plugin: Plugins = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of tables, and of masks out of tolerance.")
    ] = Path("results/stress"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Walk techniques along axes (low light, far from the origin, tiny gaps, ...) until they break.

    Prints the operating range of each: where IoU stays above 0.95, acne and leak below 1%, or the value where it
    breaks first, and how. Stopped at any point, the same command goes on where it was. Exit code 1 for NaN, infinity
    or an OpenGL error, 3 for a crash or hang; breaking points are no failure.
    """
    from shadowbench.extremes.ranges import ranges_frame
    from shadowbench.extremes.stress import LIMITS, select_axes
    from shadowbench.extremes.stress import stress as walk
    from shadowbench.extremes.sweep import default_specs
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.measure.worker import Worker
    from shadowbench.techniques.spec import parse_spec

    axes = select_axes(axis or ())
    known = techniques_with(plugin or ())
    asked = tuple(dict.fromkeys(parse_spec(text, known) for text in techniques or ()))
    specs = asked or default_specs(known.values())
    with console.Reporter(quiet) as reporter, Worker(plugin or (), LIMITS) as worker:
        found = walk(specs, axes, output, worker, reporter, quick=quick)
    if json:
        frame = ranges_frame(found.ranges).astype(object)
        console.print_json(frame.where(lambda frame: frame.notna(), None).to_dict("records"))
    else:
        for spec in (spec.text for spec in specs):
            _print(spec, [one for one in found.ranges if one.spec == spec])
        if not quiet:
            console.say(f"{output / 'ranges.csv'}: {len(found.ranges)} ranges of {len(found.rows)} cells")
    console.say_unsupported([str(row["status"]) for row in found.rows])
    raise typer.Exit(_exit_code(found.rows))


def _print(title: str, ranges: "Sequence[OperatingRange]") -> None:
    """A line an axis, a column a kind of light; one line in all for what never holds."""
    from shadowbench.extremes.axes.model import NAMES

    if not any(one.in_tolerance for one in ranges):
        if ranges:
            console.say(f"{title}: breaks at home on every axis")
        return
    lights = [kind for kind in NAMES if any(one.light == kind for one in ranges)]
    rows = []
    for axis in dict.fromkeys(one.axis for one in ranges):
        texts = {one.light: one.text for one in ranges if one.axis is axis}
        rows.append([axis.name, *(texts.get(kind, "") for kind in lights)])
    console.print_table(title, ("axis", *(NAMES[kind] for kind in lights)), rows, whole=("axis",))
    console.out().print()


def _exit_code(rows: "Sequence[Record]") -> int:
    """What FORMATS promises, with one line a kind of failure on stderr."""
    from shadowbench.extremes.ranges import BROKEN, DEAD, failure

    code = 0
    for kinds, verdict, what in ((BROKEN, 1, "NaN, infinity or an OpenGL error"), (DEAD, 3, "a crash, hang or error")):
        found = [(row, one) for row in rows if (one := failure(row)) is not None and one.kind in kinds]
        if found:
            row, one = found[0]
            place = f"{row['axis']} {row['axis_value']} {row['light']}"
            first = f"{row['spec']} at {place}: {one.text}"
            console.complain(f"shadowbench: {what} in {len(found)} of {len(rows)} cells; the first: {first}")
            code = verdict
    return code
