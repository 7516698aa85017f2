"""The cost matrix and the verdict, for rows with a known answer."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from shadowbench.plugin.registry import engines, own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.reports.gallery import scored_cells
from shadowbench.reports.html import html_report
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.panels import panel_data, panels_of
from shadowbench.reports.verdict import cell_texts, cost_note, device_note, verdict
from shadowbench.reports.words import preset_note
from shadowbench.results.configurations import Configuration, Section, by_kind
from shadowbench.results.ranking import Target, candidates, cheapest, cost_matrix, mean_section, targets_of, ties
from shadowbench.scores.metrics import METRICS
from shadowbench.techniques import shadow_map as presets
from tests.reports.conftest import CELLS, TRUTH_ERROR, Cell

UNSUPPORTED = "unsupported: a lamp shines all round"
LOST = Cell("a", 512, None, None, phase=1, status="failed: died")
UNTIMED = [replace(cell, ms=None) for cell in CELLS]
# Soft shadows: the one with the lower IoU has the lower RMSE.
SOFT = (
    Cell("unshadowed", None, 1.0, 1.0, rmse_pen=2.0),
    Cell("sharp", 512, 0.001, 5.0, rmse_pen=0.4),
    Cell("blurred", 512, 0.3, 8.0, rmse_pen=0.06),
    Cell("sampled", None, 0.1, 90.0, rmse_pen=2 * TRUTH_ERROR),
)


def elsewhere(cell: Cell, **changes: Any) -> Cell:
    """A cell in another scene."""
    return replace(cell, **({"scene": "terrace"} | changes))


def phases(*errors: float, **changes: Any) -> list[Cell]:
    """A shadow map's cells in several phases, of which the first is timed."""
    return [
        Cell("shadow-map", 512, error, None if phase else 5.0, phase=phase, **changes)
        for phase, error in enumerate(errors)
    ]


def shown(made: Sequence[Section], metric: str = "iou") -> dict[str, list[str]]:
    """The texts of the cost matrix's cells, by technique."""
    lines = cost_matrix(candidates(made), targets_of(METRICS[metric]))
    return {
        name: [" ".join(filter(None, cell_texts(cell, len(made)))) for cell in cells] for name, cells in lines.items()
    }


A, B = Cell("a", 512, 0.004, 5.0), Cell("b", 512, 0.004, 50.0)
LARGE = Cell("a", 1024, 0.002, 9.0)
MATRICES = {
    "the cheapest of each technique that reaches a target": (
        CELLS,
        {
            "shadow-map": ["5.00 ms shadow-map at 512", "20.0 ms shadow-map at 2048", "– best 0.995"],
            "ray-traced": ["60.0 ms ray-traced"] * 3,
        },
    ),
    "of equal costs the more accurate": (
        (Cell("a", 512, 0.004, 5.0), Cell("a:bias=none", 512, 0.003, 5.0), Cell("a:fit=view", 512, 0.005, 5.0)),
        {"a": ["5.00 ms a:bias=none at 512"] * 2 + ["– best 0.997"]},
    ),
    "techniques by cost at the middle target": (
        (Cell("a", 512, 0.02, 1.0), Cell("b", 512, 0.005, 9.0), Cell("c", 512, 0.005, 8.0), Cell("d", 512, 0.2, 1.0)),
        {
            "c": ["8.00 ms c at 512"] * 2 + ["– best 0.995"],
            "b": ["9.00 ms b at 512"] * 2 + ["– best 0.995"],
            "a": ["1.00 ms a at 512", "– best 0.98", "– best 0.98"],
            "d": ["– best 0.8"] * 3,
        },
    ),
    "without times the smallest map": (
        UNTIMED,
        {
            "ray-traced": ["no map ray-traced"] * 3,
            "shadow-map": ["map 512 shadow-map at 512", "map 2048 shadow-map at 2048", "– best 0.995"],
        },
    ),
    "one setting must reach it in every scene, and its mean counts": (
        (A, LARGE, elsewhere(A, error=0.04), elsewhere(LARGE, ms=11.0)),
        {"a": ["5.00 ms a at 512", "10.0 ms a at 1024", "– at best in 0 of 2 scenes"]},
    ),
    "what supports some scenes stands below what supports all": (
        (A, B, elsewhere(A, error=None, ms=None, status=UNSUPPORTED), elsewhere(B)),
        {
            "b": ["50.0 ms b at 512"] * 2 + ["– at best in 0 of 2 scenes"],
            "a": ["5.00 ms a at 512 supports 1 of 2 scenes"] * 2 + ["– at best in 0 of 2 scenes"],
        },
    ),
    "what failed in a scene meets no target": (
        (A, B, elsewhere(B), elsewhere(A, error=None, ms=None, status="failed: the worker died")),
        {
            "b": ["50.0 ms b at 512"] * 2 + ["– at best in 0 of 2 scenes"],
            "a": [f"– at best in {count} of 2 scenes" for count in (1, 1, 0)],
        },
    ),
    "what is missing in a scene meets no target": (
        (A, B, elsewhere(B)),
        {
            "b": ["50.0 ms b at 512"] * 2 + ["– at best in 0 of 2 scenes"],
            "a": [f"– at best in {count} of 2 scenes" for count in (1, 1, 0)],
        },
    ),
    "what is timed in some scenes has no cost": (
        (A, replace(LARGE, ms=90.0), elsewhere(A, ms=None), elsewhere(LARGE, ms=90.0)),
        {"a": ["90.0 ms a at 1024"] * 2 + ["– at best in 0 of 2 scenes"]},
    ),
    "what failed in a phase meets no target": ((A, LOST), {}),
}


