"""The cost matrix and the verdict of rows with a known answer, and notes on how they were measured."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from shadowbench.plugin.registry import engines, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.reports.gallery import scored_cells
from shadowbench.reports.report import html_report, markdown_report, panels_of
from shadowbench.reports.texts import (
    accuracy_text,
    answer_texts,
    cost_note,
    digits,
    error_text,
    mask_warnings,
    notes_of,
    run_facts,
    time_source,
    unscored,
    value_text,
    verdict,
    verdict_setting,
)
from shadowbench.results.frame import read_runs
from shadowbench.results.summary import Summary, Target, by_kind, over_scenes, summaries, targets_of
from shadowbench.scores.metrics import METRICS
from tests.reports.conftest import CELLS, TRUTH_ERROR, Cell, parts_of

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


def whole(scenes: list[Summary]) -> Summary:
    """The summary over all scenes."""
    return over_scenes(scenes, "all scenes")


def matrix(summary: Summary, metric: str = "iou") -> dict[str, list[str]]:
    """The texts of the cost matrix's cells, by technique."""
    rows = summary.matrix(targets_of(METRICS[metric]))
    return {name: [" ".join(filter(None, answer_texts(summary, one))) for one in row] for name, row in rows.items()}


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
    "what is timed in some scenes has no cost": (
        (A, replace(LARGE, ms=90.0), elsewhere(A, ms=None), elsewhere(LARGE, ms=90.0)),
        {"a": ["90.0 ms a at 1024"] * 2 + ["– at best in 0 of 2 scenes"]},
    ),
    "what failed in a phase meets no target": ((A, LOST), {}),
}


def test_the_cost_matrix_has_the_cheapest_of_each_technique_for_each_target(measured) -> None:
    for what, (cells, rows) in MATRICES.items():
        texts = matrix(whole(measured(*cells)))
        assert texts == rows and list(texts) == list(rows), what


def test_edges_are_a_target_too_and_a_value_equal_to_the_limit_meets_it(measured) -> None:
    (scene,) = measured(Cell("a", 512, 0.3, 5.0, edge=0.6), Cell("a", 1024, 0.25, 8.0, edge=0.5))
    assert matrix(scene, "edge_px") == {"a": ["5.00 ms a at 512", "8.00 ms a at 1024", "– best 0.500 px"]}
    (exact,) = [one for one in scene.timed if one.map_size == 1024]
    assert [scene.meets(exact, Target("iou", limit)) for limit in (0.75, 0.76)] == [True, False]


@pytest.mark.parametrize(("ms", "spread", "same"), [(5.1, 0.02, True), (5.3, 0.02, False), (5.3, 0.05, True)])
def test_ties_within_the_noise_of_times_are_named(measured, ms, spread, same) -> None:
    """The interquartile ranges, 10 ms · spread wide, overlap."""
    made = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=spread), Cell("b", 512, 0.004, ms, ratio_iqr=spread))
    (answer,) = made[0].answers(made[0].candidates, [Target("iou", 0.99)])
    assert answer.cheapest.spec == "a" and [one.spec for one in answer.ties] == (["b"] if same else [])
    assert ("; as cheap within the noise: `b at 512`." in verdict(made[0])[0]) == same


def test_costs_are_explained(measured) -> None:
    (untimed,) = measured(*UNTIMED)
    assert cost_note(untimed) == "Nothing here was timed: the cost is the size of the smallest map that suffices."
    (some,) = measured(Cell("a", 512, 0.004, None), Cell("b", None, 0.004, 5.0))
    assert cost_note(some).endswith(" What is not ranked lacks times.")
    (rough,) = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=0.4))
    assert "~5.00 ms a frame" in verdict(rough)[0] and cost_note(rough) == (
        "Cost: frame time of shadows. Times of a software renderer: for trends only, not representative of a GPU. "
        "~ marks a rough time."
    )


