"""What the cells of a frame say: medians, ranges, fronts, and the cheapest setting for a target of accuracy.

A *setting* is a spec at one map size. Tables, pages, charts and JSON show the settings of a `Summary`: of a run in one
scene, or over several scenes.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from shadowbench.errors import InputError
from shadowbench.measure.columns import ROW_METRICS, TIMES, TOTALS, TRUTH_ERRORS
from shadowbench.options import ViewSize
from shadowbench.plugin.registry import own_techniques, preset_names
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.frame import Run
from shadowbench.results.law import Law
from shadowbench.results.times import ROUGH, ReferenceTime, normalise_times, pareto_front
from shadowbench.scores.metrics import METRICS, Metric, is_soft, ranking
from shadowbench.techniques.unshadowed import Unshadowed

_BOOTSTRAPS = 2000
_VALUES = {*TRUTH_ERRORS, "width_bias", *list(TIMES)[:4], *TOTALS, "predicted_ms", "gpu_bytes"}  # besides metrics

CostName = Literal["frame_ms", "predicted_ms", "work_cost", "map_size"]
"""By what settings are ranked: a measured time, a predicted one, work, or without any the map."""

Setting = Any
"""A line of `Summary.settings`, its columns as attributes, and its `Index`."""


class Target(NamedTuple):
    """A required accuracy: a limit of a metric, by name."""

    metric: str
    limit: float


class Interval(NamedTuple):
    """A median, and the ends of its 95% bootstrap confidence interval, NaN for a single value."""

    median: float
    low: float = math.nan
    high: float = math.nan


def interval(values: Iterable[float]) -> Interval | None:
    """Median and bootstrap confidence interval (fixed seed) of the values that are not NaN; None if there are none."""
    array = np.asarray(list(values), dtype=float)
    array = array[~np.isnan(array)]
    if len(array) < 2:
        return Interval(float(array[0])) if len(array) else None
    draws = np.random.default_rng(0).choice(array, (_BOOTSTRAPS, len(array)))
    low, high = np.percentile(np.median(draws, axis=1), [2.5, 97.5])
    return Interval(float(np.median(array)), float(low), float(high))


def targets_of(metric: Metric) -> list[Target]:
    """The targets that reports ask for, from easy to hard."""
    return [Target(metric.name, limit) for limit in metric.targets]


class Answer(NamedTuple):
    """The cheapest setting that meets a target, None if none does, those that tie with it, and the closest one."""

    target: Target
    cheapest: Setting | None
    closest: Setting
    ties: tuple[Setting, ...] = ()


@dataclass(frozen=True, eq=False)
class Summary:
    """The settings of a run in one scene, under one light where there are several; or their means over `scenes`.

    cells: of the run's frame, their times normalised to one reference time; reference: that time, where settings are
    ranked by measured ones; cost: by what they are ranked; device: whose times are predicted; scenes: empty for one.

    settings: a line each, best first, with the medians of a cell's numbers over the cells that succeeded, and

    - technique, spec, full_spec, map_size (None without a map), name (a preset's, else the spec), label (with the map)
    - cells, phases: numbers of successful cells and of their phases; refused: statuses of the others
    - error, low, high: of the metric that ranks shadows, with its confidence interval
    - METRIC_least, METRIC_most: ranges of the metrics that have targets
    - cost, NaN if unknown; rough: whether times vary so much that they are estimates; front: whether it is
      Pareto-optimal in error and cost
    - scored: number of scenes with a score in each cell; unsupported: of those that its technique does not support
    """

    run: Run
    scene: str
    title: str
    soft: bool
    cells: pd.DataFrame
    settings: pd.DataFrame
    cost: CostName
    reference: ReferenceTime | None = None
    device: str = ""
    scenes: tuple["Summary", ...] = ()

    @property
    def parts(self) -> tuple["Summary", ...]:
        """The summary of each scene."""
        return self.scenes or (self,)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks its settings."""
        return ranking(self.soft)

    @property
    def targets(self) -> list[Target]:
        """The targets that reports ask for."""
        return targets_of(self.ranked_by)

    @cached_property
    def lines(self) -> list[Setting]:
        """All settings."""
        rows = zip(self.settings.index, self.settings.to_dict("records"), strict=True)
        # Not named tuples, since a plug-in's metric may have a hyphen.
        return [
            SimpleNamespace(**{"Index": index} | {str(name): value for name, value in row.items()})
            for index, row in rows
        ]

    @cached_property
    def shown(self) -> list[Setting]:
        """The settings with a score; over several scenes, with one in each."""
        return [one for one in self.lines if (one.scored == len(self.scenes) if self.scenes else known(one.error))]

    @cached_property
    def timed(self) -> list[Setting]:
        """The settings with a score and a time that is their cost; none where costs are predicted or work."""
        return [one for one in self.shown if not math.isnan(one.cost)] if self.cost == "frame_ms" else []

    @cached_property
    def candidates(self) -> list[Setting]:
        """The settings with a score in every cell of one scene or more; in most scenes first."""
        return [one for one in self.lines if one.scored]

    @cached_property
    def real_time(self) -> list[Setting]:
        """The candidates that are real-time techniques: those that `recommend` may choose."""
        never = {technique.name for technique in own_techniques() if technique.catalogue.never_recommended}
        return [one for one in self.candidates if one.technique not in never]

    @cached_property
    def _by_scene(self) -> dict[tuple[str, int | None], dict[str, Setting]]:
        lines: dict[tuple[str, int | None], dict[str, Setting]] = {}
        for part in self.parts:
            for one in part.candidates:
                lines.setdefault((one.spec, one.map_size), {})[part.title] = one
        return lines

    def by_scene(self, one: Setting) -> dict[str, Setting]:
        """The lines of a candidate in the scenes where it has a score, by title."""
        return self._by_scene[one.spec, one.map_size]

    def missing(self, one: Setting) -> int:
        """Number of scenes where a setting failed or was not measured, though its technique may support them."""
        return len(self.parts) - int(one.scored) - int(one.unsupported)

    def worst_scene(self, one: Setting, metric: str) -> str:
        """Title of the scene in which a candidate has the worst value of a metric."""
        values = {title: getattr(line, metric) for title, line in self.by_scene(one).items()}
        return max(values, key=lambda title: METRICS[metric].error(values[title]) if known(values[title]) else 1.0)

    def scenes_met(self, one: Setting, target: Target) -> int:
        """Number of scenes in which a candidate meets a target, by its median."""
        values = [getattr(line, target.metric) for line in self.by_scene(one).values()]
        return sum(METRICS[target.metric].meets(value, target.limit) for value in values if known(value))

    def meets(self, one: Setting, target: Target) -> bool:
        """Whether a candidate meets a target in every scene that its technique supports."""
        return not self.missing(one) and self.scenes_met(one, target) == one.scored

    def cheapest(self, among: Sequence[Setting], target: Target) -> Setting | None:
        """The cheapest candidate that meets a target; None if none does.

        Support for more scenes comes first, then the lower cost. Candidates without one come after others, the smaller
        map first; of two with equal cost, the more accurate one is returned.
        """
        return min((one for one in among if self.meets(one, target)), key=self._price, default=None)

    def _price(self, one: Setting) -> tuple[int, bool, float, float, float, str]:
        """The order of candidates; where predicted times are equal, less work comes first, as in `recommend`."""
        cost = one.cost if known(one.cost) else float(one.map_size or 0)
        work = one.work_cost if self.cost == "predicted_ms" and known(one.work_cost) else 0.0
        return -one.scored, not known(one.cost), cost, work, one.error, one.label

    def answers(self, among: Sequence[Setting], targets: Sequence[Target]) -> list[Answer]:
        """An answer for each target, among some of the candidates; empty without any."""
        answers = []
        for target in targets if among else ():
            best = self.cheapest(among, target)
            closest = max(among, key=lambda one: (self.scenes_met(one, target), -one.error))
            answers.append(Answer(target, best, closest, self._ties(among, best, target) if best else ()))
        return answers

    def _ties(self, among: Sequence[Setting], best: Setting, target: Target) -> tuple[Setting, ...]:
        """Others that meet a target in as many scenes as the best, at the same cost: IQRs of times overlap."""

        def near(one: Setting) -> bool:
            spreads = (one.frame_iqr_ms, best.frame_iqr_ms) if self.cost == "frame_ms" else ()
            return bool(abs(one.cost - best.cost) <= sum(filter(known, spreads)) / 2)  # False for NaN

        others = [one for one in among if one.Index != best.Index and one.scored == best.scored]
        return tuple(one for one in others if self.meets(one, target) and near(one))

    def matrix(self, targets: Sequence[Target]) -> dict[str, list[Answer]]:
        """The answers of each technique except `unshadowed`, ordered by cost at the middle target."""
        techniques = dict.fromkeys(one.technique for one in self.candidates if one.technique != Unshadowed.name)
        rows = {
            name: self.answers([one for one in self.candidates if one.technique == name], targets)
            for name in techniques
        }
        middle, never = len(targets) // 2, (0, True, math.inf, 0.0, 0.0, "")

        def rank(name: str) -> list[tuple[int, bool, float, float, float, str]]:
            """The price at the middle target, then at the easier ones; a target that is not met ranks last."""
            answers = rows[name]
            order = [*answers[middle::-1], *answers[middle + 1 :]]
            return [never if one.cheapest is None else self._price(one.cheapest) for one in order]

        return {name: rows[name] for name in sorted(rows, key=rank)}

    @cached_property
    def least_error(self) -> float:
        """The error at which charts draw smaller ones: of half a wrong pixel, or for soft shadows the truth's own."""
        if self.soft:
            return float(self.cells["truth_error"].mean())
        receivers = self.cells["receivers"].dropna()
        return 0.5 / float(receivers.max()) if len(receivers) else 1e-7

    @property
    def file_stem(self) -> str:
        """Start of the names of its chart files: scene, light, view size, and `absolute` for absolute coordinates."""
        first = self.cells.iloc[0]
        absolute = ".absolute" if first["coordinates"] == "absolute" else ""
        return f"{self.scene.replace(', ', '.')}.{ViewSize(first['view_width'], first['view_size'])}{absolute}"

    @property
    def max_cells(self) -> int:
        """Largest number of cells (views × phases) of any setting in a scene."""
        return max(int(part.settings["cells"].max()) for part in self.parts)

    def records(self) -> list[dict[str, Any]]:
        """The settings as JSON objects; None for NaN."""

        def plain(value: Any) -> Any:
            return None if isinstance(value, float) and math.isnan(value) else value

        lines = self.settings.to_dict("records")
        return [{str(name): plain(value) for name, value in line.items()} for line in lines]

    def passes(self, one: Setting) -> list[tuple[str, float, str]]:
        """The passes of a setting in the order in which they are drawn: name, median time in ms, what redraws it."""
        sizes = self.cells["map_size"]
        own = self.cells.index[(self.cells["spec"] == one.spec) & sizes.isin([one.map_size or pd.NA])]
        times = [time for index in own if (time := self.run.results[int(index)].time)]
        first = {name: entry for time in reversed(times) for name, entry in time["passes"].items()}
        names = dict.fromkeys(name for time in times for name in time["passes"])
        medians = {name: self.settings[f"pass_{name}_ms"].iloc[one.Index] for name in names}
        return [
            (name, float(ms), str(first[name].get("changes", "frame"))) for name, ms in medians.items() if known(ms)
        ]


def known(value: float) -> bool:
    """Whether a number of a setting is one, and not NaN."""
    return not math.isnan(value)


def summaries(run: Run, law: Law | None = None) -> list[Summary]:
    """A run's summaries, one a scene. Different lights, view sizes or coordinates are apart.

    law: predicts the times by which settings are ranked where a run has no GPU's.
    """
    cells = _with_costs(run, law)
    costs = {soft: _cost_name(run, cells[cells["soft"] == soft]) for soft in (False, True)}
    parts = []
    for (scene, height, width, coordinates), own in cells.groupby(
        [_scenes(run.frame), "view_size", "view_width", "coordinates"], sort=False, dropna=False
    ):
        size = f"{height}²" if height == width else f"{width} × {height}"
        title = f"{scene}, {size} view" + (f", {coordinates} coordinates" if coordinates == "absolute" else "")
        soft = bool(own["soft"].any())
        normalised, reference = normalise_times(own)
        settings = _settings(normalised, ranking(soft), costs[soft])
        device = law.device if law and costs[soft] == "predicted_ms" else ""
        shown = reference if costs[soft] == "frame_ms" else None
        parts.append(Summary(run, str(scene), title, soft, normalised, settings, costs[soft], shown, device))
    return parts


def _with_costs(run: Run, law: Law | None) -> pd.DataFrame:
    """The cells of a run with `predicted_ms`, `soft`, and `work_cost` where that stands for what is drawn.

    It does not for rays, which are no shader invocations, and for what a technique says that counts do not see.
    """
    rows = [result.score for result in run.results]
    drawn = [row["status"] == "ok" for row in rows]
    counted = {spec: _counted(spec) for spec in run.frame["full_spec"].unique()}
    predict = law.of_row if law and run.software else None
    predicted = [predict(row) if predict and ok else None for row, ok in zip(rows, drawn, strict=True)]
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
    """The scene of each line, its sequence, and its light and renderer where there are several."""
    # One table for several lights would compare medians over different cells: techniques support different lights.
    several = frame.groupby("scene")["light"].transform("nunique") > 1
    scenes = frame["scene"].where(~several, frame["scene"] + ", " + frame["light"])
    scenes = scenes.where(frame["sequence"].isna(), scenes + ", " + frame["sequence"].astype(str))
    return (scenes if frame["renderer"].nunique() < 2 else scenes + ", " + frame["renderer"]).astype(str)


def _settings(cells: pd.DataFrame, metric: Metric, cost: CostName) -> pd.DataFrame:
    """The lines of `Summary.settings` of cells in one scene."""
    group = cells.groupby(["spec", "map_size"], sort=False, dropna=False).ngroup()
    drawn, statuses = cells["status"] == "ok", cells["status"].groupby(group)
    counts = ("work_", "fact_", "pass_")
    names = [name for name in cells if name in ROW_METRICS or name in _VALUES or str(name).startswith(counts)]
    numbers = cells[names].astype(float).where(drawn)
    values = numbers.groupby(group)
    settings = cells.groupby(group)[["technique", "spec", "full_spec", "map_size"]].first().join(values.median())
    sizes = [None if pd.isna(size) else int(size) for size in settings["map_size"]]
    settings["map_size"] = pd.Series(sizes, settings.index, dtype=object)
    settings["name"] = [preset_names().get(spec, spec) for spec in settings["spec"]]
    settings["label"] = [
        f"{name} at {size}" if size else name for name, size in zip(settings["name"], sizes, strict=True)
    ]
    settings["cells"] = drawn.groupby(group).sum()
    settings["phases"] = cells["phase"].where(drawn).groupby(group).nunique()
    settings["refused"] = [tuple(own[own != "ok"]) for _, own in statuses]
    intervals = [interval(own) or Interval(math.nan) for _, own in values[metric.name]]
    settings[["error", "low", "high"]] = [
        (1 - middle, 1 - high, 1 - low) if metric.better == "higher" else (middle, low, high)
        for middle, low, high in intervals
    ]
    for ranged in (one.name for one in METRICS.values() if one.targets):
        settings[f"{ranged}_least"], settings[f"{ranged}_most"] = values[ranged].min(), values[ranged].max()
    settings["scored"] = [
        int(not math.isnan(error) and not refused)
        for error, refused in zip(settings["error"], settings["refused"], strict=True)
    ]
    settings["unsupported"] = [
        int(bool(refused) and not drawn and all(status.startswith("unsupported") for status in refused))
        for drawn, refused in zip(settings["cells"], settings["refused"], strict=True)
    ]
    lines: list[Setting] = list(settings.itertuples())
    lines.sort(key=lambda one: (one.error if known(one.error) else math.inf, one.spec, one.map_size or 0))
    settings = settings.loc[[one.Index for one in lines]]
    return _with_front(settings, settings["error"].notna(), cost)


def _with_front(settings: pd.DataFrame, complete: pd.Series, cost: CostName) -> pd.DataFrame:
    """The settings, renumbered, with `cost`, `rough`, and `front` among the complete ones.

    A cost of 0, of `unshadowed` where a time beyond itself is predicted, is on no front.
    """
    settings = settings.assign(
        cost=math.nan if cost == "map_size" else settings[cost],
        rough=settings["frame_iqr_ms"] > ROUGH * settings["frame_ms"],
        front=False,
    )
    drawn = settings[complete & (settings["cost"] > 0)]
    front = pareto_front(list(zip(drawn["cost"], drawn["error"], strict=True)))
    settings.loc[[drawn.index[at] for at in front], "front"] = True
    return settings.reset_index(drop=True)


def over_scenes(parts: Sequence[Summary], title: str) -> Summary:
    """The means over scenes of one run and kind, of each setting over those where it has a score in every cell.

    A value that one of them lacks is NaN. Of a single scene, its own summary.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    cells = pd.concat([part.cells for part in parts])
    lines = pd.concat([part.settings for part in parts]).drop(columns=["cost", "rough", "front"])
    counts = ("cells", "phases", "scored", "unsupported")
    numbers = [name for name in lines.select_dtypes("number") if name not in counts]
    spreads = ["low", "high", *(name for name in lines if str(name).endswith(("_least", "_most")))]
    means = []
    for _, every in lines.groupby(["spec", "map_size"], sort=False, dropna=False):
        own = every[every["scored"] > 0]
        if len(own):
            mean = own.iloc[0].to_dict() | own[numbers].apply(fmean).to_dict()  # NaN if one is
            mean |= {"cells": own["cells"].sum(), "phases": own["phases"].min(), "scored": len(own)}
            mean |= {"refused": (), "unsupported": every["unsupported"].sum()}
            means.append(mean if len(own) == 1 else mean | dict.fromkeys(spreads, math.nan))
    means.sort(key=lambda mean: (-mean["scored"], mean["error"]))
    settings = pd.DataFrame(means, columns=lines.columns)
    settings["map_size"] = pd.Series([mean["map_size"] for mean in means], dtype=object)
    settings = _with_front(settings, settings["scored"] == len(parts), first.cost)
    return Summary(first.run, title, title, first.soft, cells, settings, first.cost, None, first.device, tuple(parts))


def by_kind(parts: Sequence[Summary]) -> list[list[Summary]]:
    """The scenes with hard shadows, and those with soft ones, whose errors are not comparable; no empty lists."""
    kinds = [[part for part in parts if part.shown and part.soft == soft] for soft in (False, True)]
    return [kind for kind in kinds if kind]


def title_of_all(kind: Sequence[Summary], kinds: int) -> str:
    """Title of all scenes of a kind; kinds: number of those in the run."""
    adjective = ("soft " if kind[0].soft else "hard ") if kinds > 1 else ""
    return f"all {adjective}scenes"


def specs_of(runs: Iterable[Run]) -> list[str]:
    """All specs that runs measured, in the order in which they were measured."""
    return list(dict.fromkeys(str(spec) for run in runs for spec in run.frame["spec"]))