@pytest.mark.parametrize(("cells", "rows"), MATRICES.values(), ids=MATRICES)
def test_the_cost_matrix_has(measured, cells, rows) -> None:
    found = shown(measured(*cells))
    assert found == rows and list(found) == list(rows)


def test_edges_are_a_target_too_and_a_value_equal_to_the_limit_meets_it(measured) -> None:
    made = measured(Cell("a", 512, 0.3, 5.0, edge=0.6), Cell("a", 1024, 0.25, 8.0, edge=0.5))
    assert shown(made, "edge_px") == {"a": ["5.00 ms a at 512", "8.00 ms a at 1024", "– best 0.500 px"]}
    (exact,) = [one for one in made[0].timed if one.map_size == 1024]
    assert [Target("iou", limit).met_by(exact) for limit in (0.75, 0.76)] == [True, False]


@pytest.mark.parametrize(("ms", "spread", "same"), [(5.1, 0.02, True), (5.3, 0.02, False), (5.3, 0.05, True)])
def test_ties_within_the_noise_of_times_are_named(measured, ms, spread, same) -> None:
    """The interquartile ranges, 10 ms · spread wide, overlap."""
    made = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=spread), Cell("b", 512, 0.004, ms, ratio_iqr=spread))
    found = candidates(made)
    best = cheapest(found, Target("iou", 0.99))
    assert best is not None and best.mean.spec == "a"
    assert [one.mean.spec for one in ties(found, best, Target("iou", 0.99))] == (["b"] if same else [])
    assert ("; as cheap within the noise: `b at 512`" in verdict(made)[0]) == same


def test_what_costs_are_is_explained(measured) -> None:
    untimed = "Nothing here was timed: the cost is the size of the smallest map that suffices."
    assert cost_note(measured(*UNTIMED)) == untimed
    some = measured(Cell("a", 512, 0.004, None), Cell("b", None, 0.004, 5.0))
    assert cost_note(some).endswith(" What is not ranked lacks times.")
    rough = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=0.4))
    assert "~5.00 ms a frame" in verdict(rough)[0]
    assert cost_note(rough) == (
        "Cost: frame time of shadows. Times of a software renderer: for trends only, not representative of a GPU. "
        "~ marks a rough time."
    )
    exact = cost_note(measured(Cell("a", 512, 0.004, 5.0), software=False))
    assert "representative" not in exact and "~" not in exact


# Several phases: their median is what counts, and what is shown


def cells_of(made: Sequence[Section]) -> list[dict[str, Any]]:
    """The cells of the only row of the first panel's matrix."""
    panel = panels_of(made[0].run, 0, made)[0]
    ((_, cells),) = panel.matrix(panel.targets)
    return cells


