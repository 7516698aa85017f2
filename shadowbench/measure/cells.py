"""What is measured: cells, and the blocks of them that share their views."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import Coordinates, LightKind, Scene, View
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.techniques.cube_map import CubeMap
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.unshadowed import Unshadowed
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth
from shadowbench.truths.trace import Truth

DEFAULT_REFERENCE = Spec(ShadowMap, ShadowMap.Params(size=1024))
"""Reference of a study that names none."""

_SUBSTITUTES: Mapping[LightKind, Spec] = {"point": Spec(CubeMap, CubeMap.Params(size=1024))}


def reference_for(chosen: Spec, kind: LightKind) -> Spec:
    """`chosen` if it supports the kind of light, else `cube-map` for a point light and `unshadowed` for others."""
    other = _SUBSTITUTES.get(kind, Spec(Unshadowed, Unshadowed.Params()))
    return chosen if kind in chosen.technique.lights else other


def reference_name(reference: Spec) -> str:
    """Name of a reference in rows, with its map size even if that is the default: `shadow-map:size=1024`."""
    name = reference.sizeless_text
    return name if reference.map_size is None else f"{name}{',' if ':' in name else ':'}size={reference.map_size}"


Step = Literal["camera", "light"]
FLIP_SAMPLES = 1
"""Samples along a pixel's side of truths that flips are counted with."""


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
    """Views and the cells that are drawn in all of them, which share their truths.

    views: one; or several frames in order, of which the first is scored and between which flips are counted; step: what
    moved between two frames, None for other frames; coordinates: in which the views are drawn; rounds: how often each
    cell is timed in the first view, 0 for no timing; reference: spec that times are divided by; place: fields of the
    rows that tell where on an axis the block lies, if it lies on one.
    """

    views: tuple[View, ...]
    cells: tuple[Cell, ...]
    coordinates: Coordinates = "relative"
    rounds: int = 0
    reference: Spec = DEFAULT_REFERENCE
    step: Step | None = None
    place: Mapping[str, Any] = field(default_factory=dict)
    _truths: dict[int, Truth] = field(default_factory=dict, repr=False)
    _prepared: list[PreparedTruth] = field(default_factory=list, repr=False)

    def of(self, cells: Sequence[Cell]) -> "Block":
        """Other cells in the same views, with the same truths."""
        return replace(self, cells=tuple(cells))

    def fresh(self) -> "Block":
        """A copy that has no truth yet, for a list of many blocks to keep."""
        return replace(self, _truths={}, _prepared=[])

    @property
    def view(self) -> View:
        """The view that is scored."""
        return self.views[0]

    @property
    def scene(self) -> Scene:
        """Scene of the views."""
        return self.view.scene

    def truth(self, index: int) -> Truth:
        """Truth of one of the views, which is traced, or read from the cache, once; the block keeps it.

        Only the first one's `area` is sampled finely, since no other is scored. Raises InputError for a view that shows
        nothing.
        """
        if index not in self._truths:
            samples = FLIP_SAMPLES if index else PIXEL_SAMPLES
            self._truths[index] = cached_truth(self.views[index], samples)
        return self._truths[index]

    @property
    def prepared(self) -> PreparedTruth:
        """The truth that masks are scored against, as the input of metrics."""
        if not self._prepared:
            self._prepared.append(prepare_truth(self.truth(0)))
        return self._prepared[0]

    @property
    def called(self) -> tuple[str, str]:
        """What it is, and its name, for a user who reads that it failed."""
        place = self.place
        return ("axis", f"{place['axis']} {place['light_kind']}") if place else ("cells", self.view.name)

    def times(self, cell: Cell) -> bool:
        """Whether a cell is timed. Only phase 0 is: other phases have other errors but the same cost."""
        return self.rounds > 0 and cell.phase == 0