def test_a_target_is_met_by_the_median_that_is_shown_with_its_range(measured) -> None:
    """Phase 0, of which the picture is, misses the target that the median meets; then the other way round."""
    (meets,), (misses,) = (measured(*phases(*errors)) for errors in ((0.06, 0.04, 0.02), (0.04, 0.08)))
    met, missed = (scene.answers(scene.candidates, scene.targets[:1])[0] for scene in (meets, misses))
    assert answer_texts(meets, met)[0] == "5.00 ms" and accuracy_text(meets, met) == "IoU 0.96 (0.94–0.98)"
    assert answer_texts(misses, missed) == ("–", "", "best 0.94 (0.92–0.96)") and not accuracy_text(misses, missed)
    ((_, picture),) = scored_cells(meets)
    assert picture["score"] == "median IoU 0.96 (0.94–0.98)"
    assert picture["caption"] == (
        "median IoU 0.96 (0.94–0.98) of 3, 5.00 ms (software renderer); picture: phase 0, IoU 0.94000, edge 6.00 px"
    )
    ((_, picture),) = scored_cells(measured(*phases(0.04))[0])
    assert picture["caption"] == "IoU 0.96000, edge 4.00 px, 5.00 ms (software renderer)"
    both = whole(measured(*phases(0.02, 0.04), *phases(0.01, 0.03, 0.04, scene="terrace")))
    (over,) = both.answers(both.candidates, both.targets[:1])
    assert accuracy_text(both, over) == "IoU 0.97 (0.96–0.98) in stairs", "the worst of the medians"


@pytest.mark.parametrize(("error", "shown"), [(0.050004, "0.949996"), (0.05, "0.95"), (0.04996, "0.95")])
def test_a_value_is_not_rounded_across_the_target_that_it_misses(measured, error, shown) -> None:
    (scene,) = measured(Cell("a", 512, error, 5.0))
    (answer,) = scene.answers(scene.candidates, scene.targets[:1])
    text = accuracy_text(scene, answer) or answer_texts(scene, answer)[2]
    assert text == (f"IoU {shown}" if error <= 0.05 else f"best {shown}")


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
    "ray tracing alone": ((TRACED,), [f"{NONE} has a score.", f"{SCALE} 5.00 ms."]),
    "a shader that traces rays is not the CPU": (
        (DRAWN, SHADER, replace(TRACED, ms=60.0)),
        [best(f"99% {SHARE}", "shadow-map at 512", "9.00"), f"{NONE} gets 99.9% right.", f"{SCALE} 60.0 ms."],
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
    "no shadow": ((Cell("shadow-map", 512, 1.0, 5.0),), [f"{NONE} draws a shadow where one should be."]),
    "not in every phase": ((A, LOST), ["Nothing here has a score in each of its cells."]),
    "no score": ((replace(LOST, phase=0),), ["Nothing here has a score."]),
}


def test_the_verdict_says_what_is_cheapest_and_what_more_costs(measured) -> None:
    for what, (cells, lines) in VERDICTS.items():
        assert verdict(whole(measured(*cells))) == lines, what


def test_the_picture_beside_the_verdict_is_of_what_it_names(measured) -> None:
    (scene,) = measured(SAMPLES, SOFT_TRACED, Cell("shadow-map", 512, 0.2, 20.0, rmse_pen=0.4))
    assert verdict(scene)[1] == "Closest: `shadow-map at 512`, RMSE 0.100."
    assert verdict_setting(scene).spec == "shadow-map"


def test_hard_and_soft_scenes_of_a_run_have_a_verdict_each(measured) -> None:
    hard = Cell("sharp", 512, 0.004, 5.0, scene="cellar")
    nothing = Cell("sharp", 512, None, None, scene="attic", status=UNSUPPORTED)
    scenes = measured(nothing, *SOFT, *(elsewhere(cell) for cell in SOFT), hard)
    panels = panels_of(scenes)
    assert [panel.title for panel in panels[:2]] == ["all soft scenes", "stairs, 32² view"]
    assert [panel.soft for panel in panels] == [True, True, True, False, False]
    assert verdict(panels[-1]) == ["Nothing here has a score."], "last"
    assert [len(kind) for kind in by_kind(scenes)] == [1, 2]


# By what settings are ranked: each cell has a time of its renderer, a predicted one and work, whose orders differ

