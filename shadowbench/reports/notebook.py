"""Measurements for notebooks: a frame that also draws its charts, and charts that a notebook shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError, alternatives
from shadowbench.reports.charts import front_chart, size_chart
from shadowbench.reports.report import write_chart
from shadowbench.reports.vega import Chart, styles_of, titled
from shadowbench.reports.words import cost_source
from shadowbench.results.configurations import Section, sections, specs_of
from shadowbench.results.folder import Run
from shadowbench.results.law import law_on_record
from shadowbench.results.tables import over_phases


@dataclass(frozen=True, eq=False)
class Figure:
    """A chart: a notebook shows it, `save` writes it, `spec` is its Vega-Lite specification."""

    spec: Chart

    def __repr__(self) -> str:
        return f"<Figure: {self.spec['description']}>"

    def save(self, file: str | Path) -> None:
        """Write a .png, .svg or .pdf. Raises InputError for another suffix."""
        path = Path(file)
        if path.suffix not in (".png", ".svg", ".pdf"):
            raise InputError(f"{path}: found suffix {path.suffix!r:.20}; allowed: .png, .svg, .pdf")
        write_chart(path, self.spec)

    def _repr_png_(self) -> bytes:
        import vl_convert  # not on every platform

        return bytes(vl_convert.vegalite_to_png(self.spec, scale=1.5))


class Results(pd.DataFrame):
    """Measurements with the columns of `table.csv`, a line per cell, or per spec, map size and view over its phases.

    `front` and `sizes` draw them. Frames made of it, such as a selection of columns, draw the same measurements.
    """

    _metadata = ["measured"]

    @classmethod
    def of(cls, run: Run, each_phase: bool) -> "Results":
        """The cells of a run."""
        found = cls(run.frame if each_phase else over_phases(run.frame))
        object.__setattr__(found, "measured", run)
        return found

    @property
    def _constructor(self) -> "type[Results]":
        return Results

    def front(self, scene: str | None = None) -> Figure:
        """Error against cost of a scene, by default the first; the line is the Pareto front.

        Cost is a time of this GPU or, without one, a predicted time, or work. Raises InputError for an unknown scene,
        and if nothing there has a cost.
        """
        section, every = self._section(scene)
        chart = front_chart(section, styles_of(specs_of(every)))
        if chart is None:
            allowed = "rounds of 1 or more on a GPU, else specs with a predicted time"
            raise InputError(f"front: {section.title} has no costs; allowed: {allowed}")
        return Figure(titled(chart, section.title, section.run.renderer, cost_source(section)))

    def sizes(self, scene: str | None = None) -> Figure:
        """Error against map size of a scene, by default the first.

        Raises InputError for an unknown scene, and if no technique there has a map.
        """
        section, every = self._section(scene)
        chart = size_chart(section, styles_of(specs_of(every)))
        if chart is None:
            raise InputError(f"sizes: {section.title} has no maps; allowed: results of techniques with maps")
        return Figure(titled(chart, section.title, section.run.renderer))

    def _section(self, scene: str | None) -> tuple[Section, Sequence[Section]]:
        run: Any = getattr(self, "measured", None)
        if run is None:
            raise InputError("found a frame joined of others; allowed: the results of one call of run")
        every = [section for parts in sections([run], law_on_record()).values() for section in parts]
        names = [section.scene for section in every]
        if scene is not None and scene not in names:
            raise InputError(f"scene: found {scene!r:.60}{alternatives(scene, names)}")
        return every[0 if scene is None else names.index(scene)], every
