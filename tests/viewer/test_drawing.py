"""What the window draws is what `render` draws, and its scores are of the masks on screen and of no others."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import psutil
import pytest

from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import download
from shadowbench.measure.points import motion_scores
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.options import ViewSize
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import View
from shadowbench.scores.comparison import PreparedTruth
from shadowbench.scores.difference import FACETS, FALSE_LIGHT, FALSE_SHADOW
from shadowbench.scores.metrics import score
from shadowbench.truths.trace import trace
from shadowbench.viewer.camera import orbited, with_kind
from shadowbench.viewer.controls import status
from shadowbench.viewer.drawing import LEAST_SIZE, Drawing, Viewer, moving_size
from shadowbench.viewer.judge import Traced
from shadowbench.viewer.state import ViewerState

SIZE, SQUARE = ViewSize(64, 48), ViewSize(512, 512)
KNOWN = techniques()
Settle = Callable[[Viewer], None]
BROKEN = """
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Broken(Technique):
    '''Breaks in many ways.'''
    name = "broken"
    class Params(TechniqueParams):
        '''Parameters.'''
        how: str = param("build", "where it breaks")
    @classmethod
    def unsupported(cls, params, view, device):
        return 1 / 0 if params.how == "unsupported" else None
    def build(self, stage):
        if self.params.how == "build":
            raise KeyError("nothing there")
        if self.params.how == "shader":
            stage.program("fullscreen.vert", "out float x;\\nvoid main() { x = nothing; }\\n")
        self.texture = stage.texture()
        self.wide = stage.texture((8, 8))
        if self.params.how == "nan":
            self.texture.write(b'\\xff' * 4 * stage.size.pixels)
    def draw(self, frame):
        if self.params.how == "exit":
            raise SystemExit(3)
        if self.params.how == "gl":
            frame.clock._device.raw("glActiveTexture", 1)
        return self.wide if self.params.how == "size" else self.texture
