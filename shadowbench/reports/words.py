"""Texts that all report formats share: numbers, notes, and operating ranges."""

from collections import Counter
from collections.abc import Iterable, Sequence

from shadowbench.errors import counted
from shadowbench.extremes.model import NAMES, Axis, value_label
from shadowbench.plugin.registry import preset_names
from shadowbench.reports.stability import Stability, complete_count
from shadowbench.results.configurations import BIAS_LENGTHS, Configuration, Section
from shadowbench.results.folder import Run, Sweep
from shadowbench.results.ranges import HARD, SOFT, OperatingRange, value_text
from shadowbench.results.times import time_notes
from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.scores.soft_faults import soft_faults

SOFTWARE = "times of a software renderer: for trends only, not representative of a GPU"
NO_HARDENING = (
    "no hardening: it needs 30 true penumbrae wider than 4 px on planes, whose widths differ by a factor of 3"
)
_BRACKETS = "( ): range over the cells; [ ], and bars of charts: 95% confidence interval of the median, by bootstrap"
EDGE_NAMES = {1.0: "1 px", 0.5: "½ px", 0.25: "¼ px"}


def digits(value: float) -> str:
    """A number with three significant digits, without an exponent if possible; more if below 1, but 1 with three."""
    if 0.9995 <= value < 1:
        return next(text for places in range(4, 18) if float(text := f"{value:.{places}g}") < 1)
    if abs(value) >= 1000:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".") if value and abs(value) >= 1e-4 else f"{value:.2g}"


def sentence(text: str) -> str:
    """The text with a capital letter, unless it begins with a unit, and a full stop."""
    return f"{text}." if text.startswith("ms:") else text[:1].upper() + text[1:] + "."


def time_source(run: Run) -> str:
    """A note on which renderer a run's times are from."""
    if not run.times:
        return "nothing was timed"
    if run.software is None:
        return "times of an unknown machine (no run.json)"
    return SOFTWARE if run.software else f"times of {run.renderer}"


def section_notes(section: Section) -> list[str]:
    """Notes on a section: medians, maps scored in one phase only, the reference of its times, and rough times."""
    rough = [one.rough for one in section.timed]
    flat = [NO_HARDENING] if section.soft and not any(one.values["hardening"] for one in section.scored) else []
    cells = f"medians over up to {section.max_cells} cells (views × phases) a configuration"
    several = [cells, _BRACKETS] if section.max_cells > 1 else []
    return [*several, *filter(None, [phase_note(section.scored)]), *flat, *time_notes(section.reference, rough)]


def phase_note(found: Sequence[Configuration]) -> str | None:
    """A warning about maps that were scored at one sub-texel offset only; None where there are none."""
    mapped = [one for one in found if one.map_size is not None and one.cells]
    if not any(one.single_phase for one in mapped):
        return None
    which = "" if all(one.single_phase for one in mapped) else "maps without an interval: "
    return f"{which}scored in one phase (sub-texel offset) only; another may reverse the order of two maps (--phases 8)"


def bias_notes(found: Sequence[Configuration]) -> list[str]:
    """What biases of a fixed size mean on each map, in metres and in texels, for a sun."""
    notes = []
    for one in found:
        bias, bias_texels, offset, offset_texels = map(one.value, BIAS_LENGTHS)
        parts = [
            f"{digits(metres)} m ({digits(texels)} texels) {along}"
            for metres, texels, along in (
                (bias, bias_texels, "along the light"),
                (offset, offset_texels, "along the normal at grazing light"),
            )
            if metres is not None and texels is not None
        ]
        if parts:
            notes.append(f"bias of {one.name} at {one.map_size}: {' and '.join(parts)}")
    return notes


def value_of(one: Configuration, name: str) -> str:
    """Text of a metric or time (see `Configuration.text`)."""
    return one.text(name, digits)


