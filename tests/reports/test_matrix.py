"""The cost matrix and the verdict, for rows with a known answer."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.reports.gallery import scored_cells
from shadowbench.reports.panels import panels_of
from shadowbench.reports.verdict import cell_texts, cost_note, verdict
from shadowbench.reports.words import faults_of, run_facts
from shadowbench.results.configurations import Interval, Section, by_kind, sections
from shadowbench.results.folder import read_runs
from shadowbench.results.ranking import (
    Target,
    candidates,
    cheapest,
    cost_matrix,
    mean_section,
    targets_of,
    ties,
)
from shadowbench.scores.metrics import METRICS
from tests.reports.conftest import CELLS, TRUTH_ERROR, Cell

Make = Callable[..., list[Section]]
UNSUPPORTED = "unsupported: a lamp shines all round"


@pytest.fixture
def measured(run_folder: Callable[..., Path]) -> Make:
    """The sections of a run with these cells, one per scene."""

    def make(*cells: Cell, **options: object) -> list[Section]:
        return [section for parts in sections(read_runs([run_folder(cells, **options)])).values() for section in parts]

    return make


def shown(made: Sequence[Section], metric: str = "iou") -> dict[str, list[str]]:
    """The texts of the cost matrix's cells, by technique."""
    lines = cost_matrix(candidates(made), targets_of(METRICS[metric]))
    return {
        name: [" ".join(filter(None, cell_texts(cell, len(made)))) for cell in cells] for name, cells in lines.items()
    }


def elsewhere(cell: Cell, **changes: Any) -> Cell:
    """A cell in another scene."""
    return replace(cell, **({"scene": "terrace"} | changes))


# One scene


def test_a_cell_is_the_cheapest_of_its_technique_that_reaches_the_target(measured: Make) -> None:
    assert shown(measured(*CELLS)) == {
        "shadow-map": ["5.00 ms shadow-map at 512", "20.0 ms shadow-map at 2048", "– best 0.995"],
        "ray-traced": ["60.0 ms ray-traced"] * 3,
    }, "unshadowed is no answer, and what has no score takes no part"


def test_edges_are_a_target_too(measured: Make) -> None:
    cells = Cell("a", 512, 0.3, 5.0, edge=0.6), Cell("a", 1024, 0.2, 8.0, edge=0.5)
    assert shown(measured(*cells), "edge_px") == {"a": ["5.00 ms a at 512", "8.00 ms a at 1024", "– best 0.500 px"]}


def test_of_two_configurations_with_equal_cost_the_more_accurate_one_is_named(measured: Make) -> None:
    cells = Cell("a", 512, 0.004, 5.0), Cell("a:bias=none", 512, 0.003, 5.0), Cell("a:fit=view", 512, 0.005, 5.0)
    assert shown(measured(*cells))["a"][1] == "5.00 ms a:bias=none at 512"


@pytest.mark.parametrize(("ms", "spread", "same"), [(5.1, 0.02, True), (5.3, 0.02, False), (5.3, 0.05, True)])
def test_ties_within_the_noise_of_times_are_named(measured: Make, ms: float, spread: float, same: bool) -> None:
    """The interquartile ranges, 10 ms · spread wide, overlap."""
    made = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=spread), Cell("b", 512, 0.004, ms, ratio_iqr=spread))
    found = candidates(made)
    best = cheapest(found, Target("iou", 0.99))
    assert best is not None and best.mean.spec == "a"
    assert [one.mean.spec for one in ties(found, best, Target("iou", 0.99))] == (["b"] if same else [])
    assert ("; as cheap within the noise: `b at 512`" in verdict(made)[0]) == same


def test_techniques_are_ordered_by_cost_at_the_middle_target(measured: Make) -> None:
    cells = Cell("a", 512, 0.02, 1.0), Cell("b", 512, 0.005, 9.0), Cell("c", 512, 0.005, 8.0), Cell("d", 512, 0.2, 1.0)
    assert list(shown(measured(*cells))) == ["c", "b", "a", "d"]


def test_without_times_the_smallest_sufficient_map_is_named(measured: Make) -> None:
    cells = [replace(cell, ms=None) for cell in CELLS]
    made = measured(*cells)
    assert shown(made)["shadow-map"] == ["map 512 shadow-map at 512", "map 2048 shadow-map at 2048", "– best 0.995"]
    assert shown(made)["ray-traced"][2] == "no map ray-traced"
    assert cost_note(made) == "Nothing here was timed: the cost is the size of the smallest map that suffices."
    alone = measured(*(cell for cell in cells if cell.spec == "shadow-map"), name="alone")
    assert verdict(alone) == [
        "99% of the shadow right: `shadow-map at 2048` is the smallest map that suffices.",
        "No real-time technique here gets 99.9% right.",
    ]