"""


@pytest.fixture
def drawing(device: Device) -> Iterator[Drawing]:
    drawing = Drawing(device)
    yield drawing
    drawing.release()


def broken(how: str, folder: Path) -> Spec:
    (folder / "broken.py").write_text(BROKEN)
    return parse_spec(f"broken:how={how}", techniques([folder / "broken.py"]))


def state_of(view: View, *specs: str) -> ViewerState:
    parsed = tuple(parse_spec(text, KNOWN) for text in specs)
    return ViewerState(view.scene, view.scene.cameras[0], view.light, parsed, SIZE)


def mask_of(drawing: Drawing, state: ViewerState, size: ViewSize = SIZE) -> np.ndarray:
    drawn = drawing.draw(state, size)
    mask = drawn.visibility(drawn.masks[0])
    drawn.frame.surface.release()
    return mask


@pytest.mark.parametrize(
    ("scene", "spec"),
    [
        ("sphere-and-torus", "cascades:size=64,filter=evsm"),
        ("room-with-lamp", "cube-map:size=64"),
        ("spot-lamp", "hybrid:size=64"),
        ("docs/gallery/terminator.toml", "shadow-map:size=128,bias=terminator+texel"),
    ],
)
def test_the_mask_is_that_of_render_also_after_motion(
    drawing: Drawing,
    builtin: Callable[..., View],
    lent_worker: Callable[..., AbstractContextManager[Worker]],
    scene: str,
    spec: str,
) -> None:
    state = state_of(builtin(scene), spec)
    with lent_worker() as worker:
        request = CellRequest(state.specs[0].full_text)
        expected = worker.call(Session.draw, state.view(), request).visibility
    moved = replace(state, camera=orbited(state.camera, 0.3, 0.1))
    mask_of(drawing, moved, SIZE.times(0.5))
    assert not np.array_equal(mask_of(drawing, moved), expected)
    assert np.array_equal(mask_of(drawing, state), expected)


@pytest.mark.parametrize(
    ("sequence", "spec"),
    [
        ("dolly", "cascades:size=64"),
        ("pan", "shadow-map:size=64,history=exponential"),
        ("moving-caster", "shadow-map:size=64,history=exponential"),
        ("quick-sun", "shadow-map:size=64,update=every(n=3)"),
    ],
)
def test_a_frame_is_that_of_a_run_whichever_was_shown_before(
    drawing: Drawing,
    builtin: Callable[..., View],
    lent_worker: Callable[..., AbstractContextManager[Worker]],
    sequence: str,
    spec: str,
) -> None:
    """Also of what remembers the frames before: a jump to a frame draws them all."""
    state = replace(state_of(builtin("stairs"), spec), sequence=sequence)
    with lent_worker() as worker:
        request = CellRequest(state.specs[0].full_text)
        expected = [
            worker.call(Session.draw, view, request, index=index).visibility
            for index, view in enumerate(state.frames[:6])
        ]
    for frame in (0, 1, 2, 5, 4, 0, 1):
        assert np.array_equal(mask_of(drawing, replace(state, frame=frame)), expected[frame]), frame
    assert not np.array_equal(expected[0], expected[5])


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("unsupported", "ZeroDivisionError: division by zero"),
        ("shader", "ShaderError: fragment shader: "),
        ("exit", "SystemExit: 3"),
        ("gl", "RuntimeError: OpenGL error GL_INVALID_ENUM in drawing broken"),
        ("size", "ValueError: broken:how=size drew 8 × 8 pixels; allowed: 64 × 48"),
    ],
)
def test_what_a_technique_breaks_is_shown_and_the_other_is_drawn(
    drawing: Drawing, builtin: Callable[..., View], tmp_path: Path, how: str, message: str
) -> None:
    state = state_of(builtin("cube-on-plane"), "unshadowed", "shadow-map:size=65536")
    drawn = drawing.draw(replace(state, specs=(broken(how, tmp_path), *state.specs)), SIZE)
    assert drawn.masks[0].failure.startswith(message)
    assert drawn.masks[1].visibility is not None
    assert drawn.masks[2].failure == "unsupported: the driver refuses a map of 65536² texels in d32f"
    drawn.frame.surface.release()


def test_overlays_show_the_error_and_the_mask(device: Device, drawing: Drawing, builtin: Callable[..., View]) -> None:
    state = state_of(builtin("sphere-and-torus"), "cascades:size=64,filter=hard")
    drawn = drawing.draw(state, SIZE)
    mask = drawn.visibility(drawn.masks[0])
    lit, facets = mask > 0.5, np.tri(*SIZE.shape, dtype=bool)
    wrong = Traced((~lit).astype(np.float32), np.ones(SIZE.shape, bool), facets, soft=False)

    def pane(source: Any, **how: Any) -> np.ndarray:
        texture = drawing.picture(drawn, replace(state, **how), source, wrong)
        pixels = download(texture, "u1")[..., :3].astype(int)
        device.free((texture,))
        return pixels

    assert np.array_equal(pane("A", overlay="mask")[..., 0], np.rint(mask * 255))
    error = pane("A", overlay="error")  # everything is wrong
    assert np.abs(error[lit] - FALSE_LIGHT).max() <= 1
    assert np.abs(error[~lit & ~facets] - FALSE_SHADOW).max() <= 1
    assert np.abs(error[~lit & facets] - FACETS).max() <= 1
    assert np.array_equal(pane("truth", overlay="mask")[..., 0], 255 * ~lit), "of the truth it is the truth"
    drawn.frame.surface.release()


def test_a_moving_image_is_smaller_on_a_software_renderer_only() -> None:
    assert [moving_size(SQUARE, ms, True).height for ms in (10, 60, 150, 1000)] == [512, 256, 256, 128]
    assert moving_size(SQUARE, 1000, False) == SQUARE
    assert moving_size(ViewSize(160, 100), 1000, True) == (102, LEAST_SIZE)
    assert moving_size(ViewSize(16, 16), 1000, True) == (16, 16)


def test_at_rest_the_scores_are_those_of_the_truth_and_stale_after_a_move(viewer: Viewer, settle: Settle) -> None:
    settle(viewer)
    assert status(viewer) == "scored at 64 against the full truth"
    truth, drawn = trace(viewer.state.view(), 1), viewer.drawn
    prepared, traced = prepare_truth(truth), viewer.judge.traced(viewer.state)
    assert drawn is not None and traced is not None
    assert np.array_equal(traced.visibility, truth.visibility)
    assert np.array_equal(traced.scored, truth.receivers & ~truth.undecided)
    for mask in drawn.masks:
        scores = viewer.judge.scores[mask.spec.full_text]
        assert dict(scores).items() >= score(drawn.visibility(mask), prepared).items()
    viewer.change(replace(viewer.state, wipe=0.3, overlay="error"))
    viewer.step()
    assert viewer.drawn is drawn and viewer.waiting, "nothing is drawn again without a change of the view"
    before = viewer.state
    viewer.change(replace(before, camera=orbited(before.camera, 0.2, 0.0)))
    viewer.step()
    assert viewer.moving and not viewer.fresh
    settle(viewer)
    viewer.change(before)
    viewer.step()
    assert not viewer.fresh


def test_a_sequence_plays_frame_by_frame_with_its_truth_and_its_flicker_so_far(viewer: Viewer, settle: Settle) -> None:
    viewer.change(replace(viewer.state, layout="side by side", overlay="mask"))
    viewer.show_sequence("pan")
    settle(viewer)
    shown, spec = [], viewer.state.specs[0].full_text
    viewer.playing = True
    while len(shown) < 5:
        if viewer.fresh and viewer.drawn is not None:
            assert viewer.state.frame == len(shown), "each is shown and scored before the next"
            shown.append((viewer.drawn.visibility(viewer.drawn.masks[0]), trace(viewer.state.view(), 1)))
            flicker = motion_scores(shown)["flicker"]
            assert viewer.judge.scores[spec]["flicker"] == (pytest.approx(flicker) if len(shown) > 1 else None)
            for source, grey in (("A", shown[-1][0]), ("truth", shown[-1][1].visibility)):
                assert np.array_equal(download(viewer.pictures[source], "u1")[..., 0], np.rint(grey * 255)), source
        viewer.step()
        time.sleep(0.002)
    viewer.playing = False
    for frame, known in ((0, True), (1, True), (3, False), (4, False), (24, True)):
        viewer.to_frame(frame)
        settle(viewer)
        assert ("flicker" in viewer.judge.scores[spec]) == known, "it is of frames in order from the first on"
    assert viewer.state.frame == 0, "after the last one"


def test_why_nothing_is_scored_is_said_and_a_dead_process_is_replaced(
    viewer: Viewer, settle: Settle, clock: Any
) -> None:
    viewer.step()
    psutil.Process(viewer.judge._process.pid).suspend()  # so that it has no answer before it is killed
    clock.now += 1.0
    viewer.step()
    viewer.step()
    assert viewer.judged and status(viewer) == "tracing the truth of this view …"
    viewer.judge._process.kill()
    while not viewer.judge.failure:
        viewer.step()
    assert status(viewer) == "not scored: the process that traces ended (code -9)"
    viewer.change(viewer.state.with_spec(1, parse_spec("unshadowed", KNOWN)))
    viewer.step()
    assert status(viewer) == "moving: scores follow at rest"
    settle(viewer)
    camera = viewer.state.camera
    viewer.change(replace(viewer.state, camera=replace(camera, position=camera.target)))
    viewer.step()
    assert "position and target are 0 m apart" in viewer.broken
    viewer.change(replace(viewer.state, camera=camera))
    settle(viewer)
    assert viewer.broken == ""


def test_a_mask_that_is_not_drawn_or_nan_has_no_scores(viewer: Viewer, clock: Any, tmp_path: Path) -> None:
    for how, message in (
        ("build", "KeyError: 'nothing there'"),
        ("nan", "ValueError: broken:how=nan drew visibility is NaN or infinite in 4096 of 4096 pixels"),
    ):
        viewer.change(viewer.state.with_spec(0, broken(how, tmp_path)))
        viewer.step()
        clock.now += 1.0
        viewer.step()
        assert message in (viewer.message, viewer.failures[0])
        while not viewer.fresh:
            time.sleep(0.01)
            viewer.step()
        assert viewer.judge.scores.keys() == {viewer.state.specs[1].full_text}
        assert status(viewer) == f"scored at 64 against the full truth; A has no mask: {viewer.failures[0]}"


@pytest.mark.slow
def test_scores_that_are_shown_as_fresh_are_always_of_what_is_shown(viewer: Viewer, clock: Any) -> None:
    """Whatever is done, in whatever order, while the process beside traces and scores, or dies."""
    random, truths, checked = Random(5), dict[object, PreparedTruth](), 0
    specs = [parse_spec(text, KNOWN) for text in ("shadow-map:size=32", "shadow-volume", "cube-map:size=32", "hybrid")]
    cameras = [orbited(viewer.state.camera, 0.1 * turn, 0.05) for turn in range(3)]
    for number in range(200):
        state, what = viewer.state, random.randrange(10)
        if what == 0:
            viewer.change(replace(state, camera=random.choice(cameras), size=random.choice((SIZE, ViewSize(48, 27)))))
        elif what == 1:
            viewer.change(state.with_spec(random.randrange(2), random.choice(specs)))
        elif what == 2:
            kind = random.choice(("directional", "spot", "point"))
            viewer.change(replace(state, light=with_kind(state.scene.lights[0], kind, state.scene)))
        elif what == 3 and number % 10 == 0:
            viewer.judge._process.kill()
        clock.now += random.choice((0.01, 0.3))
        time.sleep(random.choice((0.0, 0.02, 0.1)))
        viewer.step()
        end = time.monotonic() + 5.0
        while number % 8 == 0 and not viewer.fresh and time.monotonic() < end:  # slow machines need the time
            clock.now += 0.3
            time.sleep(0.01)
            viewer.step()
        if not viewer.fresh or viewer.drawn is None:
            continue
        viewed = viewer.state.viewed
        truths[viewed] = truths.get(viewed) or prepare_truth(trace(viewer.state.view(), 1))
        for mask in viewer.drawn.masks:
            if scores := viewer.judge.scores.get(mask.spec.full_text):
                assert scores.items() >= score(viewer.drawn.visibility(mask), truths[viewed]).items()
                checked += 1
    assert checked > 20
