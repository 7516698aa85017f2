"""How drawing fails, and its limits."""

from dataclasses import dataclass

from shadowbench.errors import ShadowbenchError, Unsupported


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


@dataclass(frozen=True)
class Failure:
    """What failed as a whole and was left out; what: `scene`, `truth`, `cells` or `axis`; where: its name."""

    what: str
    where: str
    reason: str