# Several phases: their median is what counts, and what is shown


def phases(*errors: float, **changes: Any) -> list[Cell]:
    """A shadow map's cells in several phases, of which the first is timed."""
    return [
        Cell("shadow-map", 512, error, None if phase else 5.0, phase=phase, **changes)
        for phase, error in enumerate(errors)
    ]


def cells_of(made: Sequence[Section], panel: int = 0) -> list[dict[str, Any]]:
    """The cells of the only row of a panel's matrix."""
    ((_, cells),) = panels_of(made[0].run, 0, made)[panel].matrix
    return cells


def test_a_target_is_met_by_the_median_that_is_shown_with_its_range(measured: Make) -> None:
    """Phase 0, of which the picture is, misses the target that the median meets; then the other way round."""
    (meets,), (misses,) = measured(*phases(0.06, 0.04, 0.02), name="meets"), measured(*phases(0.04, 0.08))
    met, missed = cells_of([meets])[0], cells_of([misses])[0]
    assert (met["cost"], met["accuracy"]) == ("5.00 ms", "IoU 0.96 (0.94–0.98)")
    assert (missed["cost"], missed["accuracy"], missed["label"]) == ("–", "", "best 0.94 (0.92–0.96)")
    (picture,) = scored_cells(meets)
    assert picture.score == "median IoU 0.96 (0.94–0.98)" and picture.error == pytest.approx(0.04)
    assert picture.own == "picture: phase 0, IoU 0.94000"
    assert picture.caption == (
        "median IoU 0.96 (0.94–0.98) of 3, 5.00 ms (software renderer); picture: phase 0, IoU 0.94000, edge 6.00 px"
    )


def test_a_single_cell_is_its_own_median(measured: Make) -> None:
    (section,) = measured(*phases(0.04))
    assert cells_of([section])[0]["accuracy"] == "IoU 0.96"
    (picture,) = scored_cells(section)
    assert (picture.own, picture.score) == ("", "IoU 0.96000")
    assert picture.caption == "IoU 0.96000, edge 4.00 px, 5.00 ms (software renderer)"


def test_over_scenes_a_cell_shows_the_worst_of_the_medians(measured: Make) -> None:
    made = measured(*phases(0.02, 0.04), *phases(0.01, 0.03, 0.04, scene="terrace"))
    assert cells_of(made)[0]["accuracy"] == "IoU 0.97 (0.96–0.98) in stairs"  # 0.97 in both: the first
    worse = measured(*phases(0.02), *phases(0.04, scene="terrace"), name="worse")
    assert cells_of(worse)[0]["accuracy"] == "IoU 0.96 in terrace"


@pytest.mark.parametrize(("error", "shown"), [(0.050004, "0.949996"), (0.05, "0.95"), (0.04996, "0.95")])
def test_a_value_is_not_rounded_across_the_target_that_it_misses(measured: Make, error: float, shown: str) -> None:
    made = measured(Cell("a", 512, error, 5.0))
    texts = cells_of(made)[0]
    assert (texts["accuracy"] or texts["label"]) == (f"IoU {shown}" if error <= 0.05 else f"best {shown}")
    if error > 0.05:
        assert verdict(made)[1] == f"Closest: `a at 512`, IoU {shown}."


def test_the_facts_of_a_run_say_in_how_many_phases_each_was_scored(measured: Make) -> None:
    def told(*cells: Cell, name: str) -> str:
        return dict(run_facts(measured(*cells, name=name)[0].run))["phases"]

    other = [Cell(spec, 512, 0.1, None) for spec in ("a", "b")]
    assert told(*other, name="one") == "1"
    assert told(*phases(0.1, 0.2, 0.3), *other, name="some") == "3 of shadow-map; 1 of all others"


# Several scenes


def test_over_scenes_one_setting_must_reach_it_in_each_and_costs_their_mean(measured: Make) -> None:
    small, large = Cell("a", 512, 0.004, 5.0), Cell("a", 1024, 0.002, 9.0)
    made = measured(small, large, elsewhere(small, error=0.04), elsewhere(large, ms=11.0))
    assert shown(made) == {"a": ["5.00 ms a at 512", "10.0 ms a at 1024", "– at best in 0 of 2 scenes"]}
    assert verdict(made)[0].endswith("in all 2 scenes: `a at 1024` is the cheapest real-time setting, 10.0 ms a frame.")
    (small_one,) = [one for one in candidates(made) if one.mean.map_size == 512]
    assert small_one.worst_scene.startswith("terrace")


