"""Generates docs/explanation/choosing.md from the rows of results/published/; --check reports a stale page.

Every number of the page is computed from these rows; predicted times follow from the work that they count.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from pages import checks, filled, table, write
from recommend_check import TARGETS

from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import own_techniques, preset_names
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.frame import read_runs
from shadowbench.results.law import SHORTEST_MS, Law, law_on_record
from shadowbench.results.summary import Target
from shadowbench.scenes.library import builtin_light
from shadowbench.scores.metrics import METRICS, is_soft

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "explanation" / "choosing.md"
STRICT = Target("iou", 0.99)
COURSE = ("", "preset=offset", "preset=constant", "preset=course", "preset=webgl")
COURSE_SCENE, COURSE_SIZE = "colonnade", 1024
FAULTS = ("acne", "leak", "contact")


def main() -> int:
    """Write or check the page."""
    law = law_on_record()
    assert law is not None
    rows = {name: _rows(name) for name in ("techniques", "plants")}
    scenes = {name: list(dict.fromkeys(row["scene"] for row in own)) for name, own in rows.items()}
    values = {
        "DEVICE": law.device,
        "SHORTEST": f"{SHORTEST_MS:g}",
        "SCENES": str(len(scenes["techniques"])),
        "VIEW": str(rows["techniques"][0]["view_size"]),
        "COUNTS": "\n".join(_counts(rows["techniques"], law)),
        "BY_SCENE": "\n".join(_by_scene(rows["techniques"], scenes["techniques"], law)),
        "PLANTS": "\n".join(_by_scene(rows["plants"], scenes["plants"], law)),
        "COURSE_SCENE": COURSE_SCENE,
        "COURSE_SIZE": str(COURSE_SIZE),
        "COURSE": "\n".join(_course(rows["techniques"])),
    }
    return write({FILE: filled(__file__, values)}, checks(__doc__))


def _rows(name: str) -> list[Record]:
    """Scored rows of a published study, under lights without a size."""
    (run,) = read_runs([ROOT / "results" / "published" / name])
    return [
        row
        for row in run.rows
        if row["status"] == "ok" and not is_soft(row["metrics"]) and row["technique"] != "unshadowed"
    ]


def _name(row: Record) -> str:
    """The spec, by its preset's name where it has one, and the map size."""
    spec = preset_names().get(row["spec"], row["spec"])
    return f"`{spec}` at {row['map_size']}" if row["map_size"] else f"`{spec}`"


def _meets(row: Record, target: Target) -> bool:
    value = row["metrics"][target.metric]
    return value is not None and METRICS[target.metric].meets(value, target.limit)


def _ranked(rows: Sequence[Record], scene: str, target: Target, law: Law) -> list[tuple[float, Record]]:
    """Rows of a scene that meet a target, with predicted times, cheapest first; of times not told apart, by work."""
    able = [
        (ms, row)
        for row in rows
        if row["scene"] == scene and _meets(row, target) and (ms := law.of_row(row)) is not None
    ]
    return sorted(able, key=lambda pair: (pair[0], pair[1]["work"]["cost"]))


def _counts(rows: Sequence[Record], law: Law) -> list[str]:
    """A table: for each target, in how many scenes each technique is the cheapest."""
    scenes = dict.fromkeys(row["scene"] for row in rows)
    choices = {
        target: [found[0][1] for scene in scenes if (found := _ranked(rows, scene, target, law))] for target in TARGETS
    }
    names = list(dict.fromkeys(row["technique"] for row in rows if law.of_row(row) is not None))
    lines = []
    for target, found in choices.items():
        won = Counter(row["technique"] for row in found)
        sizes = [row["map_size"] for row in found if row["map_size"]]
        counts = [won[name] for name in names]
        lines.append([_target(target), *counts, len(scenes) - len(found), f"{median(sizes):g}"])
    return table(["target", *(f"`{name}`" for name in names), "none", "median map"], lines)


def _target(target: Target) -> str:
    return f"IoU ≥ {target.limit:.2f}" if target.metric == "iou" else f"edges ≤ {target.limit:g} px off"


def _by_scene(rows: Sequence[Record], scenes: Sequence[str], law: Law) -> list[str]:
    """A table: the cheapest at the strict target in each scene, and the cheapest of another technique."""
    headings = ("scene", "light", "cheapest", "IoU", "ms", "next technique", "IoU", "ms", "without a predicted time")
    lines = []
    for scene in scenes:
        ranked = _ranked(rows, scene, STRICT, law)
        others = [pair for pair in ranked if pair[1]["technique"] != ranked[0][1]["technique"]]
        unranked = [
            _name(row) for row in rows if row["scene"] == scene and _meets(row, STRICT) and law.of_row(row) is None
        ]
        lines.append([scene, builtin_light(scene), *_choice(ranked), *_choice(others), ", ".join(unranked)])
    return table(headings, lines, texts=("light", "cheapest", "next technique", "without a predicted time"))


def _choice(found: Sequence[tuple[float, Record]]) -> tuple[str, str, str]:
    """Spec, IoU and predicted time of the first row; `none` if there is none."""
    if not found:
        return "none", "", ""
    ms, row = found[0]
    return _name(row), _iou(row["metrics"]["iou"]), f"{ms:.2g}" if ms > SHORTEST_MS else f"<{SHORTEST_MS:g}"


def _iou(value: float) -> str:
    return "1" if value == 1.0 else f"{value:.4f}" if value < 0.99995 else f"{value:.6f}"


def _course(rows: Sequence[Record]) -> list[str]:
    """A table: scores in one scene of the default and of settings that courses publish."""
    known = {one.name: one for one in own_techniques()}
    metrics = {
        row["spec"]: row["metrics"] for row in rows if (row["map_size"], row["scene"]) == (COURSE_SIZE, COURSE_SCENE)
    }
    lines = []
    for items in COURSE:
        short = f"shadow-map:{items}".rstrip(":")
        own = metrics[parse_spec(short, known).sizeless_text]
        lines.append([f"`{short}`", f"{1 - own['iou']:.4f}", *(f"{own[name]:.2g}" for name in FAULTS)])
    return table(("spec", "1 − IoU", *FAULTS), lines)


if __name__ == "__main__":
    sys.exit(main())
