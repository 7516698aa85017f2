"""Run time by activity."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

# Activities and their descriptions. The worker measures its own, waiting for the GPU before and after.
ACTIVITIES = {
    "passes": "GL passes: the G-buffer, the frames that are scored, counted and timed, pictures",
    "truth": "ray tracing, or reading it from the cache",
    "score": "metrics",
    "prepare": "programs, textures and buffers of the cells: prepare_ms, and again for cells not kept in memory",
    "build": "uploading geometry to the GPU",
    "read back": "images from the GPU, quantised",
    "files": "waiting until rows, masks and pictures are on disk",
    "waiting": "for the worker, beyond its own activities: its start, the pipe",
    "other": "scenes, tables",
}
MEASURING = ("passes", "truth", "score")


@dataclass
class Profile:
    """Seconds by activity. Time in a nested activity counts only for the inner one."""

    seconds: dict[str, float] = field(default_factory=dict)
    clock: Callable[[], float] = time.perf_counter
    _nested: list[str] = field(default_factory=list)
    _since: float = 0.0

    @contextmanager
    def activity(self, name: str) -> Iterator[None]:
        """Add the duration of the block to an activity."""
        self._add_elapsed()
        self._nested.append(name)
        try:
            yield
        finally:
            self._add_elapsed()
            self._nested.pop()

    def _add_elapsed(self) -> None:
        """Add the time since the last call to the current activity."""
        now = self.clock()
        if self._nested:
            activity = self._nested[-1]
            self.seconds[activity] = self.seconds.get(activity, 0.0) + now - self._since
        self._since = now


def complete_profile(parent: Mapping[str, float], worker: Mapping[str, float], total: float) -> dict[str, float]:
    """Seconds of a run for each of ACTIVITIES, adding up to `total`; the worker's own replace the wait for them."""
    seconds = {**parent, **worker}
    seconds["waiting"] = parent.get("waiting", 0.0) - sum(worker.values())
    seconds["other"] = total - sum(parent.values())
    return {activity: seconds.get(activity, 0.0) for activity in ACTIVITIES}


def share(seconds: Mapping[str, float], activities: Sequence[str] = MEASURING) -> float:
    """Share of the time spent in some activities: by default GL passes, ray tracing and scoring."""
    return sum(seconds.get(activity, 0.0) for activity in activities) / sum(seconds.values())
