"""Comparison with a baseline: what is worse, better or unchanged."""

import math
import statistics
from typing import Any

import pytest

from shadowbench.measure.rows import Result
from shadowbench.results.baseline import compare
from shadowbench.scores.metrics import METRICS
from tests.results.cells import GOOD, TIME
from tests.results.cells import result as cell


def verdicts(found: Result, before: Result, **tolerances: float) -> dict[str, str]:
    return {change.what: change.verdict for change in compare([found], [before], tolerances).changes}


def without(name: str) -> dict[str, float]:
    """The metrics of an older version."""
    return {other: value for other, value in GOOD.items() if other != name}


def test_each_metric_has_its_direction_and_its_tolerance() -> None:
    for name, metric in METRICS.items():
        sign = 1 if metric.better in ("higher", "near 1") else -1
        for step, verdict in ((1.1, "improved"), (-1.1, "regressed")):
            moved = GOOD | {name: GOOD[name] + sign * step * metric.tolerance}
            assert verdicts(cell(metrics=moved), cell()) == {name: verdict}
            within = GOOD | {name: GOOD[name] + sign * step / 2 * metric.tolerance}
            assert verdicts(cell(metrics=within), cell()) == {}
        assert verdicts(cell(metrics=GOOD | {name: 0.5}), cell(), **{name: 1.0}) == {}


def test_a_move_by_just_the_tolerance_is_no_change() -> None:
    now, before = cell(metrics=GOOD | {"iou": 0.5}), cell(metrics=GOOD | {"iou": 0.75})
    assert verdicts(now, before, iou=0.25) == {}
    assert list(verdicts(now, before, iou=0.2499)) == ["iou"]


@pytest.mark.parametrize(
    ("now", "then", "equal"),
    [
        ({"mask_sha256": "a"}, {"mask_sha256": "a"}, 1),
        ({"mask_sha256": "b"}, {"mask_sha256": "a"}, 0),  # which alone is no failure
        ({}, {}, 0),  # no hash is equal to none
        ({"mask_sha256": "a"}, {"mask_sha256": "a", "metrics": without("acne_soft")}, 1),
    ],
)
def test_a_mask_s_hash_is_information_alone(now: dict[str, Any], then: dict[str, Any], equal: int) -> None:
    findings = compare([cell(**now)], [cell(**then)])
    assert (findings.changes, findings.equal) == ((), equal)


def test_a_metric_that_is_lost_has_regressed() -> None:
    none = cell(metrics=GOOD | {"edge_px": None})
    assert verdicts(none, cell()) == {"edge_px": "regressed"}
    assert verdicts(none, none) == {}


def test_a_metric_that_is_newer_than_the_baseline_is_a_note() -> None:
    findings = compare([cell()], [cell(metrics=without("contact"))])
    assert not findings.changes and findings.notes == ("not compared, since one side lacks them: contact",)


def test_motion_is_compared_in_frames_of_one_sequence_alone() -> None:
    def moving(flicker: float, **more: Any) -> Result:
        return cell(**{"sequence": "pan", "frames": 8, "metrics": GOOD | {"flicker": flicker}, **more})

    assert verdicts(moving(0.02), moving(0.01)) == {"flicker": "regressed"}
    assert verdicts(moving(0.0), moving(0.01)) == {"flicker": "improved"}
    for other in (cell(), moving(0.01, sequence="zoom"), moving(0.01, frames=9)):
        assert compare([moving(0.02)], [other]).compared == 0


def test_the_order_of_parameters_is_no_part_of_a_cells_identity() -> None:
    then = cell(full_spec="shadow-map:size=1,bias=slope(max=1,min=0)")
    for full_spec, compared in (("bias=slope(max=1,min=0),size=1", 1), ("bias=slope(max=1,min=0),size=2", 0)):
        assert compare([cell(full_spec=f"shadow-map:{full_spec}")], [then]).compared == compared


