"""What a summary says in words: numbers, notes on how they were measured, and the verdict on what accuracy costs."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from shadowbench.errors import counted
from shadowbench.measure.columns import TRUTH_ERRORS
from shadowbench.plugin.registry import engines, preset_names
from shadowbench.results.frame import Run
from shadowbench.results.law import SHORTEST_MS
from shadowbench.results.summary import (
    Answer,
    CostName,
    Interval,
    Setting,
    Summary,
    Target,
    known,
)
from shadowbench.results.times import time_notes
from shadowbench.scores.metrics import METRICS, soft_faults
from shadowbench.techniques.shadow_map import ENGINES

Digits = Callable[[float], str]

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
_MARKUP = re.compile(r"\||<(?=[A-Za-z/!?])|\](?=\()")
_NONE = "No real-time technique here"
_EDGES = {1.0: "1 px", 0.5: "½ px", 0.25: "¼ px"}


# Numbers


def digits(value: float) -> str:
    """A number with three significant digits, without an exponent if possible; more if below 1, but 1 with three."""
    if 0.9995 <= value < 1:
        return next(text for places in range(4, 18) if float(text := f"{value:.{places}g}") < 1)
    if abs(value) >= 1000:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:#.3g}".rstrip(".") if value and abs(value) >= 1e-4 else f"{value:.2g}"


def interval_text(interval: Interval, digits: Digits) -> str:
    """Text such as `0.0123 [0.0110, 0.0140]`."""
    if math.isnan(interval.low):
        return digits(interval.median)
    return f"{digits(interval.median)} [{digits(interval.low)}, {digits(interval.high)}]"


def value_text(one: Setting, name: str, digits: Digits = digits) -> str:
    """Text of a median, – for none; ~ for a time that varied widely, `<0.0012` below the truth's error.

    Work is in millions, `1.39 M`.
    """
    value = getattr(one, name)
    if math.isnan(value):
        return "–"
    if name in METRICS:
        errors = {field: getattr(one, field) for field in TRUTH_ERRORS if known(getattr(one, field))}
        text, bias = METRICS[name].text(value, digits, errors), one.width_bias
        if name == "width" and bias and abs(bias) >= value / 2:  # of most penumbrae
            text += " wide" if bias > 0 else " narrow"
        return text
    if name == "work_cost":
        return f"{digits(value / 1e6)} M"
    if name == "predicted_ms":
        return f"<{SHORTEST_MS:g}" if 0 < value <= SHORTEST_MS else digits(value)
    return f"{'~' if name.endswith('_ms') and one.rough else ''}{digits(value)}"


def error_text(summary: Summary, one: Setting, digits: Digits = digits, bounds: bool = True) -> str:
    """Text of a setting's error, by default with its interval, or `<0.0012` below the truth's own error."""
    if math.isnan(one.error):
        return "–"
    text = value_text(one, summary.ranked_by.name, digits)
    if text.startswith("<"):
        return text
    return interval_text(Interval(one.error, one.low if bounds else math.nan, one.high), digits)


def median_text(one: Setting, name: str, limit: float | None = None) -> str:
    """Text of a metric's median, with the range over several views and phases: `0.9534 (0.9466–0.9571)`.

    limit: a target, to the other side of which the median is not rounded.
    """
    if math.isnan(getattr(one, name)):
        return "–"
    form = METRICS["iou"].digits_beside(1.0, "{:.4g}".format) if name == "iou" else digits
    text = value_text(one, name, form if limit is None else METRICS[name].digits_beside(limit, form))
    ends = [form(end) for end in (getattr(one, f"{name}_least"), getattr(one, f"{name}_most")) if known(end)]
    return f"{text}{' px' if name == 'edge_px' else ''}" + (f" ({'–'.join(ends)})" if len(set(ends)) > 1 else "")


def cost_text(summary: Summary, one: Setting, digits: Digits = digits) -> str:
    """A setting's cost with a unit: a time, work, or where nothing has either the map size."""
    if summary.cost == "map_size":
        return f"map {one.map_size}" if one.map_size else "no map"
    if math.isnan(one.cost):
        return "not ranked"
    return value_text(one, summary.cost, digits) + ("" if summary.cost == "work_cost" else " ms")


