"""What is measured: a cell, and the view that it is seen in."""

from dataclasses import dataclass

from shadowbench.scenes.model import Coordinates, Scene, View
from shadowbench.techniques.spec import Spec


@dataclass(frozen=True)
class CellRequest:
    """A cell as it is sent to where it is drawn: its full spec as text, and the phase."""

    spec: str
    phase: int = 0


@dataclass(frozen=True)
class Cell:
    """One measurement: a spec at a phase, in a block's view."""

    spec: Spec
    phase: int = 0

    @property
    def request(self) -> CellRequest:
        """The cell as the worker takes it."""
        return CellRequest(self.spec.full_text, self.phase)


@dataclass(frozen=True, eq=False)
class Block:
    """A view and the cells of all phases, which share its truth and its G-buffer."""

    view: View
    cells: tuple[Cell, ...]

    @property
    def scene(self) -> Scene:
        """The view's scene."""
        return self.view.scene


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A view (file coordinates), and the coordinates that it is drawn in."""

    view: View
    coordinates: Coordinates = "relative"
