"""The cells that `tune` measures: specs on many views, phases and map sizes, each once."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

from shadowbench.advice.tune_space import rows_of
from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.measurer import Measurer, Reporter
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.session import Session
from shadowbench.scenes.model import view_of
from shadowbench.studies.study import Study
from shadowbench.techniques.spec import Spec
from shadowbench.truths.cache import cached_truth


class Cells:
    """Measures specs on blocks as they are asked for; the study says sizes, phases and views."""

    def __init__(self, study: Study, measurer: Measurer) -> None:
        self.study, self.measurer = study, measurer
        self.results: dict[str, Result] = {}

    @property
    def reporter(self) -> Reporter:
        """Who is told how it goes."""
        return self.measurer.reporter

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
        at = PlacedView(block.view, self.study.coordinates)
        return self.measurer.executor.call(Session.unsupported, at, Cell(spec).request)

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

    def measure(self, specs: Sequence[Spec], blocks: Sequence[Block]) -> dict[Spec, list[Record]]:
        """The score rows of each spec; a block after the other, so that its scene is loaded once."""
        cells = {spec: self._cells(spec) for spec in specs}
        rows: dict[Spec, list[Record]] = {spec: [] for spec in cells}
        for block in blocks:
            together = tuple(cell for own in cells.values() for cell in own)
            results = iter(self.measurer.measure(replace(block, cells=together)))
            for spec, own in cells.items():
                found = list(itertools.islice(results, len(own)))
                rows[spec] += [one.score for one in found]
                self.results |= {one.score["key"]: one for one in found}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()