def target_name(target: Target) -> str:
    """A target as a column heading: `IoU ≥ 0.99`, `edge ≤ ½ px`, `RMSE ≤ 0.02`."""
    metric = METRICS[target.metric]
    limit = _EDGES[target.limit] if target.metric == "edge_px" else f"{target.limit:g}"
    return f"{metric.label} {'≥' if metric.better == 'higher' else '≤'} {limit}"


def sentence(text: str) -> str:
    """The text with a capital letter, unless it begins with a unit, and a full stop."""
    return f"{text}." if text.startswith("ms:") else text[:1].upper() + text[1:] + "."


# Markdown


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], texts: Sequence[str] = ()) -> list[str]:
    """A Markdown table, numbers to the right; empty without rows. texts: headings of other columns than the first."""
    rules = ["---" if name in texts or not at else "---:" for at, name in enumerate(headings)]
    lines = [headings, rules, *rows]
    return ["\n".join(f"| {' | '.join(map(escaped, line))} |" for line in lines)] if rows else []


def escaped(text: str) -> str:
    """Text escaped for a cell of a Markdown table: on one line, without separators, tags of HTML and links."""
    return " ".join(_MARKUP.sub(r"\\\g<0>", text).split())


# Notes


def time_source(run: Run) -> str:
    """A note on which renderer a run's times are from."""
    if not run.times:
        return "nothing was timed"
    if run.software is None:
        return "times of an unknown machine (no run.json)"
    return SOFTWARE if run.software else f"times of {run.renderer}"


def cost_source(summary: Summary) -> str:
    """A note on what costs are."""
    if summary.cost == "predicted_ms":
        shortest = f"below {SHORTEST_MS:g} ms they are not told apart"
        return f"times beyond a frame without shadows, predicted for {summary.device} from counted work; {shortest}"
    if summary.cost == "work_cost":
        return "millions (M) of shader invocations and texture reads, which is not time"
    return time_source(summary.run)


def cost_note(summary: Summary) -> str:
    """A note on what the costs are, and how far their times can be trusted."""
    if summary.cost == "map_size":
        return "Nothing here was timed: the cost is the size of the smallest map that suffices."
    costs = [known(one.cost) for one in summary.candidates]
    if not any(costs):
        return "Nothing here has a cost that is known."
    timed = summary.cost == "frame_ms"
    what = "work" if summary.cost == "work_cost" else "frame time of shadows"
    mean = f"mean {what} over these scenes" if summary.scenes else what
    rough = " ~ marks a rough time." if any(one.rough for part in summary.parts for one in part.timed) else ""
    why = "lacks times" if timed else "has none that is known"
    unranked = "" if all(costs) else f" What is not ranked {why}."
    return f"Cost: {mean}. {sentence(cost_source(summary))}{rough}{unranked}"


def notes_of(summary: Summary) -> list[str]:
    """Notes on a scene: medians, maps scored in one phase only, the reference of its times, and rough times."""
    notes = []
    if summary.max_cells > 1:
        notes += [f"medians over up to {summary.max_cells} cells (views × phases) a configuration", _BRACKETS]
    notes += filter(None, (phase_note(summary.shown), preset_note(summary.shown)))
    if summary.soft and not any(known(one.hardening) for one in summary.shown):
        notes.append(NO_HARDENING)
    return [*notes, *time_notes(summary.reference, [one.rough for one in summary.timed])]


