"""The panels of a report, each with the results of one scene or of all scenes of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from shadowbench.measure.flips import ROW_METRICS
from shadowbench.reports.charts import bias_charts, default_size, front_chart, pass_chart, size_chart
from shadowbench.reports.gallery import Place, gallery, scored_cells
from shadowbench.reports.verdict import accuracy_text, cell_texts, real_time, verdict_candidate
from shadowbench.reports.words import COLUMNS, COST_HEADINGS, digits
from shadowbench.results.configurations import Configuration, Section, by_kind
from shadowbench.results.folder import Run
from shadowbench.results.ranking import (
    Candidate,
    CostCell,
    Target,
    candidates,
    cost_matrix,
    cost_row,
    mean_section,
    targets_of,
    title_of_all,
)

_TIMES = {
    "IQR, ms": "frame_iqr_ms",
    "all still, ms": "still_ms",
    "camera moves, ms": "camera_ms",
    "light moves, ms": "light_ms",
    "× reference": "ratio",
}

Matrix = list[tuple[str, list[dict[str, Any]]]]
"""Rows of a cost matrix: a technique or scene, and the texts and data of its cells."""


@dataclass(frozen=True, eq=False)
class Panel:
    """Results of one scene of a run, or of all its scenes of a kind, hard or soft.

    id: HTML id; run: index of the run; scene_ids: HTML ids of the run's single-scene panels, by section title.
    """

    id: str
    run: int
    title: str
    sections: tuple[Section, ...]
    scene_ids: Mapping[str, str]

    @property
    def soft(self) -> bool:
        """Whether its shadows have penumbrae."""
        return self.sections[0].soft

    @property
    def targets(self) -> tuple[Target, ...]:
        """The targets of its cost matrix."""
        return targets_of(self.sections[0].ranked_by)

    @cached_property
    def candidates(self) -> list[Candidate]:
        """Its configurations."""
        return candidates(self.sections)

    @property
    def start(self) -> dict[str, Any] | None:
        """Spec, map size and scene of the picture that is shown first, that of the verdict; None without a score."""
        best = verdict_candidate(self.candidates)
        return None if best is None else self._picture_of(best)

    def matrix(self, targets: Sequence[Target]) -> Matrix:
        """The cost matrix, a row for each technique."""
        rows = cost_matrix(self.candidates, targets).items()
        return [(technique, [self._cell(cell, self.sections) for cell in cells]) for technique, cells in rows]

    def matrix_by_scene(self, targets: Sequence[Target]) -> Matrix:
        """Rows with the cheapest real-time configuration in each scene; empty for a single scene."""
        scenes = self.sections if len(self.sections) > 1 else ()
        rows = [(one, cost_row(real_time(candidates([one])), targets)) for one in scenes]
        return [(one.scene, [self._cell(cell, [one]) for cell in cells]) for one, cells in rows]

    def _picture_of(self, one: Candidate) -> dict[str, Any]:
        """Spec, map size and scene of a candidate's picture; of several scenes, the one in which it is worst."""
        return {"spec": one.mean.spec, "size": one.mean.map_size, "scene": self.scene_ids[one.worst_scene]}

    def _cell(self, cell: CostCell, sections: Sequence[Section]) -> dict[str, Any]:
        cost, label, note = cell_texts(cell, len(sections))
        best = cell.cheapest
        about = [note] if best is None else [best.mean.full_spec]
        if cell.ties:
            about.append(f"as cheap, within the noise: {', '.join(one.mean.label for one in cell.ties)}")
        return {
            "cost": cost,
            "accuracy": accuracy_text(cell, {one.title: one.scene for one in sections}),
            "label": label,
            "note": note,
            "about": "; ".join(about),
            "state": "none" if best is None else "all" if len(best.by_scene) == len(sections) else "some",
            **self._picture_of(best or cell.closest),
        }


