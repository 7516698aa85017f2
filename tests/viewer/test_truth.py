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
from shadowbench.viewer.truth import Answer, Failed, Scored, Traced, TruthTask

SIZE = 128


@pytest.fixture(scope="module")
def task() -> Iterator[TruthTask]:
    task = TruthTask()
    yield task
    task.stop()


def until(task: TruthTask, enough: Callable[[list[Answer]], bool]) -> list[Answer]:
    found: list[Answer] = []
    while not enough(found):
        time.sleep(0.01)
        found += task.answers()
    return found


def is_scored(found: list[Answer]) -> bool:
    return any(isinstance(one, Scored | Failed) for one in found)


def test_a_view_is_traced_coarsely_then_fully_and_masks_are_scored(
    task: TruthTask, builtin: Callable[..., View]
) -> None:
    view = builtin("cube-on-plane", SIZE)
    mask = np.ones((SIZE, SIZE), dtype=np.float32)
    number = task.ask(view, {"lit": mask})
    answers = until(task, is_scored)
    assert all(one.number == number for one in answers)
    traced = [one for one in answers if isinstance(one, Traced)]
    assert [(len(one.visibility), one.final) for one in traced] == [(16, False), (32, False), (128, True)]
    truth = trace(view)
    assert np.array_equal(traced[-1].visibility, truth.visibility)
    assert np.array_equal(traced[-1].scored, truth.receivers & ~truth.undecided)
    (scored,) = [one for one in answers if isinstance(one, Scored)]
    assert scored.spec == "lit"
    assert scored.scores == score(mask, prepare_truth(truth))


def test_another_mask_of_the_view_is_only_scored(task: TruthTask, builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    number = task.ask(view, {"lit": np.ones((SIZE, SIZE), dtype=np.float32)})
    until(task, is_scored)
    assert task.ask(view, {"dark": np.zeros((SIZE, SIZE), dtype=np.float32)}, again=True) > number
    (scored,) = until(task, is_scored)  # no truth among the answers
    assert isinstance(scored, Scored) and scored.spec == "dark"


def test_what_cannot_be_traced_is_told_and_the_next_view_is_traced(
    task: TruthTask, builtin: Callable[..., View]
) -> None:
    view = builtin("cube-on-plane", SIZE)
    away = replace(view, camera=replace(view.camera, target=(100.0, 100.0, 100.0), near=0.1, far=100.0))
    task.ask(away, {})
    (failed,) = until(task, is_scored)
    assert isinstance(failed, Failed) and "shows nothing" in failed.reason
    moved = replace(view, light=replace(view.light, direction=(0.1, -1.0, 0.1)))
    number = task.ask(moved, {"lit": np.ones((SIZE, SIZE), dtype=np.float32)})
    assert until(task, is_scored)[-1].number == number


def test_a_process_that_dies_is_told_and_replaced(task: TruthTask, builtin: Callable[..., View]) -> None:
    task._process.kill()
    (failed,) = until(task, is_scored)
    assert isinstance(failed, Failed) and "the process that traces ended" in failed.reason
    task.ask(builtin("post", SIZE), {"lit": np.ones((SIZE, SIZE), dtype=np.float32)})
    assert isinstance(until(task, is_scored)[-1], Scored)
