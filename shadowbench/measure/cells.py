"""What is measured: cells, and the blocks of them that share their views."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from shadowbench.measure.references import DEFAULT_REFERENCE
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import Coordinates, Scene, View
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.techniques.spec import Spec
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth
from shadowbench.truths.trace import Truth

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
