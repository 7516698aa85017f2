"""What is measured: a cell, the view that it is seen in, and what beside those a measurement depends on."""

from dataclasses import dataclass

from shadowbench.measure.references import USUAL
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


@dataclass(frozen=True)
class Conditions:
    """What a measurement depends on beside the cell and its view.

    rounds: how often a cell is timed, 0 for not at all; reference: what its times are ratios to; time_again: whether
    cells that have a time get another, beside which the old one stays in the rows.
    """

    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = USUAL
    time_again: bool = False
