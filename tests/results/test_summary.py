"""Summaries: medians, intervals and means over scenes of known values."""

import math
from typing import Any

import numpy as np
import pytest

from shadowbench.measure.rows import Result
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.summary import Interval, Setting, Summary, interval, over_scenes
from shadowbench.scores.metrics import METRICS
from tests.results.cells import cell
from tests.runs import summaries_of

FAILED = {"status": "failed: crashed"}


def result(iou: float = 0.5, size: int | None = 64, time: dict[str, Any] | None = None, **score: Any) -> Result:
    """A cell with an IoU, of some other metrics if given."""
    metrics = dict.fromkeys(METRICS) | {"iou": iou} | score.pop("metrics", {})
    return Result(cell(score.pop("spec", "t"), score.pop("scene", "cube"), size, metrics=metrics, **score), time)


def timed(ratio: float, **times: Any) -> dict[str, Any]:
    reference = {"reference": "r", "reference_ms": 10.0, "frame_ms": 10 * ratio, "frame_iqr_ms": 0.1}
    return {"ratio": ratio, "ratio_iqr": 0.01, "passes": {}} | reference | times


def summary(*cells: Result) -> Summary:
    (only,) = summaries_of(*cells).values()
    return only


def settings(*cells: Result) -> list[Setting]:
    return summary(*cells).lines


def test_a_setting_has_medians_over_views_of_the_cells_that_succeeded() -> None:
    views = [("a", 0.1, 0.1), ("b", 0.2, 0.2), ("c", 0.9, 3)]
    lost = result(0.0, view="d", time=FAILED)
    (row,) = settings(*(result(iou, view=view, time=timed(ratio)) for view, iou, ratio in views), lost)
    assert (row.cells, row.refused, row.scored) == (3, ("failed: while timed: crashed",), 0)
    assert (row.iou, row.frame_ms, row.error) == pytest.approx((0.2, 2, 0.8))
    assert (row.low, row.high) == pytest.approx((0.1, 0.9)), "of the error, the ends exchanged"
    assert (row.iou_least, row.iou_most) == (0.1, 0.9) and math.isnan(row.ssim)


def test_the_interval_is_the_middle_95_percent_of_the_median() -> None:
    # The median of 401 draws from 0, 1, …, 400 lies at rank 200 ± 10 (one standard deviation), about normally.
    found = interval([*np.random.default_rng(1).permutation(401).astype(float), float("nan")])
    assert found is not None and found.median == 200
    assert (found.low, found.high) == pytest.approx((200 - 1.96 * 10, 200 + 1.96 * 10), abs=2)
    assert interval([3.0]) == Interval(3.0, pytest.approx(math.nan, nan_ok=True), pytest.approx(math.nan, nan_ok=True))
    assert interval([]) is interval([float("nan")]) is None


def test_lights_of_one_scene_are_summaries_of_their_own() -> None:
    """Techniques that support only a sun must not be compared with medians that include lamps."""
    cells = [result(0.9), result(light="lamp"), result(0.8, spec="cascades")]
    specs = {scene: [row.spec for row in one.lines] for scene, one in summaries_of(*cells).items()}
    assert specs == {"cube, sun": ["t", "cascades"], "cube, lamp": ["t"]}
    assert list(summaries_of(cells[0])) == ["cube"], "one light needs no name"


def test_soft_shadows_are_ranked_by_rmse_and_hard_ones_by_iou() -> None:
    """A truth without penumbrae leaves `rmse_pen` undefined."""
    for rmse_pen, order in ((None, ["sharp", "wide"]), (0.5, ["wide", "sharp"])):
        one = summary(
            *(
                result(iou, spec=spec, metrics={"rmse": rmse, "rmse_pen": rmse_pen}, truth_error=0.01)
                for spec, iou, rmse in (("sharp", 0.9, 0.2), ("wide", 0.8, 0.1))
            )
        )
        assert [row.spec for row in one.lines] == order and one.soft is (rmse_pen is not None)
        assert one.lines[0].truth_error == 0.01


def test_a_mean_over_scenes_has_the_fewest_phases_of_them_and_no_value_that_one_lacks() -> None:
    cells = [
        *(result(iou, phase=phase, metrics={"contact": 0.1}) for phase, iou in enumerate((0.2, 0.2))),
        result(0.4, scene="post"),
        result(0.9, scene="post", spec="elsewhere"),
        result(0.9, spec="elsewhere", status="unsupported: no ground"),
    ]
    scenes = list(summaries_of(*cells).values())
    both = over_scenes(scenes, "both")
    row, elsewhere = both.lines
    assert (row.cells, row.phases, row.scored, elsewhere.scored, elsewhere.unsupported) == (3, 1, 2, 1, 1)
    assert row.iou == pytest.approx(0.3) and math.isnan(row.contact) and math.isnan(row.iou_least)
    assert [one.spec for one in both.shown] == ["t"] and both.missing(elsewhere) == 0
    assert over_scenes(scenes[:1], "one") is scenes[0]


def test_a_time_whose_middle_half_spans_more_than_a_third_of_it_is_rough() -> None:
    for iqr, rough in ((0.099, False), (0.101, True)):
        (row,) = settings(result(time=timed(0.3, ratio_iqr=iqr)))
        assert row.rough is rough


def test_a_preset_is_called_by_its_name_and_other_specs_as_they_are() -> None:
    known = techniques()
    for text in ("shadow-map:preset=three", "cascades:preset=godot", "cube-map:preset=course"):
        spec = parse_spec(f"{text},size=128", known).sizeless_text
        names = {row.spec: row.name for row in settings(result(spec=spec), result(spec=f"{spec},cull=false"))}
        assert names == {spec: text, f"{spec},cull=false": f"{spec},cull=false"}
