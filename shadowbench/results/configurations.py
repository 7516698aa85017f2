"""Configurations, a spec at one map size each, summarised over the cells of a run in one scene."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.measure.columns import TIMES, TOTALS, TRUTH_ERRORS
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import own_techniques, preset_names
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.folder import Run
from shadowbench.results.law import SHORTEST_MS
from shadowbench.results.times import ROUGH, ReferenceTime, normalise_times, pareto_front
from shadowbench.scores.metrics import METRICS, Metric, is_soft, ranking

BIAS_LENGTHS = ("fact_bias_m", "fact_bias_texels", "fact_normal_offset_m", "fact_normal_offset_texels")
_VALUES = [*TRUTH_ERRORS, "width_bias", *list(TIMES)[:4], *TOTALS, "predicted_ms", "work_cost", "gpu_bytes"]
_BOOTSTRAPS = 2000

CostName = Literal["frame_ms", "predicted_ms", "work_cost", "map_size"]
"""By what a section's configurations are ranked: a measured time, a predicted one, work, or without any the map."""


class Prediction(Protocol):
    """Predicts the times of a device from the work that a software renderer counts."""

    @property
    def device(self) -> str:
        """Its name."""

    def of_row(self, row: Record) -> float | None:
        """Milliseconds of a score row; None where they cannot be told."""


@dataclass(frozen=True)
class Interval:
    """Median over views and phases, with its 95% bootstrap confidence interval and the range of the values.

    low, high: ends of the confidence interval; least, most: of the range. None for one value.
    """

    median: float
    low: float | None = None
    high: float | None = None
    least: float | None = None
    most: float | None = None

    def complement(self) -> "Interval":
        """Interval of 1 − x, which turns a similarity into an error."""
        ends = (None if end is None else 1 - end for end in (self.high, self.low, self.most, self.least))
        return Interval(1 - self.median, *ends)

    def text(self, digits: Callable[[float], str]) -> str:
        """Text such as `0.0123 [0.0110, 0.0140]`; digits: formats a number."""
        if self.low is None or self.high is None:
            return digits(self.median)
        return f"{digits(self.median)} [{digits(self.low)}, {digits(self.high)}]"


def interval(values: Sequence[float] | NDArray[np.float64]) -> Interval | None:
    """Median and bootstrap confidence interval (fixed seed) of the values that are not NaN; None if there are none."""
    array = np.asarray(values, dtype=float)
    array = array[~np.isnan(array)]
    if len(array) < 2:
        return Interval(float(array[0])) if len(array) else None
    draws = np.random.default_rng(0).choice(array, (_BOOTSTRAPS, len(array)))
    low, high = np.percentile(np.median(draws, axis=1), [2.5, 97.5])
    return Interval(float(np.median(array)), float(low), float(high), float(array.min()), float(array.max()))


@dataclass(frozen=True)
class PassTime:
    """Median time of a rendering pass, relative to the section's reference; changes: what invalidates its result."""

    name: str
    ms: float
    changes: str


