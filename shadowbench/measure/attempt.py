"""Jobs whose failure is reported and left out, so that a long study goes on (`--keep-going`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from shadowbench.errors import InputError, message, quoted
from shadowbench.measure.bench import Bench, Job
from shadowbench.measure.rows import Record
from shadowbench.scenes.model import View

R = TypeVar("R")


@dataclass(frozen=True)
class Failure:
    """A part of a study that failed as a whole; what: `scene`, `truth`, `cells` or `axis`; where: its name."""

    what: str
    where: str
    reason: str


@dataclass(frozen=True, eq=False)
class Attempt(Job[R | Failure]):
    """Job that tries another, and returns a Failure if it raises.

    Errors of the disk are raised, as everything after them would be lost too.
    """

    job: Job[R]
    what: str
    where: str

    @property
    def known(self) -> Sequence[Record]:  # type: ignore[override]
        """The job's."""
        return self.job.known

    @property
    def truths(self) -> Sequence[tuple[View, int]]:
        """The job's."""
        return self.job.truths

    def __call__(self, bench: Bench) -> R | Failure:
        """Result of the job, or why it failed. Raises OSError, and InputError unless a truth is traced."""
        try:
            return self.job(bench)
        except OSError:
            raise
        except Exception as error:
            if isinstance(error, InputError) and self.what != "truth":  # of the row store
                raise
            return Failure(self.what, self.where, quoted(message(error) or type(error).__name__))
