"""The bench: what a job measures with."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from shadowbench.measure.executor import Executor
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import Rows
from shadowbench.measure.rows import Record
from shadowbench.scenes.model import View

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class Reporter(Protocol):
    """Receiver of progress messages."""

    def note(self, line: str) -> None:
        """Show one line to the user."""

    def stage(self, name: str, total: int | None) -> None:
        """Begin a stage of `total` steps, None if unknown."""

    def step(self, what: str) -> None:
        """Count one step of the stage as done."""


@dataclass(frozen=True, eq=False)
class Bench:
    """What jobs measure with.

    executor: draws; store: receives rows; reporter: receives progress; pictures: receives images, None for rows only.
    """

    executor: Executor
    store: Rows
    reporter: Reporter
    pictures: Pictures | None = None

    def run(self, jobs: "Sequence[Job[R]]") -> Iterator[R]:
        """Results of jobs, in their order; rows are in the store before the result of their job is yielded."""
        return self.executor.run(jobs, self)


class Job(Generic[R_co]):
    """Independent part of a measurement, in any order with others: picklable, and called with a bench, makes rows.

    An executor may call it in another process, on a bench with a store and pictures of its own, whose rows and images
    it copies. A job therefore returns no rows; they are read from the store by key.

    known: rows of the bench's store that it builds on.
    """

    known: Sequence[Record] = ()

    @property
    def truths(self) -> Sequence[tuple[View, int]]:
        """Views, and samples per pixel, of the truths that it shares with other jobs."""
        return ()

    def __call__(self, bench: Bench) -> R_co:
        """Make the rows that the bench's store lacks."""
        raise NotImplementedError