def median_text(one: Configuration, name: str, limit: float | None = None) -> str:
    """Text of a metric's median, with the range over several views and phases: `0.9534 (0.9466–0.9571)`.

    limit: a target, to the other side of which the median is not rounded.
    """
    found = one.values[name]
    if found is None:
        return "–"
    form = METRICS["iou"].digits_beside(1.0, "{:.4g}".format) if name == "iou" else digits
    text = one.text(name, form if limit is None else METRICS[name].digits_beside(limit, form))
    ends = [form(end) for end in (found.least, found.most) if end is not None]
    return f"{text}{' px' if name == 'edge_px' else ''}" + (f" ({'–'.join(ends)})" if len(set(ends)) > 1 else "")


def fault_lines(one: Configuration) -> list[str]:
    """What is wrong with the soft shadows of a configuration, by its medians, causes first; empty for hard ones."""
    metrics = {name: one.value(name) for name in METRICS}
    faults = soft_faults(metrics, one.value("width_bias")) if is_soft(metrics) else []
    return [f"{fault.name}: {fault.line}" for fault in faults]


def faults_of(section: Section) -> list[tuple[str, str]]:
    """What is wrong with each configuration of a soft scene, best first: label and sentences."""
    told = [(one.label, "; ".join(fault_lines(one))) for one in section.scored]
    return [(label, line) for label, line in told if line]


def unscored(section: Section) -> list[tuple[str, str]]:
    """Configurations with cells that have no score: spec and map sizes, and the reason, such as `unsupported: …`."""
    found: dict[tuple[str, str], list[int]] = {}
    for one in section.configurations:
        reasons = []
        if one.cells and one.error is None:
            reasons.append("no IoU: neither the truth nor the mask has a shadow")
        for status, count in Counter(one.refused).items():
            total = one.cells + len(one.refused)
            reasons.append(f"{count} of {total} cells {status}" if total > 1 else status)
        for reason in reasons:
            sizes = found.setdefault((one.name, reason), [])
            sizes += [one.map_size] if one.map_size else []
    return [
        (f"{spec} at {', '.join(map(str, sorted(sizes)))}" if sizes else spec, reason)
        for (spec, reason), sizes in found.items()
    ]


def mask_warnings(section: Section) -> list[str]:
    """Warnings about external masks, such as a suspected shift or encoding; these were scored unchanged."""
    keys = set(section.frame["key"])
    rows = [row for row in section.run.rows if row["key"] in keys]
    return [f"{row['spec']}: {line}" for row in rows for line in row.get("input", {}).get("warnings", ())]


def run_facts(run: Run | Sweep) -> list[tuple[str, str]]:
    """How a run or sweep was measured, as (name, value) pairs: command, machine, renderer, settings, versions."""
    about = run.about
    machine, device = about.get("machine", {}), about.get("device", {})
    cells = counted(len(run.rows), "cell")
    older = f"; {counted(run.older, 'older record')} of the same cells left out" if run.older else ""
    foreign = (
        f"; {counted(run.foreign, 'time')} of another machine left out" if isinstance(run, Run) and run.foreign else ""
    )
    # Sweeps are not timed.
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
        ("phases", _phases(run) if isinstance(run, Run) else None),
        ("versions", ", ".join(f"{name} {value}" for name, value in about.get("versions", {}).items())),
    ]
    return [(name, str(value)) for name, value in facts if value not in (None, "")]


def _phases(run: Run) -> str:
    """The number of phases in which each spec was scored: `8`, or `8 of shadow-map; 1 of all others`."""
    scored = run.frame[run.frame["status"] == "ok"]
    specs: dict[int, list[str]] = {}
    for spec, count in scored["phase"].fillna(0).groupby(scored["spec"], sort=False).nunique().items():
        specs.setdefault(count, []).append(preset_names().get(str(spec), str(spec)))
    if len(specs) < 2:
        return "".join(map(str, specs))
    *fewer, (most, _) = sorted(specs.items(), key=lambda item: len(item[1]))
    return "; ".join([*(f"{count} of {', '.join(names)}" for count, names in fewer), f"{most} of all others"])


