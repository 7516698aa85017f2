"""A session: what it times around a technique, and how it counts frames; without GL."""

from functools import partial
from itertools import chain, repeat
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench.gl.clock import WALL, Clock
from shadowbench.measure import session as module
from shadowbench.measure.cells import CellRequest
from shadowbench.measure.session import WARM_UP, Session
from shadowbench.techniques.base import Frame, Phase, TechniqueParams
from shadowbench.techniques.filters import PCF, Dither4, Filter, Hard, Hardware

REQUEST = CellRequest("recorder")
AT: Any = None  # the view, which is always open


class Bare(Session):
    """A session without a device, whose technique records the index of every frame drawn."""

    def __init__(self) -> None:
        self.device: Any = SimpleNamespace(
            context=SimpleNamespace(finish=lambda: None),
            reset=lambda: None,
            check=lambda what: None,
            pipeline_statistics=False,
            software=True,
            draws=0,
        )
        self.clock = Clock(self.device)
        self.facts: dict[str, float] = {}
        self.params: Any = TechniqueParams()
        loaded = SimpleNamespace(picture_pass=SimpleNamespace(draw=lambda surface, view, texture, tint: None))
        surface = SimpleNamespace(release=lambda: None)
        self._open_view: Any = SimpleNamespace(
            loaded=loaded, view=SimpleNamespace(size=2), surface=surface, matches=lambda at: True
        )
        self._kept = {}
        self._timed = []
        self.freed: list[str] = []
        self.indices: list[int] = []

    def _assemble(self, opened: Any, request: CellRequest) -> Any:
        def draw(frame: Frame) -> np.ndarray:
            self.indices.append(frame.index)
            self.device.draws += 1
            return np.ones((2, 2, 1), np.float32)

        technique = SimpleNamespace(
            draw=draw,
            facts=lambda: self.facts,
            map_image=lambda: None,
            draws_on_cpu=lambda params: False,
            params=self.params,
        )
        surface: Any = None
        frame = Frame(opened.view, Phase(request.phase), 0, surface, self.clock)
        release = partial(self.freed.append, request.spec)
        return technique, SimpleNamespace(release=release, bytes=10), frame


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> Bare:
    monkeypatch.setattr(module, "visibility_of", lambda spec, texture, size: texture[..., 0])
    return Bare()


def test_building_is_timed_in_milliseconds_without_the_warm_up(bare: Bare, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = chain([5.0, 5.25], repeat(9.0))
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(ticks))
    assert bare.prepare_timing(AT, REQUEST) == 250


def test_frames_of_a_kept_cell_are_counted_from_its_build(bare: Bare) -> None:
    bare.prepare_timing(AT, REQUEST)
    assert bare.indices == list(range(WARM_UP)) == [0, 1]
    bare.time_frame(0)
    bare.time_passes(0)
    bare.time_frame(0)
    assert bare.indices == [0, 1, 2, 3, 4]


def test_every_scored_cell_has_counters_of_its_own(bare: Bare) -> None:
    bare.prepare_timing(AT, REQUEST)
    bare.prepare_timing(AT, REQUEST)
    for held in (1, 0, 1):
        bare.time_frame(held)
    assert bare.indices == [0, 1, 0, 1, 2, 2, 3]
    bare.release_timed()
    bare.prepare_timing(AT, REQUEST)
    assert bare.indices[-2:] == [0, 1]


def test_a_kept_cell_is_built_once(bare: Bare, monkeypatch: pytest.MonkeyPatch) -> None:
    built = []
    assembled = bare._assemble
    monkeypatch.setattr(
        bare, "_assemble", lambda opened, request: (built.append(request.spec), assembled(opened, request))[1]
    )
    specs = [CellRequest(name) for name in "abc"]
    for spec in specs:
        bare.draw(AT, spec, keep=25)  # each takes 10
    assert bare.freed == ["c"]
    took = bare._kept[specs[0]].prepare_ms
    bare.draw(AT, CellRequest("d"))
    assert bare.freed == ["c", "d"]
    assert bare.prepare_timing(AT, specs[0]) == took
    bare.prepare_timing(AT, specs[2])
    assert built == ["a", "b", "c", "d", "c"]
    assert bare.indices[-2 * WARM_UP :] == [0, 1, 0, 1]  # as if it had not been drawn before
    bare.release_timed()
    bare._close()
    assert bare.freed == ["c", "d", "c", "a", "b"]


def test_a_cell_built_beforehand_is_not_built_again_to_draw_it(bare: Bare) -> None:
    bare.build(AT, REQUEST)
    took = bare._kept[REQUEST].prepare_ms
    bare.build(AT, REQUEST)
    bare.draw(AT, REQUEST, keep=25)
    bare.draw(AT, REQUEST, keep=25)
    assert bare._kept[REQUEST].prepare_ms == took
    assert bare.freed == []
    bare.draw(AT, REQUEST)
    assert bare.freed == [REQUEST.spec]


def test_a_scored_frame_and_its_work_are_both_without_history(bare: Bare) -> None:
    drawn = bare.draw(AT, REQUEST)
    assert bare.indices == [0, 0]
    assert drawn.work == {"draws": 1}
    bare.draw(AT, REQUEST)
    assert bare.indices == [0] * 4


def test_a_timed_frame_names_its_clock(bare: Bare) -> None:
    bare.prepare_timing(AT, REQUEST)
    assert bare.time_frame(0).clock == WALL


@pytest.mark.parametrize(("row", "reads"), [(Hard(), 1), (Hardware(), 1), (PCF(taps=5), 25), (Dither4(), 4)])
def test_a_filter_reads_its_map_so_often_for_every_pixel(bare: Bare, row: Filter, reads: int) -> None:
    bare.params = SimpleNamespace(filter=row)
    assert bare.draw(AT, REQUEST).work == {"draws": 1, "reads": 2 * 2 * reads}


def test_reads_and_rays_that_a_technique_states_are_work_and_no_facts(bare: Bare) -> None:
    bare.params = SimpleNamespace(filter=PCF())
    bare.facts = {"reads": 7.0, "rays": 3.0, "texel_m": 0.5}
    drawn = bare.draw(AT, REQUEST)
    assert drawn.work == {"draws": 1, "reads": 7, "rays": 3}
    assert drawn.facts == {"texel_m": 0.5}


def test_the_cost_is_the_sum_of_invocations_reads_and_rays(bare: Bare, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = {"draws": 100, "primitives": 1000, "vertices": 1, "geometry": 2, "fragments": 4}
    monkeypatch.setattr(module, "work_of", lambda device, draw: counted)
    bare.facts = {"reads": 8.0, "rays": 16.0}
    assert bare.draw(AT, REQUEST).work == counted | {"reads": 8, "rays": 16, "cost": 31}


def test_without_invocations_there_is_no_cost(bare: Bare) -> None:
    assert "cost" not in bare.draw(AT, REQUEST).work
