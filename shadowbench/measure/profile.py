"""Where the time of a run goes."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

# Activity: what it is. Those of the worker are measured there, with the GPU's work finished at both ends.
ACTIVITIES = {
    "passes": "GL passes: the G-buffer, the frames that are scored, counted and timed, pictures",
    "truth": "ray tracing, or reading it from the cache",
    "score": "metrics",
    "prepare": "programs, textures and buffers of the cells: prepare_ms, and once more where memory keeps none",
    "build": "geometry to the device",
    "read back": "images from the device, quantised",
    "files": "rows, masks and pictures to disk, where nothing else was done meanwhile",
    "waiting": "for the worker, beyond what it says of itself: its start, the pipe",
    "other": "scenes, tables",
}
MEASURING = ("passes", "truth", "score")


@dataclass
class Profile:
    """Seconds by activity. What is done within another activity counts as that one alone, never as both."""

    seconds: dict[str, float] = field(default_factory=dict)
    clock: Callable[[], float] = time.perf_counter
    _within: list[str] = field(default_factory=list)
    _since: float = 0.0

    @contextmanager
    def of(self, activity: str) -> Iterator[None]:
        """Add the time of a block to an activity."""
        self._book()
        self._within.append(activity)
        try:
            yield
        finally:
            self._book()
            self._within.pop()

    def _book(self) -> None:
        """Give the time since the last change to whatever was done in it."""
        now = self.clock()
        if self._within:
            activity = self._within[-1]
            self.seconds[activity] = self.seconds.get(activity, 0.0) + now - self._since
        self._since = now


def whole(parent: Mapping[str, float], worker: Mapping[str, float], total: float) -> dict[str, float]:
    """Seconds of a run by ACTIVITIES, which add up to `total`: the worker's own in place of the wait for them."""
    seconds = {**parent, **worker}
    seconds["waiting"] = parent.get("waiting", 0.0) - sum(worker.values())
    seconds["other"] = total - sum(parent.values())
    return {activity: seconds.get(activity, 0.0) for activity in ACTIVITIES}


def share(seconds: Mapping[str, float], activities: Sequence[str] = MEASURING) -> float:
    """How much of it was spent inside GL passes, ray tracing and scoring, or whatever is asked for."""
    return sum(seconds.get(activity, 0.0) for activity in activities) / sum(seconds.values())
