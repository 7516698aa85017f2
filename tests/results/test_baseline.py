"""Comparison with a baseline: what is worse, better or unchanged."""

import math
import statistics
from typing import Any

import pytest

from shadowbench.measure.rows import Result
from shadowbench.results import baseline
from shadowbench.results.baseline import compare
from shadowbench.scores.metrics import METRICS

GOOD = {name: 0.9 if metric.better == "higher" else 0.1 for name, metric in METRICS.items()}
TIME = {"machine": "m", "clock": "wall", "reference": "shadow-map:size=1024", "n": 9, "ratio": 2.0, "ratio_iqr": 0.02}


def cell(status: str = "ok", time: dict[str, Any] | None = None, size: int = 512, **score: Any) -> Result:
    record = {
        "scene": "s", "view": "camera", "light": "sun", "phase": 0, "full_spec": "shadow-map", "map_size": size,
        "view_size": 512, "coordinates": "relative", "renderer": "llvmpipe", "status": status, "metrics": GOOD,
        "receivers": 9, "undecided": 1, "mask_sha256": None, "gpu_bytes": 100,
        "work": {"draws": 2, "primitives": 100, "fragments": 1000, "cost": 1000},
    } | score  # fmt: skip
    return Result(record, time)


def verdicts(found: list[Result], baseline: list[Result], **tolerances: float) -> dict[str, str]:
    return {change.what: change.verdict for change in compare(found, baseline, tolerances).changes}


@pytest.mark.parametrize("name", METRICS)
def test_each_metric_has_its_direction_and_its_tolerance(name: str) -> None:
    metric = METRICS[name]
    sign = 1 if metric.better in ("higher", "near 1") else -1
    for step, verdict in ((1.1, "improved"), (-1.1, "regressed")):
        moved = GOOD | {name: GOOD[name] + sign * step * metric.tolerance}
        assert verdicts([cell(metrics=moved)], [cell()]) == {name: verdict}
        within = GOOD | {name: GOOD[name] + sign * step / 2 * metric.tolerance}
        assert verdicts([cell(metrics=within)], [cell()]) == {}
    assert verdicts([cell(metrics=GOOD | {name: 0.5})], [cell()], **{name: 1.0}) == {}


def test_a_move_by_just_the_tolerance_is_no_change() -> None:
    for after in (0.5, 1.0):
        found, baseline = cell(metrics=GOOD | {"iou": after}), cell(metrics=GOOD | {"iou": 0.75})
        assert verdicts([found], [baseline], iou=0.25) == {}
        assert list(verdicts([found], [baseline], iou=0.2499)) == ["iou"]


def test_an_equal_mask_against_another_truth_has_regressed() -> None:
    worse = GOOD | {"iou": 0.284}  # as many receivers and undecided pixels, elsewhere
    assert verdicts([cell(mask_sha256="a", metrics=worse)], [cell(mask_sha256="a")]) == {"iou": "regressed"}
    assert compare([cell(mask_sha256="a", metrics=worse)], [cell(mask_sha256="a")]).equal == 0


def test_a_mask_s_hash_is_information_alone() -> None:
    same, other = (compare([cell(mask_sha256=found)], [cell(mask_sha256="a")]) for found in "ab")
    assert (same.changes, same.equal) == ((), 1)
    assert (other.changes, other.equal) == ((), 0), "another hash alone is no failure"
    none = compare([cell()], [cell()])
    assert none.equal == 0, "no hash is equal to none"
    older = {name: value for name, value in GOOD.items() if name != "acne_soft"}
    assert compare([cell(mask_sha256="a")], [cell(mask_sha256="a", metrics=older)]).equal == 1


def test_a_metric_that_is_lost_has_regressed() -> None:
    assert verdicts([cell(metrics=GOOD | {"edge_px": None})], [cell()]) == {"edge_px": "regressed"}
    none = cell(metrics=GOOD | {"edge_px": None})
    assert verdicts([none], [none]) == {}


def test_a_metric_that_the_baseline_does_not_know_is_not_compared() -> None:
    older = {name: value for name, value in GOOD.items() if name != "acne_soft"}
    assert verdicts([cell()], [cell(metrics=older)]) == {}


def test_a_metric_that_is_newer_than_the_baseline_is_a_note() -> None:
    old = cell(metrics={name: value for name, value in GOOD.items() if name != "contact"})
    findings = compare([cell()], [old])
    assert not findings.changes and findings.notes == ("not compared, since one side lacks them: contact",)


