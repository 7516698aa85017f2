"""Timing of draws by the clock suited to the device, and counts of their work.

Software renderers: wall clock between two calls of `finish`, as their timer queries are wrong. Hardware:
GL_TIME_ELAPSED queries, checked against the wall clock. Queries cannot nest, so whole frames and single passes are
timed in different draws.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Literal, TypeVar, get_args

from shadowbench.gl.device import Device, moderngl

T = TypeVar("T")
Changes = Literal["light", "view", "frame"]
QUERIES = "gl_time_elapsed"
WALL = "finish+wall"

_STATISTICS = {  # GL_ARB_pipeline_statistics_query
    "vertices": 0x82F0,  # vertex shader invocations
    "geometry": 0x887F,  # geometry shader invocations
    "primitives": 0x82F6,  # clipping input primitives: the output depends on the driver's batches
    "fragments": 0x82F4,  # fragment shader invocations
}
_QUERY_RESULT = 0x8866
COST = ("vertices", "geometry", "fragments", "reads", "rays")  # the counts that add up to the cost


@dataclass(frozen=True)
class Sample:
    """One measured time: milliseconds by `clock`, and by the wall clock, which includes CPU work."""

    ms: float
    wall_ms: float
    clock: str


@dataclass
class PassTimes:
    """Milliseconds by pass, what invalidates each pass, and the clocks used."""

    ms: dict[str, float] = field(default_factory=dict)
    changes: dict[str, Changes] = field(default_factory=dict)
    clocks: set[str] = field(default_factory=set)


class Clock:
    """Times whole frames or their passes. Techniques call `timed` for each pass; it does nothing outside `passes`."""

    def __init__(self, device: Device, seconds: Callable[[], float] = time.perf_counter) -> None:
        self._device, self._seconds = device, seconds
        self._queries = not device.software
        self._on_cpu = False
        self._passes: PassTimes | None = None

    @property
    def name(self) -> str:
        """Name of the clock, as in rows."""
        return QUERIES if self._queries else WALL

    def frame(self, draw: Callable[[], object], on_cpu: bool = False) -> Sample:
        """Time of one whole draw. on_cpu: by the wall clock, since the CPU draws, which queries do not see."""
        self._on_cpu = on_cpu
        with self._span() as samples:
            draw()
        return samples[0]

    def passes(self, draw: Callable[[], object], on_cpu: bool = False) -> PassTimes:
        """Milliseconds of the passes of one draw, by the clock of `frame`."""
        self._on_cpu, self._passes = on_cpu, (times := PassTimes())
        try:
            draw()
        finally:
            self._passes = None
        return times

    @contextmanager
    def timed(self, name: str, changes: Changes = "frame") -> Iterator[None]:
        """Context manager that times one pass. Raises ValueError for unknown `changes`."""
        if changes not in get_args(Changes):
            raise ValueError(f"pass {name!r}: changes is {changes!r}; allowed: {', '.join(get_args(Changes))}")
        if (passes := self._passes) is None:
            yield
            return
        with self._span() as samples:
            yield
        passes.ms[name] = passes.ms.get(name, 0.0) + samples[0].ms  # of all its draws in a frame
        passes.changes[name] = changes
        passes.clocks.add(samples[0].clock)

    @contextmanager
    def _span(self) -> Iterator[list[Sample]]:
        """Time the body; the yielded list has the sample afterwards."""
        samples: list[Sample] = []
        context = self._device.context
        query: moderngl.Query | None = context.query(time=True) if self._queries and not self._on_cpu else None
        context.finish()
        start = self._seconds()
        with query or nullcontext():
            yield samples
        context.finish()
        wall = (self._seconds() - start) * 1e3
        elapsed = None if query is None else query.elapsed / 1e6
        if elapsed is not None and not 0.0 <= elapsed <= wall:  # 0 for a pass that draws nothing
            self._queries, elapsed = False, None  # the wall clock refutes the query: never again
        samples.append(Sample(wall, wall, WALL) if elapsed is None else Sample(elapsed, wall, QUERIES))


def with_work(device: Device, draw: Callable[[], T]) -> tuple[T, dict[str, int]]:
    """What a draw returns, and its exact work: draw calls and, with pipeline statistics, invocations and primitives."""
    draws = device.draws
    if not device.pipeline_statistics:
        return draw(), {"draws": device.draws - draws}
    raw, counts = device.raw, {}
    names = (ctypes.c_uint * len(_STATISTICS))()
    raw("glGenQueries", len(names), names)
    for name, target in zip(names, _STATISTICS.values(), strict=True):
        raw("glBeginQuery", target, name)
    try:
        result = draw()
    finally:
        for target in _STATISTICS.values():
            raw("glEndQuery", target)
        for name, counter in zip(names, _STATISTICS, strict=True):
            value = ctypes.c_uint64()
            raw("glGetQueryObjectui64v", name, _QUERY_RESULT, ctypes.byref(value))
            counts[counter] = value.value
        raw("glDeleteQueries", len(names), names)
    return result, {"draws": device.draws - draws, **counts}


def with_cost(work: dict[str, int]) -> dict[str, int]:
    """Counts of work with `cost`, the sum of COST, added; unchanged without pipeline statistics."""
    if "fragments" not in work:
        return work
    return work | {"cost": sum(work.get(name, 0) for name in COST)}
