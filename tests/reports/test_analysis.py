"""Sections of a report: the Pareto front, medians, notes, and configurations without a score."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.reports.gallery import scored_cells
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.verdict import cost_note, verdict
from shadowbench.reports.words import mask_warnings, section_notes, time_source, unscored, value_of
from shadowbench.results.configurations import Interval, Section, sections
from shadowbench.results.folder import read_runs
from shadowbench.results.ranking import Target
from tests.reports.conftest import CELLS, RECEIVERS, Cell


def test_the_front_of_a_scene_leaves_out_what_is_slower_and_worse(section_of: Callable[..., Section]) -> None:
    labels = [one.label for one in section_of().front]
    assert labels == [
        "unshadowed",
        "shadow-map:bias=none at 512",
        "shadow-map at 512",
        "shadow-map at 1024",
        "shadow-map at 2048",
        "ray-traced",
    ]


def test_a_value_equal_to_the_limit_meets_a_target(section_of: Callable[..., Section]) -> None:
    (exact,) = section_of((Cell("a", 512, 0.25, 7.0, edge=0.5),)).timed
    assert [Target("iou", limit).met_by(exact) for limit in (0.75, 0.76)] == [True, False]
    assert [Target("edge_px", limit).met_by(exact) for limit in (0.5, 0.4)] == [True, False]


def test_times_and_errors_are_medians_over_the_cells(section_of: Callable[..., Section]) -> None:
    cells = [Cell("a", 512, error, ms, phase=phase) for phase, (error, ms) in enumerate([(0.1, 3), (0.3, 4), (0.2, 9)])]
    (one,) = section_of(cells).timed
    assert one.value("frame_ms") == 4
    assert one.error is not None and one.error.median == pytest.approx(0.2)
    assert one.error.low is not None and one.error.low <= 0.2 <= (one.error.high or 0)


def test_no_error_is_drawn_below_every_error_there_can_be(section_of: Callable[..., Section]) -> None:
    assert 0 < section_of().least_error < 1 / RECEIVERS


def test_configurations_without_a_score_are_listed_separately(section_of: Callable[..., Section]) -> None:
    section = section_of((*CELLS, Cell("void", 512, None, 3.0)))
    assert sorted(unscored(section)) == [
        ("cube-map at 512", "failed: the worker died"),
        ("planar-projection", "unsupported: no receiver is a plane"),
        ("void at 512", "no IoU: neither the truth nor the mask has a shadow"),
    ]
    assert {one.technique for one in section.scored} == {"unshadowed", "shadow-map", "ray-traced"}


def test_warnings_about_external_masks_are_reported(run_folder: Callable[..., Path]) -> None:
    folder = run_folder()
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    rows[0]["input"] = {"warnings": ["seems shifted by 1 px up; scored as it is"]}
    (folder / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    ((section,),) = sections(read_runs([folder])).values()
    assert mask_warnings(section) == [f"{rows[0]['spec']}: seems shifted by 1 px up; scored as it is"]
    assert "seems shifted by 1 px up" in markdown_report([section.run], {section.title: [section]}, [])


def test_a_configuration_that_failed_in_some_phases_says_in_how_many(section_of: Callable[..., Section]) -> None:
    cells = [Cell("a", 512, 0.1, 3.0), Cell("a", 512, None, None, phase=1, status="failed: too slow")]
    assert unscored(section_of(cells)) == [("a at 512", "1 of 2 cells failed: too slow")]


def test_map_sizes_without_a_number_for_one_reason_are_one_line(section_of: Callable[..., Section]) -> None:
    cells = [Cell("a", size, None, None, status="unsupported: no ground") for size in (1024, 512)]
    assert unscored(section_of(cells)) == [("a at 512, 1024", "unsupported: no ground")]


LOADED = (
    Cell("slow", 512, 0.009, 18.0, ratio_iqr=0.9),
    Cell("fast", 512, 0.005, 16.0, reference_ms=20.0),  # while the machine took twice as long for everything
    Cell("shadow-map", 1024, 0.02, 10.0),
)


def test_front_prices_and_passes_are_by_ratios_whatever_the_machine_did_meanwhile(
    section_of: Callable[..., Section],
) -> None:
    section = section_of(LOADED)
    assert [one.label for one in section.front] == ["fast at 512"]
    assert (
        verdict([section])[0]
        == "99% of the shadow right: `fast at 512` is the cheapest real-time setting, 12.0 ms a frame."
    )
    ms = {one.spec: one.value("frame_ms") for one in section.timed}
    assert ms == pytest.approx({"slow": 1.8 * 15, "fast": 0.8 * 15, "shadow-map": 15})
    passes = {one.spec: [made.ms for made in one.passes] for one in section.timed}
    assert passes["slow"] == pytest.approx([1.5, 3.0]) and passes["fast"] == pytest.approx([0.75, 1.5])
    assert {cell.spec: cell.caption.split(", ")[-1] for cell in scored_cells(section)} == {
        "slow": "~27.0 ms (software renderer)",
        "fast": "12.0 ms (software renderer)",
        "shadow-map": "15.0 ms (software renderer)",
    }


def test_a_section_says_what_its_times_are_by_and_which_are_rough(section_of: Callable[..., Section]) -> None:
    section = section_of(LOADED)
    notes = section_notes(section)
    assert "ms: time relative to shadow-map:size=1024" in notes[1] and "15 ms, its median over 2" in notes[1]
    assert "load of the machine varied: shadow-map:size=1024 took 10 to 20 ms" in notes[2]
    assert notes[3].startswith("~: ")
    text = markdown_report([section.run], {section.title: [section]}, [])
    assert "| ~27.0 |" in text and "| 12.0 |" in text
    assert all(note[1:] in text for note in notes) and "\nms: time relative" in text, "no megaseconds"
    assert section_notes(section_of((Cell("unshadowed", None, 1.0, None),), name="untimed")) == []


def test_every_time_of_a_cell_that_varied_is_marked_and_no_metric(section_of: Callable[..., Section]) -> None:
    marks = {}
    for one in section_of(LOADED).timed:
        one.values["camera_ms"] = Interval(3.0)
        marks[one.spec] = [value_of(one, name)[0] == "~" for name in ("frame_ms", "camera_ms", "ratio", "ssim")]
    assert marks["slow"] == [True, True, False, False] and not any(marks["fast"])


def test_maps_scored_in_one_phase_have_a_note(section_of: Callable[..., Section]) -> None:
    def note(*cells: Cell, name: str) -> str:
        return section_notes(section_of(cells, name=name))[-1]

    alone = [Cell("a", size, 0.1, None) for size in (512, 1024)]
    assert note(*alone, name="one").startswith("scored in one phase")
    again = Cell("a", 512, 0.2, None, phase=1)
    assert note(*alone, again, name="some").startswith("maps without an interval: scored in one phase")
    cells, brackets = section_notes(section_of((alone[0], again), name="two"))
    assert cells == "medians over up to 2 cells (views × phases) a configuration"
    assert brackets.startswith("( ): range over the cells; [ ], and bars of charts: 95% confidence interval")


def test_a_run_without_times_has_no_prices(section_of: Callable[..., Section]) -> None:
    section = section_of([Cell("a", 512, 0.1, None)])
    assert "Nothing here was timed" in cost_note([section])
    assert time_source(section.run) == "nothing was timed"
    assert section.front == []


def test_another_view_size_or_run_is_a_section_of_its_own(run_folder: Callable[..., object]) -> None:
    first, second = run_folder(name="first"), run_folder(name="second")
    (parts,) = sections(read_runs([first, second])).values()  # type: ignore[list-item]
    assert [part.run.label for part in parts] == ["first", "second"]
