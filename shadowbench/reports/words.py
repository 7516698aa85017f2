"""Numbers and sentences, as every format of a report says them."""

from collections import Counter

from shadowbench.extremes.axes.model import NAMES, Axis, value_label
from shadowbench.extremes.ranges import TOLERANCES, OperatingRange, value_text
from shadowbench.reports.analysis import Configuration, Section
from shadowbench.reports.stability import Stability, whole
from shadowbench.studies.folder import Run, Sweep
from shadowbench.studies.tables import phase_note
from shadowbench.studies.times import time_notes

SOFTWARE = "times of a software renderer: for trends only, no GPU's"
RAY_TRACED = "ray-traced"  # the technique that is the truth's own method: where the speed axis ends
EDGE_NAMES = {1.0: "1 px", 0.5: "½ px", 0.25: "¼ px"}


def digits(value: float) -> str:
    """Three significant digits, without an exponent where it can be."""
    if abs(value) >= 1000:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".") if value and abs(value) >= 1e-4 else f"{value:.2g}"


def counted(count: int, what: str) -> str:
    """`1 cell`, `2 cells`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def sentence(text: str) -> str:
    """With a capital and a full stop."""
    return text[:1].upper() + text[1:] + "."


def times_are(run: Run) -> str:
    """What a reader must know of a run's times before reading them."""
    if run.software is None:
        return "times of an unknown machine (no run.json)"
    return SOFTWARE if run.software else f"times of {run.renderer}"


def section_notes(section: Section) -> list[str]:
    """What a reader must know of a section: maps of one phase, the reference of its times, which times are rough."""
    rows = [one.row for one in section.held]
    rough = [one.row.wide for one in section.timed]
    return [*filter(None, [phase_note(rows)]), *time_notes(section.reference, rough)]


def value_of(one: Configuration, name: str) -> str:
    """A metric or a time as text; ~ before every time of a cell whose rounds varied much."""
    value = one.value(name)
    return "–" if value is None else f"{'~' if name.endswith('_ms') and one.row.wide else ''}{digits(value)}"


def refusals(section: Section) -> list[tuple[str, str]]:
    """Configurations without a number somewhere: spec and map sizes, and why (`unsupported: …`, `failed: …`)."""
    found: dict[tuple[str, str], list[int]] = {}
    for one in section.configurations:
        whys = []
        if one.row.cells and one.error is None:
            whys.append("no IoU: neither the truth nor the mask has a shadow")
        for status, count in Counter(one.row.refused).items():
            total = one.row.cells + len(one.row.refused)
            whys.append(f"{count} of {total} cells {status}" if total > 1 else status)
        for why in whys:
            sizes = found.setdefault((one.spec, why), [])
            sizes += [one.map_size] if one.map_size else []
    return [
        (f"{spec} at {', '.join(map(str, sorted(sizes)))}" if sizes else spec, why)
        for (spec, why), sizes in found.items()
    ]


def warned(section: Section) -> list[str]:
    """What was noticed of masks that came from elsewhere, and scored as they are: a shift, an encoding."""
    keys = set(section.frame["key"])
    rows = [row for row in section.run.rows if row["key"] in keys]
    return [f"{row['spec']}: {line}" for row in rows for line in row.get("input", {}).get("warnings", ())]


