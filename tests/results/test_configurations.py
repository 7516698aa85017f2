"""Configurations: medians with confidence intervals, and slopes, of known values."""

from typing import Any

import numpy as np
import pytest
from shadowbench.results.configurations import Configuration, Interval, interval
from shadowbench.results.ranking import mean

from shadowbench.measure.rows import Result
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.curves import Slope, slopes
from shadowbench.results.frame import cells_frame
from shadowbench.scores.metrics import METRICS
from tests.results.cells import cell
from tests.runs import sections_of


def result(iou: float = 0.5, size: int | None = 64, time: dict[str, Any] | None = None, **score: Any) -> Result:
    """A cell with an IoU, of some other metrics if given."""
    metrics = dict.fromkeys(METRICS) | {"iou": iou} | score.pop("metrics", {})
    return Result(cell(score.pop("spec", "t"), "cube", size, metrics=metrics, **score), time)


UNTIMED = {"status": "failed: crashed"}


def configurations(*cells: Result) -> tuple[Configuration, ...]:
    (section,) = sections_of(*cells).values()
    return section.configurations


def slopes_of(*cells: Result) -> list[Slope]:
    (section,) = sections_of(*cells).values()
    return slopes(section)


def one(spec: str = "a", size: int | None = 512, phases: int = 1, **values: Any) -> Configuration:
    return Configuration(spec, spec, spec, size, 1, (), values, phases)


def timed(ratio: float, **times: Any) -> dict[str, Any]:
    reference = {"reference": "r", "reference_ms": 10.0, "frame_ms": 10 * ratio}
    return {"ratio": ratio, "ratio_iqr": 0.01, "passes": {}} | reference | times


def test_a_summary_is_the_median_over_views_without_details_of_measurement() -> None:
    cells = [
        result(iou, view=view, time=timed(ratio, frame_iqr_ms=0.1, added_ms=0.5, n=9, clock="gpu"))
        for iou, view, ratio in [(0.1, "a", 0.1), (0.2, "b", 0.2), (0.9, "c", 3)]
    ]
    (row,) = configurations(*cells)
    iou, ms = row.values["iou"], row.values["frame_ms"]
    assert iou is not None and ms is not None
    assert (row.cells, iou.median, ms.median) == (3, 0.2, 2)
    assert (iou.low, iou.high) == (0.1, 0.9)
    assert row.values["ssim"] is None
    assert {"frame_ms", "frame_iqr_ms", "added_ms", "ratio"} <= row.values.keys()
    assert not {"n", "clock"} & row.values.keys()


def test_facts_of_techniques_have_columns() -> None:
    frame = cells_frame([result(facts={"open_parts": 2.0}), result()])
    assert frame["fact_open_parts"].tolist() == pytest.approx([2.0, np.nan], nan_ok=True)


def test_a_table_of_more_than_100_columns_is_in_one_piece() -> None:
    """Each technique has passes and facts, and so columns, of its own; warnings of pandas are errors in tests."""
    passes = {f"pass-{number}": {"ms": 1.0} for number in range(120)}
    facts = dict.fromkeys(map(str, range(100)), 1.0)
    cells = [result(0.5, size, timed(1, passes=passes), facts=facts) for size in (64, 128)]
    assert len(slopes_of(*cells)) == 1


def test_unsuccessful_cells_are_left_out() -> None:
    cells = [result(0.1, view="a"), result(0.9, view="b", time=UNTIMED), result(0.2, view="c")]
    (row,) = configurations(*cells)
    assert row.value("iou") == pytest.approx(0.15)
    assert (row.cells, row.refused) == (2, ("failed: while timed: crashed",))


def test_the_interval_is_the_middle_95_percent_of_the_median() -> None:
    # The median of 401 draws from 0, 1, …, 400 lies at rank 200 ± 10 (one standard deviation), about normally.
    found = interval([*np.random.default_rng(1).permutation(401).astype(float), float("nan")])
    assert found is not None and found.median == 200
    assert (found.low, found.high) == pytest.approx((200 - 1.96 * 10, 200 + 1.96 * 10), abs=2)