def phase_note(settings: Iterable[Setting]) -> str | None:
    """A warning about maps that were scored at one sub-texel offset only; None where there are none."""
    single = [one.phases == 1 for one in settings if one.map_size is not None and one.cells]
    if not any(single):
        return None
    which = "" if all(single) else "maps without an interval: "
    return f"{which}scored in one phase (sub-texel offset) only; another may reverse the order of two maps (--phases 8)"


def preset_note(settings: Iterable[Setting]) -> str | None:
    """That presets with the name of an engine are not its pictures; None where there are none."""
    names = [one.name.partition(":preset=") for one in settings if one.cells]
    presets = sorted({preset for technique, _, preset in names if preset in ENGINES and technique not in ENGINES})
    if not presets:
        return None
    where = "; rows of engines: results/published/engines, docs/how-to/engines.md" if {*presets} & {*engines()} else ""
    return (
        f"presets with an engine's name ({', '.join(presets)}) draw its parameters in our shaders; the engine's own "
        f"picture may be far less accurate{where}"
    )


def fault_lines(summary: Summary, one: Setting) -> list[str]:
    """What is wrong with the soft shadows of a setting, by its medians, causes first; empty for hard ones."""
    if not summary.soft:
        return []
    values = {name: value if known(value := getattr(one, name)) else None for name in (*METRICS, "width_bias")}
    return [f"{name}: {line}" for name, line in soft_faults(values, values["width_bias"]).items()]


def unscored(summary: Summary) -> list[tuple[str, str]]:
    """Settings with cells that have no score: spec and map sizes, and the reason, such as `unsupported: …`."""
    sizes: dict[tuple[str, str], list[int]] = {}
    for one in summary.lines:
        total = one.cells + len(one.refused)
        reasons = [
            f"{count} of {total} cells {status}" if total > 1 else status
            for status, count in Counter(one.refused).items()
        ]
        if one.cells and math.isnan(one.error):
            reasons.insert(0, "no IoU: neither the truth nor the mask has a shadow")
        for reason in reasons:
            sizes.setdefault((one.name, reason), []).extend([one.map_size] if one.map_size else [])
    return [
        (f"{name} at {', '.join(map(str, sorted(own)))}" if own else name, reason)
        for (name, reason), own in sizes.items()
    ]


def mask_warnings(summary: Summary) -> list[str]:
    """Warnings about external masks, such as a suspected shift or encoding; these were scored unchanged."""
    keys = set(summary.cells["key"])
    rows = [row for row in summary.run.rows if row["key"] in keys]
    return [f"{row['spec']}: {line}" for row in rows for line in row.get("input", {}).get("warnings", ())]


def run_facts(run: Run) -> list[tuple[str, str]]:
    """How a run or sweep was measured, as (name, value) pairs: command, machine, renderer, settings, versions."""
    about, swept = run.about, "axis" in run.rows[0]
    machine, device, study = about.get("machine", {}), about.get("device", {}), about.get("study", {})
    cells = [f"{counted(len(run.rows), 'cell')}, all that the folder holds, of this and earlier commands"]
    cells += [f"{counted(run.older, 'older record')} of the same cells left out"] if run.older else []
    cells += [f"{counted(run.foreign, 'time')} of another machine left out"] if run.foreign else []
    phases = run.frame[run.frame["status"] == "ok"].groupby("spec")["phase"].nunique().clip(lower=1)
    gl = device.get("version") and f"{device['version'] / 100:.1f}, {device.get('subpixel_bits')} sub-pixel bits"
    facts: list[tuple[str, Any]] = [
        ("command", about.get("command", "unknown: no run.json")),
        ("commit", ", ".join(dict.fromkeys(row["commit"] for row in run.rows if "commit" in row))),
        ("finished", about.get("finished")),
        ("rows", "; ".join(cells)),
        ("renderer", f"{run.renderer}{' (software)' if run.software else ''}"),
        ("processor", machine.get("processor") and f"{machine['processor']}, {machine.get('cores')} cores"),
        ("memory", machine.get("memory_gib") and f"{machine['memory_gib']} GiB"),
        ("system", machine.get("system")),
        ("clock", None if swept else about.get("clock")),  # sweeps are not timed
        ("OpenGL", gl),
        ("time ratios against", None if swept else study.get("reference")),
        ("rounds", None if swept else study.get("rounds")),
        ("phases", None if swept else ", ".join(map(str, sorted({*phases})))),
        ("versions", ", ".join(f"{name} {value}" for name, value in about.get("versions", {}).items())),
        ("times", None if swept else time_source(run)),
    ]
    return [(name, str(value)) for name, value in facts if value not in (None, "")]


