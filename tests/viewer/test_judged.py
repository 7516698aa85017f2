"""Scores and truths are shown for the masks on screen and for no others."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import psutil
import pytest

from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scores.comparison import PreparedTruth
from shadowbench.scores.metrics import score
from shadowbench.truths.trace import trace
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.canvas import label
from shadowbench.viewer.lights import with_kind
from shadowbench.viewer.navigation import orbited
from shadowbench.viewer.result_panels import status
from shadowbench.viewer.truth import Answer, Failed, Judge, Scored, Traced

LEVEL = """
from pathlib import Path
import numpy as np
from shadowbench.plugin.base import Technique
class Level(Technique):
    '''The visibility that a file has, as if it were a shader.'''
    name = "level"
    def build(self, stage):
        level = float((Path(__file__).parent / "level.glsl").read_text())
        if level < 0:
            raise RuntimeError("less than none")
        self.texture = stage.texture()
        self.texture.write(np.full(stage.size, level, dtype=np.float32))
    def draw(self, frame):
        return self.texture
"""
SCORED = "scored at 64² against the full truth"
Settle = Callable[[Viewer], None]


@pytest.fixture
def level(viewer: Viewer, tmp_path: Path) -> Spec:
    """A technique, shown as A, whose mask a file says."""
    (tmp_path / "plugin.py").write_text(LEVEL)
    (tmp_path / "level.glsl").write_text("1.0")
    spec = parse_spec("level", techniques([tmp_path / "plugin.py"]))
    viewer.change(viewer.state.with_spec(0, spec))
    viewer._read_changed_files()
    return spec


def test_at_rest_the_scores_are_those_of_the_truth_and_stale_after_a_move(viewer: Viewer, settle: Settle) -> None:
    settle(viewer)
    prepared = prepare_truth(trace(viewer.state.view()))
    assert viewer.drawn is not None
    for mask in viewer.drawn.masks:
        expected = score(viewer.drawing.visibility(viewer.drawn, mask), prepared)
        assert dict(viewer.judge.scores[mask.spec.full_text]) == expected
        assert viewer.work[mask.spec]["draws"] > 0
    viewer.change(replace(viewer.state, camera=orbited(viewer.state.camera, 0.2, 0.0)))
    viewer.step()
    assert viewer.moving and not viewer.fresh
    settle(viewer)
    viewer.undo()
    viewer.step()
    assert not viewer.fresh


def test_after_a_changed_shader_the_scores_are_of_the_new_mask(
    viewer: Viewer, settle: Settle, level: Spec, tmp_path: Path
) -> None:
    settle(viewer)
    assert viewer.fresh and status(viewer) == SCORED
    lit = viewer.judge.scores[level.full_text]
    (tmp_path / "level.glsl").write_text("0.0")
    viewer.step()
    assert not viewer.fresh, "the old scores are grey"
    settle(viewer)
    assert viewer.judge.scores[level.full_text]["leak"] == 0.0 != lit["leak"]


def test_a_mask_that_is_no_longer_drawn_has_no_scores(
    viewer: Viewer, settle: Settle, level: Spec, tmp_path: Path
) -> None:
    settle(viewer)
    (tmp_path / "level.glsl").write_text("-1.0")
    viewer.step()
    settle(viewer)
    assert "less than none" in viewer.mask_failures()[0]
    assert viewer.judge.scores.keys() == {viewer.state.specs[1].full_text}
    assert status(viewer) == f"{SCORED}; A has no mask: {viewer.mask_failures()[0]}"


def test_what_is_removed_leaves_no_picture(viewer: Viewer, settle: Settle) -> None:
    viewer.change(replace(viewer.state, layout="wipe", left="A", right="B"))
    settle(viewer)
    assert "B" in viewer.pictures
    viewer.change(replace(viewer.state, specs=viewer.state.specs[:1]))
    viewer.step()
    assert set(viewer.pictures) == {"A"}


def traced(number: int, final: bool) -> Traced:
    return Traced(number, *(np.ones((4, 4)),) * 4, soft=False, final=final)  # type: ignore[arg-type]


def test_a_pane_says_of_which_truth_it_is(viewer: Viewer, settle: Settle) -> None:
    viewer.change(replace(viewer.state, layout="side by side", overlay="error"))
    viewer.step()
    assert label(viewer, "A") == "A: shadow-map: size=64 (error follows the truth)"
    assert label(viewer, "truth") == "truth (tracing)"
    settle(viewer)
    assert (label(viewer, "A"), label(viewer, "truth")) == ("A: shadow-map: size=64", "truth")
    viewer.judge._traced = traced(viewer.judge._number, False)
    assert label(viewer, "truth") == "truth (coarse truth)"
    viewer.change(replace(viewer.state, size=32))
    viewer.step()
    assert label(viewer, "truth") == "truth (of an earlier view)"


class Task:
    """Stands for the process: numbers questions, and gives the answers that a test puts into it."""

    def __init__(self) -> None:
        self.number, self.given = 0, list[Answer]()

    def ask(self, view: object, masks: object) -> int:
        self.number += 1
        return self.number

    def answers(self) -> list[Answer]:
        given, self.given = self.given, []
        return given


def test_only_answers_to_the_last_question_are_taken(viewer: Viewer) -> None:
    task, state = Task(), viewer.state
    judge = Judge(task)  # type: ignore[arg-type]
    for _ in range(2):
        judge.ask(state, {})
    task.given = [traced(1, True), Scored(1, {"a": {"iou": 0.1}})]
    judge.receive()
    assert judge.traced(state) is not None and not judge.is_answered, "a truth of the same view, but not its scores"
    task.given = [Scored(2, {"a": {"iou": 0.3}})]
    judge.receive()
    assert judge.is_answered
    smaller = replace(state, size=32)
    judge.ask(smaller, {})
    judge.ask(state, {})
    task.given = [traced(3, True), Scored(3, {"a": {"iou": 0.4}}), Failed(3, "late")]
    judge.receive()
    assert judge.traced(state) is None and judge.failure == "" and not judge.is_answered
    assert judge.scores == {"a": {"iou": 0.3}}, "earlier scores are kept, and known as such"


def test_why_nothing_is_scored_is_said(viewer: Viewer, clock: Any) -> None:
    viewer.step()
    psutil.Process(viewer.judge.task._process.pid).suspend()  # so that it has no answer before it is killed
    clock.now += 1.0
    viewer.step()
    viewer.step()
    assert viewer.judged and status(viewer) == "tracing the truth of this view …"
    viewer.judge.task._process.kill()
    while not viewer.judge.failure:
        viewer.step()
    assert status(viewer).startswith("not scored: the process that traces ended (code -9)")
    camera = viewer.state.camera
    viewer.change(replace(viewer.state, camera=replace(camera, position=camera.target)))
    viewer.step()
    clock.now += 1.0
    assert status(viewer) == "nothing is drawn, and nothing scored"


@pytest.mark.slow
def test_scores_that_are_shown_as_fresh_are_always_of_what_is_shown(viewer: Viewer, clock: Any) -> None:
    """Whatever is done, in whatever order, while the process beside traces and scores, or dies."""
    random, known, file = Random(5), techniques(), Path(str(viewer.state.origin and viewer.state.origin.source))
    specs = [parse_spec(text, known) for text in ("shadow-map:size=32", "shadow-volume", "cube-map:size=32", "hybrid")]
    cameras = [orbited(viewer.state.camera, 0.1 * turn, 0.05) for turn in range(3)]
    text, truths, checked = file.read_text(), dict[object, PreparedTruth](), 0
    for number in range(200):
        state = viewer.state
        light = with_kind(state.scene.lights[0], random.choice(("directional", "spot", "point")), state.scene)
        random.choice(
            [
                lambda state=state: viewer.change(replace(state, camera=random.choice(cameras))),
                lambda state=state: viewer.change(replace(state, size=random.choice((32, 64)))),
                lambda state=state: viewer.change(state.with_spec(random.randrange(2), random.choice(specs))),
                lambda state=state, light=light: viewer.change(replace(state, light=light)),
                viewer.undo,
                viewer.redo,
                lambda: file.write_text(text.replace("0.5, -1.0", f"{random.choice((0.5, 0.4))}, -1.0")),
                lambda: viewer.judge.task._process.kill() if random.random() < 0.1 else None,
                *[lambda: None] * 8,
            ]
        )()
        clock.now += random.choice((0.01, 0.3))
        time.sleep(random.choice((0.0, 0.02, 0.1)))
        viewer.step()
        end = time.monotonic() + 5.0
        while number % 8 == 0 and not viewer.fresh and time.monotonic() < end:  # slow machines need the time
            clock.now += 0.3
            time.sleep(0.01)
            viewer.step()
        if viewer.fresh and viewer.drawn is not None:
            if viewer.state.viewed not in truths:
                truths[viewer.state.viewed] = prepare_truth(trace(viewer.state.view()))
            for one in viewer.drawn.masks:
                scores = viewer.judge.scores.get(one.spec.full_text)
                if scores is not None:
                    assert one.visibility is not None
                    expected = score(viewer.drawing.visibility(viewer.drawn, one), truths[viewer.state.viewed])
                    assert {name: scores[name] for name in expected} == expected
                    checked += 1
    assert checked > 20