def machine_facts(run: Run | Sweep) -> list[tuple[str, str]]:
    """Name and value of everything that is known of how a run or a sweep was made."""
    about = run.about
    machine, device = about.get("machine", {}), about.get("device", {})
    cells = counted(len(run.rows), "cell")
    older = f"; {counted(run.older, 'older record')} of the same cells left out" if run.older else ""
    foreign = (
        f"; {counted(run.foreign, 'time')} of another machine left out" if isinstance(run, Run) and run.foreign else ""
    )
    # A sweep is not timed.
    study, clock = (about.get("study", {}), about.get("clock")) if isinstance(run, Run) else ({}, None)
    facts = [
        ("command", about.get("command", "unknown: no run.json")),
        ("finished", about.get("finished")),
        ("rows", f"{cells}, all that the folder holds, of this and earlier commands{older}{foreign}"),
        ("renderer", f"{run.renderer}{' (software)' if run.software else ''}"),
        ("processor", machine.get("processor") and f"{machine['processor']}, {machine.get('cores')} cores"),
        ("memory", machine.get("memory_gib") and f"{machine['memory_gib']} GiB"),
        ("system", machine.get("system")),
        ("clock", clock),
        (
            "OpenGL",
            device.get("version") and f"{device['version'] / 100:.1f}, {device.get('subpixel_bits')} sub-pixel bits",
        ),
        ("time ratios against", study.get("reference")),
        ("rounds", study.get("rounds")),
        ("phases", study.get("phases")),
        ("versions", ", ".join(f"{name} {value}" for name, value in about.get("versions", {}).items())),
    ]
    return [(name, str(value)) for name, value in facts if value not in (None, "")]


def tolerances() -> str:
    """What is in tolerance, in words."""
    least = f"IoU of at least {TOLERANCES['iou']:g}"
    most = [f"{name} of at most {100 * limit:g}%" for name, limit in TOLERANCES.items() if name != "iou"]
    return f"{least}, {', '.join(most)}; no NaN, infinity, OpenGL error, crash or hang"


def stability_headline(found: Stability) -> list[str]:
    """Along how many axes each spec holds, and what is left out."""
    counts = {
        spec: (whole(ranges), len(ranges))
        for spec in found.specs
        for ranges in [[one for one in found.ranges if one.spec == spec]]
    }
    texts = [f"`{spec}` {held} of {swept}" for spec, (held, swept) in counts.items()]
    lines = [f"Axes, by kind of light, that hold from end to end: {', '.join(texts)}."] if texts else []
    if found.unfinished:
        spec, axis, _ = found.unfinished[0]
        lines.append(f"Left out as unfinished: {len(found.unfinished)}, the first `{spec}` along {axis}.")
    if found.unknown:
        lines.append(f"Left out as not of this version's axes: {counted(found.unknown, 'cell')}.")
    if found.floor:
        lines.append(
            f"Left out as the floor that every score is read against: {counted(found.floor, 'cell')} unshadowed."
        )
    return lines if texts else ["Nothing here has a range.", *lines]


def range_text(one: OperatingRange) -> str:
    """A range as `stress` prints it, the count of values that hold, and what is refused."""
    if one.share is None or (one.share == 1 and not one.axis.ordered):
        return one.plain
    refused = f"; {_refused(one)} unsupported" if one.unsupported else ""
    return f"{one.plain} ({len(one.in_tolerance)} of {one.measured}{refused})"


def range_tables(found: Stability) -> list[tuple[str, list[str], list[tuple[str, list[OperatingRange | None]]]]]:
    """For each spec its lights, and for each axis a range a light, None where the axis is not swept under it."""
    tables = []
    for spec in found.specs:
        kinds = [kind for other, kind in found.lines if other == spec]
        rows = [
            (axis.name, ranges)
            for axis in found.axes
            for ranges in [[found.at.get((spec, axis.name, kind)) for kind in kinds]]
            if any(ranges)
        ]
        tables.append((spec, [NAMES[kind] for kind in kinds], rows))
    return tables


def range_cells(found: Stability) -> list[tuple[Axis, list[OperatingRange | None], list[str]]]:
    """By axis, its ranges in the order of `found.lines`, None where it is not swept, and how each is told."""
    rows = []
    for axis in found.axes:
        ranges = [found.at.get((spec, axis.name, kind)) for spec, kind in found.lines]
        rows.append((axis, ranges, ["" if one is None else range_text(one) for one in ranges]))
    return rows


def ended(found: Stability) -> list[tuple[str, str]]:
    """Breaking points that left no picture: where, and what ended the cell."""
    return [
        (f"{one.spec} at {one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}", row["status"])
        for one, broken, row in found.breaking_points()
        if row["status"] != "ok"
    ]


def _refused(one: OperatingRange) -> str:
    return ", ".join(value_label(value) for value in one.unsupported)
