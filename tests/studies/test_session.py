"""A session's own doing around a technique: what it times, and how it counts frames; without GL."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench.gl.clock import WALL, Clock
from shadowbench.studies import session as module
from shadowbench.studies.session import WARM_UP, CellRequest, Session
from shadowbench.techniques.base import Frame, Phase

REQUEST = CellRequest("recorder")


class Bare(Session):
    """A session without a device; its only technique notes the index of every frame that it draws."""

    def __init__(self) -> None:
        context = SimpleNamespace(finish=lambda: None, enable_only=lambda flags: None, wireframe=False)
        self.device: Any = SimpleNamespace(
            context=context, check=lambda what: None, pipeline_statistics=False, software=True, draws=0
        )
        self.clock = Clock(self.device)
        self.view: Any = None
        self._picture_pass: Any = SimpleNamespace(draw=lambda surface, view, texture, tint: None)
        self._held = []
        self.indices: list[int] = []

    def _build(self, request: CellRequest) -> Any:
        def draw(frame: Frame) -> np.ndarray:
            self.indices.append(frame.index)
            self.device.draws += 1
            return np.ones((2, 2, 1), np.float32)

        technique = SimpleNamespace(draw=draw, facts=dict, map_image=lambda: None)
        surface: Any = None
        frame = Frame(self.view, Phase(request.phase), 0, surface, self.clock)
        return technique, SimpleNamespace(release=lambda: None, bytes=0), frame

    def _check(self, request: CellRequest, texture: object) -> None:
        pass


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bare]:
    monkeypatch.setattr(module, "download", lambda texture: texture)
    return Bare()


def test_building_is_timed_in_milliseconds_without_the_warm_up(bare: Bare, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter([5.0, 5.25])
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(ticks))
    assert bare.hold(REQUEST) == 250


def test_frames_of_a_held_cell_are_counted_from_its_build(bare: Bare) -> None:
    bare.hold(REQUEST)
    assert bare.indices == list(range(WARM_UP)) == [0, 1]
    bare.time_frame(0)
    bare.time_passes(0)
    bare.time_frame(0)
    assert bare.indices == [0, 1, 2, 3, 4]


def test_every_held_cell_has_a_count_of_its_own(bare: Bare) -> None:
    bare.hold(REQUEST)
    bare.hold(REQUEST)
    for held in (1, 0, 1):
        bare.time_frame(held)
    assert bare.indices == [0, 1, 0, 1, 2, 2, 3]
    bare.let_go()
    bare.hold(REQUEST)
    assert bare.indices[-2:] == [0, 1]


def test_a_scored_frame_and_its_work_are_both_without_history(bare: Bare) -> None:
    drawn = bare.draw(REQUEST)
    assert bare.indices == [0, 0]
    assert drawn.work == {"draws": 1}
    bare.draw(REQUEST)
    assert bare.indices == [0] * 4


def test_a_timed_frame_says_by_which_clock(bare: Bare) -> None:
    bare.hold(REQUEST)
    assert bare.time_frame(0).clock == WALL
