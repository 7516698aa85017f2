"""Cells measured by `tune`: specs in many views, phases and map sizes."""

from collections.abc import Sequence

from shadowbench.advice.tune_space import family_of
from shadowbench.measure.campaign import Campaign, Reporter
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.rows import Record, Result
from shadowbench.scenes.model import view_of
from shadowbench.studies.run import readable_blocks
from shadowbench.studies.study import Study
from shadowbench.techniques.spec import Spec


class TuningCells:
    """Measures specs on blocks on request; the study gives map sizes, phases and views."""

    def __init__(self, study: Study, campaign: Campaign) -> None:
        self.study, self.campaign = study, campaign
        self.results: dict[str, Result] = {}

    @property
    def reporter(self) -> Reporter:
        """Receiver of progress messages."""
        return self.campaign.reporter

    def eligible_blocks(self, spec: Spec) -> list[Block]:
        """Blocks for every camera and light of the study's scenes that show a shadow and that `spec` supports.

        Traces their truths; the other views are reported.
        """
        going = self.campaign.keep_going
        readable = readable_blocks(self.study, self.campaign.failures) if going else self.study.blocks()
        blocks = [
            self.study.block(view_of(block.scene, camera, block.view.light, block.view.size))
            for block in readable
            for camera in block.scene.cameras
        ]
        kept = []
        for block, uniform in self.campaign.trace(blocks):
            reason = "nothing is in shadow" if uniform == "lit" else None
            reason = reason or self.campaign.drawer.unsupported(block, Cell(spec))
            if reason is None:
                kept.append(block)
            else:
                self.reporter.note(f"{block.view.name} takes no part: {reason}")
        return kept

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
                if any(
                    self.campaign.drawer.unsupported(block, Cell(spec.with_(**{name: one()}))) is not None
                    for block in views
                )
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
        together = [cell for own in cells.values() for cell in own]
        for found in self.campaign.measure(block.of(together).fresh() for block in blocks):
            for spec, own in cells.items():
                rows[spec] += [found[cell].score for cell in own]
            self.results |= {result.score["key"]: result for result in found.values()}
        return rows

    def _cells(self, spec: Spec) -> tuple[Cell, ...]:
        return self.study.with_specs([spec]).cells()