def presets_of(specs: Iterable[str]) -> list[tuple[str, str]]:
    """The presets among specs, each by its name and with the spec that it stands for."""
    return [(name, spec) for spec in dict.fromkeys(specs) if (name := preset_names().get(spec))]


# The verdict


def verdict(summary: Summary) -> list[str]:
    """The sentences on the cheapest setting for an accuracy, in one scene or in all; settings are in backticks.

    What `recommend` never chooses is left out; ray tracing, on the CPU as the truth is, is named for scale.
    """
    able = _able(summary)
    if not summary.candidates:
        some = any(part.shown for part in summary.parts)
        return [f"Nothing here has a score{' in each of its cells' if some else ''}."]
    if not able:
        what = "draws a shadow where one should be" if summary.real_time else "has a score"
        return [f"{_NONE} {what}.", *_ray_traced(summary)]
    where = f" in all {len(summary.scenes)} scenes" if summary.scenes else ""
    answer = _main_answer(summary, able)
    name, target, best = answer.target.metric, answer.target, answer.cheapest
    complete = [one for one in able if one.scored == len(summary.parts)]
    if best is None:
        near = answer.closest
        how = f"{METRICS[name].label} {median_text(near, name, target.limit)}"
        how = f"in {summary.scenes_met(near, target)} of them" if where else how
        lines = [f"{_NONE} {_reaches(target, ' of the shadow right')}{where}.", f"Closest: `{near.label}`, {how}."]
    else:
        tied = [one for one in answer.ties if one.technique != best.technique][:2]
        noise = " within the noise" if summary.cost == "frame_ms" else ""
        also = f"; as cheap{noise}: {', '.join(f'`{one.label}`' for one in tied)}" if tied else ""
        lines = [f"{_accuracy(target, ' of the shadow right')}{where}: {_cost_phrase(summary, best)}{also}."]
        lines += _next_target(summary, complete, target, best, where)
    partial = summary.cheapest([one for one in able if one.scored < len(summary.parts)], target)
    if partial is not None and (best is None or partial.cost < best.cost):
        cost = f" for {cost_text(summary, partial)}" if known(partial.cost) else ""
        of = counted(partial.scored + partial.unsupported, "scene")
        lines.append(f"`{partial.label}` suffices{cost} in the {partial.scored} of {of} that it supports.")
    return [*lines, *_ray_traced(summary)]


def verdict_setting(summary: Summary) -> Setting | None:
    """The setting that the verdict names first, else the most accurate; None without candidates."""
    able = _able(summary)
    if not able:
        return next(iter(summary.candidates), None)
    answer = _main_answer(summary, able)
    return answer.cheapest or answer.closest


def _able(summary: Summary) -> list[Setting]:
    """The candidates that are real-time techniques and draw a shadow where one should be."""
    return [one for one in summary.real_time if getattr(one, "iou_soft" if summary.soft else "iou") > 0]


def _main_answer(summary: Summary, able: Sequence[Setting]) -> Answer:
    """The answer of the first sentence: the middle target, or if nothing meets that in all scenes, the easiest."""
    complete = [one for one in able if one.scored == len(summary.parts)]
    easiest, middle = summary.answers(able, summary.targets[:2])
    best = [summary.answers(complete, [target]) for target in summary.targets[:2]]
    for answer, of in ((middle, best[1]), (easiest, best[0])):
        if of and of[0].cheapest is not None:
            return answer._replace(cheapest=of[0].cheapest, ties=of[0].ties)
    return easiest._replace(cheapest=None)