@pytest.mark.parametrize("names", [[], ["ssim"]], ids=["all", "all but one"])
def test_a_metric_that_one_cell_alone_lacks_has_regressed(names: list[str]) -> None:
    bare = cell(metrics={name: GOOD[name] for name in names}, mask_sha256="a")
    old = [cell(mask_sha256="a"), cell(size=64)]
    findings = compare([bare, cell(size=64)], old)
    assert {change.what: change.verdict for change in findings.changes} == dict.fromkeys(
        METRICS.keys() - names, "regressed"
    )
    assert (findings.equal, findings.notes) == (0, ())


def test_a_metric_that_some_rows_of_the_baseline_lack_is_compared_in_the_others() -> None:
    older = {name: value for name, value in GOOD.items() if name != "contact"}
    worse = GOOD | {"contact": 0.9}
    found = [cell(metrics=worse), cell(metrics=worse, size=64)]
    (change,) = compare(found, [cell(metrics=older), cell(size=64)]).changes
    assert (change.what, change.score["map_size"]) == ("contact", 64)


def test_flips_are_compared_after_the_same_step_alone() -> None:
    def after(step: str, flips: float) -> list[Result]:
        return [cell(step=step, flips=flips)]

    assert verdicts(after("camera", 0.02), after("camera", 0.01)) == {"flips": "regressed"}
    assert verdicts(after("camera", 0.0), after("camera", 0.01)) == {"flips": "improved"}
    for found, before, why in (
        (after("light", 0.02), after("camera", 0.01), "flips are not compared: one side has them after a step of"),
        (after("light", 0.02), [cell()], "not compared, since one side lacks them: flips"),
        ([cell()], after("light", 0.02), "not compared, since one side lacks them: flips"),
    ):
        findings = compare(found, before)
        assert not findings.changes and findings.notes[0].startswith(why)


def test_a_row_without_metrics_is_not_of_another_version() -> None:
    findings = compare([cell(metrics={})], [cell()])
    assert {change.what for change in findings.changes} == set(METRICS) and not findings.notes


def test_a_missing_cell_fails_and_an_extra_one_is_a_note() -> None:
    findings = compare([cell()], [cell(), cell(size=1024)])
    (change,) = findings.changes
    assert (change.what, change.after, change.verdict) == ("status", "missing", "regressed")
    findings = compare([cell(), cell(size=1024)], [cell()])
    assert not findings.changes and findings.notes == ("1 cell is not in the baseline",) and findings.compared == 1
    assert compare([cell()], [cell(size=1024)]).compared == 0


def test_the_order_of_parameters_is_no_part_of_a_cells_identity() -> None:
    now, then = (
        cell(full_spec=f"shadow-map:{items}")
        for items in ("bias=slope(max=1,min=0),size=1", "size=1,bias=slope(max=1,min=0)")
    )
    assert compare([now], [then]).compared == 1
    assert compare([cell(full_spec="shadow-map:size=2,bias=slope(max=1,min=0)")], [then]).compared == 0


def test_a_cell_that_is_no_longer_ok_has_regressed() -> None:
    failed, declined = cell("failed: crashed"), cell("unsupported: no light")
    for bad in (failed, declined):
        assert verdicts([bad], [cell()]) == {"status": "regressed"}
        assert verdicts([cell()], [bad]) == {"status": "improved"}
    assert verdicts([failed], [declined]) == {}


@pytest.mark.parametrize(
    ("work", "expected"),
    [
        ({"draws": 3, "primitives": 100, "fragments": 1000}, {"draws": "regressed"}),
        ({"draws": 2, "primitives": 99, "fragments": 1000}, {"primitives": "improved"}),
        ({"draws": 2, "primitives": 100, "fragments": 1019}, {}),
        ({"draws": 2, "primitives": 100, "fragments": 1021}, {"fragments": "regressed"}),
        ({"draws": 2, "primitives": 100, "fragments": 1000, "cost": 9000, "rays": 1}, {}),
    ],
)
def test_work_is_exact_but_for_invocations(work: dict[str, int], expected: dict[str, str]) -> None:
    assert verdicts([cell(work=work)], [cell()]) == expected
    elsewhere = compare([cell(work=work, renderer="another")], [cell()])
    assert not elsewhere.changes and "another" in elsewhere.notes[0]


def test_work_is_compared_with_a_driver_of_other_arithmetic() -> None:
    more = cell(work={"draws": 3}, renderer="llvmpipe, arithmetic 1b8b548d")
    for other in (cell(), cell(renderer="llvmpipe, arithmetic b7b1f04e")):
        found = compare([more], [other])
        assert [change.what for change in found.changes] == ["draws"]
        assert not found.notes


