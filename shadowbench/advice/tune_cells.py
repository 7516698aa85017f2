"""Cells measured by `tune`: specs in many views, phases and map sizes."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

from shadowbench.advice.tune_space import family_of
from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.measurer import Measurer, Reporter
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.session import Session
from shadowbench.scenes.model import view_of
from shadowbench.studies.study import Study
from shadowbench.techniques.spec import Spec
from shadowbench.truths.cache import cached_truth


class TuningCells:
    """Measures specs on blocks on request; the study gives map sizes, phases and views."""

    def __init__(self, study: Study, measurer: Measurer) -> None:
        self.study, self.measurer = study, measurer
        self.results: dict[str, Result] = {}

    @property
    def reporter(self) -> Reporter:
        """Receiver of progress messages."""
        return self.measurer.reporter

    def eligible_blocks(self, spec: Spec) -> list[Block]:
        """Blocks for every camera and light of the study's scenes that show a shadow and that `spec` supports.

        Traces their truths; the other views are reported.
        """
        blocks = [
            replace(block, view=view_of(block.scene, camera, block.view.light, block.view.size))
            for block in self.study.blocks()
            for camera in block.scene.cameras
        ]
        self.reporter.stage("truth", len(blocks))
        kept = []
        for block in blocks:
            reason = None if (cached_truth(block.view).visibility < 1).any() else "nothing is in shadow"
            reason = reason or self.unsupported_reason(spec, block)
            if reason is None:
                kept.append(block)
            else:
                self.reporter.note(f"{block.view.name} takes no part: {reason}")
            self.reporter.step(block.view.name)
        return kept

    def unsupported_reason(self, spec: Spec, block: Block) -> str | None:
        """Why a spec does not support a block's view; None if it does."""
        at = PlacedView(block.view, self.study.coordinates)
        return self.measurer.executor.call(Session.unsupported, at, Cell(spec).request)

    def unsupported_components(
        self, spec: Spec, names: Sequence[str], blocks: Sequence[Block]
    ) -> dict[str, frozenset[str]]:
        """By parameter, the components with which a spec does not support some kind of light in the blocks."""
        views = list({block.view.light.kind: block for block in blocks}.values())
        fields = type(spec.params).model_fields
        return {
            name: frozenset(
                one.name
                for one in family_of(fields[name])
                if any(self.unsupported_reason(spec.with_(**{name: one()}), block) is not None for block in views)
            )
            for name in names
        }

    def cells_per_block(self, spec: Spec) -> int:
        """Number of cells of a spec in one block."""
        return len(self._cells(spec))

    def measure(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, list[Record]]:
        """Score rows of each spec, measured block by block, so that each scene is loaded once."""
        cells = {spec: self._cells(spec) for spec in specs}
        rows: dict[Spec, list[Record]] = {spec: [] for spec in cells}
        for block in blocks:
            together = tuple(cell for own in cells.values() for cell in own)
            results = iter(self.measurer.measure(replace(block, cells=together)))
            for spec, own in cells.items():
                found = list(itertools.islice(results, len(own)))
                rows[spec] += [result.score for result in found]
                self.results |= {result.score["key"]: result for result in found}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()