def test_an_interval_excludes_a_fortieth_of_the_resampled_medians_on_either_side(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Ramp:
        """A random generator whose resamples have medians 0, 1, 2, …"""

        def choice(self, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
            return np.broadcast_to(np.arange(shape[0])[:, None], (shape[0], len(values)))

    monkeypatch.setattr(np.random, "default_rng", lambda seed: Ramp())
    found = interval([1.0, 2.0, 3.0])
    assert found is not None and found.low is not None and found.high is not None
    assert (found.low, found.high) == pytest.approx((1999 / 40, 1999 * 39 / 40)), "of 2,000"


def test_a_single_value_has_no_interval_and_no_value_gives_none() -> None:
    assert interval([3.0]) == Interval(3.0)
    assert interval([]) is interval([float("nan")]) is None


def test_an_error_is_the_complement_with_its_ends_exchanged() -> None:
    assert Interval(0.75, 0.5, 1.0).complement() == Interval(0.25, 0.0, 0.5)


@pytest.mark.parametrize("apart", [{"view": "b"}, {"phase": 1}])
def test_a_slope_is_fitted_separately_for_each_view_and_phase(apart: dict[str, Any]) -> None:
    # Errors of c / size in one and c / size² in the other: slopes −1 and −2.
    cells = [
        result(1 - scale * (64 / size) ** power, size, **of)
        for of, scale, power in [({}, 0.5, 1), (apart, 0.1, 2)]
        for size in (64, 128, 256)
    ]
    (found,) = slopes_of(*cells)
    assert (found.slope.low, found.slope.median, found.slope.high) == pytest.approx((-2, -1.5, -1))
    assert (found.sizes, found.phases) == ((64, 128, 256), 2 if "phase" in apart else 1)


def test_a_cell_without_an_error_has_no_logarithm_and_takes_no_part_in_a_slope() -> None:
    found = slopes_of(result(0.5, 128), result(0.75, 256), result(1.0, 512), result(1.0, 64), result(0.5, None))
    assert [(one.slope.median, one.sizes) for one in found] == [(pytest.approx(-1), (128, 256))]
    assert slopes_of(result(), result(size=None), result(0.9, view="b")) == [], "one size has none"


def test_a_slope_of_soft_shadows_is_that_of_their_rmse() -> None:
    cells = [result(0.9, size, metrics={"rmse": rmse, "rmse_pen": 0.5}) for size, rmse in ((512, 0.1), (1024, 0.4))]
    (slope,) = slopes_of(*cells)
    assert slope.slope.median == pytest.approx(2)


def test_times_that_were_added_are_columns_after_all_others() -> None:
    times = {"wall_ms": 2.0, "still_ms": 0.0, "camera_ms": 3.0, "light_ms": 4.0}
    frame = cells_frame([result(time={"frame_ms": 1.0, **times}), result()])
    assert list(frame)[-4:] == list(times)
    assert frame.loc[0, list(times)].tolist() == list(times.values())
    assert frame.loc[1, list(times)].isna().all()


def test_lights_of_one_scene_are_tables_of_their_own() -> None:
    """Techniques that support only a sun must not be compared with medians that include lamps."""
    cells = [result(0.9), result(light="lamp"), result(0.8, spec="cascades")]
    found = {scene: [row.spec for row in section.configurations] for scene, section in sections_of(*cells).items()}
    assert found == {"cube, sun": ["t", "cascades"], "cube, lamp": ["t"]}
    assert list(sections_of(cells[0])) == ["cube"], "one light needs no name"


@pytest.mark.parametrize(("rmse_pen", "order"), [(None, ["sharp", "wide"]), (0.5, ["wide", "sharp"])])
def test_soft_shadows_are_ranked_by_rmse_and_hard_ones_by_iou(rmse_pen: float | None, order: list[str]) -> None:
    """A truth without penumbrae leaves `rmse_pen` undefined."""
    errors = {} if rmse_pen is None else {"truth_error": 0.01, "truth_error_pen": 0.02, "penumbra": 7}
    cells = [
        result(iou, spec=spec, metrics={"rmse": rmse, "rmse_pen": rmse_pen}, **errors)
        for spec, iou, rmse in (("sharp", 0.9, 0.2), ("wide", 0.8, 0.1))
    ]
    rows = configurations(*cells)
    assert [(row.spec, row.soft) for row in rows] == [(spec, rmse_pen is not None) for spec in order]
    if rmse_pen is not None:
        assert (rows[0].values["truth_error"], rows[0].values["truth_error_pen"]) == (Interval(0.01), Interval(0.02))
        assert cells_frame(cells)["penumbra"].tolist() == [7, 7]
        assert mean([rows[0], rows[0]]).values["truth_error_pen"] == Interval(0.02)


def test_a_score_below_the_error_of_the_truth_is_no_number() -> None:
    medians = {"rmse_pen": 0.01, "noise": 0.004, "iou": 0.9, "truth_error": 0.002, "truth_error_pen": 0.005}
    values = {name: Interval(median) for name, median in medians.items()}
    row = one("a", None, rmse=Interval(0.001, 0.0005, 0.003), **values)
    assert row.error_text("{:.3g}".format) == "<0.002"
    shown = [row.text(name, "{:.3g}".format) for name in ("rmse_pen", "noise", "iou", "width")]
    assert shown == ["0.01", "<0.005", "0.9", "–"]


def test_a_map_that_was_scored_at_one_offset_is_marked() -> None:
    two = [result(phase=0), result(0.6, phase=1)]
    for cells, phases in ((two, 2), (two[:1], 1)):
        (row,) = configurations(*cells)
        assert (row.phases, row.single_phase) == (phases, phases == 1)
    without, lost = result(size=None, spec="volume"), result(spec="lost", time=UNTIMED)
    assert not any(row.single_phase for row in configurations(without, lost)), "no map, or none that held"


def test_a_mean_over_scenes_has_the_fewest_phases_of_them_and_no_value_that_one_lacks() -> None:
    found = mean([one(phases=2, iou=Interval(0.2), contact=Interval(0.1)), one(iou=Interval(0.4), contact=None)])
    assert (found.cells, found.phases) == (2, 1)
    assert (found.value("iou"), found.value("contact")) == (pytest.approx(0.3), None)


@pytest.mark.parametrize(("iqr", "rough"), [(None, False), (0.99, False), (1.0, False), (1.01, True)])
def test_a_time_whose_middle_half_spans_more_than_a_third_of_it_is_rough(iqr: float | None, rough: bool) -> None:
    values = {"frame_ms": Interval(3.0), "frame_iqr_ms": None if iqr is None else Interval(iqr)}
    assert one(**values).rough is rough
    assert not one(frame_iqr_ms=Interval(9.0)).rough


def test_a_preset_is_printed_by_its_name_and_other_specs_as_they_are() -> None:
    known = techniques()
    for text in ("shadow-map:preset=three", "cascades:preset=godot", "cube-map:preset=course"):
        spec = parse_spec(f"{text},size=128", known).sizeless_text
        assert one(spec).name == text
        assert one(f"{spec},cull=false").name == f"{spec},cull=false"
    beside = configurations(*(result(spec=spec, full_spec=f"{spec},blend=0.1") for spec in ("a", "a:blend=0.1")))
    assert {row.name for row in beside} == {"a", "a:blend=0.1"}, "without parameters at their defaults"


@pytest.mark.parametrize(("bias", "text"), [(0.9, "1 wide"), (-0.9, "1 narrow"), (0.2, "1"), (None, "1")])
def test_the_width_of_penumbrae_has_a_direction(bias: float | None, text: str) -> None:
    values = {"width": Interval(1.0), "width_bias": None if bias is None else Interval(bias)}
    assert one("pcss", **values).text("width", "{:g}".format) == text
