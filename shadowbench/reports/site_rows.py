"""Rows as a site shows them: what each scored, what made it, and how to measure it again."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from urllib.parse import quote, urlencode

from shadowbench.measure.rows import Record, Result
from shadowbench.plugin.registry import engines, preset_names
from shadowbench.reports.words import COLUMNS, optional
from shadowbench.results.configurations import Section
from shadowbench.results.engine_settings import label_of, names_of
from shadowbench.results.folder import Run
from shadowbench.scores.metrics import Metric, is_soft, ranking
from shadowbench.studies.repro import bibtex

MAP_SIZE = 1024
"""Of the settings that the first page compares."""


@dataclass(frozen=True, eq=False)
class SiteRow:
    """A row; run: the folder that has it; title: that of its section in the run's report."""

    run: Run
    title: str
    score: Record
    result: Result

    @cached_property
    def name(self) -> str:
        """Setting, a preset by its name, and map size."""
        spec, size = self.score["spec"], self.score["map_size"]
        if self.is_engine:
            return label_of(self.score["technique"], spec, size).replace("`", "")
        return preset_names().get(spec, spec) + (f" at {size}" if size else "")

    @property
    def is_engine(self) -> bool:
        """Whether another engine drew it."""
        return self.score["technique"] in engines()

    @property
    def version(self) -> str:
        """Version of what drew it."""
        ours = str(self.run.about.get("versions", {}).get("shadowbench", "unknown"))
        return str(self.score.get("engine", {}).get("version", "not drawn")) if self.is_engine else ours

    @property
    def compared(self) -> bool:
        """Whether the first page compares it: at MAP_SIZE or without a map; of an engine, as shipped."""
        shipped = not self.is_engine or self.score["spec"] == next(iter(names_of(engines()[self.score["technique"]])))
        return shipped and self.score["map_size"] in (None, MAP_SIZE)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks it."""
        return ranking(is_soft(self.score.get("metrics", {})))

    @cached_property
    def error(self) -> float | None:
        """The error by which it is ranked; None without a score."""
        value = self.score.get("metrics", {}).get(self.ranked_by.name)
        return None if value is None or self.score["status"] != "ok" else self.ranked_by.error(value)

    @property
    def values(self) -> dict[str, str]:
        """Its other metrics, work and the time of a GPU, by heading."""
        metrics, time = self.score.get("metrics", {}), self.result.time or {}
        found = {title: metrics.get(name) for title, name in COLUMNS[self.ranked_by.name == "rmse"].items()}
        found |= {"contact": metrics.get("contact"), "work": self.score.get("work", {}).get("cost")}
        found |= {} if self.run.software else {"ms": time.get("frame_ms")}
        return {title: optional(value) for title, value in found.items()}

    @property
    def address(self) -> str:
        """Its place on the site, from the first page."""
        return f"{scene_file(self.score['scene'])}#{self.score['key']}"

    @property
    def repeat(self) -> str:
        """The commands that measure it again, from the root of the repository if it is published."""
        row = self.score
        size = ["--map-size", str(row["map_size"])] if row["map_size"] else []
        view = ["--view-size", str(row["view_size"]), "--phases", str(row["phase"] + 1), "--rounds", "0"]
        command = shlex.join(["shadowbench", "run", row["scene"], "-t", row["spec"], *size, *view])
        install = f"shadowbench engines install {row['technique']}\n" if self.is_engine else ""
        folder = shlex.quote(os.path.relpath(self.run.folder))
        study = "# or, in a clone, as a study with this row as its baseline:"
        return f"{install}{command}\n{study}\nshadowbench repro {row['key']} --of {folder}"

    @property
    def citation(self) -> str:
        """Its BibTeX entry; nothing without a score."""
        return bibtex(self.run, self.score) if self.error is not None else ""

    @property
    def mask(self) -> Path | None:
        """Its mask, if it is kept."""
        file = self.run.folder / "masks" / f"{self.score['key']}.png"
        return file if file.exists() else None

    @property
    def wipe(self) -> str:
        """The place of its picture beside the truth, in the report of its run."""
        size = f" at {self.score['map_size']}" if self.score["map_size"] else ""
        chosen = {"scene": self.title, "left": self.score["spec"] + size, "right": "truth"}
        return f"{quote(self.run.label)}.html#{urlencode(chosen)}"


def scene_file(scene: str) -> str:
    """The page of a scene, from the first page."""
    return f"scenes/{quote(scene)}.html"


def site_rows(sections: Sequence[Section]) -> list[SiteRow]:
    """The rows of all sections, least error first, those without a score last."""
    rows = []
    for section in sections:
        results = [section.run.results[int(index)] for index in section.frame.index]
        rows += [SiteRow(section.run, section.title, result.score, result) for result in results]
    return sorted(rows, key=lambda row: (row.error is None, row.error or 0.0, row.name))


def level(row: SiteRow) -> str:
    """CSS class of its error: at most 1%, at most 5%, or more; none without a score."""
    return "" if row.error is None else "all" if row.error <= 0.01 else "some" if row.error <= 0.05 else "much"