def test_work_that_moved_is_measured_in_fiftieths_or_in_ones_where_that_is_more() -> None:
    old = cell(work={"draws": 2, "fragments": 1000})
    excess = {
        change.what: change.excess for change in compare([cell(work={"draws": 5, "fragments": 1030})], [old]).changes
    }
    assert excess == {"draws": 3, "fragments": pytest.approx(1.5)}


def test_counts_are_exact() -> None:
    assert verdicts([cell(work={"draws": 2.05})], [cell(work={"draws": 2})]) == {"draws": "regressed"}


def test_bytes_are_exact() -> None:
    assert verdicts([cell(gpu_bytes=101)], [cell()]) == {"gpu_bytes": "regressed"}


def test_time_needs_a_factor_and_a_significance() -> None:
    old = cell(time=TIME)
    assert verdicts([cell(time=TIME | {"ratio": 2.3})], [old]) == {"time": "slower"}
    assert verdicts([cell(time=TIME | {"ratio": 1.7})], [old]) == {"time": "faster"}
    for ratio in (2.1, 1.9, 2.2):
        assert verdicts([cell(time=TIME | {"ratio": ratio})], [old]) == {}, "at most a tenth is below the factor"
    assert compare([cell(time=TIME), cell(size=64)], [old, cell(size=64)]).timed == 1
    assert verdicts([cell(time=TIME | {"ratio": 2.3, "ratio_iqr": 2.0})], [old]) == {}, "within the noise"


def test_the_significance_of_a_time_is_that_of_two_medians_of_normal_samples() -> None:
    """The standard error of n values' median is 1 / (2 √n f) where f is their density; three are significant."""
    normal = statistics.NormalDist()
    ends, sizes, ratios = (0.3, 0.1), (16, 100), (2.0, 2.5)
    sides = [{"ratio": ratio, "ratio_iqr": iqr, "n": n} for ratio, iqr, n in zip(ratios, ends, sizes, strict=True)]
    old, new = (cell(time=TIME | side) for side in sides)
    (change,) = compare([new], [old]).changes
    sigmas = [iqr / (normal.inv_cdf(0.75) - normal.inv_cdf(0.25)) for iqr in ends]
    errors = [
        sigma / (2 * normal.pdf(0) * math.sqrt(n)) / ratio
        for sigma, n, ratio in zip(sigmas, sizes, ratios, strict=True)
    ]
    assert 3 * change.excess == pytest.approx(math.log(2.5 / 2.0) / math.hypot(*errors), rel=1e-4)


def test_a_time_that_is_just_as_far_as_is_significant_is_no_change(monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = cell(time=TIME), cell(time=TIME | {"ratio": 2.3})
    monkeypatch.setattr(baseline, "SIGNIFICANT", 1.0)
    (change,) = compare([new], [old]).changes
    monkeypatch.setattr(baseline, "SIGNIFICANT", change.excess)
    assert verdicts([new], [old]) == {}


def test_without_a_tolerance_or_a_spread_a_millionth_of_a_millionth_is_the_unit() -> None:
    """So that nothing is divided by zero, and the larger change still comes first."""
    moved = compare([cell(metrics=GOOD | {"iou": 0.4})], [cell()], {"iou": 0.0})
    assert [change.excess for change in moved.changes] == pytest.approx([0.5e12])
    steady = TIME | {"ratio_iqr": 0.0}
    (change,) = compare([cell(time=steady | {"ratio": 2.3})], [cell(time=steady)]).changes
    assert 3 * change.excess == pytest.approx(math.log(2.3 / 2.0) * 1e12)


@pytest.mark.parametrize("change", [{"machine": "x"}, {"clock": "gpu"}, {"reference": "y"}, {"ratio": None}])
def test_times_of_different_machines_clocks_or_references_are_not_compared(change: dict[str, Any]) -> None:
    assert verdicts([cell(time=TIME | {"ratio": 9.0} | change)], [cell(time=TIME)]) == {}
    assert verdicts([cell()], [cell(time=TIME)]) == {}


def test_the_worst_comes_first() -> None:
    moved = GOOD | {"iou": 0.8, "ssim": 0.85, "acne": 0.1005}
    findings = compare([cell(metrics=moved), cell("failed: x", size=64)], [cell(), cell(size=64)])
    assert [change.what for change in findings.changes] == ["status", "iou", "ssim"]
    assert math.isinf(findings.changes[0].excess)
    assert [change.what for change in findings.of("regressed")] == ["status", "iou", "ssim"]
    assert findings.of("slower") == []