def presets_of(specs: Iterable[str]) -> list[tuple[str, str]]:
    """The presets among specs, each by its name and with the spec that it stands for."""
    return [(name, spec) for spec in dict.fromkeys(specs) if (name := preset_names().get(spec))]


def tolerances() -> str:
    """The tolerances of `stress` as text."""
    least = f"IoU of at least {HARD['iou']:g}"
    most = [f"{name} of at most {100 * limit:g}%" for name, limit in HARD.items() if name != "iou"]
    soft = [f"{name} of at most {limit:g}" for name, limit in SOFT.items()]
    return (
        f"{least}, {', '.join(most)}, of soft shadows {', '.join(soft)}; no NaN, infinity, OpenGL error, crash or hang"
    )


def stability_headline(found: Stability) -> list[str]:
    """Sentences on the number of axes along which each spec is in tolerance, and on cells left out."""
    counts = {
        spec: (complete_count(ranges), len(ranges))
        for spec in found.specs
        for ranges in [[one for one in found.ranges if one.spec == spec]]
    }
    texts = [f"`{spec}` {complete} of {swept}" for spec, (complete, swept) in counts.items()]
    lines = (
        [f"Axes, counted per kind of light, that are in tolerance from end to end: {', '.join(texts)}."]
        if texts
        else []
    )
    if found.unfinished:
        spec, axis, _ = found.unfinished[0]
        lines.append(
            f"Left out as unfinished: {counted(len(found.unfinished), 'sweep')}, the first of `{spec}` along {axis}."
        )
    if found.unknown:
        lines.append(f"Left out because this version has no such axis or value: {counted(found.unknown, 'cell')}.")
    if found.floor:
        lines.append(f"Left out because `unshadowed` is out of tolerance by design: {counted(found.floor, 'cell')}.")
    return lines if texts else ["No spec has an operating range.", *lines]


def range_text(one: OperatingRange) -> str:
    """Text of an operating range: as printed by `stress`, the number of values in tolerance, and unsupported values."""
    if one.share is None or (one.share == 1 and not one.axis.ordered):
        return one.plain
    unsupported = f"; {', '.join(map(value_label, one.unsupported))} unsupported" if one.unsupported else ""
    return f"{one.plain} ({len(one.in_tolerance)} of {one.measured}{unsupported})"


def range_tables(found: Stability) -> list[tuple[str, list[str], list[tuple[str, list[OperatingRange | None]]]]]:
    """A table for each spec: (spec, lights, rows of (axis, a range per light)); None if not swept under that light."""
    tables = []
    for spec in found.specs:
        kinds = [kind for other, kind in found.series if other == spec]
        rows = [
            (axis.name, ranges)
            for axis in found.axes
            for ranges in [[found.range_at.get((spec, axis.name, kind)) for kind in kinds]]
            if any(ranges)
        ]
        tables.append((spec, [NAMES[kind] for kind in kinds], rows))
    return tables


def range_cells(found: Stability) -> list[tuple[Axis, list[OperatingRange | None], list[str]]]:
    """A table row per axis: the axis, its ranges in the order of `found.series`, and their texts; None if not swept."""
    rows = []
    for axis in found.axes:
        ranges = [found.range_at.get((spec, axis.name, kind)) for spec, kind in found.series]
        rows.append((axis, ranges, ["" if one is None else range_text(one) for one in ranges]))
    return rows


def breaks_without_picture(found: Stability) -> list[tuple[str, str]]:
    """Breaking points without a picture, as (spec, axis value and light; status) pairs."""
    return [
        (f"{one.spec} at {one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}", row["status"])
        for one, broken, row in found.breaking_points()
        if row["status"] != "ok"
    ]
