"""Normalisation of times from different blocks to one reference time."""

from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.measure.rows import Result
from shadowbench.results.frame import cells_frame
from shadowbench.results.times import DRIFT, ReferenceTime, normalise_times, pareto_front, time_notes
from shadowbench.scores.metrics import METRICS
from tests.results.cells import cell
from tests.runs import summaries_of


def timed(spec: str, frame_ms: float, reference_ms: float = 10.0, iqr: float = 0.02, **of: Any) -> Result:
    """A cell and its time, in a block in which the reference took `reference_ms`; `iqr` is the ratio's.

    of: other fields of the time record, or the cell's scene, view and light.
    """
    score = {name: of.pop(name) for name in ("scene", "view", "light") if name in of}
    time = {
        "frame_ms": frame_ms, "frame_iqr_ms": 99.0, "ratio": frame_ms / reference_ms, "ratio_iqr": iqr,
        "reference": "shadow-map:size=1024", "reference_ms": reference_ms, "added_ms": frame_ms - 1, "wall_ms": None,
        "still_ms": 0.0, "camera_ms": frame_ms / 2, "light_ms": frame_ms, "prepare_ms": 7.0,
        "passes": {"depth": {"ms": frame_ms / 2}},
    }  # fmt: skip
    return Result(cell(spec, size=None, metrics=dict.fromkeys(METRICS), **({"scene": "cube"} | score)), time | of)


# One cell of a quiet block, the reference itself, and one of a block at half the speed.
MIXED = [timed("slow", 18.0), timed("reference", 10.0), timed("fast", 16.0, reference_ms=20.0)]


def shown(*cells: Result) -> pd.DataFrame:
    return normalise_times(cells_frame(cells))[0].set_index("spec")


def reference_of(*cells: Result) -> ReferenceTime:
    reference = normalise_times(cells_frame(cells))[1]
    assert reference is not None
    return reference


def test_cells_of_different_blocks_are_ordered_by_their_ratios() -> None:
    frame = cells_frame(MIXED)
    assert frame["frame_ms"].tolist() == [18, 10, 16], "as they were measured, in the table of cells"
    times = shown(*MIXED)["frame_ms"]
    assert times.to_dict() == pytest.approx({"slow": 1.8 * 15, "reference": 15, "fast": 0.8 * 15})
    rows = {one.spec: one.frame_ms for one in summaries_of(*MIXED)["cube"].lines}
    assert rows == pytest.approx(times.to_dict())


def test_the_interquartile_range_of_the_reference_is_that_of_its_own_rounds() -> None:
    """Its ratio to itself has none, and 0 would read as perfect timing."""
    cells = [timed("reference", 10.0, iqr=0.0, frame_iqr_ms=3.0), timed("a", 16.0, 20.0, iqr=0.1)]
    spread = shown(*cells)["frame_iqr_ms"]
    assert spread.to_dict() == pytest.approx({"reference": 3.0 * 15 / 10, "a": 0.1 * 15})


def test_a_time_with_another_reference_or_none_is_not_compared() -> None:
    other = timed("other", 5.0, reference="unshadowed")
    none = timed("none", 5.0, ratio=None, ratio_iqr=None)
    frame, reference = normalise_times(cells_frame([*MIXED, other, none]))
    left = frame.set_index("spec").loc[["other", "none"]]
    columns = ["frame_ms", "frame_iqr_ms", "ratio", "added_ms", "light_ms", "pass_depth_ms"]
    assert left[columns].isna().all(axis=None)
    assert frame["frame_ms"].notna().sum() == 3
    assert reference is not None and (reference.ms, reference.left_out) == (15, 2)
    assert "times of 2 cells left out: they have no ratio to shadow-map:size=1024" in time_notes(reference)


def test_a_table_says_where_the_reference_took_longer_by_more_than_a_quarter() -> None:
    for longest, drifted in ((10 * DRIFT, False), (10 * DRIFT + 0.1, True)):
        reference = reference_of(timed("a", 1.0), timed("b", 1.0, longest))
        assert (reference.drifted, any("load of the machine" in one for one in time_notes(reference))) == (drifted,) * 2


def test_a_reference_that_costs_more_in_another_view_is_no_drift_of_the_machine() -> None:
    cells = [timed("a", 1.0), timed("a", 1.0, 30.0, view="b"), timed("a", 1.0, 20.0, light="lamp")]
    reference = reference_of(*cells)
    assert not reference.drifted and reference.blocks == 3
    reference = reference_of(*cells, timed("b", 1.0, 40.0, view="b"))
    assert reference.drifted
    assert (reference.shortest_ms, reference.longest_ms) == (30, 40), "of the view whose blocks differ"


SMALL = st.integers(0, 5).map(float)  # few values, so that ties are met


@given(st.lists(st.tuples(SMALL, SMALL), max_size=25))
def test_the_front_has_the_points_that_no_other_dominates(points: list[tuple[float, float]]) -> None:
    def beaten(one: tuple[float, float]) -> bool:
        return any(other[0] <= one[0] and other[1] <= one[1] and other != one for other in points)

    found = pareto_front(points)
    assert set(found) == {index for index, point in enumerate(points) if not beaten(point)}
    assert [points[index][0] for index in found] == sorted(points[index][0] for index in found)
    assert [points[index][1] for index in found] == sorted((points[index][1] for index in found), reverse=True)
