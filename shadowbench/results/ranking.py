"""The cost of accuracy: the cheapest configuration of each technique for each target, in one or several scenes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import pandas as pd

from shadowbench.results.configurations import Configuration, Interval, Section
from shadowbench.scores.metrics import METRICS, Metric
from shadowbench.techniques.unshadowed import Unshadowed

_KINDS = {False: "hard ", True: "soft "}


@dataclass(frozen=True)
class Target:
    """A required accuracy: a limit of a metric, by name."""

    metric: str
    limit: float

    def met_by(self, one: Configuration) -> bool:
        """Whether a configuration's median meets the target; False without a score."""
        value = one.value(self.metric)
        return value is not None and METRICS[self.metric].meets(value, self.limit)


def targets_of(metric: Metric) -> tuple[Target, ...]:
    """The targets that reports ask for."""
    return tuple(Target(metric.name, limit) for limit in metric.targets)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A configuration over one or more scenes.

    mean: means over the scenes with a score; by_scene: its results there, by scene title; unsupported: titles of the
    scenes that its technique does not support; missing: titles of those where it failed, has no score or was not
    measured.
    """

    mean: Configuration
    by_scene: dict[str, Configuration]
    unsupported: tuple[str, ...]
    missing: tuple[str, ...]

    @property
    def in_all_scenes(self) -> bool:
        """Whether it has a score in every scene."""
        return not self.unsupported and not self.missing

    @property
    def cost(self) -> float | None:
        """Mean cost over its scenes; None unless it has one in all of them."""
        return self.mean.cost

    @property
    def worst_scene(self) -> str:
        """Title of the scene with the largest error."""
        return self.worst_by(self.mean.ranked_by.name)

    def worst_by(self, metric: str) -> str:
        """Title of the scene with the worst value of a metric."""
        values = {title: one.value(metric) for title, one in self.by_scene.items()}
        return max(values, key=lambda title: 1.0 if (value := values[title]) is None else METRICS[metric].error(value))

    def meets(self, target: Target) -> bool:
        """Whether it meets a target in every scene that its technique supports."""
        return not self.missing and bool(self.by_scene) and self.scenes_met(target) == len(self.by_scene)

    def scenes_met(self, target: Target) -> int:
        """Number of scenes in which it meets a target."""
        return sum(target.met_by(one) for one in self.by_scene.values())


@dataclass(frozen=True)
class CostCell:
    """The cheapest candidate that meets a target, None if none does, those that tie with it, and the closest one."""

    target: Target
    cheapest: Candidate | None
    closest: Candidate
    ties: tuple[Candidate, ...] = ()


def candidates(sections: Sequence[Section]) -> list[Candidate]:
    """All configurations with a score in at least one section of a run.

    Those with a score in every section come first, then those with scores in the most; equal ones by mean error.
    """
    by_key: dict[tuple[str, int | None], dict[str, Configuration]] = {}
    for section in sections:
        for one in section.configurations:
            by_key.setdefault((one.spec, one.map_size), {})[section.title] = one
    titles = [section.title for section in sections]
    found = [_candidate(parts, titles) for parts in by_key.values()]
    return sorted(filter(None, found), key=lambda one: (not one.in_all_scenes, -len(one.by_scene), _error(one.mean)))


def _candidate(parts: Mapping[str, Configuration], titles: Sequence[str]) -> Candidate | None:
    """A configuration over scenes, by title; None without a score in any of them."""
    scored = {title: one for title, one in parts.items() if one.error is not None and not one.refused}
    unsupported = tuple(title for title, one in parts.items() if title not in scored and _unsupported(one))
    missing = tuple(title for title in titles if title not in scored and title not in unsupported)
    return Candidate(mean(list(scored.values())), scored, unsupported, missing) if scored else None


def _error(one: Configuration) -> float:
    return 1.0 if one.error is None else one.error.median


def _unsupported(one: Configuration) -> bool:
    return not one.cells and bool(one.refused) and all(status.startswith("unsupported") for status in one.refused)


def mean(parts: Sequence[Configuration]) -> Configuration:
    """Means of one configuration over scenes; a value that is missing in one of them is None."""
    if len(parts) == 1:
        return parts[0]
    values: dict[str, Interval | None] = {}
    for name in parts[0].values:
        medians = [median for one in parts if (median := one.value(name)) is not None]
        values[name] = Interval(fmean(medians)) if len(medians) == len(parts) else None
    cells, phases = sum(one.cells for one in parts), min(one.phases for one in parts)
    return replace(parts[0], cells=cells, refused=(), values=values, phases=phases, passes=())


def title_of_all(kind: Sequence[Section], kinds: int) -> str:
    """Title of all scenes of a kind; kinds: number of those in the run."""
    return f"all {_KINDS[kind[0].soft] if kinds > 1 else ''}scenes"


def mean_section(sections: Sequence[Section], title: str) -> Section:
    """Means over scenes of one kind, as a section; only of configurations with a score in every scene."""
    first = sections[0]
    means = tuple(one.mean for one in candidates(sections) if one.in_all_scenes)
    frame = pd.concat([section.frame for section in sections])
    return Section(first.run, title, title, frame, None, means, first.cost_name, first.device)


def cheapest(found: Sequence[Candidate], target: Target) -> Candidate | None:
    """The cheapest candidate that meets a target; None if none does.

    Support for more scenes comes first, then the lower cost. Candidates without one come after others, the smaller map
    first; of two with equal cost, the more accurate one is returned.
    """
    able = [one for one in found if one.meets(target)]
    return min(able, key=_cost, default=None)


def _cost(one: Candidate) -> tuple[int, bool, float, float, float, str]:
    """Of predicted times that are not told apart, the one of less work comes first, as in `recommend`."""
    cost = one.cost if one.cost is not None else float(one.mean.map_size or 0)
    work = one.mean.value("work_cost") or 0.0 if one.mean.cost_name == "predicted_ms" else 0.0
    return -len(one.by_scene), one.cost is None, cost, work, _error(one.mean), one.mean.label


def ties(found: Sequence[Candidate], best: Candidate, target: Target) -> tuple[Candidate, ...]:
    """Other candidates that meet a target in as many scenes as the best, at the same cost: IQRs of times overlap."""

    def near(one: Candidate) -> bool:
        timed = one.mean.cost_name == "frame_ms"
        spread = sum(side.mean.value("frame_iqr_ms") or 0.0 for side in (one, best)) if timed else 0.0
        return one.cost is not None and best.cost is not None and abs(one.cost - best.cost) <= spread / 2

    able = (one for one in found if one is not best and one.meets(target) and len(one.by_scene) == len(best.by_scene))
    return tuple(filter(near, able))


def closest(found: Sequence[Candidate], target: Target) -> Candidate:
    """The candidate that meets a target in the most scenes; of several, the most accurate."""
    return max(found, key=lambda one: (one.scenes_met(target), -_error(one.mean)))


def cost_row(found: Sequence[Candidate], targets: Sequence[Target]) -> list[CostCell]:
    """A cell for each target; empty without candidates."""
    cells = []
    for target in targets if found else ():
        best = cheapest(found, target)
        cells.append(CostCell(target, best, closest(found, target), ties(found, best, target) if best else ()))
    return cells


def cost_matrix(found: Sequence[Candidate], targets: Sequence[Target]) -> dict[str, list[CostCell]]:
    """A row of cells for each technique except `unshadowed`, ordered by cost at the middle target."""
    techniques = dict.fromkeys(one.mean.technique for one in found if one.mean.technique != Unshadowed.name)
    rows = {name: cost_row([one for one in found if one.mean.technique == name], targets) for name in techniques}
    return dict(sorted(rows.items(), key=lambda item: _rank(item[1])))


def _rank(cells: Sequence[CostCell]) -> list[tuple[int, bool, float, float, float, str]]:
    """Sort key: the cost at the middle target, then at the easier ones; a target that is not met ranks last."""
    never = (0, True, float("inf"), 0.0, 0.0, "")
    middle = len(cells) // 2
    order = [*cells[middle::-1], *cells[middle + 1 :]]
    return [never if cell.cheapest is None else _cost(cell.cheapest) for cell in order]
