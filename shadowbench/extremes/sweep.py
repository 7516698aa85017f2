"""Sweeps of `stress`: a row for each spec at each value of each axis, drawn in a worker that may crash."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from shadowbench.extremes.axes import Axis, Setting, Value, value_label
from shadowbench.extremes.ranges import failure
from shadowbench.measure.attempt import Attempt, Failure
from shadowbench.measure.bench import Bench, Job
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.keys import cell_key, joint_key, view_key
from shadowbench.measure.rows import Record
from shadowbench.measure.scorer import Scorer, ScoreRequest
from shadowbench.scenes.model import LightKind
from shadowbench.studies.part import WHOLE, Part
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec

SHARE = 0.5  # share of the worker's memory limit for the textures and buffers of a cell


@dataclass(frozen=True, eq=False)
class Point:
    """One value of one axis under one kind of light."""

    axis: Axis
    value: Value
    light: LightKind

    @property
    def name(self) -> str:
        """Name for progress messages."""
        return f"{self.axis.name} {value_label(self.value)} {self.light}"


def sweep(
    specs: Sequence[Spec],
    axes: Sequence[Axis],
    bench: Bench,
    quick: bool,
    part: Part = WHOLE,
    failed: list[Failure] | None = None,
) -> list[Record]:
    """Rows of specs at all values of axes, in their order; images are written for cells out of tolerance.

    Existing rows are not measured again. part: measure only its ranges, of a spec on an axis under one kind of light;
    failed: receives lines that fail, whose rows are left out; None to raise.
    """
    lit = [(axis, light) for axis in axes for light in axis.lights]
    ranges = [(axis, light, spec) for axis, light in lit for spec in specs if light in spec.technique.lights]
    found: dict[tuple[Axis, LightKind], list[Spec]] = {}
    for axis, light, spec in part.of(ranges, lambda one: [one[0].name, one[1], one[2].full_text]):
        found.setdefault((axis, light), []).append(spec)
    known: dict[tuple[str, str], list[Record]] = {}
    for row in bench.store.scores.values():
        known.setdefault((row["axis"], row["light_kind"]), []).append(row)
    lines = [
        LineJob(axis, light, axis.swept(quick), tuple(own), known.get((axis.name, light), ()))
        for (axis, light), own in found.items()
    ]
    bench.reporter.stage("stress", sum(len(line.values) for line in lines))
    attempts: Sequence[Job[list[str] | Failure]] = lines
    if failed is not None:
        attempts = [Attempt(line, "axis", f"{line.axis.name} {line.light}") for line in lines]
    rows = []
    for answer in bench.run(attempts):
        if isinstance(answer, Failure):
            assert failed is not None
            failed.append(answer)
        else:
            rows += [bench.store.scores[key] for key in answer]
    return rows


@dataclass(frozen=True, eq=False)
class LineJob(Job[list[str]]):
    """Job that measures specs at the values of an axis under one kind of light; returns the keys of the rows.

    A line is measured in one piece, as the memory of a map is extrapolated from that of the smaller ones before it.
    """

    axis: Axis
    light: LightKind
    values: tuple[Value, ...]
    specs: tuple[Spec, ...]
    known: Sequence[Record] = ()

    def __call__(self, bench: Bench) -> list[str]:
        """Make the rows. Reports one step per value."""
        return Line(self, bench).measure()


class Line:
    """Measurement of a line on a bench."""

    def __init__(self, job: LineJob, bench: Bench) -> None:
        self.job, self.executor, self.reporter = job, bench.executor, bench.reporter
        self._scorer = Scorer(bench, lambda row: failure(row) is not None)
        self._bytes: dict[Spec, tuple[int, int]] = {}  # map size and bytes of the last cell

    def measure(self) -> list[str]:
        """Keys of the rows of all values, in order."""
        keys = []
        for value in self.job.values:
            point = Point(self.job.axis, value, self.job.light)
            keys += [row["key"] for row in self._measure_point(point)]
            self.reporter.step(point.name)
        return keys

    def _measure_point(self, point: Point) -> list[Record]:
        setting = point.axis.at(point.value, point.light)
        at_point = [(spec, spec_at(spec, setting)) for spec in self.job.specs if point.light in spec.technique.lights]
        cells = [(base, spec) for base, spec in at_point if spec is not None]
        if not cells:
            return []
        views = [view_key(view) for view in setting.views]
        frames = [PlacedView(view, setting.coordinates) for view in setting.views]
        rows = self._scorer.rows(frames, [self._request(point, base, spec, setting, views) for base, spec in cells])
        for (base, spec), row in zip(cells, rows, strict=True):
            if row["status"] == "ok" and spec.map_size:
                self._bytes[base] = spec.map_size, row["gpu_bytes"]
        return rows

    def _request(self, point: Point, base: Spec, spec: Spec, setting: Setting, views: Sequence[str]) -> ScoreRequest:
        """Request for the row of a spec at a point; views: the keys of all frames.

        The row's key includes the point, since several axes share the base scene as one of their values.
        """
        parts = [cell_key(Cell(spec), view, setting.coordinates, self.executor.identity) for view in views]
        key = joint_key([point.axis.name, point.value, point.light, parts])
        axis_fields = {
            "axis": point.axis.name,
            "axis_value": point.value,
            "axis_unit": point.axis.unit,
            "light_kind": point.light,
            "home_spec": base.text,
        }
        too_large = self._too_large(base, spec)
        return ScoreRequest(Cell(spec), key, axis_fields, unsupported=too_large)

    def _too_large(self, base: Spec, spec: Spec) -> str | None:
        """Why a map must not be allocated: it exceeds the device's map size or the worker's memory; None if it may.

        Its memory is extrapolated from the last smaller map of the cell, with the square of the size.
        """
        size, info = spec.map_size, self.executor.info
        if size is None:
            return None
        if size > info.max_map_size:
            return f"map size {size}: {info.renderer} allows 1 to {info.max_map_size}"
        smaller_size, smaller_bytes = self._bytes.get(base, (size, 0))
        needed, limit = smaller_bytes * (size / smaller_size) ** 2, SHARE * self.executor.limits.bytes
        if size > smaller_size and needed > limit:
            return (
                f"map size {size} takes about {needed / 2**30:.1f} GiB; a cell may take {limit / 2**30:g} GiB, half of "
                "the worker's memory limit"
            )
        return None


def spec_at(spec: Spec, setting: Setting) -> Spec | None:
    """The spec with the parameters of a setting; None if the technique lacks one of them."""
    known = type(spec.params).model_fields
    params = {name: value for name, value in setting.params.items() if name in known}
    if len(params) < len(setting.params):
        return None
    return spec.with_(**params) if params else spec


def default_specs(techniques: Iterable[type[Technique]]) -> tuple[Spec, ...]:
    """A spec of every technique at its defaults, for the lights of the axes, which have no size."""
    return tuple(Spec(technique, technique.Params()) for technique in techniques if not technique.soft_only)
