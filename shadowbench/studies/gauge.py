"""Measures single cells of one view as they are asked for, through the runner, into one folder of rows."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from shadowbench.scenes.model import LightKind, View
from shadowbench.studies.runner import Reporter, Result, Runner
from shadowbench.studies.study import Block, Cell, Study
from shadowbench.studies.worker import Worker
from shadowbench.techniques.spec import Spec

REFERENCES: Mapping[LightKind, str] = {  # what times are set against: one map that answers the light
    "directional": "shadow-map:size=1024",
    "spot": "shadow-map:size=1024",
    "point": "cube-map:size=1024",
}


class Gauge(Runner):
    """A runner of no fixed study: cells of one view, measured when they are asked for, once.

    Use as a context manager. rounds: how often a cell is timed, 0 for not at all.
    """

    def __init__(
        self, view: View, reference: Spec, rounds: int, folder: Path, worker: Worker, reporter: Reporter
    ) -> None:
        study = Study((view.scene.name,), (reference,), reference, view_size=view.size, rounds=rounds)
        super().__init__(study, folder, worker, reporter)
        self.view = view

    def measured(self, specs: Sequence[Spec]) -> list[Result]:
        """The rows of specs, made now or before."""
        return self.run_block(Block(self.view, tuple(Cell(spec, 0) for spec in specs)))
