"""What reaches an accuracy at the least cost, by technique: in one scene, or in every scene of a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import pandas as pd

from shadowbench.reports.analysis import EDGE_STEPS, IOU_STEPS, Configuration, Section, reaches_edge, reaches_iou
from shadowbench.studies.tables import Interval, SummaryRow
from shadowbench.techniques.unshadowed import Unshadowed

ALL_SCENES = "all scenes"


@dataclass(frozen=True)
class Target:
    """An accuracy: an IoU of so much or more, or (`edges`) edges that are off by so many pixels or less."""

    limit: float
    edges: bool = False

    def met_by(self, one: Configuration) -> bool:
        """Whether a configuration's median reaches it."""
        return (reaches_edge if self.edges else reaches_iou)(one, self.limit)


IOU_TARGETS = tuple(Target(step) for step in IOU_STEPS)
EDGE_TARGETS = tuple(Target(step, edges=True) for step in EDGE_STEPS)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A configuration over scenes.

    `whole`: its means over the scenes in `held`, by title, where it has a score. `unsupported`: titles of those that
    its technique declines; `lacking`: of those where it failed, has no score or was not asked.
    """

    whole: Configuration
    held: dict[str, Configuration]
    unsupported: tuple[str, ...]
    lacking: tuple[str, ...]

    @property
    def everywhere(self) -> bool:
        """Whether it has a score in every scene."""
        return not self.unsupported and not self.lacking

    @property
    def ms(self) -> float | None:
        """Mean frame time over its scenes; None unless all of them were timed."""
        return self.whole.value("frame_ms")

    @property
    def worst(self) -> str:
        """The title of the scene in which its IoU is least."""
        return min(self.held, key=lambda title: self.held[title].value("iou") or 0.0)

    def reaches(self, target: Target) -> bool:
        """Whether it reaches a target wherever its technique answers."""
        return not self.lacking and bool(self.held) and self.met(target) == len(self.held)

    def met(self, target: Target) -> int:
        """In how many scenes it reaches a target."""
        return sum(target.met_by(one) for one in self.held.values())

    def as_cheap_as(self, other: "Candidate") -> bool:
        """Whether the middle halves of the rounds of both overlap: that one costs less may be noise."""
        (low, high), (least, most) = _span(self), _span(other)
        return low <= most and least <= high


def _span(one: Candidate) -> tuple[float, float]:
    ms, iqr = one.ms or 0.0, one.whole.value("frame_iqr_ms") or 0.0
    return ms - iqr / 2, ms + iqr / 2


@dataclass(frozen=True)
class Cell:
    """A technique at a target: the cheapest that reaches it, None for none, and what comes nearest.

    `equals`: others of the same technique that cost as much, within the noise of their times.
    """

    target: Target
    cheapest: Candidate | None
    nearest: Candidate
    equals: tuple[Candidate, ...] = ()


def candidates(sections: Sequence[Section]) -> list[Candidate]:
    """Every configuration with a score in some of a run's scenes, those with one in all of them first, best first."""
    by_key: dict[tuple[str, int | None], dict[str, Configuration]] = {}
    for section in sections:
        for one in section.configurations:
            by_key.setdefault((one.spec, one.map_size), {})[section.title] = one
    found = []
    for parts in by_key.values():
        held = {title: one for title, one in parts.items() if one.error is not None and not one.row.refused}
        declined = tuple(title for title, one in parts.items() if title not in held and _declined(one))
        titles = [section.title for section in sections]
        lacking = tuple(title for title in titles if title not in held and title not in declined)
        if held:
            found.append(Candidate(_mean(list(held.values())), held, declined, lacking))
    return sorted(found, key=lambda one: (not one.everywhere, -len(one.held), -(one.whole.value("iou") or 0.0)))


def _declined(one: Configuration) -> bool:
    refused = one.row.refused
    return not one.row.cells and bool(refused) and all(status.startswith("unsupported") for status in refused)


def _mean(parts: Sequence[Configuration]) -> Configuration:
    """One configuration's means over scenes; what some of them lack has none."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    values: dict[str, Interval | None] = {}
    for name in first.row.values:
        medians = [value.median for one in parts if (value := one.row.values[name]) is not None]
        values[name] = Interval(fmean(medians)) if len(medians) == len(parts) else None
    cells, phases = sum(one.row.cells for one in parts), min(one.row.phases for one in parts)
    row = SummaryRow(first.spec, first.map_size, cells, (), values, phases)
    return Configuration(first.technique, first.full_spec, row, ())


def over_all(sections: Sequence[Section]) -> Section:
    """A section of what has a score in every scene of a run: means over them."""
    first = sections[0]
    held = tuple(one.whole for one in candidates(sections) if one.everywhere)
    frame = pd.concat([section.frame for section in sections])
    return Section(first.run, ALL_SCENES, ALL_SCENES, frame, None, held)


def cheapest(found: Sequence[Candidate], target: Target) -> Candidate | None:
    """What reaches a target at the least cost: in the most scenes, then in the least time, or with the smallest map.

    Of two that cost the same, the more accurate one. What was not timed costs more than what was.
    """
    able = [one for one in found if one.reaches(target)]
    return min(able, key=_cost, default=None)


def _cost(one: Candidate) -> tuple[int, bool, float, float, str]:
    cost = one.ms if one.ms is not None else float(one.whole.map_size or 0)
    return -len(one.held), one.ms is None, cost, -(one.whole.value("iou") or 0.0), one.whole.label


def equals(found: Sequence[Candidate], best: Candidate, target: Target) -> tuple[Candidate, ...]:
    """The others that reach a target in as many scenes and cost as much as the best, within the noise of times."""
    if best.ms is None:
        return ()
    able = (one for one in found if one is not best and one.reaches(target) and len(one.held) == len(best.held))
    return tuple(one for one in able if one.ms is not None and one.as_cheap_as(best))


def nearest(found: Sequence[Candidate], target: Target) -> Candidate:
    """What reaches a target in the most scenes, and of those the most accurate."""
    return max(found, key=lambda one: (one.met(target), one.whole.value("iou") or 0.0))


def line(found: Sequence[Candidate], targets: Sequence[Target]) -> list[Cell]:
    """The cheapest of some configurations for each target; of none, nothing."""
    cells = []
    for target in targets if found else ():
        best = cheapest(found, target)
        same = () if best is None else equals(found, best, target)
        cells.append(Cell(target, best, nearest(found, target), same))
    return cells


def matrix(found: Sequence[Candidate], targets: Sequence[Target]) -> dict[str, list[Cell]]:
    """By technique, the cheapest for each target; first the technique that is cheapest at the middle one.

    `unshadowed` takes no part.
    """
    techniques = dict.fromkeys(one.whole.technique for one in found if one.whole.technique != Unshadowed.name)
    lines = {name: line([one for one in found if one.whole.technique == name], targets) for name in techniques}
    return dict(sorted(lines.items(), key=lambda one: _rank(one[1])))


def _rank(cells: Sequence[Cell]) -> list[tuple[int, bool, float, float, str]]:
    """By what the middle target costs, then the next easier; what reaches none stands last."""
    never = (0, True, float("inf"), 0.0, "")
    middle = len(cells) // 2
    order = [*cells[middle::-1], *cells[middle + 1 :]]
    return [never if cell.cheapest is None else _cost(cell.cheapest) for cell in order]
