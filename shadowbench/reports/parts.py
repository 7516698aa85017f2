"""What a page shows at a time: one scene of a run, or all of them; texts, matrix, and the data of its scripts."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from shadowbench.measure.flips import ROW_METRICS
from shadowbench.reports.analysis import Configuration, Section, front
from shadowbench.reports.bias_curve import bias_charts
from shadowbench.reports.charts import default_size, front_chart, pass_chart, size_chart
from shadowbench.reports.gallery import gallery, no_pictures, shots_of_section
from shadowbench.reports.matrix import (
    ALL_SCENES,
    IOU_TARGETS,
    Candidate,
    Cell,
    candidates,
    line,
    matrix,
    over_all,
)
from shadowbench.reports.styles import Styles
from shadowbench.reports.verdict import best_of, cell_texts, cost_note, verdict
from shadowbench.reports.words import digits, refusals, section_notes, value_of, warned
from shadowbench.studies.folder import Run

_COST, _ERROR = "cost, ms", "1 − IoU"
_TIMES = {
    "IQR, ms": "frame_iqr_ms",
    "all still, ms": "still_ms",
    "camera moves, ms": "camera_ms",
    "light moves, ms": "light_ms",
    "× reference": "ratio",
}
_VALUES = {name: name for name in ROW_METRICS if name != "iou"} | _TIMES | {"GPU bytes": "gpu_bytes"}
DEFAULT_COLUMNS = [_COST, "map", _ERROR, "worst scene", "scenes", "edge_px", "ssim", "acne", "leak"]
"""The columns of a table that show until a reader chooses others."""


@dataclass(frozen=True, eq=False)
class Part:
    """One scene of a run, or all of them. `start`: the configuration and scene whose picture is shown first."""

    id: str
    run: int
    title: str
    sections: tuple[Section, ...]
    scene_ids: dict[str, str]

    @cached_property
    def found(self) -> list[Candidate]:
        """Its configurations."""
        return candidates(self.sections)

    @property
    def verdict(self) -> list[str]:
        """Its answer."""
        return verdict(self.sections)

    @property
    def start(self) -> dict[str, Any] | None:
        """What the verdict names first."""
        best = best_of(self.found)
        return None if best is None else self.pick(best)

    @property
    def cost_note(self) -> str:
        """What a cost in its matrix is."""
        return cost_note(self.sections)

    @property
    def notes(self) -> list[str]:
        """What a reader must know of its numbers."""
        if len(self.sections) > 1:
            return []
        cells = self.sections[0].cells
        several = f"medians of up to {cells} cells (views × phases) a configuration; intervals are 95%, by bootstrap"
        return [*section_notes(self.sections[0]), *([several] if cells > 1 else [])]

    @property
    def refusals(self) -> list[tuple[str, str]]:
        """What has no number, and why."""
        return refusals(self.sections[0]) if len(self.sections) == 1 else []

    @property
    def warned(self) -> list[str]:
        """What was noticed of masks from elsewhere."""
        return warned(self.sections[0]) if len(self.sections) == 1 else []

    @property
    def matrix(self) -> list[tuple[str, list[dict[str, Any]]]]:
        """By technique, what each cell shows."""
        lines = matrix(self.found, IOU_TARGETS)
        return [
            (technique, [self._cell(cell, len(self.sections)) for cell in cells]) for technique, cells in lines.items()
        ]

    @property
    def by_scene(self) -> list[tuple[str, list[dict[str, Any]]]]:
        """Of several scenes each, with the cheapest of all techniques."""
        if len(self.sections) == 1:
            return []
        lines = [(one.scene, line(candidates([one]), IOU_TARGETS)) for one in self.sections]
        return [(scene, [self._cell(cell, 1) for cell in cells]) for scene, cells in lines]

    def pick(self, one: Candidate) -> dict[str, Any]:
        """What its picture is found by: of several scenes the one in which it is worst."""
        return {"spec": one.whole.spec, "size": one.whole.map_size, "scene": self.scene_ids[one.worst]}

    def _cell(self, cell: Cell, scenes: int) -> dict[str, Any]:
        cost, label, note = cell_texts(cell, scenes)
        best = cell.cheapest
        state = "none" if best is None else "all" if len(best.held) == scenes else "some"
        same = ", ".join(one.whole.label for one in cell.equals)
        about = f"as cheap, within the noise: {same}" if same else label or note
        return {
            "cost": cost,
            "label": label,
            "note": note,
            "about": about,
            "state": state,
            **self.pick(best or cell.nearest),
        }


def parts_of(run: Run, index: int, every: Sequence[Section]) -> list[Part]:
    """Those of a run: all its scenes, where there are several, then each."""
    ours = [section for section in every if section.run is run]
    ids = {section.title: f"{index}-{at}" for at, section in enumerate(ours, start=1)}
    whole = [Part(f"{index}-0", index, ALL_SCENES, tuple(ours), ids)] if len(ours) > 1 else []
    return [*whole, *(Part(ids[one.title], index, one.title, (one,), ids) for one in ours)]


def part_of(part: Part, styles: Styles, most: int) -> dict[str, Any]:
    """The data of a part: charts, rows and columns of its table, and pictures, which only a single scene has."""
    several = len(part.sections) > 1
    section = over_all(part.sections) if several else part.sections[0]
    best = [] if several and not section.held else front(section)
    pictures = None if several else gallery(section.run.folder, shots_of_section(section), most)
    sizes: list[int | None] = [*sorted({one.map_size for one in section.timed if one.map_size})]
    passes = [(size, chart) for size in sizes or [None] if (chart := pass_chart(section, size)) is not None]
    on_front = {(one.spec, one.map_size) for one in best}
    return {
        "charts": {
            "front": front_chart(section, styles),
            "sizes": size_chart(section, styles),
            "passes": passes,
            "pass_size": default_size(section),
            "biases": [] if several else bias_charts(section),
        },
        "columns": [_COST, "map", _ERROR, *(["worst scene", "scenes"] if several else []), *_VALUES, "cells"],
        "rows": [_row(part, one, (one.whole.spec, one.whole.map_size) in on_front) for one in part.found],
        "gallery": None if pictures is None else asdict(pictures),
        "no_gallery": no_pictures(section.run),
    }


def _row(part: Part, one: Candidate, on_front: bool) -> dict[str, Any]:
    """A line of the table: by column, what it is sorted by and what it shows."""
    whole = one.whole
    error = whole.error
    assert error is not None  # only what has a score is a candidate
    low = one.held[one.worst].error
    where = next(section.scene for section in part.sections if section.title == one.worst)
    values: dict[str, tuple[float | None, str]] = {
        _COST: _value(whole, "frame_ms"),
        "map": (whole.map_size, str(whole.map_size or "")),
        _ERROR: (error.median, error.text(digits)),
        "worst scene": (
            None if low is None else low.median,
            f"{'–' if low is None else digits(low.median)} in {where}",
        ),
        "scenes": (len(one.held), f"{len(one.held)} of {len(part.sections)}"),
        **{title: _value(whole, name) for title, name in _VALUES.items()},
        "cells": (whole.row.cells, str(whole.row.cells)),
    }
    return {
        "technique": whole.technique,
        "spec": whole.spec,
        "map": whole.map_size,
        "full": whole.full_spec,
        "front": on_front,
        "scene": part.scene_ids[one.worst],
        "values": values,
    }


def _value(one: Configuration, name: str) -> tuple[float | None, str]:
    return one.value(name), value_of(one, name)