@pytest.mark.parametrize("status", ["failed: crashed", "unsupported: no light"])
def test_a_cell_that_is_no_longer_ok_has_regressed(status: str) -> None:
    assert verdicts(cell(status=status), cell()) == {"status": "regressed"}
    assert verdicts(cell(), cell(status=status)) == {"status": "improved"}
    assert verdicts(cell(status=status), cell(status="failed: otherwise")) == {}


@pytest.mark.parametrize(
    ("work", "expected"),
    [
        ({"draws": 3, "primitives": 100, "fragments": 1000}, {"draws": "regressed"}),
        ({"draws": 2, "primitives": 99, "fragments": 1000}, {"primitives": "improved"}),
        ({"draws": 2, "primitives": 100, "fragments": 1019}, {}),
        ({"draws": 2, "primitives": 100, "fragments": 1021}, {"fragments": "regressed"}),
        ({"draws": 2, "primitives": 100, "fragments": 1000, "cost": 9000, "rays": 1}, {}),
        ({"draws": 2.05, "primitives": 100, "fragments": 1000}, {"draws": "regressed"}),
    ],
)
def test_work_is_exact_but_for_invocations(work: dict[str, int], expected: dict[str, str]) -> None:
    before = cell(work={"draws": 2, "primitives": 100, "fragments": 1000, "cost": 1000})
    assert verdicts(cell(work=work), before) == expected
    assert verdicts(cell(work=work, gpu_bytes=101), before) == {**expected, "gpu_bytes": "regressed"}
    elsewhere = compare([cell(work=work, renderer="another")], [before])
    assert not elsewhere.changes and "another" in elsewhere.notes[0]


@pytest.mark.parametrize("other", ["llvmpipe", "llvmpipe, arithmetic b7b1f04e"])
def test_work_is_compared_with_a_driver_of_other_arithmetic(other: str) -> None:
    more = cell(work={"draws": 3}, renderer="llvmpipe, arithmetic 1b8b548d")
    found = compare([more], [cell(renderer=other)])
    assert ([change.what for change in found.changes], found.notes) == (["draws"], ())


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        ({"ratio": 2.3}, {"time": "slower"}),
        ({"ratio": 1.7}, {"time": "faster"}),
        *(({"ratio": ratio}, {}) for ratio in (2.1, 1.9, 2.2)),  # at most a tenth is below the factor
        ({"ratio": 2.3, "ratio_iqr": 2.0}, {}),  # within the noise
        *(({"ratio": 9.0} | change, {}) for change in ({"machine": "x"}, {"clock": "gpu"}, {"reference": "y"})),
        ({"ratio": None}, {}),
        (None, {}),
    ],
)
def test_time_needs_a_factor_and_a_significance_on_the_same_machine(
    time: dict[str, Any] | None, expected: dict[str, str]
) -> None:
    old = cell(TIME)
    assert verdicts(cell(None if time is None else TIME | time), old) == expected
    assert compare([cell(TIME), cell(size=64)], [old, cell(size=64)]).timed == 1


def test_the_significance_of_a_time_is_that_of_two_medians_of_normal_samples() -> None:
    """The standard error of n values' median is 1 / (2 √n f) where f is their density; three are significant."""
    normal = statistics.NormalDist()
    sides = [{"ratio": 2.0, "ratio_iqr": 0.3, "n": 16}, {"ratio": 2.5, "ratio_iqr": 0.1, "n": 100}]
    old, new = (cell(TIME | side) for side in sides)
    (change,) = compare([new], [old]).changes
    sigmas = [side["ratio_iqr"] / (normal.inv_cdf(0.75) - normal.inv_cdf(0.25)) for side in sides]
    errors = [
        sigma / (2 * normal.pdf(0) * math.sqrt(side["n"])) / side["ratio"]
        for sigma, side in zip(sigmas, sides, strict=True)
    ]
    assert 3 * change.excess == pytest.approx(math.log(2.5 / 2.0) / math.hypot(*errors), rel=1e-4)
