"""Measures single cells of one view as they are asked for, through the runner, into one folder of rows."""

from collections.abc import Sequence
from pathlib import Path

from shadowbench.measure.references import REFERENCE
from shadowbench.measure.runner import Reporter, Result, Runner
from shadowbench.measure.worker import Worker
from shadowbench.scenes.model import View
from shadowbench.studies.study import Block, Cell, Study
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import Spec, parse_spec


class Gauge(Runner):
    """A runner of no fixed study: cells of one view, measured when they are asked for, once.

    Use as a context manager. rounds: how often a cell is timed, 0 for not at all.
    """

    def __init__(self, view: View, rounds: int, folder: Path, worker: Worker, reporter: Reporter) -> None:
        reference = parse_spec(REFERENCE, {ShadowMap.name: ShadowMap})
        study = Study.of([view.scene], [reference], view_size=view.size, rounds=rounds)
        super().__init__(study, folder, worker, reporter)
        self.view = view

    def measured(self, specs: Sequence[Spec]) -> list[Result]:
        """The rows of specs, made now or before."""
        return self.run_block(Block(self.view, tuple(Cell(spec, 0) for spec in specs)))