PRICED = (
    Cell("shadow-volume", None, 0.0, 1.0, work=1e6, predicted=3.1),
    Cell("shadow-map", 512, 0.005, 123.0, work=9e6, predicted=0.27),
    Cell("hybrid", 512, 0.0, 50.0, work=5e6, predicted=None),
    Cell("unshadowed", None, 1.0, 0.5, work=1e5, predicted=0.0),
    Cell("ray-traced", None, 0.0, 60.0),
)


def test_a_gpu_is_ranked_by_its_own_times_and_other_renderers_by_predicted_ones(measured) -> None:
    (gpu,), (software,) = measured(*PRICED, software=False), measured(*PRICED)
    assert verdict(gpu)[0] == best(f"99% {SHARE}", "shadow-volume", "1.00")
    assert matrix(gpu)["shadow-map"][0] == "123 ms shadow-map at 512"
    assert verdict(software) == [
        f"99% {SHARE}: `shadow-map at 512` is the cheapest real-time setting by times predicted for a device on "
        "record, 0.270 ms a frame.",
        "99.9% takes `shadow-volume`, 3.10 ms (× 11.5).",
    ]
    assert matrix(software)["hybrid"] == ["not ranked hybrid at 512"] * 3
    assert [one.spec for one in software.lines if one.front] == ["shadow-volume", "shadow-map"]


def test_every_cost_of_a_page_is_in_one_currency(measured) -> None:
    (scene,) = measured(*PRICED)
    page = html_report([(scene.run, [scene])], [])
    (data,) = parts_of(page)
    assert data["columns"][0] == "predicted ms" and not {"cost, ms", "IQR, ms", "× reference"} & {*data["columns"]}
    assert data["charts"]["passes"] is None, "times of the renderer that drew"
    shown = {(row["spec"], row["map"]): row["values"]["predicted ms"][1] for row in data["rows"]}
    assert shown["shadow-map", 512] == "0.270" and shown["hybrid", 512] == "–" and shown["unshadowed", None] == "0"
    for text in (json.dumps(data), markdown_report([(scene.run, [scene])], [])):
        assert not any(f"{ms} ms" in text or f"| {ms} |" in text for ms in ("123", "50.0", "60.0"))


def test_soft_shadows_without_a_gpu_are_ranked_by_the_work_that_is_counted(measured) -> None:
    """A law gives no times under lights with a size; rays, and what counts do not see, are not ranked."""
    soft = [
        Cell("shadow-map:filter=pcss", 512, 0.1, 3.0, work=2.5e6, rmse_pen=0.06),
        Cell("shadow-map:filter=evsm", 512, 0.1, 90.0, work=1.25e6, rmse_pen=0.06),
    ]
    (scene,) = measured(*soft)
    by_work = "`shadow-map:filter=evsm at 512` is the cheapest real-time setting by work, 1.25 M a frame"
    assert verdict(scene)[0] == f"RMSE ≤ 0.02: {by_work}."
    assert cost_note(scene) == "Cost: work. Millions (M) of shader invocations and texture reads, which is not time."


def test_short_predicted_times_are_not_told_apart_and_less_work_comes_first(measured) -> None:
    cells = [Cell("a", size, 0.001 * size / 512, 1.0, work=1e6, predicted=0.1) for size in (512, 1024)]
    line = verdict(measured(*cells, Cell("b", 512, 0.0005, 1.0, work=2e6, predicted=0.1))[0])[0]
    assert "`a at 512` is the cheapest" in line and line.endswith("<0.1 ms a frame; as cheap: `b at 512`.")


# Notes


def test_what_has_no_score_is_listed_with_its_sizes_phases_and_reason(measured) -> None:
    dark = [Cell("a", size, None, None, status="unsupported: no ground") for size in (1024, 512)]
    late = [Cell("b", 512, 0.1, 3.0), Cell("b", 512, None, None, phase=1, status="failed: too slow")]
    (scene,) = measured(*CELLS, Cell("void", 512, None, 3.0), *dark, *late)
    assert sorted(unscored(scene)) == [
        ("a at 512, 1024", "unsupported: no ground"),
        ("b at 512", "1 of 2 cells failed: too slow"),
        ("cube-map at 512", "failed: the worker died"),
        ("planar-projection", "unsupported: no receiver is a plane"),
        ("void at 512", "no IoU: neither the truth nor the mask has a shadow"),
    ]


