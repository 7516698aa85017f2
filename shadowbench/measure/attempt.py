"""Jobs whose failure is reported and left out, so that a long study goes on (`--keep-going`)."""

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from shadowbench.errors import InputError, message, quoted
from shadowbench.measure.bench import Bench, Job

R = TypeVar("R")


@dataclass(frozen=True)
class Failure:
    """A part of a study that failed as a whole; what: `scene`, `truth`, `cells` or `axis`; where: its name."""

    what: str
    where: str
    reason: str


@dataclass(frozen=True, eq=False)
class Attempt(Generic[R]):
    """Job that tries another, and returns a Failure if it raises.

    Errors of the disk are raised, as everything after them would be lost too.
    """

    job: Job[R]
    what: str
    where: str

    def __getattr__(self, name: str) -> Any:
        """What else an executor asks of a job."""
        if name.startswith("__") or name == "job":  # while it is unpickled
            raise AttributeError(name)
        return getattr(self.job, name)

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
