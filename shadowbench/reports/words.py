"""Texts that all report formats share: numbers, and notes on runs and on their sections."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shadowbench.errors import counted
from shadowbench.maps.presets import ENGINES
from shadowbench.plugin.registry import engines, preset_names
from shadowbench.results.configurations import BIAS_LENGTHS, Configuration, CostName, Section
from shadowbench.results.folder import Folder, Run
from shadowbench.results.law import SHORTEST_MS
from shadowbench.results.times import time_notes
from shadowbench.scores.metrics import METRICS, is_soft, soft_faults

SOFTWARE = "times of a software renderer: for trends only, not representative of a GPU"
NO_HARDENING = (
    "no hardening: it needs 30 true penumbrae wider than 4 px on planes, whose widths differ by a factor of 3"
)
COST_HEADINGS: Mapping[CostName, str] = {
    "frame_ms": "ms",
    "predicted_ms": "predicted ms",
    "work_cost": "work",
    "map_size": "ms",
}
"""Headings of the column of costs."""
COLUMNS = {
    False: {"SSIM": "ssim", "edge px": "edge_px", "acne": "acne", "leak": "leak"},
    True: {"RMSE pen": "rmse_pen", "IoU": "iou", "SSIM": "ssim"}
    | {name: name for name in ("bleed", "noise", "width", "hardening")},
}
"""Metrics that tables and charts show besides the error, of hard and of soft shadows (True): heading and name."""
_BRACKETS = "( ): range over the cells; [ ], and bars of charts: 95% confidence interval of the median, by bootstrap"


def digits(value: float) -> str:
    """A number with three significant digits, without an exponent if possible; more if below 1, but 1 with three."""
    if 0.9995 <= value < 1:
        return next(text for places in range(4, 18) if float(text := f"{value:.{places}g}") < 1)
    if abs(value) >= 1000:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".") if value and abs(value) >= 1e-4 else f"{value:.2g}"


def optional(value: float | None) -> str:
    """A number, – for None."""
    return "–" if value is None else digits(value)


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


def cost_source(section: Section) -> str:
    """A note on what the costs of a section are."""
    if section.cost_name == "predicted_ms":
        shortest = f"below {SHORTEST_MS:g} ms they are not told apart"
        return f"times beyond a frame without shadows, predicted for {section.device} from counted work; {shortest}"
    if section.cost_name == "work_cost":
        return "millions (M) of shader invocations and texture reads, which is not time"
    return time_source(section.run)


def section_notes(section: Section) -> list[str]:
    """Notes on a section: medians, maps scored in one phase only, the reference of its times, and rough times."""
    notes = []
    if section.max_cells > 1:
        notes += [f"medians over up to {section.max_cells} cells (views × phases) a configuration", _BRACKETS]
    if (one_phase := phase_note(section.scored)) is not None:
        notes.append(one_phase)
    if (presets := preset_note(section.scored)) is not None:
        notes.append(presets)
    if section.soft and not any(one.values["hardening"] for one in section.scored):
        notes.append(NO_HARDENING)
    return [*notes, *time_notes(section.reference, [one.rough for one in section.timed])]


def phase_note(found: Sequence[Configuration]) -> str | None:
    """A warning about maps that were scored at one sub-texel offset only; None where there are none."""
    single = [one.single_phase for one in found if one.map_size is not None and one.cells]
    if not any(single):
        return None
    which = "" if all(single) else "maps without an interval: "
    return f"{which}scored in one phase (sub-texel offset) only; another may reverse the order of two maps (--phases 8)"


def preset_note(found: Sequence[Configuration]) -> str | None:
    """That presets with the name of an engine are not its pictures; None where there are none."""
    shown = [one.name.partition(":preset=") for one in found if one.cells]
    names = sorted({preset for technique, _, preset in shown if preset in ENGINES and technique not in ENGINES})
    if not names:
        return None
    where = "; rows of engines: results/published/engines, docs/how-to/engines.md" if {*names} & {*engines()} else ""
    return (
        f"presets with an engine's name ({', '.join(names)}) draw its parameters in our shaders; the engine's own "
        f"picture may be far less accurate{where}"
    )


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


def unscored(section: Section) -> list[tuple[str, str]]:
    """Configurations with cells that have no score: spec and map sizes, and the reason, such as `unsupported: …`."""
    found: dict[tuple[str, str], list[int]] = {}
    for one in section.configurations:
        total = one.cells + len(one.refused)
        reasons = [
            f"{count} of {total} cells {status}" if total > 1 else status
            for status, count in Counter(one.refused).items()
        ]
        if one.cells and one.error is None:
            reasons.insert(0, "no IoU: neither the truth nor the mask has a shadow")
        for reason in reasons:
            found.setdefault((one.name, reason), []).extend([one.map_size] if one.map_size else [])
    return [
        (f"{spec} at {', '.join(map(str, sorted(sizes)))}" if sizes else spec, reason)
        for (spec, reason), sizes in found.items()
    ]


def mask_warnings(section: Section) -> list[str]:
    """Warnings about external masks, such as a suspected shift or encoding; these were scored unchanged."""
    keys = set(section.frame["key"])
    rows = [row for row in section.run.rows if row["key"] in keys]
    return [f"{row['spec']}: {line}" for row in rows for line in row.get("input", {}).get("warnings", ())]


def run_facts(run: Folder) -> list[tuple[str, str]]:
    """How a run or sweep was measured, as (name, value) pairs: command, machine, renderer, settings, versions."""
    about = run.about
    machine, device = about.get("machine", {}), about.get("device", {})
    left_out = [f"{counted(run.older, 'older record')} of the same cells"] if run.older else []
    timed: list[tuple[str, Any]] = []
    if isinstance(run, Run):
        left_out += [f"{counted(run.foreign, 'time')} of another machine"] if run.foreign else []
        study = about.get("study", {})
        timed = [("time ratios against", study.get("reference")), ("rounds", study.get("rounds"))]
        timed.append(("phases", _phases(run)))
    rows = f"{counted(len(run.rows), 'cell')}, all that the folder holds, of this and earlier commands"
    gl = device.get("version") and f"{device['version'] / 100:.1f}, {device.get('subpixel_bits')} sub-pixel bits"
    facts = [
        ("command", about.get("command", "unknown: no run.json")),
        ("commit", ", ".join(dict.fromkeys(row["commit"] for row in run.rows if "commit" in row))),
        ("finished", about.get("finished")),
        ("rows", "; ".join([rows, *(f"{what} left out" for what in left_out)])),
        ("renderer", f"{run.renderer}{' (software)' if run.software else ''}"),
        ("processor", machine.get("processor") and f"{machine['processor']}, {machine.get('cores')} cores"),
        ("memory", machine.get("memory_gib") and f"{machine['memory_gib']} GiB"),
        ("system", machine.get("system")),
        ("clock", about.get("clock") if timed else None),  # sweeps are not timed
        ("OpenGL", gl),
        *timed,
        ("versions", ", ".join(f"{name} {value}" for name, value in about.get("versions", {}).items())),
        ("times", time_source(run) if isinstance(run, Run) else None),
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