def test_a_target_is_met_by_the_median_that_is_shown_with_its_range(measured) -> None:
    """Phase 0, of which the picture is, misses the target that the median meets; then the other way round."""
    (meets,), (misses,), (single,) = (
        measured(*phases(*errors)) for errors in ((0.06, 0.04, 0.02), (0.04, 0.08), (0.04,))
    )
    met, missed = cells_of([meets])[0], cells_of([misses])[0]
    assert (met["cost"], met["accuracy"]) == ("5.00 ms", "IoU 0.96 (0.94–0.98)")
    assert (missed["cost"], missed["accuracy"], missed["note"]) == ("–", "", "best 0.94 (0.92–0.96)")
    ((_, picture),) = scored_cells(meets)
    assert picture["score"] == "median IoU 0.96 (0.94–0.98)" and picture["error"] == pytest.approx(0.04)
    assert picture["own"] == "picture: phase 0, IoU 0.94000"
    assert picture["caption"] == (
        "median IoU 0.96 (0.94–0.98) of 3, 5.00 ms (software renderer); picture: phase 0, IoU 0.94000, edge 6.00 px"
    )
    assert cells_of([single])[0]["accuracy"] == "IoU 0.96"
    ((_, picture),) = scored_cells(single)
    assert (picture["own"], picture["score"]) == ("", "IoU 0.96000")
    assert picture["caption"] == "IoU 0.96000, edge 4.00 px, 5.00 ms (software renderer)"


def test_over_scenes_a_cell_shows_the_worst_of_the_medians(measured) -> None:
    made = measured(*phases(0.02, 0.04), *phases(0.01, 0.03, 0.04, scene="terrace"))
    assert cells_of(made)[0]["accuracy"] == "IoU 0.97 (0.96–0.98) in stairs"  # 0.97 in both: the first
    worse = measured(*phases(0.02), *phases(0.04, scene="terrace"))
    assert cells_of(worse)[0]["accuracy"] == "IoU 0.96 in terrace"


@pytest.mark.parametrize(("error", "shown"), [(0.050004, "0.949996"), (0.05, "0.95"), (0.04996, "0.95")])
def test_a_value_is_not_rounded_across_the_target_that_it_misses(measured, error, shown) -> None:
    made = measured(Cell("a", 512, error, 5.0))
    texts = cells_of(made)[0]
    assert (texts["accuracy"] or texts["note"]) == (f"IoU {shown}" if error <= 0.05 else f"best {shown}")
    if error > 0.05:
        assert verdict(made)[1] == f"Closest: `a at 512`, IoU {shown}."


# The verdict

NONE, SHARE = "No real-time technique here", "of the shadow right"
SCALE = "For scale: ray tracing on the CPU takes"
TRACED, DRAWN = Cell("ray-traced", None, 0.0, 5.0), Cell("shadow-map", 512, 0.004, 9.0)
SHADER = Cell("ray-traced:where=gpu", None, 0.0, 2.0)
SAMPLES = Cell("light-samples", None, 0.004, 5.0, rmse_pen=0.04)
SOFT_TRACED = Cell("ray-traced:samples=64", None, 0.004, 9.0, rmse_pen=0.06)


def best(share: str, what: str, ms: str) -> str:
    return f"{share}: `{what}` is the cheapest real-time setting, {ms} ms a frame."


