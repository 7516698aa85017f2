"""The cells that `tune` measures: specs on many views, phases and map sizes, each once."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from shadowbench.advice.tune_space import rows_of
from shadowbench.measure.drawn import Drawn
from shadowbench.measure.rows import Record
from shadowbench.measure.runner import Reporter, Result, Runner
from shadowbench.measure.timing import request_of
from shadowbench.measure.worker import Worker
from shadowbench.scenes.model import View, view_of
from shadowbench.studies.study import Block, Cell, Study
from shadowbench.techniques.spec import Spec
from shadowbench.truth.cache import cached_truth
from shadowbench.truth.trace import Truth


class Cells(Runner):
    """A runner that is given specs and blocks as they are asked for; the study says sizes, phases and views.

    Use as a context manager. Rows alone are kept, neither masks nor pictures.
    """

    def __init__(self, study: Study, folder: Path, worker: Worker, reporter: Reporter) -> None:
        super().__init__(study, folder, worker, reporter)
        self._check_sizes()
        self.results: dict[str, Result] = {}

    def taking_part(self, spec: Spec) -> list[Block]:
        """Every camera and light of the study's scenes, truths traced, where something is in shadow and `spec` answers.

        The others are noted.
        """
        blocks = [
            replace(block, view=view_of(block.scene, camera, block.view.light, block.view.size))
            for block in self.study.blocks()
            for camera in block.scene.cameras
        ]
        self.reporter.stage("truth", len(blocks))
        kept = []
        for block in blocks:
            reason = None if (cached_truth(block.view).visibility < 0.5).any() else "nothing is in shadow"
            reason = reason or self.refusal(spec, block)
            if reason is None:
                kept.append(block)
            else:
                self.reporter.note(f"{block.view.name} takes no part: {reason}")
            self.reporter.step(block.view.name)
        return kept

    def refusal(self, spec: Spec, block: Block) -> str | None:
        """Why a spec has no answer for a block's view; None where it has one."""
        self._stage.open(block)
        reason: str | None = self.worker.call("unsupported", request_of(Cell(spec, 0)))
        return reason

    def refused_rows(self, spec: Spec, names: Sequence[str], blocks: Sequence[Block]) -> dict[str, frozenset[str]]:
        """By parameter, the rows with which a spec has no answer under one of the kinds of light that there are."""
        views = list({block.view.light.kind: block for block in blocks}.values())
        fields = type(spec.params).model_fields
        return {
            name: frozenset(
                row.name
                for row in rows_of(fields[name])
                if any(self.refusal(spec.with_(**{name: row()}), block) is not None for block in views)
            )
            for name in names
        }

    def each(self, spec: Spec) -> int:
        """The cells of a spec in one block."""
        return len(self._cells(spec))

    def measured(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, list[Record]]:
        """The score rows of each spec; a block after the other, so that its scene is loaded once."""
        cells = {spec: self._cells(spec) for spec in specs}
        rows: dict[Spec, list[Record]] = {spec: [] for spec in cells}
        for block in blocks:
            together = tuple(cell for own in cells.values() for cell in own)
            results = iter(self.run_block(replace(block, cells=together)))
            for spec, own in cells.items():
                found = list(itertools.islice(results, len(own)))
                rows[spec] += [one.score for one in found]
                self.results |= {one.score["key"]: one for one in found}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()

    def _write_truth(self, view: View, truth: Truth) -> None:
        pass

    def _write_cell(self, row: Record, drawn: Drawn | None) -> None:
        self._store.append(row)
