"""Times and scores of every technique at its defaults, at each map size, in the scenes of the study `trends`.

pytest benchmarks/test_techniques.py -k "colonnade and shadow-map"
"""

from collections.abc import Callable
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.campaign import Cell
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene
from shadowbench.studies.study import find_study, read_study

STUDY = read_study(find_study("trends"), techniques())


@pytest.fixture(scope="module", params=STUDY.scenes)
def scene(request: pytest.FixtureRequest) -> Scene:
    return load_scene(request.param)


def _id(cell: Cell) -> str:
    return "-".join(filter(None, (cell.spec.sizeless_text, str(cell.spec.map_size or ""))))


@pytest.mark.parametrize(
    ("cell", "map_size"), [pytest.param(cell, cell.spec.map_size, id=_id(cell)) for cell in STUDY.cells()]
)
def test_frame(
    scene: Scene,
    cell: Cell,
    map_size: int | None,
    smallest: bool,
    growth: Any,
    shadow_benchmark: Callable[..., Any],
    benchmark: BenchmarkFixture,
) -> None:
    shadow_benchmark(cell.spec.full_text, scene=scene, view_size=64 if smallest else STUDY.view_size)
    if map_size:
        growth.add(f"{scene.name}: {cell.spec.sizeless_text} over map size", map_size, benchmark, "frame_ms")