VERDICTS = {
    "what is cheapest and what more costs": (
        CELLS,
        [best(f"99% {SHARE}", "shadow-map at 2048", "20.0"), f"{NONE} gets 99.9% right.", f"{SCALE} 60.0 ms."],
    ),
    "ray tracing for scale only": (
        (TRACED, DRAWN),
        [best(f"99% {SHARE}", "shadow-map at 512", "9.00"), f"{NONE} gets 99.9% right.", f"{SCALE} 5.00 ms."],
    ),
    "ray tracing alone": ((TRACED,), [f"{NONE} has a score.", f"{SCALE} 5.00 ms."]),
    "a shader that traces rays is not the CPU": (
        (DRAWN, SHADER, replace(TRACED, ms=60.0)),
        [best(f"99% {SHARE}", "shadow-map at 512", "9.00"), f"{NONE} gets 99.9% right.", f"{SCALE} 60.0 ms."],
    ),
    "nor alone": (
        (DRAWN, SHADER),
        [best(f"99% {SHARE}", "shadow-map at 512", "9.00"), f"{NONE} gets 99.9% right."],
    ),
    "without times": (
        [cell for cell in UNTIMED if cell.spec == "shadow-map"],
        [f"99% {SHARE}: `shadow-map at 2048` is the smallest map that suffices.", f"{NONE} gets 99.9% right."],
    ),
    "an easier target": (
        (Cell("a", 512, 0.02, 5.0),),
        [best(f"95% {SHARE}", "a at 512", "5.00"), f"{NONE} gets 99% right."],
    ),
    "the closest": (
        (Cell("a", 512, 0.2, 5.0),),
        [f"{NONE} gets 95% {SHARE}.", "Closest: `a at 512`, IoU 0.8."],
    ),
    "the closest over scenes": (
        (Cell("a", 512, 0.04, 5.0), elsewhere(Cell("a", 512, 0.2, 5.0))),
        [f"{NONE} gets 95% {SHARE} in all 2 scenes.", "Closest: `a at 512`, in 1 of them."],
    ),
    "over scenes": (
        (A, LARGE, elsewhere(A, error=0.04), elsewhere(LARGE, ms=11.0)),
        [best(f"99% {SHARE} in all 2 scenes", "a at 1024", "10.0"), f"{NONE} gets 99.9% right in all 2 scenes."],
    ),
    "what suffices where it is supported": (
        (A, B, elsewhere(A, error=None, ms=None, status=UNSUPPORTED), elsewhere(B)),
        [
            best(f"99% {SHARE} in all 2 scenes", "b at 512", "50.0"),
            f"{NONE} gets 99.9% right in all 2 scenes.",
            "`a at 512` suffices for 5.00 ms in the 1 of 2 scenes that it supports.",
        ],
    ),
    "soft shadows by their RMSE": (
        SOFT,
        [best("RMSE ≤ 0.02", "blurred at 512", "8.00"), "RMSE ≤ 0.01 takes `sampled`, 90.0 ms (× 11.2)."],
    ),
    "the closest of soft ones": (
        SOFT[1:2],
        [f"{NONE} reaches RMSE ≤ 0.05.", "Closest: `sharp at 512`, RMSE 0.100."],
    ),
    "what recommend never chooses is not the cheapest": (
        (SAMPLES, Cell("unshadowed", None, 0.1, 1.0, rmse_pen=0.06), SOFT_TRACED),
        [f"{NONE} has a score.", f"{SCALE} 9.00 ms."],
    ),
    "what recommend may choose is": (
        (SAMPLES, Cell("shadow-map", 512, 0.004, 20.0, rmse_pen=0.06)),
        [best("RMSE ≤ 0.02", "shadow-map at 512", "20.0"), f"{NONE} reaches RMSE ≤ 0.01."],
    ),
    "no technique": ((Cell("unshadowed", None, 1.0, 1.0),), [f"{NONE} has a score."]),
    "no shadow": ((Cell("shadow-map", 512, 1.0, 5.0),), [f"{NONE} draws a shadow where one should be."]),
    "not in every phase": ((A, LOST), ["Nothing here has a score in each of its cells."]),
    "no score": ((replace(LOST, phase=0),), ["Nothing here has a score."]),
}


@pytest.mark.parametrize(("cells", "lines"), VERDICTS.values(), ids=VERDICTS)
def test_the_verdict_says(measured, cells, lines) -> None:
    assert verdict(measured(*cells)) == lines


def test_the_picture_beside_the_verdict_is_of_what_it_names(measured) -> None:
    made = measured(SAMPLES, SOFT_TRACED, Cell("shadow-map", 512, 0.2, 20.0, rmse_pen=0.4))
    assert verdict(made)[1] == "Closest: `shadow-map at 512`, RMSE 0.100."
    (panel,) = panels_of(made[0].run, 0, made)
    assert panel.start is not None and panel.start["spec"] == "shadow-map"