@dataclass(frozen=True, eq=False)
class Configuration:
    """A spec at one map size; spec: as written by the user, without the map size.

    cells, phases: numbers of successful cells and of their phases; refused: statuses of the others; values: medians
    over the successful ones, with times normalised to one reference time; cost_name: the value that is its cost.
    """

    technique: str
    spec: str
    full_spec: str
    map_size: int | None
    cells: int
    refused: tuple[str, ...]
    values: Mapping[str, Interval | None]
    phases: int
    passes: tuple[PassTime, ...] = ()
    cost_name: CostName = "frame_ms"

    @property
    def name(self) -> str:
        """The spec as tables print it: a preset by its name, others as users write them."""
        return preset_names().get(self.spec, self.spec)

    @property
    def label(self) -> str:
        """Name and map size, as in `shadow-map at 1024`."""
        return f"{self.name} at {self.map_size}" if self.map_size else self.name

    def value(self, name: str) -> float | None:
        """Median of a metric or time such as `frame_ms`; None if it was not measured."""
        found = self.values.get(name)
        return None if found is None else found.median

    @property
    def cost(self) -> float | None:
        """Median of its cost; None if it has none, or only a map size."""
        return self.value(self.cost_name)

    def cost_text(self, digits: Callable[[float], str]) -> str:
        """Text of its cost, with a unit."""
        if self.cost is None:
            return "not ranked"
        return self.text(self.cost_name, digits) + ("" if self.cost_name == "work_cost" else " ms")

    @property
    def rough(self) -> bool:
        """Whether the IQR of the time is so large that it is only a rough estimate."""
        ms, iqr = self.value("frame_ms"), self.value("frame_iqr_ms")
        return ms is not None and iqr is not None and iqr > ROUGH * ms

    @property
    def soft(self) -> bool:
        """Whether the truth has penumbrae."""
        return is_soft(self.values)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks its shadows."""
        return ranking(self.soft)

    @property
    def error(self) -> Interval | None:
        """The error by which it is ranked, 1 − IoU or RMSE; None without a score."""
        value = self.values.get(self.ranked_by.name)
        return value.complement() if value is not None and self.ranked_by.better == "higher" else value

    def error_text(self, digits: Callable[[float], str], bounds: bool = True) -> str:
        """Text of the error, by default with its interval, or `<0.0012` below the truth's own error."""
        value = self.error
        if value is None:
            return "–"
        below = self.text(self.ranked_by.name, digits)
        return below if below.startswith("<") else value.text(digits) if bounds else digits(value.median)

    def text(self, name: str, digits: Callable[[float], str]) -> str:
        """Text of a value's median, – for none; ~ for a time that varied widely, `<0.0012` below the truth's error.

        Work is in millions, `1.39 M`.
        """
        value = self.value(name)
        if value is None:
            return "–"
        if name in METRICS:
            errors = {field: found for field in TRUTH_ERRORS if (found := self.value(field)) is not None}
            bias = self.value("width_bias") if name == "width" else None
            way = "" if not bias or abs(bias) < value / 2 else " wide" if bias > 0 else " narrow"  # of most penumbrae
            return METRICS[name].text(value, digits, errors) + way
        if name == "work_cost":
            return f"{digits(value / 1e6)} M"
        if name == "predicted_ms":
            return f"<{SHORTEST_MS:g}" if 0 < value <= SHORTEST_MS else digits(value)
        return f"{'~' if name.endswith('_ms') and self.rough else ''}{digits(value)}"

    @property
    def single_phase(self) -> bool:
        """Whether a map was scored at a single phase."""
        return self.map_size is not None and self.phases == 1


