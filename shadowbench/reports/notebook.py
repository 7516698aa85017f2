"""Measurements for notebooks: a frame that also draws its charts, and charts that a notebook shows."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError, alternatives, module_of_extra
from shadowbench.reports.charts import Chart, front_chart, size_chart, styles_of, titled, write_chart
from shadowbench.reports.texts import cost_source
from shadowbench.results.frame import Run, over_phases
from shadowbench.results.law import law_on_record
from shadowbench.results.summary import specs_of, summaries


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
        vl_convert = module_of_extra("vl_convert", "figures", "charts in notebooks are drawn by")
        return bytes(vl_convert.vegalite_to_png(self.spec, scale=1.5))


class Results(pd.DataFrame):
    """Measurements with the columns of `table.csv`, a line per cell, or per spec, map size and view over its phases.

    `front` and `sizes` draw them. Frames made of it, such as a selection of columns, draw the same measurements.
    """

    _metadata = ["measured"]

    @classmethod
    def of(cls, run: Run, each_phase: bool) -> "Results":
        """The cells of a run."""
        results = cls(run.frame if each_phase else over_phases(run.frame))
        object.__setattr__(results, "measured", run)
        return results

    @property
    def _constructor(self) -> "type[Results]":
        return Results

    def front(self, scene: str | None = None) -> Figure:
        """Error against cost of a scene, by default the first; the line is the Pareto front.

        Cost is a time of this GPU or, without one, a predicted time, or work. Raises InputError for an unknown scene,
        and if nothing there has a cost.
        """
        return self._figure(scene, front_chart, "costs; allowed: a GPU's times, or specs with a predicted time")

    def sizes(self, scene: str | None = None) -> Figure:
        """Error against map size of a scene, by default the first. Raises InputError, as `front` does."""
        return self._figure(scene, size_chart, "maps; allowed: results of techniques with maps")

    def _figure(self, scene: str | None, draw: Callable[..., Chart | None], missing: str) -> Figure:
        run: Any = getattr(self, "measured", None)
        if run is None:
            raise InputError("found a frame joined of others; allowed: the results of one call of run")
        scenes = {summary.scene: summary for summary in reversed(summaries(run, law_on_record()))}
        if scene is not None and scene not in scenes:
            raise InputError(f"scene: found {scene!r:.60}{alternatives(scene, list(reversed(scenes)))}")
        summary = scenes[next(reversed(scenes)) if scene is None else scene]
        chart = draw(summary, styles_of(specs_of([run])))
        if chart is None:
            raise InputError(f"{summary.title} has no {missing}")
        subtitle = [cost_source(summary)] if draw is front_chart else []
        return Figure(titled(chart, summary.title, run.renderer, *subtitle))