def _next_target(summary: Summary, complete: Sequence[Setting], main: Target, best: Setting, where: str) -> list[str]:
    """A sentence on the cost of the next higher accuracy; none at the highest."""
    for target in summary.targets[summary.targets.index(main) + 1 :][:1]:
        dearer = summary.cheapest(complete, target)
        if dearer is None:
            return [f"{_NONE} {_reaches(target, ' right')}{where}."]
        if dearer.Index == best.Index:
            return [f"`{best.label}` {_reaches(target, ' right')} too."]
        factor = f" (× {digits(dearer.cost / best.cost)})" if dearer.cost > 0 and best.cost > 0 else ""
        return [f"{_accuracy(target)} takes `{dearer.label}`, {cost_text(summary, dearer)}{factor}."]
    return []


def _ray_traced(summary: Summary) -> list[str]:
    """A sentence on the cost of ray tracing on the CPU, if it was measured and timed in all scenes."""
    traced = [one for one in summary.candidates if one.technique == "ray-traced" and one.scored == len(summary.parts)]
    costs = [cost_text(summary, one) for one in traced if one.cost > 0 and "where=gpu" not in one.full_spec]
    return [f"For scale: ray tracing on the CPU takes {cost}." for cost in costs[:1]]


def _accuracy(target: Target, of_what: str = "") -> str:
    return f"{100 * target.limit:g}%{of_what}" if target.metric == "iou" else target_name(target)


def _reaches(target: Target, of_what: str) -> str:
    return f"{'gets' if target.metric == 'iou' else 'reaches'} {_accuracy(target, of_what)}"


def _cost_phrase(summary: Summary, one: Setting) -> str:
    """What the cheapest setting costs, and by what it is the cheapest."""
    if known(one.cost):
        how = {"predicted_ms": f" by times predicted for {summary.device}", "work_cost": " by work"}
        by = how.get(summary.cost, "")
        return f"`{one.label}` is the cheapest real-time setting{by}, {cost_text(summary, one)} a frame"
    if summary.cost != "map_size":
        return f"`{one.label}` suffices, at a cost that is not known; nothing does at a known one"
    what = "the smallest map that suffices" if one.map_size else "sufficient, without a map"
    return f"`{one.label}` is {what}"


def answer_texts(summary: Summary, answer: Answer) -> tuple[str, str, str]:
    """Texts of a cell of the cost matrix: cost, setting, and a note.

    If no setting meets the target: a dash, nothing, and the best accuracy.
    """
    best, scenes = answer.cheapest, len(summary.parts)
    if best is not None:
        partly = "" if best.scored == scenes else f"supports {best.scored} of {scenes} scenes"
        return cost_text(summary, best), best.label, partly
    if scenes > 1:
        return "–", "", f"at best in {summary.scenes_met(answer.closest, answer.target)} of {scenes} scenes"
    name, limit = answer.target
    if math.isnan(getattr(answer.closest, name)):
        return "–", "", f"no {METRICS[name].label}"
    return "–", "", f"best {median_text(answer.closest, name, limit)}"


def accuracy_text(summary: Summary, answer: Answer) -> str:
    """What the cheapest setting of a cell reaches; if scenes differ, in the worst: `IoU 0.9534 in street`.

    Empty if no setting meets the target.
    """
    if answer.cheapest is None:
        return ""
    name, limit = answer.target
    lines = summary.by_scene(answer.cheapest)
    texts = {title: f"{METRICS[name].label} {median_text(one, name, limit)}" for title, one in lines.items()}
    worst = summary.worst_scene(answer.cheapest, name)
    scenes = {part.title: part.scene for part in summary.parts}
    return texts[worst] + (f" in {scenes[worst]}" if len(set(texts.values())) > 1 else "")
