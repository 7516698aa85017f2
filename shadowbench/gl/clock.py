"""How long drawing takes, by the clock that is right for the device, and how much work it was.

Software renderers: `finish` on both sides and the wall clock; their timer queries are wrong. Hardware: GL_TIME_ELAPSED,
checked against the wall, and never nested: whole frames and single passes are measured in different draws.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Literal, get_args

import moderngl

from shadowbench.gl.device import Device
from shadowbench.scenes.tables import LONGEST_NAME

Changes = Literal["light", "view", "frame"]
QUERIES = "gl_time_elapsed"
WALL = "finish+wall"

# GL_ARB_pipeline_statistics_query
_STATISTICS = {
    "vertices": 0x82F0,  # vertex shader invocations
    "geometry": 0x887F,  # geometry shader invocations
    "primitives": 0x82F6,  # clipping input primitives: the output depends on the driver's batches
    "fragments": 0x82F4,  # fragment shader invocations
}
_QUERY_RESULT = 0x8866
COST = ("vertices", "geometry", "fragments", "reads", "rays")  # the counts that take time


@dataclass(frozen=True)
class Sample:
    """One time: milliseconds by the clock that is named, and by the wall beside it, which work on the CPU is in too."""

    ms: float
    wall_ms: float
    clock: str


@dataclass
class PassTimes:
    """Milliseconds by pass, what each pass depends on, and every clock that measured one of them."""

    ms: dict[str, float] = field(default_factory=dict)
    changes: dict[str, Changes] = field(default_factory=dict)
    clocks: set[str] = field(default_factory=set)

    def add(self, name: str, changes: Changes, sample: Sample) -> None:
        """Add to a pass; one that is drawn several times a frame sums up."""
        self.ms[name] = self.ms.get(name, 0.0) + sample.ms
        self.changes[name] = changes
        self.clocks.add(sample.clock)


class Clock:
    """Times frames or their passes. `timed` is what techniques call; outside `passes` it costs nothing."""

    def __init__(self, device: Device, seconds: Callable[[], float] = time.perf_counter) -> None:
        self._device, self._seconds = device, seconds
        self._queries = not device.software
        self._passes: PassTimes | None = None

    @property
    def name(self) -> str:
        """Which clock, as rows state it."""
        return QUERIES if self._queries else WALL

    def frame(self, draw: Callable[[], object]) -> Sample:
        """What one whole draw took."""
        with self._span() as samples:
            draw()
        return samples[0]

    def passes(self, draw: Callable[[], object]) -> PassTimes:
        """Milliseconds of the passes of one draw."""
        self._passes = times = PassTimes()
        try:
            draw()
        finally:
            self._passes = None
        return times

    @contextmanager
    def timed(self, name: str, changes: Changes = "frame") -> Iterator[None]:
        """Bracket one pass; ValueError when `changes` is none of its three words, or `name` beyond LONGEST_NAME."""
        if len(name) > LONGEST_NAME:
            raise ValueError(f"pass {name!r:.60}… has a name of {len(name)} characters; allowed: {LONGEST_NAME}")
        if changes not in get_args(Changes):
            raise ValueError(f"pass {name!r}: changes is {changes!r}; allowed: {', '.join(get_args(Changes))}")
        if self._passes is None:
            yield
            return
        with self._span() as samples:
            yield
        self._passes.add(name, changes, samples[0])

    @contextmanager
    def _span(self) -> Iterator[list[Sample]]:
        """Measures what is done within; the list holds the sample afterwards."""
        samples: list[Sample] = []
        context = self._device.context
        query: moderngl.Query | None = context.query(time=True) if self._queries else None
        context.finish()
        start = self._seconds()
        with query or nullcontext():
            yield samples
        context.finish()
        wall = (self._seconds() - start) * 1e3
        samples.append(Sample(wall, wall, WALL) if query is None else self._plausible(query.elapsed / 1e6, wall))

    def _plausible(self, elapsed: float, wall: float) -> Sample:
        """The query's answer, unless the wall clock shows it to be impossible: then queries are given up for good."""
        if 0.0 <= elapsed <= wall:  # 0 for a pass that draws nothing
            return Sample(elapsed, wall, QUERIES)
        self._queries = False
        return Sample(wall, wall, WALL)


def work_of(device: Device, draw: Callable[[], object]) -> dict[str, int]:
    """Exact counts of one draw: draw calls and, where the driver counts them, shader invocations and primitives."""
    draws = device.draws
    if not device.pipeline_statistics:
        draw()
        return {"draws": device.draws - draws}
    raw = device.raw
    names = (ctypes.c_uint * len(_STATISTICS))()
    raw("glGenQueries", len(names), names)
    for name, target in zip(names, _STATISTICS.values(), strict=True):
        raw("glBeginQuery", target, name)
    counts = {}
    try:
        try:
            draw()
        finally:
            for target in _STATISTICS.values():
                raw("glEndQuery", target)
        counts["draws"] = device.draws - draws
        for name, counter in zip(names, _STATISTICS, strict=True):
            value = ctypes.c_uint64()
            raw("glGetQueryObjectui64v", name, _QUERY_RESULT, ctypes.byref(value))
            counts[counter] = value.value
    finally:
        raw("glDeleteQueries", len(names), names)
    return counts


def with_cost(work: dict[str, int]) -> dict[str, int]:
    """Work with `cost`, the sum of COST; without it where the driver counts no invocations."""
    if "fragments" not in work:
        return work
    return work | {"cost": sum(work.get(name, 0) for name in COST)}
