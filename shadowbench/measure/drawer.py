"""Interface of what draws and times cells: OpenGL in a process of its own, or another renderer."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.failures import Limits
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.session import DeviceInfo
from shadowbench.measure.time_rows import Timing
from shadowbench.plugin.stage import ShaderText


class Drawer(Protocol):
    """What draws cells: a process with limits, replaced after a failure."""

    @property
    def limits(self) -> Limits:
        """Limits of each call."""

    @property
    def info(self) -> DeviceInfo:
        """Facts about the device. Raises ShadowbenchError if the process cannot start."""

    @property
    def identity(self) -> Mapping[str, str]:
        """What draws and traces, by which the keys of rows differ: the renderer, and how Embree rounds there."""

    @property
    def machine(self) -> Mapping[str, Any]:
        """The computer, as by `measure.machine.machine`."""

    def unsupported(self, block: Block, cell: Cell) -> str | None:
        """Why a cell's technique does not support a block's view; None if it does."""

    def draw(self, block: Block, cell: Cell, keep: bool = False) -> Iterator[Rendering]:
        """A cell drawn in each view of a block, in their order. Raises Unsupported and CellFailed.

        keep: it will be timed, so that what was built for it stays if there is room.
        """

    def surface(self, block: Block) -> NDArray[np.int32]:
        """(N, N) triangle ids of the surfaces that masks of a block's view are drawn over, row 0 at the top."""

    def shading(self, block: Block) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Two pictures of a block's view, (N, N, 3) uint8 sRGB: visibility 1 everywhere, and 0 everywhere."""

    def time(self, block: Block, sizes: Mapping[Cell, int], retried: Mapping[Cell, int]) -> Iterator[Timing]:
        """Timings of cells of a block, by GPU bytes; retried: cells with times but no ratio, as their reference failed.

        The latter are skipped if it fails again.
        """

    def shaders(self, block: Block, cell: Cell) -> Sequence[ShaderText]:
        """GLSL of a cell as passed to the driver, with all includes and defines resolved. Raises as `draw` does."""
