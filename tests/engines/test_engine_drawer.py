"""Other engines as drawers: what they draw is measured, and what they draw wrongly is a failed cell."""

import shutil
from typing import Any
from unittest.mock import Mock

import numpy as np
import psutil
import pytest

from shadowbench.engines.drawer import EngineDrawer
from shadowbench.engines.environment import environment, what_lacks
from shadowbench.errors import InputError, Unsupported
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.drawer import CellFailed
from shadowbench.measure.rendering import Rendering
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view
from shadowbench.truths.cache import cached_truth
from tests.engines.conftest import SIZE


def drawn(engine: type[Engine], view: View, fault: str = "none", **params: Any) -> Rendering:
    (engine.folder() / "fault").write_text(fault)
    spec = Spec(engine, EngineParams(**params))
    with EngineDrawer(Mock()) as drawer:
        (rendering,) = drawer.draw(Block(view, (Cell(spec),)), Cell(spec))
    return rendering


def test_an_engine_that_draws_the_truth_has_its_mask(engine: type[Engine], view: View) -> None:
    found, truth = drawn(engine, view), cached_truth(view)
    inside = truth.receivers & ~truth.undecided
    assert found.measurable is not None
    assert found.measurable[inside].all()
    assert np.abs(found.visibility - truth.visibility)[inside].max() < 0.02
    assert found.engine == {"version": "1.0", "renderer": "a test", "box": "own", "phase": "none"}


def test_what_an_engine_prints_is_no_answer(engine: type[Engine], view: View) -> None:
    assert np.array_equal(drawn(engine, view, "prints").visibility, drawn(engine, view).visibility)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("dies", "it ended with exit code 3: out of memory"),
        ("raises", "ValueError: no such filter"),
        ("lighter", "lighter with shadows than without"),
        ("noise", "two different pictures"),
        ("upside down", "upside down"),
        ("mirrored", "upside down"),
        ("nothing", "neither black nor white"),
        ("gamma 2.2", "another encoding"),
        ("NaN", "not finite"),
        ("SwiftShader", "4 sub-pixel bits"),
        ("size", "63 × 64"),
    ],
)
def test_a_fault_fails_the_cell(engine: type[Engine], view: View, fault: str, told: str) -> None:
    before = set(psutil.Process().children())
    with pytest.raises(CellFailed, match=told):
        drawn(engine, view, fault)
    assert set(psutil.Process().children()) <= before


def test_a_picture_one_frame_late_fails_the_cell(engine: type[Engine], view: View) -> None:
    with pytest.raises(CellFailed):
        drawn(engine, view, "late")


def test_an_engine_that_hangs_is_ended(engine: type[Engine], view: View) -> None:
    engine.seconds = 3.0
    with pytest.raises(CellFailed, match="no answer to 'draw' within 3 s"):
        drawn(engine, view, "hangs")


def test_a_light_that_an_engine_does_not_draw_is_unsupported(engine: type[Engine]) -> None:
    with pytest.raises(Unsupported, match="a point light; fake draws directional ones"):
        drawn(engine, chosen_view("room-with-lamp", SIZE))


def test_an_engine_that_is_not_installed_says_how(engine: type[Engine], view: View) -> None:
    shutil.rmtree(environment(engine))
    assert what_lacks(engine) == "not installed: shadowbench engines install fake"
    with pytest.raises(InputError, match="fake: not installed: shadowbench engines install fake"):
        drawn(engine, view)