def panels_of(run: Run, index: int, every: Sequence[Section]) -> list[Panel]:
    """The panels of a run: one for all its hard or soft scenes if there are several, then one per scene.

    Scenes without any score come last.
    """
    ours = sorted((section for section in every if section.run is run), key=lambda section: not section.scored)
    ids = {section.title: f"{index}-{at}" for at, section in enumerate(ours, start=1)}
    kinds = by_kind(ours)
    overall = [
        Panel(f"{index}-{'soft' if kind[0].soft else 0}", index, title_of_all(kind, len(kinds)), tuple(kind), ids)
        for kind in kinds
        if len(kind) > 1
    ]
    return [*overall, *(Panel(ids[one.title], index, one.title, (one,), ids) for one in ours)]


def panel_data(panel: Panel, place: Place) -> dict[str, Any]:
    """The JSON data of a panel: charts, table, and for a single scene pictures."""
    several = len(panel.sections) > 1
    section = mean_section(panel.sections, panel.title) if several else panel.sections[0]
    sizes: list[int | None] = [*sorted({one.map_size for one in section.timed if one.map_size})]
    cost = _cost_heading(panel)
    on_front = {(one.spec, one.map_size) for one in section.front}
    error, over_scenes = panel.sections[0].ranked_by.error_label, ["worst scene", "scenes"]
    return {
        "charts": {
            "front": front_chart(section, None),
            "sizes": size_chart(section, None),
            "biases": {} if several else bias_charts(section),
            "passes": [(size, chart) for size in sizes or [None] if (chart := pass_chart(section, size)) is not None],
            "pass_size": default_size(section),
        },
        "columns": [cost, "map", error, *(over_scenes if several else []), *_values(panel), "cells"],
        "shown": [cost, "map", error, *over_scenes, *COLUMNS[panel.soft].values()],
        "rows": [_row(panel, one, (one.mean.spec, one.mean.map_size) in on_front) for one in panel.candidates],
        "gallery": None if several else gallery(section.run.folder, scored_cells(section), place),
    }


def _row(panel: Panel, one: Candidate, on_front: bool) -> dict[str, Any]:
    """A row of the table; values: by column, (sort key, text)."""
    mean, worst = one.mean, one.by_scene[one.worst_scene]
    error, worst_error = (found.error.median if found.error else None for found in (mean, worst))
    worst_scene = next(section.scene for section in panel.sections if section.title == one.worst_scene)
    values: dict[str, tuple[float | None, str]] = {
        _cost_heading(panel): _value(mean, mean.cost_name),
        "map": (mean.map_size, str(mean.map_size or "")),
        mean.ranked_by.error_label: (error, mean.error_text(digits)),
        "worst scene": (worst_error, f"{worst.error_text(digits, bounds=False)} in {worst_scene}"),
        "scenes": (len(one.by_scene), f"{len(one.by_scene)} of {len(panel.sections)}"),
        **{title: _value(mean, name) for title, name in _values(panel).items()},
        "cells": (mean.cells, str(mean.cells)),
    }
    return {
        "technique": mean.technique,
        "spec": mean.spec,
        "label": mean.name,
        "map": mean.map_size,
        "full": mean.full_spec,
        "front": on_front,
        "scene": panel.scene_ids[one.worst_scene],
        "values": values,
    }


def _values(panel: Panel) -> dict[str, str]:
    """Values of the table by heading, besides the error by which it is ranked."""
    names = dict.fromkeys([*(COLUMNS[True].values() if panel.soft else ()), *ROW_METRICS])
    ranked_by = panel.sections[0].ranked_by.name
    times = _TIMES if panel.sections[0].cost_name == "frame_ms" else {}
    return {name: name for name in names if name != ranked_by} | times | {"GPU bytes": "gpu_bytes"}


def _cost_heading(panel: Panel) -> str:
    heading = COST_HEADINGS[panel.sections[0].cost_name]
    return f"cost, {heading}" if heading == "ms" else heading


def _value(one: Configuration, name: str) -> tuple[float | None, str]:
    return one.value(name), one.text(name, digits)