def test_configurations_that_support_some_scenes_count_only_if_none_supports_all(measured: Make) -> None:
    sun, lamp = Cell("a", 512, 0.004, 5.0), Cell("b", 512, 0.004, 50.0)
    made = measured(sun, lamp, elsewhere(sun, error=None, ms=None, status=UNSUPPORTED), elsewhere(lamp))
    assert shown(made)["a"][1] == "5.00 ms a at 512 supports 1 of 2 scenes"
    assert shown(made)["b"][1] == "50.0 ms b at 512"
    assert list(shown(made)) == ["b", "a"], "what answers everywhere stands first"
    assert verdict(made) == [
        "99% of the shadow right in all 2 scenes: `b at 512` is the cheapest real-time setting, 50.0 ms a frame.",
        "No real-time technique here gets 99.9% right in all 2 scenes.",
        "`a at 512` suffices for 5.00 ms in the 1 of 2 scenes that it supports.",
    ]


@pytest.mark.parametrize("status", ["failed: the worker died", None])
def test_a_configuration_that_failed_or_is_missing_in_a_scene_meets_no_target(
    measured: Make, status: str | None
) -> None:
    one, other = Cell("a", 512, 0.004, 5.0), Cell("b", 512, 0.004, 50.0)
    lost = [] if status is None else [elsewhere(one, error=None, ms=None, status=status)]
    made = measured(one, other, elsewhere(other), *lost)
    assert shown(made)["a"] == [f"– at best in {count} of 2 scenes" for count in (1, 1, 0)]
    assert verdict(made)[0].endswith("`b at 512` is the cheapest real-time setting, 50.0 ms a frame.")


def test_a_configuration_that_failed_in_one_phase_meets_no_target(measured: Make) -> None:
    cells = Cell("a", 512, 0.004, 5.0), Cell("a", 512, None, None, phase=1, status="failed: too slow")
    assert candidates(measured(*cells)) == []


def test_configurations_timed_in_only_some_scenes_have_no_cost_and_come_last(measured: Make) -> None:
    one, other = Cell("a", 512, 0.004, 5.0), Cell("a", 1024, 0.002, 90.0)
    made = measured(one, other, elsewhere(one, ms=None), elsewhere(other))
    assert shown(made)["a"][1] == "90.0 ms a at 1024"


def test_the_section_of_all_scenes_has_means_of_configurations_scored_in_all(measured: Make) -> None:
    one, other = Cell("a", 512, 0.004, 5.0), Cell("b", 512, 0.002, 9.0)
    made = measured(one, other, elsewhere(one, error=0.008, ms=7.0))
    section = mean_section(made, "all scenes")
    (mean,) = section.configurations
    assert mean.label == "a at 512" and mean.value("frame_ms") == 6.0
    assert mean.error is not None and mean.error.median == pytest.approx(0.006)
    assert [best.label for best in section.front] == ["a at 512"]


# Soft shadows: the one with the lower IoU has the lower RMSE

SOFT = (
    Cell("unshadowed", None, 1.0, 1.0, rmse_pen=2.0),
    Cell("sharp", 512, 0.001, 5.0, rmse_pen=0.4),
    Cell("blurred", 512, 0.3, 8.0, rmse_pen=0.06),
    Cell("sampled", None, 0.1, 90.0, rmse_pen=2 * TRUTH_ERROR),
)


def test_soft_shadows_are_judged_by_their_rmse(measured: Make) -> None:
    made = measured(*SOFT)
    assert verdict(made) == [
        "RMSE ≤ 0.02: `blurred at 512` is the cheapest real-time setting, 8.00 ms a frame.",
        "RMSE ≤ 0.01 takes `sampled`, 90.0 ms (× 11.2).",
    ]
    assert shown(made, "rmse") == {
        "blurred": ["8.00 ms blurred at 512", "8.00 ms blurred at 512", "– best 0.0150"],
        "sampled": ["90.0 ms sampled"] * 3,
        "sharp": ["– best 0.100"] * 3,
    }
    assert [one.label for one in made[0].front] == ["unshadowed", "sharp at 512", "blurred at 512", "sampled"]
    assert verdict(measured(SOFT[1], name="hard")) == [
        "No real-time technique here reaches RMSE ≤ 0.05.",
        "Closest: `sharp at 512`, RMSE 0.100.",
    ]