def test_hard_and_soft_scenes_of_a_run_have_a_verdict_each(measured) -> None:
    hard = Cell("sharp", 512, 0.004, 5.0, scene="cellar")
    sections = measured(*SOFT, *(elsewhere(cell) for cell in SOFT), hard)
    panels = panels_of(sections[0].run, 0, sections)
    assert [panel.title for panel in panels[:2]] == ["all soft scenes", "stairs, 32² view"]
    assert [panel.targets[0].metric for panel in panels] == ["rmse"] * 3 + ["iou"]
    assert [len(kind) for kind in by_kind(sections)] == [1, 2]


@pytest.mark.parametrize("kind", [CELLS, SOFT], ids=["hard", "soft"])
def test_a_scene_in_which_nothing_is_supported_leaves_the_verdict_on_the_others_as_it_is(measured, kind) -> None:
    """Also as the first of the run, by whose kind of shadows a report would go."""
    nothing = replace(kind[0], scene="attic", error=None, ms=None, status=UNSUPPORTED, rmse_pen=None)
    others = [*kind, *(elsewhere(cell) for cell in kind)]
    alone, beside = measured(*others), measured(nothing, *others)
    assert [len(found) for found in by_kind(beside)] == [len(found) for found in by_kind(alone)] == [2]
    assert verdict(by_kind(beside)[0]) == verdict(by_kind(alone)[0])
    first, second = (panels_of(found[0].run, 0, found) for found in (alone, beside))
    assert second[0].start == first[0].start and verdict(second[-1].sections) == ["Nothing here has a score."]
    assert [panel.title for panel in second] == [*(panel.title for panel in first), "attic, 32² view"]


def test_the_section_of_all_scenes_has_means_of_configurations_scored_in_all(measured) -> None:
    made = measured(A, Cell("b", 512, 0.002, 9.0), elsewhere(A, error=0.008, ms=7.0))
    section = mean_section(made, "all scenes")
    (mean,) = section.configurations
    assert mean.label == "a at 512" and mean.value("frame_ms") == 6.0
    assert mean.error is not None and mean.error.median == pytest.approx(0.006)
    assert [best.label for best in section.front] == ["a at 512"]


# By what settings are ranked: each cell has a time of its renderer, a predicted one and work, whose orders differ

PRICED = (
    Cell("shadow-volume", None, 0.0, 1.0, work=1e6, predicted=3.1),
    Cell("shadow-map", 512, 0.005, 123.0, work=9e6, predicted=0.27),
    Cell("hybrid", 512, 0.0, 50.0, work=5e6, predicted=None),
    Cell("unshadowed", None, 1.0, 0.5, work=1e5, predicted=0.0),
    Cell("ray-traced", None, 0.0, 60.0),
)
DEVICE = "times predicted for a device on record"
RANKED = {
    "a GPU by its own times": (
        {"software": False},
        [best(f"99% {SHARE}", "shadow-volume", "1.00"), "`shadow-volume` gets 99.9% right too.", f"{SCALE} 60.0 ms."],
        {"shadow-volume": ["1.00 ms"] * 3, "hybrid": ["50.0 ms"] * 3, "ray-traced": ["60.0 ms"] * 3}
        | {"shadow-map": ["123 ms"] * 2 + ["–"]},
    ),
    "without one by predicted times": (
        {},
        [
            f"99% {SHARE}: `shadow-map at 512` is the cheapest real-time setting by {DEVICE}, 0.270 ms a frame.",
            "99.9% takes `shadow-volume`, 3.10 ms (× 11.5).",
        ],
        {"shadow-map": ["0.270 ms"] * 2 + ["–"], "shadow-volume": ["3.10 ms"] * 3}
        | {"ray-traced": ["not ranked"] * 3, "hybrid": ["not ranked"] * 3},
    ),
}


@pytest.mark.parametrize(("how", "lines", "rows"), RANKED.values(), ids=RANKED)
def test_ranked_is(measured, how, lines, rows) -> None:
    made = measured(*PRICED, **how)
    assert verdict(made) == lines
    matrix = cost_matrix(candidates(made), targets_of(METRICS["iou"]))
    costs = {name: [cell_texts(cell, 1)[0] for cell in cells] for name, cells in matrix.items()}
    assert costs == rows
    assert list(costs)[:1] == list(rows)[:1], "the cheapest first"


