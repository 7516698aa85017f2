"""Interface for drawing cells in another process, and for running the jobs that do."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Protocol, TypeVar

from shadowbench.errors import ShadowbenchError, quoted

if TYPE_CHECKING:
    from shadowbench.measure.bench import Bench, Job
    from shadowbench.measure.session import DeviceInfo, Session

P = ParamSpec("P")
R = TypeVar("R")


class Unsupported(Exception):
    """Raised when a technique does not support a view; the message is one line that says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(quoted(reason))


class CellFailed(ShadowbenchError):
    """Raised when a call raised an exception, crashed, hung or exceeded its memory; the message says which."""


class MemoryExceeded(CellFailed):
    """Raised when the drawing process exceeded its memory limit."""


def status_of(reason: CellFailed | Unsupported) -> str:
    """Row status of a cell that was unsupported or failed."""
    return f"{'unsupported' if isinstance(reason, Unsupported) else 'failed'}: {reason}"


@dataclass(frozen=True)
class Limits:
    """Limits of one call: seconds, and bytes of resident memory of the drawing process."""

    seconds: float = 120.0
    bytes: int = 8 << 30


class Executor(Protocol):
    """A session in another process. After a failure, the next call starts a fresh one."""

    @property
    def info(self) -> "DeviceInfo":
        """Device facts from the start of the session. Raises as `call` does."""

    @property
    def identity(self) -> Mapping[str, str]:
        """What draws and traces, by which rows' keys differ: the renderer, and how Embree rounds there."""

    @property
    def machine(self) -> Mapping[str, Any]:
        """The computer that draws, as by `measure.machine.machine`."""

    @property
    def jobs_at_once(self) -> int:
        """Number of jobs that `run` can run at the same time."""

    @property
    def limits(self) -> Limits:
        """Limits of each call."""

    def call(self, method: "Callable[Concatenate[Session, P], R]", *arguments: P.args, **options: P.kwargs) -> R:
        """Result of `method(session, …)`. Raises Unsupported, CellFailed, or ShadowbenchError if it cannot start."""

    def run(self, jobs: "Sequence[Job[R]]", bench: "Bench") -> Iterator[R]:
        """Results of jobs on a bench of this executor, in their order; see `Bench.run`."""

    def stop(self) -> None:
        """Kill the session."""
