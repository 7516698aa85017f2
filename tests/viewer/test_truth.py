"""The truth that comes beside the drawing: coarse to full, and scored as `score` does."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import View
from shadowbench.scores.metrics import score
from shadowbench.truths.trace import trace
from shadowbench.viewer.truth import Answer, Failed, Scored, TruthTask

SIZE = 128
LIT, DARK = (np.full((SIZE, SIZE), level, dtype=np.float32) for level in (1.0, 0.0))


@pytest.fixture(scope="module")
def task() -> Iterator[TruthTask]:
    task = TruthTask()
    yield task
    task.stop()


def last_answers(task: TruthTask) -> list[Answer]:
    """The answers up to scores or a failure."""
    found: list[Answer] = []
    while not any(isinstance(one, Scored | Failed) for one in found):
        time.sleep(0.01)
        found += task.answers()
    return found


def test_a_view_is_traced_coarsely_then_fully_once_and_masks_are_scored(
    task: TruthTask, builtin: Callable[..., View]
) -> None:
    view = builtin("cube-on-plane", SIZE)
    number = task.ask(view, {"lit": LIT, "dark": DARK})
    *traced, scored = last_answers(task)
    assert [(len(one.visibility), one.final) for one in traced] == [(16, False), (32, False), (128, True)]
    truth = trace(view)
    assert np.array_equal(traced[-1].visibility, truth.visibility)
    assert np.array_equal(traced[-1].scored, truth.receivers & ~truth.undecided)
    assert not traced[-1].facets.any(), "of flat surfaces"
    prepared = prepare_truth(truth)
    assert scored.scores == {"lit": score(LIT, prepared), "dark": score(DARK, prepared)}
    assert {one.number for one in (*traced, scored)} == {number}
    assert task.ask(replace(view), {"dark": DARK}) > number
    (again,) = last_answers(task)  # no truth among the answers
    assert again.scores == {"dark": score(DARK, prepared)}


def test_what_cannot_be_traced_is_told_and_the_next_view_is_traced(
    task: TruthTask, builtin: Callable[..., View]
) -> None:
    view = builtin("cube-on-plane", SIZE)
    away = replace(view, camera=replace(view.camera, target=(100.0, 100.0, 100.0), near=0.1, far=100.0))
    task.ask(away, {})
    (failed,) = last_answers(task)
    assert isinstance(failed, Failed) and "shows nothing" in failed.reason
    number = task.ask(replace(view, light=replace(view.light, direction=(0.1, -1.0, 0.1))), {"lit": LIT})
    assert last_answers(task)[-1].number == number


def test_a_process_that_dies_is_told_and_replaced(task: TruthTask, builtin: Callable[..., View]) -> None:
    task._process.kill()
    (failed,) = last_answers(task)
    assert isinstance(failed, Failed) and "the process that traces ended" in failed.reason
    task.ask(builtin("post", SIZE), {"lit": LIT})
    assert isinstance(last_answers(task)[-1], Scored)
