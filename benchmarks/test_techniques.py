"""Times and scores of every technique at its defaults, at each map size, in the scenes of the study `trends`.

pytest benchmarks/test_techniques.py -k "colonnade and shadow-map"
"""

from typing import Any, NamedTuple

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.campaign import Cell
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.model import View
from shadowbench.scores.comparison import PreparedTruth
from shadowbench.studies.study import find_study, read_study
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

STUDY = read_study(find_study("trends"), techniques())


class ScoringView(NamedTuple):
    """A view and the truth that its cells are scored against."""

    view: View
    truth: Truth
    prepared: PreparedTruth


@pytest.fixture(scope="module", params=STUDY.scenes)
def scoring_view(request: pytest.FixtureRequest, smallest: bool) -> ScoringView:
    study = STUDY.with_(view_size=64) if smallest else STUDY
    (block,) = study.with_(scenes=(request.param,)).blocks()
    truth = cached_truth(block.view)
    return ScoringView(block.view, truth, prepare_truth(truth))


def _id(cell: Cell) -> str:
    return "-".join(filter(None, (cell.spec.sizeless_text, str(cell.spec.map_size or ""))))


@pytest.mark.parametrize(
    ("cell", "map_size"), [pytest.param(cell, cell.spec.map_size, id=_id(cell)) for cell in STUDY.cells()]
)
def test_frame(
    scoring_view: ScoringView, cell: Cell, map_size: int | None, cells: Any, growth: Any, benchmark: BenchmarkFixture
) -> None:
    view, truth, prepared = scoring_view
    benchmark.group = view.scene.name
    rendering = cells.time(benchmark, view, cell.spec.full_text)
    record = mask_record(rendering.visibility, truth, prepared, cells.session.surface(view).triangle)
    benchmark.extra_info |= record["metrics"] | {
        "spec": cell.spec.text,
        "mask_sha256": record["mask_sha256"],
        **{f"work_{name}": count for name, count in rendering.work.items()},
    }
    assert np.isfinite(rendering.visibility).all()
    if map_size:
        growth.add(f"{view.scene.name}: {cell.spec.sizeless_text} over map size", map_size, benchmark)