def test_warnings_about_external_masks_are_reported(run_folder) -> None:
    folder = run_folder()
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    rows[0]["input"] = {"warnings": ["seems shifted by 1 px up; scored as it is"]}
    (folder / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (scene,) = summaries(read_runs([folder])[0])
    assert mask_warnings(scene) == [f"{rows[0]['spec']}: seems shifted by 1 px up; scored as it is"]


def test_a_scene_says_what_its_times_are_by_and_which_are_rough(measured) -> None:
    (scene,) = measured(
        Cell("slow", 512, 0.009, 18.0, ratio_iqr=0.9),
        Cell("fast", 512, 0.005, 16.0, reference_ms=20.0),  # while the machine took twice as long for everything
        Cell("shadow-map", 1024, 0.02, 10.0),
    )
    notes = notes_of(scene)
    assert "ms: time relative to shadow-map:size=1024" in notes[1] and "15 ms, its median over 2" in notes[1]
    assert "load of the machine varied" in notes[2] and notes[3].startswith("~: ")
    assert [one.label for one in scene.lines if one.front] == ["fast at 512"] and "12.0 ms a frame" in verdict(scene)[0]
    assert {one.spec: [ms for _, ms, _ in scene.passes(one)] for one in scene.timed} == {
        "slow": pytest.approx([1.5, 3.0]),
        "fast": pytest.approx([0.75, 1.5]),
        "shadow-map": pytest.approx([1.5, 3.0]),
    }
    (slow,) = [one for one in scene.timed if one.spec == "slow"]
    assert [value_text(slow, name)[0] == "~" for name in ("frame_ms", "ratio", "ssim")] == [True, False, False]
    assert time_source(measured(Cell("a", 512, 0.1, None))[0].run) == "nothing was timed"


def test_maps_scored_in_one_phase_have_a_note(measured) -> None:
    alone, again = [Cell("a", size, 0.1, None) for size in (512, 1024)], Cell("a", 512, 0.2, None, phase=1)
    one, some, two = (notes_of(measured(*cells)[0]) for cells in (alone, [*alone, again], [alone[0], again]))
    assert one[-1].startswith("scored in one phase")
    assert some[-1].startswith("maps without an interval: scored in one phase")
    assert two[0] == "medians over up to 2 cells (views × phases) a configuration" and len(two) == 2
    other = [Cell(spec, 512, 0.1, None) for spec in ("a", "b")]
    facts = [dict(run_facts(measured(*cells)[0].run))["phases"] for cells in (other, [*phases(0.1, 0.2), *other])]
    assert facts == ["1", "1, 2"]


def test_a_score_below_the_error_of_the_truth_is_no_number_and_a_width_has_a_direction(measured) -> None:
    (scene,) = measured(*SOFT)
    (one,) = [one for one in scene.shown if one.spec == "sampled"]
    assert error_text(scene, one) == "<0.00200" and value_text(one, "rmse_pen") == "<0.00800"
    widths = [(1.0, 0.9), (1.0, -0.9), (1.0, 0.2), (1.0, float("nan"))]
    texts = [
        value_text(SimpleNamespace(**vars(one) | {"width": width, "width_bias": bias}), "width", "{:g}".format)
        for width, bias in widths
    ]
    assert texts == ["1 wide", "1 narrow", "1", "1"]


def test_numbers_have_three_digits_and_only_1_is_1() -> None:
    numbers = (0.99996, 1.0, 12345.6, 0.0123456, 1e-5, 0.0)
    assert list(map(digits, numbers)) == ["0.99996", "1.00", "12300", "0.0123", "1e-05", "0"]


def test_a_preset_named_after_an_engine_is_not_said_to_be_its_picture(measured) -> None:
    for spec, named in (("shadow-map:preset=three", "(three)"), ("cascades:preset=unity", "(unity)"), ("three", None)):
        text = parse_spec(spec, techniques() | engines()).sizeless_text
        notes = [note for note in notes_of(measured(Cell(text, 512, 0.1, 3.0))[0]) if "draw its parameters in" in note]
        assert [named in note for note in notes] == [True] * (named is not None)
