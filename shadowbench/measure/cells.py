"""What is measured: cells, and the blocks of them that share their views."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import Coordinates, LightKind, View
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.unshadowed import Unshadowed

DEFAULT_REFERENCE = Spec(ShadowMap, ShadowMap.Params(size=1024))
"""Reference of a study that names none."""

UNSHADOWED = Spec(Unshadowed, Unshadowed.Params())
_SUBSTITUTES: Mapping[LightKind, Spec] = {"point": Spec(CubeMap, CubeMap.Params(size=1024))}

Step = Literal["camera", "light"]


@dataclass(frozen=True)
class Cell:
    """One measurement: a spec at one phase.

    home: on an axis of `stress`, the spec that the axis varies, which its row names; None elsewhere.
    """

    spec: Spec
    phase: int = 0
    home: Spec | None = None


@dataclass(frozen=True, eq=False)
class Block:
    """A view and the cells that are drawn in it.

    later: frames after that view, which is scored and timed; flips are counted from frame to frame; step: what moved
    between two frames, None for other frames; coordinates: in which the views are drawn; rounds: how often each cell
    is timed, 0 for no timing; reference: spec that times are divided by; place: fields of the rows that tell where on
    an axis the block lies, if it lies on one.
    """

    view: View
    cells: tuple[Cell, ...]
    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = DEFAULT_REFERENCE
    later: tuple[View, ...] = ()
    step: Step | None = None
    place: Mapping[str, Any] = field(default_factory=dict)

    @property
    def reference_cell(self) -> Cell:
        """The cell that times are divided by: if `reference` does not support the light, `cube-map` or `unshadowed`."""
        kind = self.view.light.hard_kind
        supported = kind in self.reference.technique.lights
        return Cell(self.reference if supported else _SUBSTITUTES.get(kind, UNSHADOWED))

    def times(self, cell: Cell) -> bool:
        """Whether a cell is timed. Other phases than 0 have other errors but the same cost; engines have none here."""
        return self.rounds > 0 and cell.phase == 0 and cell.spec.technique.own


def reference_name(reference: Spec) -> str:
    """Name of a reference in rows, with its map size even if that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"
