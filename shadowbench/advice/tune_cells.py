"""Cells measured by `tune`: specs in many views, phases and map sizes."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from shadowbench.advice.tune_space import family_of
from shadowbench.measure.attempt import Attempt, Failure
from shadowbench.measure.bench import Bench, Job, Reporter
from shadowbench.measure.cells import Block, Cell, PlacedView
from shadowbench.measure.measurer import Measurer
from shadowbench.measure.rows import Record, Result
from shadowbench.measure.session import Session
from shadowbench.scenes.model import Coordinates, View, view_of
from shadowbench.studies.run import readable_blocks
from shadowbench.studies.study import Study
from shadowbench.techniques.spec import Spec
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth


class TuningCells:
    """Measures specs on blocks on request; the study gives map sizes, phases and views.

    failures: scenes and truths that failed and were left out; None to raise.
    """

    def __init__(self, study: Study, measurer: Measurer, failures: list[Failure] | None = None) -> None:
        self.study, self.measurer, self.failures = study, measurer, failures
        self.results: dict[str, Result] = {}

    @property
    def reporter(self) -> Reporter:
        """Receiver of progress messages."""
        return self.measurer.bench.reporter

    def eligible_blocks(self, spec: Spec) -> list[Block]:
        """Blocks for every camera and light of the study's scenes that show a shadow and that `spec` supports.

        Traces their truths; the other views are reported.
        """
        readable = self.study.blocks() if self.failures is None else readable_blocks(self.study, self.failures)
        blocks = [
            replace(block, view=view_of(block.scene, camera, block.view.light, block.view.size))
            for block in readable
            for camera in block.scene.cameras
        ]
        self.reporter.stage("truth", len(blocks))
        kept = []
        jobs: Sequence[Job[str | Failure | None]]
        jobs = [EligibilityJob(block.view, self.study.coordinates, spec) for block in blocks]
        if self.failures is not None:
            jobs = [Attempt(job, "truth", block.view.name) for job, block in zip(jobs, blocks, strict=True)]
        for block, reason in zip(blocks, self.measurer.bench.run(jobs), strict=True):
            if isinstance(reason, Failure):
                assert self.failures is not None
                self.failures.append(reason)
            elif reason is None:
                kept.append(block)
            else:
                self.reporter.note(f"{block.view.name} takes no part: {reason}")
        return kept

    def unsupported_reason(self, spec: Spec, block: Block) -> str | None:
        """Why a spec does not support a block's view; None if it does."""
        at = PlacedView(block.view, self.study.coordinates)
        return self.measurer.bench.executor.call(Session.unsupported, at, Cell(spec).request)

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
        together = tuple(cell for own in cells.values() for cell in own)
        for of_block in self.measurer.measure([replace(block, cells=together) for block in blocks]):
            results = iter(of_block)
            for spec, own in cells.items():
                found = list(itertools.islice(results, len(own)))
                rows[spec] += [result.score for result in found]
                self.results |= {result.score["key"]: result for result in found}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()


@dataclass(frozen=True, eq=False)
class EligibilityJob(Job[str | None]):
    """Job that traces the truth of a view into the cache, and returns why the view takes no part in tuning a spec."""

    view: View
    coordinates: Coordinates
    spec: Spec

    @property
    def truths(self) -> Sequence[tuple[View, int]]:
        """The view's."""
        return ((self.view, PIXEL_SAMPLES),)

    def __call__(self, bench: Bench) -> str | None:
        """Why nothing can be tuned in the view; None if it takes part."""
        lit = not (cached_truth(self.view).visibility < 1).any()
        at = PlacedView(self.view, self.coordinates)
        reason = "nothing is in shadow" if lit else None
        reason = reason or bench.executor.call(Session.unsupported, at, Cell(self.spec).request)
        bench.reporter.step(self.view.name)
        return reason
