"""Sections of a report: the Pareto front, medians, notes, and configurations without a score."""

import json

import pytest
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.verdict import verdict
from shadowbench.results.configurations import Interval, sections

from shadowbench.reports.gallery import scored_cells
from shadowbench.reports.words import (
    digits,
    fault_lines,
    mask_warnings,
    run_facts,
    section_notes,
    time_source,
    unscored,
)
from shadowbench.results.frame import read_runs
from tests.reports.conftest import CELLS, Cell
from tests.reports.test_verdict import SOFT, phases

LOADED = (
    Cell("slow", 512, 0.009, 18.0, ratio_iqr=0.9),
    Cell("fast", 512, 0.005, 16.0, reference_ms=20.0),  # while the machine took twice as long for everything
    Cell("shadow-map", 1024, 0.02, 10.0),
)


def test_the_front_leaves_out_what_is_slower_and_worse(measured) -> None:
    (hard,), (soft,), (untimed,) = measured(), measured(*SOFT), measured(Cell("a", 512, 0.1, None))
    bare = "shadow-map:bias=none at 512"
    maps = [f"shadow-map at {size}" for size in (512, 1024, 2048)]
    assert [one.label for one in hard.front] == ["unshadowed", bare, *maps, "ray-traced"]
    assert [one.label for one in soft.front] == ["unshadowed", "sharp at 512", "blurred at 512", "sampled"]
    assert untimed.front == [] and time_source(untimed.run) == "nothing was timed"


def test_what_has_no_score_is_listed_with_its_sizes_phases_and_reason(measured) -> None:
    dark = [Cell("a", size, None, None, status="unsupported: no ground") for size in (1024, 512)]
    late = [Cell("b", 512, 0.1, 3.0), Cell("b", 512, None, None, phase=1, status="failed: too slow")]
    (section,) = measured(*CELLS, Cell("void", 512, None, 3.0), *dark, *late)
    assert sorted(unscored(section)) == [
        ("a at 512, 1024", "unsupported: no ground"),
        ("b at 512", "1 of 2 cells failed: too slow"),
        ("cube-map at 512", "failed: the worker died"),
        ("planar-projection", "unsupported: no receiver is a plane"),
        ("void at 512", "no IoU: neither the truth nor the mask has a shadow"),
    ]
    assert {one.technique for one in section.scored} == {"unshadowed", "shadow-map", "ray-traced", "b"}


def test_warnings_about_external_masks_are_reported(run_folder) -> None:
    folder = run_folder()
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    rows[0]["input"] = {"warnings": ["seems shifted by 1 px up; scored as it is"]}
    (folder / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    ((section,),) = sections(read_runs([folder])).values()
    assert mask_warnings(section) == [f"{rows[0]['spec']}: seems shifted by 1 px up; scored as it is"]
    assert "seems shifted by 1 px up" in markdown_report([section.run], {section.title: [section]}, [])


def test_front_prices_and_passes_are_by_ratios_whatever_the_machine_did_meanwhile(measured) -> None:
    (section,) = measured(*LOADED)
    assert [one.label for one in section.front] == ["fast at 512"] and "12.0 ms a frame" in verdict([section])[0]
    ms = {one.spec: one.value("frame_ms") for one in section.timed}
    assert ms == pytest.approx({"slow": 1.8 * 15, "fast": 0.8 * 15, "shadow-map": 15})
    passes = {one.spec: [made.ms for made in one.passes] for one in section.timed}
    assert passes["slow"] == pytest.approx([1.5, 3.0]) and passes["fast"] == pytest.approx([0.75, 1.5])
    assert {cell["spec"]: cell["caption"].split(", ")[-1] for _, cell in scored_cells(section)} == {
        "slow": "~27.0 ms (software renderer)",
        "fast": "12.0 ms (software renderer)",
        "shadow-map": "15.0 ms (software renderer)",
    }
    marks = {}
    for one in section.timed:
        one.values["camera_ms"] = Interval(3.0)
        marks[one.spec] = [one.text(name, digits)[0] == "~" for name in ("frame_ms", "camera_ms", "ratio", "ssim")]
    assert marks["slow"] == [True, True, False, False] and not any(marks["fast"]), "rough times, and no metric"


def test_a_section_says_what_its_times_are_by_and_which_are_rough(measured) -> None:
    (section,) = measured(*LOADED)
    notes = section_notes(section)
    assert "ms: time relative to shadow-map:size=1024" in notes[1] and "15 ms, its median over 2" in notes[1]
    assert "load of the machine varied: shadow-map:size=1024 took 10 to 20 ms" in notes[2]
    assert notes[3].startswith("~: ")
    text = markdown_report([section.run], {section.title: [section]}, [])
    assert "| ~27.0 |" in text and "| 12.0 |" in text
    assert all(note[1:] in text for note in notes) and "\nms: time relative" in text, "no megaseconds"
    assert section_notes(measured(Cell("unshadowed", None, 1.0, None))[0]) == []


def test_maps_scored_in_one_phase_have_a_note(measured) -> None:
    alone, again = [Cell("a", size, 0.1, None) for size in (512, 1024)], Cell("a", 512, 0.2, None, phase=1)
    one, some, two = (section_notes(measured(*cells)[0]) for cells in (alone, [*alone, again], [alone[0], again]))
    assert one[-1].startswith("scored in one phase")
    assert some[-1].startswith("maps without an interval: scored in one phase")
    assert two[0] == "medians over up to 2 cells (views × phases) a configuration"
    assert two[1].startswith("( ): range over the cells; [ ], and bars of charts: 95% confidence interval")


def test_the_facts_of_a_run_say_in_how_many_phases_each_was_scored(measured) -> None:
    other = [Cell(spec, 512, 0.1, None) for spec in ("a", "b")]
    told = [dict(run_facts(measured(*cells)[0].run))["phases"] for cells in (other, [*phases(0.1, 0.2, 0.3), *other])]
    assert told == ["1", "3 of shadow-map; 1 of all others"]


def test_soft_cells_say_what_is_wrong_and_how_much(measured) -> None:
    """All metrics of these cells are ½: too light, noisy and flat; hard ones have no such words."""
    (soft,), (hard,) = measured(*SOFT), measured()
    for _, cell in scored_cells(soft):
        assert cell["faults"][0].startswith("penumbra width: half of those drawn are at least 1.4 times")
    assert not any(map(fault_lines, hard.scored)) and not any(cell["faults"] for _, cell in scored_cells(hard))
    for one in soft.scored:
        one.values["bleed"] = Interval(0.25)
        assert any("mean visibility is 0.25, not 0" in line for line in fault_lines(one)), "medians, as in the table"
