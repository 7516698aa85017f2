"""What rows say of a scene: its configurations, their Pareto front, and which accuracies they reach."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from shadowbench.studies.folder import Run
from shadowbench.studies.tables import Interval, SummaryRow, interval, summary_rows, titles
from shadowbench.studies.times import ReferenceTime, normalise_times, pareto_front

IOU_STEPS = (0.95, 0.99, 0.999)
EDGE_STEPS = (1.0, 0.5, 0.25)


@dataclass(frozen=True)
class Pass:
    """The median time of a pass, by the table's reference, and when it has to be drawn again."""

    name: str
    ms: float
    changes: str


@dataclass(frozen=True, eq=False)
class Configuration:
    """A spec at a map size, with the medians of its cells over views, lights and phases."""

    technique: str
    full_spec: str
    row: SummaryRow
    passes: tuple[Pass, ...]

    @property
    def spec(self) -> str:
        """As it was written, without the map's size."""
        return self.row.spec

    @property
    def map_size(self) -> int | None:
        """Texels along a side of the map; None without a map."""
        return self.row.map_size

    @property
    def label(self) -> str:
        """Spec and map size, as people say it."""
        return f"{self.spec} at {self.map_size}" if self.map_size else self.spec

    @property
    def error(self) -> Interval | None:
        """1 − IoU."""
        iou = self.row.values["iou"]
        return None if iou is None else iou.complement()

    def value(self, name: str) -> float | None:
        """The median of a metric or a time (`frame_ms`, …); None where there is none."""
        found = self.row.values[name]
        return None if found is None else found.median


@dataclass(frozen=True, eq=False)
class Section:
    """What one run measured in one scene under one light.

    `frame` has its times by one time of `reference`, which is None where nothing has a ratio; `configurations` stand
    best first; `floor` is where no error is drawn.
    """

    run: Run
    scene: str
    title: str
    frame: pd.DataFrame
    reference: ReferenceTime | None
    configurations: tuple[Configuration, ...]

    @property
    def held(self) -> list[Configuration]:
        """The configurations with a score."""
        return [one for one in self.configurations if one.error is not None]

    @property
    def soft(self) -> bool:
        """Whether its shadows have penumbrae, so that the configurations are ranked by `rmse`."""
        return any(one.row.soft for one in self.held)

    @property
    def timed(self) -> list[Configuration]:
        """Those with a score and a time."""
        return [one for one in self.held if one.value("frame_ms") is not None]

    @property
    def floor(self) -> float:
        """Half a pixel's worth of error: below every error there can be but none, which a log axis has no place for."""
        receivers = self.frame["receivers"].dropna()
        return 0.5 / float(receivers.max()) if len(receivers) else 1e-7

    @property
    def file_stem(self) -> str:
        """What files about it begin with: scene, light, view size, and coordinates unless they are the usual ones."""
        first = self.frame.iloc[0]
        stem = f"{self.scene.replace(', ', '.')}.{first['view_size']}"
        return stem + (".absolute" if first["coordinates"] == "absolute" else "")

    @property
    def cells(self) -> int:
        """The most cells (views × phases) behind one configuration."""
        return max((one.row.cells for one in self.configurations), default=0)


def sections(runs: Sequence[Run]) -> dict[str, list[Section]]:
    """By title, the sections of every run that measured it. Other lights, view sizes or coordinates are another."""
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


def specs_of(sections: Sequence[Section]) -> list[str]:
    """Every spec that their runs measured, in that order."""
    return list(dict.fromkeys(str(spec) for section in sections for spec in section.run.frame["spec"]))


def _configurations(run: Run, frame: pd.DataFrame) -> list[Configuration]:
    return [
        Configuration(str(group["technique"].iloc[0]), str(group["full_spec"].iloc[0]), row, _passes(run, group))
        for row in summary_rows(frame)
        for group in [frame[(frame["spec"] == row.spec) & _of_size(frame["map_size"], row.map_size)]]
    ]


def _of_size(sizes: "pd.Series[int]", size: int | None) -> "pd.Series[bool]":
    return sizes.isna() if size is None else sizes.eq(size).fillna(False)


def _passes(run: Run, group: pd.DataFrame) -> tuple[Pass, ...]:
    times = [run.results[int(index)].time for index in group.index]
    names = list(dict.fromkeys(name for time in times if time for name in time["passes"]))
    passes = []
    for name in names:
        held = [time["passes"][name] for time in times if time and name in time["passes"]]
        median = interval(group[f"pass_{name}_ms"].tolist())
        if median is not None:
            passes.append(Pass(name, median.median, str(held[0].get("changes", "frame"))))
    return tuple(passes)


def front(section: Section) -> list[Configuration]:
    """The configurations that none beats in both error and time, fastest and least accurate first."""
    timed = section.timed
    points = [(one.row.values["frame_ms"], one.error) for one in timed]
    return [timed[index] for index in pareto_front([(ms.median, error.median) for ms, error in points if ms and error])]


def reaches_iou(one: Configuration, step: float) -> bool:
    """Whether the median IoU is the step or better."""
    value = one.value("iou")
    return value is not None and value >= step


def reaches_edge(one: Configuration, step: float) -> bool:
    """Whether the shadows' edges are off by the step's pixels or less."""
    value = one.value("edge_px")
    return value is not None and value <= step
