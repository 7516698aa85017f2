"""Computation behind `stress`: a sweep of specs along axes into a folder, and their operating ranges."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.errors import InputError, ShadowbenchError, alternatives
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import VIEW_SIZE, Axis, Setting, Value
from shadowbench.measure.campaign import Block, Campaign, Cell, Failure
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import Limits
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.spec import Spec
from shadowbench.results.frame import read_folders, write_table
from shadowbench.results.ranges import OperatingRange, failure, operating_ranges, points_frame, ranges_frame
from shadowbench.scenes.model import LightKind
from shadowbench.studies.run import dealt
from shadowbench.studies.study import Study

Point = tuple[Axis, LightKind, Value]

LIMITS = Limits(seconds=120.0, bytes=4 << 30)  # fixed, so that the same maps are too large on every machine


SWEEPING: Mapping[str, Any] = {"sweep": True, "keeps_images": failure}
"""Options of a campaign along axes: images are written of cells out of tolerance."""


def points_of(axes: Sequence[Axis], quick: bool) -> list[Point]:
    """Values of axes under each kind of light, in their order. quick: a few of each axis."""
    return [(axis, light, value) for axis in axes for light in axis.lights for value in axis.swept(quick)]


def block_at(specs: Sequence[Spec], point: Point) -> Block:
    """Block of specs at a point, without those that lack the axis's parameters or do not support the light."""
    axis, light, value = point
    setting = axis.at(value, light)
    at_point = [(spec, spec_at(spec, setting)) for spec in specs if light in spec.technique.lights]
    cells = tuple(Cell(spec, home=home) for home, spec in at_point if spec is not None)
    place = {"axis": axis.name, "axis_value": value, "axis_unit": axis.unit, "light_kind": light}
    return Block(setting.views, cells, setting.coordinates, place=place)


def spec_at(spec: Spec, setting: Setting) -> Spec | None:
    """The spec with the parameters of a setting; None if the technique lacks one of them."""
    if not setting.params.keys() <= type(spec.params).model_fields.keys():
        return None
    return spec.with_(**setting.params) if setting.params else spec


def default_specs(subjects: Iterable[type[Subject]]) -> tuple[Spec, ...]:
    """A spec of every technique among these at its defaults, for the lights of the axes, which have no size."""
    techniques = [one for one in subjects if issubclass(one, Technique)]
    return tuple(Spec(technique, technique.Params()) for technique in techniques if not technique.catalogue.soft_only)


def select_axes(names: Sequence[str]) -> list[Axis]:
    """Axes by name, in the order of AXES; all for no name. Raises InputError for an unknown name."""
    for name in names:
        if name not in AXES:
            raise InputError(f"--axis: found {name!r:.60}{alternatives(name, AXES)}")
    return [axis for axis in AXES.values() if not names or axis.name in names]


@dataclass(frozen=True, eq=False)
class StressResult:
    """Rows of a sweep, its operating ranges, and what was left out, with `keep_going`."""

    rows: tuple[Record, ...]
    ranges: tuple[OperatingRange, ...]
    failures: tuple[Failure, ...] = ()


def stress(
    specs: Sequence[Spec],
    axes: Sequence[Axis],
    campaign: Campaign,
    *,
    quick: bool = False,
    part: str | None = None,
) -> StressResult:
    """Sweep specs along axes and write rows, `ranges.csv`, `table.csv` and `run.json` into a campaign's folder.

    campaign: with the options SWEEPING, whose drawer has LIMITS; quick: a few values of each axis; part: K/N, to
    measure only its points. Raises InputError for a folder with other files. A cell that fails gets a row with that
    status.
    """
    points = points_of(axes, quick)
    homes = {(axis, light): len(block_at(specs, (axis, light, axis.default)).cells) for axis, light, _ in points}
    points = [point for point in points if homes[point[:2]]]
    points = dealt(points, part, lambda point: [point[0].name, *point[1:]], campaign.reporter)
    campaign.reporter.stage("stress", sum(homes[axis, light] for axis, light, _ in points))
    with campaign:
        measured = campaign.measure(block_at(specs, point) for point in points)
        rows = [result.score for found in measured for result in found]
        if not rows and campaign.failures:
            first = campaign.failures[0]
            raise ShadowbenchError(f"no cell was measured: {first.where}: {first.reason}")
        ranges = operating_ranges(axes, rows)
        write_table(campaign.folder / "ranges.csv", ranges_frame(ranges))
        study = Study.of([axis.name for axis in axes], specs, reference=specs[0], view_size=VIEW_SIZE, rounds=0)
        campaign.finish(study.facts, [], [row["key"] for row in rows])
        empty = not campaign.store.scores and part is not None
        shown = () if empty else read_folders([campaign.folder])[1][0].rows
        write_table(campaign.folder / "table.csv", points_frame(shown))
    return StressResult(tuple(rows), tuple(ranges), tuple(dict.fromkeys(campaign.failures)))
