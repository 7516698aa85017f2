"""Writes to disk beside the drawing, but not beside what is timed."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from shadowbench.measure.profile import Profile


class Writer:
    """Writes in a thread of its own, in order and one thing at a time, while the worker draws.

    Nothing is written between `finish` and `start`. Use as a context manager: all is on disk when it ends. What writing
    raises is raised by the next `finish`, or the end.
    """

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._pool = ThreadPoolExecutor(1)
        self._next: list[Callable[[], None]] = []
        self._begun: list[Future[None]] = []

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, *_: object) -> None:
        with self._pool:
            self.start()
            self.finish()

    def add(self, write: Callable[[], None]) -> None:
        """Have it written after the next `start`."""
        self._next.append(write)

    def start(self) -> None:
        """Begin to write what was added."""
        self._begun += [self._pool.submit(write) for write in self._next]
        self._next = []

    def finish(self) -> None:
        """Wait until what was begun is on disk; more would be held in memory otherwise."""
        begun, self._begun = self._begun, []
        with self._profile.of("files"):
            for writing in begun:
                writing.result()