def test_soft_shadows_without_a_gpu_are_ranked_by_the_work_that_is_counted(measured) -> None:
    """A law gives no times under lights with a size; rays, and what counts do not see, are not ranked."""
    soft = [
        Cell("shadow-map:filter=pcss", 512, 0.1, 3.0, work=2.5e6, rmse_pen=0.06),
        Cell("shadow-map:filter=evsm", 512, 0.1, 90.0, work=1.25e6, rmse_pen=0.06),
    ]
    made = measured(*soft)
    by_work = "`shadow-map:filter=evsm at 512` is the cheapest real-time setting by work, 1.25 M a frame"
    assert verdict(made)[0] == f"RMSE ≤ 0.02: {by_work}."
    assert cost_note(made) == ("Cost: work. Millions (M) of shader invocations and texture reads, which is not time.")
    assert device_note(made[0]).startswith("No device's times are predicted for lights with a size")
    assert "--device" not in device_note(made[0]), "which refuses such lights"


def test_every_cost_of_a_panel_is_in_one_currency(measured) -> None:
    (made,) = measured(*PRICED)
    (panel,) = panels_of(made.run, 0, [made])
    data = panel_data(panel, lambda _, value: value)
    assert data["columns"][0] == "predicted ms" and not {"cost, ms", "IQR, ms", "× reference"} & {*data["columns"]}
    assert data["charts"]["passes"] == [], "times of the renderer that drew"
    shown = {(row["spec"], row["map"]): row["values"]["predicted ms"][1] for row in data["rows"]}
    assert shown["shadow-map", 512] == "0.270" and shown["hybrid", 512] == "–" and shown["unshadowed", None] == "0"
    points = data["charts"]["front"]["data"]["values"]
    assert {(point["spec"], point["cost"]) for point in points} == {("shadow-map", 0.27), ("shadow-volume", 3.1)}
    assert [one.spec for one in made.front] == ["shadow-map", "shadow-volume"]
    page = html_report([made.run], {made.title: [made]}, [], lambda _, value: value)
    words = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    for text in (words, json.dumps(data), markdown_report([made.run], {made.title: [made]}, [])):
        for ms in ("123", "50.0", "60.0"):
            assert f"{ms} ms" not in text and f"| {ms} |" not in text
    assert "a device on record from counted work; below 0.1 ms they are not told apart" in words


def test_short_predicted_times_are_not_told_apart_and_less_work_comes_first(measured) -> None:
    cells = [Cell("a", size, 0.001 * size / 512, 1.0, work=1e6, predicted=0.1) for size in (512, 1024)]
    line = verdict(measured(*cells, Cell("b", 512, 0.0005, 1.0, work=2e6, predicted=0.1)))[0]
    assert (
        "`a at 512` is the cheapest" in line
        and line.endswith("<0.1 ms a frame; as cheap: `b at 512`.")
        and "within the noise" not in line
    )


@pytest.mark.parametrize(
    ("spec", "named"),
    [("shadow-map:preset=three", "three"), ("cascades:preset=unity", "unity"), ("three", None), ("shadow-map", None)],
)
def test_a_preset_named_after_an_engine_is_not_said_to_be_its_picture(spec, named) -> None:
    text = parse_spec(spec, techniques() | engines()).sizeless_text
    one = Configuration(spec.partition(":")[0], text, text, 512, 1, (), {}, 1)
    note = preset_note([one])
    assert (note is not None) == (named is not None)
    assert note is None or (f"({named})" in note and ("results/published/engines" in note) == (named == "three"))
    assert preset_note([replace(one, cells=0)]) is None, "nothing was drawn"


def test_every_preset_of_an_engine_is_known_as_one() -> None:
    """Their parameters are declared beside where they come from."""
    declared = {name.lower() for name, value in vars(presets).items() if name.isupper() and isinstance(value, str)}
    named = {name for one in own_techniques() for name in one.presets}
    assert (
        set(presets.ENGINES) == declared & named == named - {"course", "constant", "webgl", "offset", "dither", "fixed"}
    )
