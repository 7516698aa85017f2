"""Timing of passes, and exact counts of work."""

from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from shadowbench.gl.clock import QUERIES, WALL, Clock, with_work
from shadowbench.gl.device import Device
from shadowbench.gl.program import Drawable, Program

SIDE = 256
BUSY = """
out float value;
void main() {
    value = 0.0;
    for (int k = 0; k < 200; ++k) value += sin(value + gl_FragCoord.x);
}
"""


@pytest.fixture
def busy(device: Device, program):
    """Draws a fullscreen triangle that takes milliseconds."""
    one: Program = program(BUSY)
    vertices = device.context.vertex_array(one.linked, [])
    target = device.context.simple_framebuffer((SIDE, SIDE), 1, dtype="f4")
    yield lambda: Drawable(one, vertices, count=3).draw(target)
    device.free((vertices, target))


def test_frames_and_passes_have_times_above_zero_and_those_of_a_pass_add_up(device, busy) -> None:
    clock = Clock(device)

    def frame() -> None:
        with clock.timed("map", "light"):
            busy()
        with clock.timed("resolve", "view"):
            busy()

    assert clock.frame(frame).ms > 0
    passes = clock.passes(lambda: (frame(), frame()))
    assert set(passes.ms) == {"map", "resolve"}
    assert all(ms > 0 for ms in passes.ms.values())
    assert passes.changes == {"map": "light", "resolve": "view"}
    ticks = iter([0.0, 1.0, 5.0, 7.0])
    clock = Clock(SimpleNamespace(software=True, context=SimpleNamespace(finish=lambda: None)), ticks.__next__)

    def face() -> None:
        with clock.timed("face", "light"):
            pass

    face()  # is timed only when asked for
    assert clock.passes(lambda: (face(), face())).ms == {"face": 3000.0}


Queried = Callable[..., Clock]


@pytest.fixture
def queried() -> Queried:
    """A GPU clock whose queries return these nanoseconds in turn; each span takes 10 ms by the wall clock."""
    ticks = iter(0.01 * number for number in range(100))

    def make(*nanoseconds: int) -> Clock:
        answers = iter(nanoseconds)

        class Query(nullcontext[None]):
            @property
            def elapsed(self) -> int:
                return next(answers)

        context = SimpleNamespace(finish=lambda: None, query=lambda time: Query())
        return Clock(SimpleNamespace(software=False, context=context), ticks.__next__)

    return make


def test_a_query_answers_in_nanoseconds_and_the_wall_is_kept_beside_it(queried) -> None:
    sample = queried(2_500_000).frame(lambda: None)
    assert (sample.ms, sample.clock) == (2.5, QUERIES)
    assert sample.wall_ms == pytest.approx(10)


@pytest.mark.parametrize("impossible", [10_100_000, -1])
def test_a_query_that_the_wall_refutes_is_the_last(queried, impossible) -> None:
    clock = queried(9_900_000, 0, impossible)  # a fourth would find no answer
    assert [clock.frame(lambda: None).clock for _ in range(2)] == [QUERIES] * 2
    assert clock.name == QUERIES
    samples = [clock.frame(lambda: None) for _ in range(2)]
    assert [sample.clock for sample in samples] == [WALL] * 2
    assert [sample.ms for sample in samples] == [sample.wall_ms for sample in samples] == pytest.approx([10, 10])
    assert clock.name == WALL


def test_with_work_a_fullscreen_triangle(device, busy) -> None:
    _, work = with_work(device, busy)
    assert work["draws"] == 1
    if device.pipeline_statistics:
        assert work["vertices"] == 3
        assert work["geometry"] == 0
        assert 1 <= work["primitives"] <= 3  # a triangle larger than the target may be clipped into a few
        assert SIDE**2 <= work["fragments"] <= 1.1 * SIDE**2


def test_work_adds_up_and_repeats_exactly(device, busy) -> None:
    _, once = with_work(device, busy)
    assert with_work(device, busy)[1] == once
    _, twice = with_work(device, lambda: (busy(), busy()))
    assert twice == {name: 2 * count for name, count in once.items()}
