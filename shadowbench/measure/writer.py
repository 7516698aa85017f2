"""Background writing of files."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Writer:
    """Runs write operations one after the other in a thread, while the worker draws.

    Use as a context manager: everything is on disk when it exits. An exception of a write is raised by the next
    `finish` or on exit.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1)
        self._begun: list[Future[object]] = []

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, *_: object) -> None:
        with self._pool:
            self.finish()

    def add(self, *writes: Callable[[], None]) -> None:
        """Begin writes after those begun before. One that raises an exception ends those added with it."""
        self._begun.append(self._pool.submit(lambda: [write() for write in writes]))

    def finish(self) -> None:
        """Wait for all writes."""
        begun, self._begun = self._begun, []
        for writing in begun:
            writing.result()
