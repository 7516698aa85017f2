"""The results of each run, scene and light: configurations, and their Pareto front."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import pandas as pd

from shadowbench.scores.metrics import Metric, ranking
from shadowbench.studies.folder import Run
from shadowbench.studies.tables import Interval, SummaryRow, interval, summary_rows, titles
from shadowbench.studies.times import ReferenceTime, normalise_times, pareto_front


@dataclass(frozen=True)
class PassTime:
    """Median time of a rendering pass, relative to the table's reference; changes: what invalidates its result."""

    name: str
    ms: float
    changes: str


@dataclass(frozen=True, eq=False)
class Configuration:
    """A spec at one map size. row: medians over its views, lights and phases."""

    technique: str
    full_spec: str
    row: SummaryRow
    passes: tuple[PassTime, ...]

    @property
    def spec(self) -> str:
        """The spec as written by the user, without the map size."""
        return self.row.spec

    @property
    def map_size(self) -> int | None:
        """Side of the shadow map in texels; None without a map."""
        return self.row.map_size

    @property
    def label(self) -> str:
        """Spec and map size, as in `shadow-map at 1024`."""
        return f"{self.row.label} at {self.map_size}" if self.map_size else self.row.label

    @property
    def error(self) -> Interval | None:
        """The error by which it is ranked; None without a score."""
        return self.row.error

    def value(self, name: str) -> float | None:
        """Median of a metric or time such as `frame_ms`; None if it was not measured."""
        found = self.row.values[name]
        return None if found is None else found.median


@dataclass(frozen=True, eq=False)
class Section:
    """Results of one run in one scene under one light.

    frame: the run's cells, with times normalised to `reference`, which is None if no cell has a time ratio;
    configurations: best first.
    """

    run: Run
    scene: str
    title: str
    frame: pd.DataFrame
    reference: ReferenceTime | None
    configurations: tuple[Configuration, ...]

    @cached_property
    def scored(self) -> list[Configuration]:
        """The configurations with a score."""
        return [one for one in self.configurations if one.error is not None]

    @cached_property
    def soft(self) -> bool:
        """Whether its shadows have penumbrae."""
        return any(one.row.soft for one in self.scored)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks its configurations."""
        return ranking(self.soft)

    @cached_property
    def timed(self) -> list[Configuration]:
        """The configurations with a score and a time."""
        return [one for one in self.scored if one.value("frame_ms") is not None]

    @cached_property
    def least_error(self) -> float:
        """The error at which charts draw smaller ones: of half a wrong pixel, or for soft shadows the truth's own."""
        if self.soft:
            return float(self.frame["truth_error"].mean())
        receivers = self.frame["receivers"].dropna()
        return 0.5 / float(receivers.max()) if len(receivers) else 1e-7

    @property
    def file_stem(self) -> str:
        """Start of the names of its chart files: scene, light, view size, and `absolute` for absolute coordinates."""
        first = self.frame.iloc[0]
        stem = f"{self.scene.replace(', ', '.')}.{first['view_size']}"
        return stem + (".absolute" if first["coordinates"] == "absolute" else "")

    @cached_property
    def max_cells(self) -> int:
        """Largest number of cells (views × phases) of any configuration."""
        return max((one.row.cells for one in self.configurations), default=0)


def sections(runs: Sequence[Run]) -> dict[str, list[Section]]:
    """The sections of all runs, by title. Different lights, view sizes or coordinates are different sections."""
    found: dict[str, list[Section]] = {}
    for run in runs:
        for (scene, size, coordinates), measured in run.frame.groupby(
            [titles(run.frame), "view_size", "coordinates"], sort=False, dropna=False
        ):
            title = f"{scene}, {size}² view" + (f", {coordinates} coordinates" if coordinates == "absolute" else "")
            frame, reference = normalise_times(measured)
            section = Section(run, str(scene), title, frame, reference, tuple(_configurations(run, frame)))
            found.setdefault(title, []).append(section)
    return found


def by_kind(sections: Sequence[Section]) -> list[list[Section]]:
    """The sections with hard shadows and those with soft ones, whose errors are not comparable; without empty lists.

    A section without any score, such as one whose light nothing supports, is of neither kind.
    """
    kinds = [[section for section in sections if section.scored and section.soft == soft] for soft in (False, True)]
    return [kind for kind in kinds if kind]


def specs_of(sections: Sequence[Section]) -> list[str]:
    """All specs that the sections' runs measured, in the order in which they were measured."""
    return list(dict.fromkeys(str(spec) for section in sections for spec in section.run.frame["spec"]))


def _configurations(run: Run, frame: pd.DataFrame) -> list[Configuration]:
    rows = {(row.spec, row.map_size): row for row in summary_rows(frame)}
    groups: dict[tuple[str, int | None], pd.DataFrame] = {}
    for key, group in frame.groupby(["spec", "map_size"], sort=False, dropna=False):
        spec, size = cast("tuple[str, float]", key)
        groups[spec, None if pd.isna(size) else int(size)] = group
    return [
        Configuration(str(group["technique"].iloc[0]), str(group["full_spec"].iloc[0]), row, _pass_times(run, group))
        for key, row in rows.items()
        for group in [groups[key]]
    ]


def _pass_times(run: Run, group: pd.DataFrame) -> tuple[PassTime, ...]:
    times = [run.results[int(index)].time for index in group.index]
    names = list(dict.fromkeys(name for time in times if time for name in time["passes"]))
    passes = []
    for name in names:
        records = [time["passes"][name] for time in times if time and name in time["passes"]]
        median = interval(group[f"pass_{name}_ms"].tolist())
        if median is not None:
            passes.append(PassTime(name, median.median, str(records[0].get("changes", "frame"))))
    return tuple(passes)


def front(section: Section) -> list[Configuration]:
    """The Pareto-optimal configurations in error and time, fastest and least accurate first."""
    timed = section.timed
    points = [(one.row.values["frame_ms"], one.error) for one in timed]
    return [timed[index] for index in pareto_front([(ms.median, error.median) for ms, error in points if ms and error])]
