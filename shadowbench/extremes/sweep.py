"""Sweeps of `stress`: a row for each spec at each value of each axis, drawn in a worker that may crash."""

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.extremes.axes import Axis, Setting, Value, value_label
from shadowbench.extremes.ranges import failure
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import Executor
from shadowbench.measure.keys import cell_key, joint_key, view_key
from shadowbench.measure.measurer import Reporter
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record
from shadowbench.measure.scorer import Scorer, ScoreRequest
from shadowbench.scenes.model import LightKind
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


class Sweep:
    """A sweep of specs along axes into one folder; existing rows are not measured again."""

    def __init__(self, specs: Sequence[Spec], folder: Path, executor: Executor, reporter: Reporter) -> None:
        self.specs, self.folder, self.executor, self.reporter = specs, folder, executor, reporter
        self._bytes: dict[tuple[Spec, str, LightKind], tuple[int, int]] = {}  # map size and bytes of the last cell

    def run(self, axes: Sequence[Axis], quick: bool) -> list[Record]:
        """Rows of all values, in the order of the axes; images are written for cells out of tolerance."""
        points = [Point(axis, value, light) for axis in axes for light in axis.lights for value in axis.swept(quick)]
        with closing(RowStore(self.folder, sweep=True)) as store:
            scorer = Scorer(self.executor, store, Pictures(self.folder), lambda row: failure(row) is not None)
            self.reporter.stage("stress", len(points))
            rows = []
            for point in points:
                rows += self._measure_point(point, scorer)
                self.reporter.step(point.name)
            return rows

    def _measure_point(self, point: Point, scorer: Scorer) -> list[Record]:
        setting = point.axis.at(point.value, point.light)
        at_point = [(spec, spec_at(spec, setting)) for spec in self.specs if point.light in spec.technique.lights]
        cells = [(base, spec) for base, spec in at_point if spec is not None]
        if not cells:
            return []
        views = [view_key(view) for view in setting.views]
        frames = [PlacedView(view, setting.coordinates) for view in setting.views]
        rows = scorer.rows(frames, [self._request(point, base, spec, setting, views) for base, spec in cells])
        for (base, spec), row in zip(cells, rows, strict=True):
            if row["status"] == "ok" and spec.map_size:
                self._bytes[base, point.axis.name, point.light] = spec.map_size, row["gpu_bytes"]
        return rows

    def _request(self, point: Point, base: Spec, spec: Spec, setting: Setting, views: Sequence[str]) -> ScoreRequest:
        """Request for the row of a spec at a point; views: the keys of all frames.

        The row's key includes the point, since several axes share the base scene as one of their values.
        """
        parts = [cell_key(Cell(spec), view, setting.coordinates, self.executor.info.renderer) for view in views]
        key = joint_key([point.axis.name, point.value, point.light, parts])
        axis_fields = {
            "axis": point.axis.name,
            "axis_value": point.value,
            "axis_unit": point.axis.unit,
            "light_kind": point.light,
            "home_spec": base.text,
        }
        too_large = self._too_large(point, base, spec)
        return ScoreRequest(Cell(spec), key, axis_fields, unsupported=too_large)

    def _too_large(self, point: Point, base: Spec, spec: Spec) -> str | None:
        """Why a map must not be allocated: it exceeds the device's map size or the worker's memory; None if it may.

        Its memory is extrapolated from the last smaller map of the cell, with the square of the size.
        """
        size, info = spec.map_size, self.executor.info
        if size is None:
            return None
        if size > info.max_map_size:
            return f"map size {size}: {info.renderer} allows 1 to {info.max_map_size}"
        smaller_size, smaller_bytes = self._bytes.get((base, point.axis.name, point.light), (size, 0))
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
