"""Background writing of files, which pauses while a build is timed."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Writer:
    """Runs write operations one after the other in a thread, while the worker draws.

    Nothing is written between `finish` and `start`. Use as a context manager: everything is on disk when it exits. An
    exception of a write is raised by the next `finish` or on exit.
    """

    def __init__(self) -> None:
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
        """Queue a write for the next `start`."""
        self._next.append(write)

    def start(self) -> None:
        """Start the queued writes."""
        self._begun += [self._pool.submit(write) for write in self._next]
        self._next = []

    def finish(self) -> None:
        """Wait for the started writes, which bounds the images held in memory."""
        begun, self._begun = self._begun, []
        for writing in begun:
            writing.result()
