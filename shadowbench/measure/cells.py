"""Cells, the unit of measurement, and the views they are drawn in."""

from dataclasses import dataclass

from shadowbench.scenes.model import Coordinates, Scene, View
from shadowbench.techniques.spec import Spec


@dataclass(frozen=True)
class CellRequest:
    """A cell as sent to the worker: its full spec as text, and its phase."""

    spec: str
    phase: int = 0


@dataclass(frozen=True)
class Cell:
    """One measurement: a spec at one phase, drawn in the view of a block."""

    spec: Spec
    phase: int = 0

    @property
    def request(self) -> CellRequest:
        """The cell as sent to the worker."""
        return CellRequest(self.spec.full_text, self.phase)


@dataclass(frozen=True, eq=False)
class Block:
    """A view and the cells measured in it, which share its truth and G-buffer."""

    view: View
    cells: tuple[Cell, ...]

    @property
    def scene(self) -> Scene:
        """Scene of the view."""
        return self.view.scene


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A view in file coordinates, and the coordinates it is drawn in."""

    view: View
    coordinates: Coordinates = "relative"