def test_hard_and_soft_scenes_of_a_run_have_a_verdict_each(measured: Make) -> None:
    hard = Cell("sharp", 512, 0.004, 5.0, scene="cellar")
    sections = measured(*SOFT, *(elsewhere(cell) for cell in SOFT), hard)
    panels = panels_of(sections[0].run, 0, sections)
    assert [panel.title for panel in panels[:2]] == ["all soft scenes", "stairs, 32² view"]
    assert [panel.targets[0] for panel in panels] == ["RMSE ≤ 0.05"] * 3 + ["IoU ≥ 0.95"]
    assert [len(kind) for kind in by_kind(sections)] == [1, 2]


@pytest.mark.parametrize("kind", [CELLS, SOFT], ids=["hard", "soft"])
def test_a_scene_in_which_nothing_is_supported_leaves_the_verdict_on_the_others_as_it_is(
    measured: Make, kind: Sequence[Cell]
) -> None:
    """Also as the first of the run, by whose kind of shadows a report would go."""
    nothing = replace(kind[0], scene="attic", error=None, ms=None, status=UNSUPPORTED, rmse_pen=None)
    others = [*kind, *(elsewhere(cell) for cell in kind)]
    alone, beside = measured(*others, name="alone"), measured(nothing, *others, name="beside")
    assert [len(found) for found in by_kind(beside)] == [len(found) for found in by_kind(alone)] == [2]
    assert verdict(by_kind(beside)[0]) == verdict(by_kind(alone)[0])
    panels = [panels_of(found[0].run, 0, found) for found in (alone, beside)]
    assert panels[1][0].verdict == panels[0][0].verdict and panels[1][0].start == panels[0][0].start
    assert [panel.title for panel in panels[1]] == [*(panel.title for panel in panels[0]), "attic, 32² view"]
    assert panels[1][-1].unscored and panels[1][-1].verdict == ["Nothing here has a score."]


# The verdict


def test_a_verdict_says_what_is_cheapest_and_what_more_costs(measured: Make) -> None:
    assert verdict(measured(*CELLS)) == [
        "99% of the shadow right: `shadow-map at 2048` is the cheapest real-time setting, 20.0 ms a frame.",
        "No real-time technique here gets 99.9% right.",
        "For scale: ray tracing on the CPU takes 60.0 ms.",
    ]


def test_ray_tracing_is_named_for_scale_only(measured: Make) -> None:
    traced, drawn = Cell("ray-traced", None, 0.0, 5.0), Cell("shadow-map", 512, 0.004, 9.0)
    assert verdict(measured(traced, drawn)) == [
        "99% of the shadow right: `shadow-map at 512` is the cheapest real-time setting, 9.00 ms a frame.",
        "No real-time technique here gets 99.9% right.",
        "For scale: ray tracing on the CPU takes 5.00 ms.",
    ]
    assert verdict(measured(traced, name="alone")) == [
        "No real-time technique here has a score.",
        "For scale: ray tracing on the CPU takes 5.00 ms.",
    ]


def test_what_recommend_never_chooses_is_not_called_the_cheapest(measured: Make) -> None:
    yardstick, bare = (
        Cell("light-samples", None, 0.004, 5.0, rmse_pen=0.04),
        Cell("unshadowed", None, 0.1, 1.0, rmse_pen=0.06),
    )
    traced = Cell("ray-traced:samples=64", None, 0.004, 9.0, rmse_pen=0.06)
    made = measured(yardstick, bare, traced)
    (line, _) = verdict(made)
    assert line == "No real-time technique here has a score."
    blurred = measured(yardstick, traced, Cell("shadow-map", 512, 0.2, 20.0, rmse_pen=0.4), name="blurred")
    assert verdict(blurred)[:2] == [
        "No real-time technique here reaches RMSE ≤ 0.05.",
        "Closest: `shadow-map at 512`, RMSE 0.100.",
    ]
    (panel,) = panels_of(blurred[0].run, 0, blurred)
    assert panel.start is not None and panel.start["spec"] == "shadow-map", "whose picture stands beside the sentence"
    with_a_map = measured(yardstick, bare, Cell("shadow-map", 512, 0.004, 20.0, rmse_pen=0.06), name="with-a-map")
    assert (
        verdict(with_a_map)[0] == "RMSE ≤ 0.02: `shadow-map at 512` is the cheapest real-time setting, 20.0 ms a frame."
    )


