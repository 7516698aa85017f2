"""Where cells are drawn, as all that measures sees it: the worker today, other machines later."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from shadowbench.errors import ShadowbenchError
from shadowbench.measure.session import DeviceInfo, Session, Unsupported

P = ParamSpec("P")
R = TypeVar("R")


class CellFailed(ShadowbenchError):
    """A call that was not answered: it raised, crashed, hung or ate memory; the text says which."""


class MemoryExceeded(CellFailed):
    """The process that draws grew past its limit."""


def status_of(reason: CellFailed | Unsupported) -> str:
    """Why a cell did not hold, as rows state it."""
    return f"{'unsupported' if isinstance(reason, Unsupported) else 'failed'}: {reason}"


@dataclass(frozen=True)
class Limits:
    """Of one call: seconds, and bytes of resident memory of the process that draws."""

    seconds: float = 120.0
    bytes: int = 8 << 30


class Executor(Protocol):
    """A session somewhere. After a failure, the next call finds a fresh one."""

    @property
    def info(self) -> DeviceInfo:
        """Its device, as it was when the session started; raises as `call` does."""

    @property
    def limits(self) -> Limits:
        """What a call may take."""

    def call(self, method: Callable[Concatenate[Session, P], R], *arguments: P.args, **options: P.kwargs) -> R:
        """The answer of `method(session, …)`; raises Unsupported, CellFailed, or the start's ShadowbenchError."""

    def stop(self) -> None:
        """End the session, by force."""
