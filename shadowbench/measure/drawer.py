"""What draws and times cells: its interface, its limits, and how it fails."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from shadowbench.errors import ShadowbenchError, Unsupported

if TYPE_CHECKING:  # the worker's start does not wait for these imports
    from shadowbench.measure.cells import Block, Cell
    from shadowbench.measure.rendering import Rendering, Surface
    from shadowbench.measure.time_rows import Times
    from shadowbench.plugin.stage import ShaderText


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


@dataclass(frozen=True)
class DeviceInfo:
    """Facts about what draws: for OpenGL, the device."""

    renderer: str
    vendor: str
    version: int
    software: bool
    clock: str
    max_map_size: int
    subpixel_bits: int
    pipeline_statistics: bool
    clip_control: bool


class Drawer(Protocol):
    """What draws cells: a process with limits, replaced after a failure."""

    @property
    def info(self) -> DeviceInfo:
        """Facts about the device. Raises ShadowbenchError if the process cannot start."""

    def identity(self, cell: "Cell") -> Mapping[str, str]:
        """What draws a cell and traces, by which keys of rows differ: the renderer, and how Embree rounds there."""

    @property
    def machine(self) -> Mapping[str, Any]:
        """The computer, as by `measure.machine.machine`."""

    def unsupported(self, block: "Block", cell: "Cell") -> str | None:
        """Why a cell's technique does not support a block's view; None if it does."""

    def draw(self, block: "Block", cell: "Cell", keep: bool = False) -> "Iterator[Rendering]":
        """A cell drawn in each view of a block, in their order. Raises Unsupported and CellFailed.

        keep: it will be timed, so that what was built for it stays if there is room.
        """

    def surface(self, block: "Block") -> "Surface":
        """What masks of a block's view are drawn over. Raises CellFailed."""

    def shaders(self, block: "Block", cell: "Cell") -> "list[ShaderText]":
        """GLSL of a technique's cell as passed to the driver. Raises as `draw` does."""

    def time(self, block: "Block", sizes: "Mapping[Cell, int]") -> "Iterator[tuple[Cell, Times | str]]":
        """Times of cells of a block, or why one has none; sizes: their GPU bytes. Also why a reference failed."""
