"""`stress`: vary one parameter of the scene at a time until a technique fails, and print the operating ranges."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.commands import console, options
from shadowbench.options import option

if TYPE_CHECKING:
    from shadowbench.measure.rows import Record
    from shadowbench.results.ranges import OperatingRange


@dataclass(frozen=True)
class StressOptions:
    """What is tested, along which axes."""

    techniques: list[str] = options.technique(
        f"Technique to test: {options.SPEC}; repeatable  [all techniques at their defaults].", default=()
    )
    axis: list[str] = option("Axis to vary (shadowbench list axes); repeatable  [all].", "NAME", default=())
    quick: bool = options.flag("Only a few values of each axis.")
    plugin: list[Path] = options.plugins()
    output: Path = options.output(
        "Folder for the tables, and the masks of failed cells.", default=Path("results/stress")
    )
    part: str | None = options.part()
    keep_going: bool = options.keep_going()


@options.command(
    "\b\nFor example\n"
    "  shadowbench stress --quick\n"
    "  shadowbench stress -t shadow-map -t 'shadow-map:bias=slope' --axis elevation"
)
def stress(chosen: StressOptions, machines: options.Machines, printed: options.Printed) -> int:
    """Find where each technique breaks.

    Varies one property of a scene at a time, along an axis: elevation of the light, distance from the origin, gap
    between caster and receiver, ... (shadowbench list axes). Prints the operating range of each technique on each axis:
    the values at which IoU is at least 0.95, acne, leak and terminator are at most 1%, flicker (of edges while the
    light moves) 0.04 px and swim (while the camera moves) 0.01 px, or the first value at which it breaks, and how. An
    interrupted run resumes when the command is repeated. Lights have no size, except along light-size, where RMSE,
    bleed and false_dark are judged. There is no --sun. Exit code 0 even if techniques break, 1 for NaN, infinity or an
    OpenGL error, 3 for a crash or hang.

    \b
    Cells of the table
      0.1…89.9°                 the whole operating range
      all 7                     every value, of an axis without an order
      breaks at 2°: acne 3.10%  the first value out of tolerance, and the reason
      refused: 1e5              values that the technique does not support
      3 of 20 values            number of values measured, with --quick
    """
    from shadowbench.measure.gl_drawer import campaign_in
    from shadowbench.measure.plugin_output import subjects_with
    from shadowbench.plugin.spec import parse_spec
    from shadowbench.results.ranges import ranges_frame
    from shadowbench.studies.stress import LIMITS, SWEEPING, default_specs, select_axes
    from shadowbench.studies.stress import stress as walk

    axes = select_axes(chosen.axis)
    known = subjects_with(chosen.plugin)
    specs = tuple(dict.fromkeys(parse_spec(text, known) for text in chosen.techniques)) or default_specs(known.values())
    with (
        console.Reporter(printed.quiet) as reporter,
        campaign_in(
            chosen.output, reporter, chosen.plugin, LIMITS, **asdict(machines), keep_going=chosen.keep_going, **SWEEPING
        ) as campaign,
    ):
        result = walk(specs, axes, campaign, quick=chosen.quick, part=chosen.part)
    if printed.json:
        frame = ranges_frame(result.ranges).astype(object)
        console.print_json(frame.where(frame.notna(), None).to_dict("records"))
    else:
        for spec in (spec.text for spec in specs):
            _print(spec, [one for one in result.ranges if one.spec == spec])
        if not printed.quiet:
            counts = f"{len(result.ranges)} operating ranges, from {len(result.rows)} cells"
            console.print_line(f"{chosen.output / 'ranges.csv'}: {counts}")
    return console.exit_code_of((), result.failures) or _exit_code(result.rows)


def _print(title: str, ranges: "Sequence[OperatingRange]") -> None:
    """Print a line for each axis and a column for each kind of light; one line for a spec never in tolerance."""
    from shadowbench.extremes.model import NAMES

    if not any(one.in_tolerance for one in ranges):
        if any(one.breaks for one in ranges):
            console.print_line(f"{title}: out of tolerance already at the default value of every axis that it supports")
        elif ranges:
            console.print_line(f"{title}: supports none of these axes")
        return
    lights = [kind for kind in NAMES if any(one.light == kind for one in ranges)]
    rows = []
    for axis in dict.fromkeys(one.axis for one in ranges):
        texts = {one.light: one.text for one in ranges if one.axis is axis}
        rows.append([axis.name, *(texts.get(kind, "") for kind in lights)])
    console.print_table(title, ("axis", *(NAMES[kind] for kind in lights)), rows, whole=("axis",))
    console.print_text("")


def _exit_code(rows: "Sequence[Record]") -> int:
    """1 or 3 for cells that failed, 0 for none; on stderr one line for each kind of failure."""
    from shadowbench.results.ranges import BROKEN, DEAD, failure

    code = 0
    for kinds, verdict, what in ((BROKEN, 1, "NaN, infinity or an OpenGL error"), (DEAD, 3, "a crash, hang or error")):
        broken = [(row, one) for row in rows if (one := failure(row)) is not None and one.kind in kinds]
        if broken:
            row, one = broken[0]
            place = f"{row['axis']} {row['axis_value']} {row['light']}"
            first = f"{row['spec']} at {place}: {one.text}"
            console.print_error(f"shadowbench: {what} in {len(broken)} of {len(rows)} cells; the first: {first}")
            code = verdict
    return code