@pytest.mark.parametrize(
    ("cells", "line"),
    [
        ([Cell("unshadowed", None, 1.0, 1.0)], "No real-time technique here has a score."),
        ([Cell("shadow-map", 512, 1.0, 5.0)], "No real-time technique here draws a shadow where one should be."),
        (
            [Cell("a", 512, 0.004, 5.0), Cell("a", 512, None, None, phase=1, status="failed: died")],
            "Nothing here has a score in each of its cells.",
        ),
    ],
    ids=["no technique", "no shadow", "not in every phase"],
)
def test_what_has_a_row_in_the_table_is_not_said_to_have_no_score(
    measured: Make, cells: Sequence[Cell], line: str
) -> None:
    assert verdict(measured(*cells)) == [line]


def test_a_shader_that_traces_rays_is_no_ray_tracing_on_the_cpu(measured: Make) -> None:
    drawn, shader = Cell("shadow-map", 512, 0.004, 9.0), Cell("ray-traced:where=gpu", None, 0.0, 2.0)
    assert not any("CPU" in line for line in verdict(measured(drawn, shader)))
    both = measured(drawn, shader, Cell("ray-traced", None, 0.0, 60.0), name="both")
    assert verdict(both)[-1] == "For scale: ray tracing on the CPU takes 60.0 ms."


def test_costs_that_are_no_times_are_explained(measured: Make) -> None:
    made = measured(Cell("a", 512, 0.004, None), Cell("b", None, 0.004, 5.0))
    assert shown(made)["a"][1] == "map 512 a at 512"
    assert cost_note(made).endswith(' Where a cost is a map size or "no map", that setting lacks times.')


def test_a_verdict_falls_back_to_an_easier_target_and_then_to_the_closest(measured: Make) -> None:
    assert verdict(measured(Cell("a", 512, 0.02, 5.0), name="easy")) == [
        "95% of the shadow right: `a at 512` is the cheapest real-time setting, 5.00 ms a frame.",
        "No real-time technique here gets 99% right.",
    ]
    assert verdict(measured(Cell("a", 512, 0.2, 5.0), name="none")) == [
        "No real-time technique here gets 95% of the shadow right.",
        "Closest: `a at 512`, IoU 0.8.",
    ]
    half = Cell("a", 512, 0.04, 5.0), elsewhere(Cell("a", 512, 0.2, 5.0))
    assert verdict(measured(*half, name="half")) == [
        "No real-time technique here gets 95% of the shadow right in all 2 scenes.",
        "Closest: `a at 512`, in 1 of them.",
    ]
    assert verdict(measured(Cell("a", 512, None, None, status="failed: died"), name="failed")) == [
        "Nothing here has a score."
    ]


def test_rough_and_software_times_are_marked(measured: Make) -> None:
    made = measured(Cell("a", 512, 0.004, 5.0, ratio_iqr=0.4))
    assert "~5.00 ms a frame" in verdict(made)[0]
    assert cost_note(made) == (
        "Cost: frame time of shadows. Times of a software renderer: for trends only, not representative of a GPU. "
        "~ marks a rough time."
    )
    exact = cost_note(measured(Cell("a", 512, 0.004, 5.0), name="gpu", software=False))
    assert "representative" not in exact and "~" not in exact


def test_the_times_of_two_machines_share_no_matrix(run_folder: Callable[..., Path]) -> None:
    slow, fast = Cell("a", 512, 0.004, 50.0), Cell("a", 512, 0.004, 5.0)
    runs = read_runs([run_folder([slow], name="slow"), run_folder([fast], name="fast", processor="Another")])
    every = [section for parts in sections(runs).values() for section in parts]
    costs = [
        cells[1]["cost"]
        for index, run in enumerate(runs)
        for panel in panels_of(run, index, every)
        for _, cells in panel.matrix
    ]
    assert costs == ["50.0 ms", "5.00 ms"]


def test_soft_cells_say_what_is_wrong_and_how_much(measured: Make) -> None:
    """All metrics of these cells are ½: too light, noisy and flat; hard ones have no such words."""
    (soft,), (hard,) = measured(*SOFT, name="soft"), measured(*CELLS, name="hard")
    cells = scored_cells(soft)
    assert [cell.error for cell in cells] == pytest.approx([0.5, 0.1, 0.015, TRUTH_ERROR / 2])
    assert all(
        cell.faults[0].startswith("penumbra width: half of those drawn are at least 1.4 times") for cell in cells
    )
    assert [label for label, _ in faults_of(soft)] == [one.label for one in soft.scored]
    assert not faults_of(hard) and not any(cell.faults for cell in scored_cells(hard))
    for one in soft.scored:
        one.values["bleed"] = Interval(0.25)
    assert all("mean visibility is 0.25, not 0" in line for _, line in faults_of(soft)), "medians, as in the table"