@dataclass(frozen=True, eq=False)
class Section:
    """Results of one run in one scene, under one light where there are several; configurations: best first.

    frame: the run's cells, with times normalised to `reference`, None if no cell has a time ratio; cost_name: the value
    by which its configurations are ranked; device: whose times are predicted.
    """

    run: Run
    scene: str
    title: str
    frame: pd.DataFrame
    reference: ReferenceTime | None
    configurations: tuple[Configuration, ...]
    cost_name: CostName = "frame_ms"
    device: str = ""

    @cached_property
    def scored(self) -> list[Configuration]:
        """The configurations with a score."""
        return [one for one in self.configurations if one.error is not None]

    @cached_property
    def soft(self) -> bool:
        """Whether its shadows have penumbrae."""
        return any(one.soft for one in self.scored)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks its configurations."""
        return ranking(self.soft)

    @cached_property
    def ranked(self) -> list[Configuration]:
        """The configurations with a score and a cost."""
        return [one for one in self.scored if one.cost is not None]

    @property
    def timed(self) -> list[Configuration]:
        """The configurations with a score and a time that is their cost; none where costs are predicted or work."""
        return self.ranked if self.cost_name == "frame_ms" else []

    @cached_property
    def front(self) -> list[Configuration]:
        """The Pareto-optimal configurations in error and cost, cheapest and least accurate first.

        Without `unshadowed`, whose predicted time, beyond itself, is 0.
        """
        drawn = [one for one in self.ranked if one.cost]
        points = [(one.cost, one.error.median) for one in drawn if one.cost and one.error]
        return [drawn[index] for index in pareto_front(points)]

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
        absolute = ".absolute" if first["coordinates"] == "absolute" else ""
        return f"{self.scene.replace(', ', '.')}.{first['view_size']}{absolute}"

    @cached_property
    def max_cells(self) -> int:
        """Largest number of cells (views × phases) of any configuration."""
        return max((one.cells for one in self.configurations), default=0)


def sections(runs: Sequence[Run], prediction: Prediction | None = None) -> dict[str, list[Section]]:
    """The sections of all runs, by title. Different lights, view sizes or coordinates are different sections.

    prediction: of the times by which they are ranked where a run has no GPU's.
    """
    found: dict[str, list[Section]] = {}
    for run in runs:
        cells = _with_costs(run, prediction)
        names = {soft: _cost_name(run, cells[cells["soft"] == soft]) for soft in (False, True)}
        for (scene, size, coordinates), measured in cells.groupby(
            [_scenes(run.frame), "view_size", "coordinates"], sort=False, dropna=False
        ):
            title = f"{scene}, {size}² view" + (f", {coordinates} coordinates" if coordinates == "absolute" else "")
            frame, reference = normalise_times(measured)
            cost = names[bool(measured["soft"].any())]
            device = prediction.device if prediction and cost == "predicted_ms" else ""
            made = tuple(_configurations(run, frame, cost))
            shown = reference if cost == "frame_ms" else None
            found.setdefault(title, []).append(Section(run, str(scene), title, frame, shown, made, cost, device))
    return found


def _with_costs(run: Run, prediction: Prediction | None) -> pd.DataFrame:
    """The cells of a run with `predicted_ms`, without the `work_cost` that stands for less than what is drawn; `soft`.

    That is of rays, which are no shader invocations, and of what a technique says that counts of work do not see.
    """
    rows = [result.score for result in run.results]
    drawn = [row["status"] == "ok" for row in rows]
    told = prediction if run.software else None
    predicted = [told.of_row(row) if told and ok else None for row, ok in zip(rows, drawn, strict=True)]
    counted = {spec: _counted(spec) for spec in run.frame["full_spec"].unique()}
    work = [
        row["work"].get("cost") if ok and "rays" not in row["work"] and counted[row["full_spec"]] else None
        for row, ok in zip(rows, drawn, strict=True)
    ]
    soft = [ok and is_soft(row["metrics"]) for row, ok in zip(rows, drawn, strict=True)]
    costs = {"predicted_ms": pd.Series(predicted, dtype=float), "work_cost": pd.Series(work, dtype=float)}
    return run.frame.assign(**costs, soft=soft)


def _counted(full_spec: str) -> bool:
    """Whether counts of work stand for what a spec draws; of a technique that is not known here they do."""
    try:
        spec = parse_spec(full_spec, {technique.name: technique for technique in own_techniques()})
    except InputError:
        return True
    return spec.drawn_here.extra_work(spec.params) is None


def _cost_name(run: Run, cells: pd.DataFrame) -> CostName:
    """What ranks cells of one kind: times of a GPU, else predicted ones, else work; else what there is."""
    names: list[CostName] = ["predicted_ms", "work_cost"]
    names.insert(2 if run.software else 0, "frame_ms")
    return next((name for name in names if cells[name].notna().any()), "map_size")


def _scenes(frame: pd.DataFrame) -> pd.Series:
    """The scene of each line, and its light and renderer where there are several."""
    # One table for several lights would compare medians over different cells: techniques support different lights.
    several = frame.groupby("scene")["light"].transform("nunique") > 1
    found = frame["scene"].where(~several, frame["scene"] + ", " + frame["light"])
    return (found if frame["renderer"].nunique() < 2 else found + ", " + frame["renderer"]).astype(str)


def by_kind(sections: Sequence[Section]) -> list[list[Section]]:
    """The sections with hard shadows, and those with soft ones, whose errors are not comparable; no empty lists."""
    kinds = [[section for section in sections if section.scored and section.soft == soft] for soft in (False, True)]
    return [kind for kind in kinds if kind]


def specs_of(sections: Sequence[Section]) -> list[str]:
    """All specs that the sections' runs measured, in the order in which they were measured."""
    return list(dict.fromkeys(str(spec) for section in sections for spec in section.run.frame["spec"]))


def _configurations(run: Run, frame: pd.DataFrame, cost: CostName) -> list[Configuration]:
    """The configurations of a frame, best first; its times must be normalised to one reference time."""
    names = [*ROW_METRICS, *_VALUES, *(name for name in BIAS_LENGTHS if name in frame)]
    numbers = frame[names].astype(float)
    found = []
    for key, group in frame.groupby(["spec", "map_size"], sort=False, dropna=False):
        spec, size = cast("tuple[str, float]", key)
        succeeded = group[group["status"] == "ok"]
        measured = numbers.loc[succeeded.index]
        full_spec = str(group["full_spec"].iloc[0])
        one = Configuration(
            technique=str(group["technique"].iloc[0]),
            spec=spec,
            full_spec=full_spec,
            map_size=None if pd.isna(size) else int(size),
            cells=len(succeeded),
            refused=tuple(group.loc[group["status"] != "ok", "status"]),
            values={name: interval(measured[name].to_numpy()) for name in names},
            phases=succeeded["phase"].nunique(),
            passes=_pass_times(run, group) if cost == "frame_ms" else (),
            cost_name=cost,
        )
        found.append(one)
    return sorted(found, key=lambda one: (one.error.median if one.error else math.inf, one.spec, one.map_size or 0))


def _pass_times(run: Run, group: pd.DataFrame) -> tuple[PassTime, ...]:
    times = [time for index in group.index if (time := run.results[int(index)].time)]
    changes = {
        name: str(entry.get("changes", "frame")) for time in reversed(times) for name, entry in time["passes"].items()
    }
    names = dict.fromkeys(name for time in times for name in time["passes"])
    medians = {name: interval(group[f"pass_{name}_ms"].tolist()) for name in names}
    return tuple(PassTime(name, one.median, changes[name]) for name, one in medians.items() if one is not None)
