"""`stress`: every technique along every axis, a row for each value, in a worker that may die of any of them."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.extremes.axes import Axis, Setting, Value, shown
from shadowbench.extremes.ranges import failure
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import Executor
from shadowbench.measure.keys import cell_key, view_key
from shadowbench.measure.measurer import Reporter
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record
from shadowbench.measure.scorer import Scorer, ScoreRequest
from shadowbench.scenes.model import LightKind
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec

SHARE = 0.5  # of the worker's memory that the textures and buffers of a cell may take


@dataclass(frozen=True, eq=False)
class Point:
    """One value of one axis under one kind of light."""

    axis: Axis
    value: Value
    light: LightKind

    @property
    def name(self) -> str:
        """For progress."""
        return f"{self.axis.name} {shown(self.value)} {self.light}"


class Sweep:
    """Walks specs along axes into one folder; what is there already is not measured again."""

    def __init__(self, specs: Sequence[Spec], folder: Path, executor: Executor, reporter: Reporter) -> None:
        self.specs, self.folder, self.executor, self.reporter = specs, folder, executor, reporter
        self._bytes: dict[tuple[Spec, str, LightKind], tuple[int, int]] = {}  # of a map of some size

    def run(self, axes: Sequence[Axis], quick: bool) -> list[Record]:
        """The rows of all values, in the order of the axes; pictures of those that are out of tolerance."""
        points = [Point(axis, value, light) for axis in axes for light in axis.lights for value in axis.swept(quick)]
        with closing(RowStore(self.folder, sweep=True)) as store:
            scorer = Scorer(self.executor, store, Pictures(self.folder), lambda row: failure(row) is not None)
            self.reporter.stage("stress", len(points))
            rows = []
            for point in points:
                rows += self._at(point, scorer)
                self.reporter.step(point.name)
            return rows

    def _at(self, point: Point, scorer: Scorer) -> list[Record]:
        setting = point.axis.at(point.value, point.light)
        changed = [(spec, changed_spec(spec, setting)) for spec in self.specs if point.light in spec.technique.lights]
        cells = [(home, spec) for home, spec in changed if spec is not None]
        if not cells:
            return []
        views = [view_key(view) for view in setting.views]
        frames = [PlacedView(view, setting.coordinates) for view in setting.views]
        rows = scorer.rows(frames, [self._asked(point, home, spec, setting, views) for home, spec in cells])
        for (home, spec), row in zip(cells, rows, strict=True):
            if row["status"] == "ok" and spec.map_size:
                self._bytes[home, point.axis.name, point.light] = spec.map_size, row["gpu_bytes"]
        return rows

    def _asked(self, point: Point, home: Spec, spec: Spec, setting: Setting, views: Sequence[str]) -> ScoreRequest:
        """The row of a spec at a value. Its key is of all frames, and of the place: the base scene is a value of many.

        views: their keys.
        """
        parts = [cell_key(Cell(spec), view, setting.coordinates, self.executor.info.renderer) for view in views]
        key = json.dumps([point.axis.name, point.value, point.light, parts])
        stands = {
            "axis": point.axis.name,
            "axis_value": point.value,
            "axis_unit": point.axis.unit,
            "light_kind": point.light,
            "home_spec": home.text,
        }
        too_large = self._too_large(point, home, spec)
        return ScoreRequest(Cell(spec), hashlib.sha256(key.encode()).hexdigest()[:24], stands, unsupported=too_large)

    def _too_large(self, point: Point, home: Spec, spec: Spec) -> str | None:
        """Why a map is not even allocated: the device's sides, or the worker's memory.

        What it would take is told from the last smaller map of the same cell: bytes grow with the square of the size.
        """
        size, info = spec.map_size, self.executor.info
        if size is None:
            return None
        if size > info.max_map_size:
            return f"map size {size}: {info.renderer} allows 1 to {info.max_map_size}"
        smaller, taken = self._bytes.get((home, point.axis.name, point.light), (size, 0))
        needed, limit = taken * (size / smaller) ** 2, SHARE * self.executor.limits.bytes
        if size > smaller and needed > limit:
            return (
                f"map size {size} takes about {needed / 2**30:.1f} GiB; a cell may take {limit / 2**30:g} GiB, half of "
                "the worker's memory limit"
            )
        return None


def changed_spec(spec: Spec, setting: Setting) -> Spec | None:
    """The spec with the setting's parameters, those that it has; None where an axis is of parameters it has not."""
    known = type(spec.params).model_fields
    params = {name: value for name, value in setting.params.items() if name in known}
    if len(params) < len(setting.params):
        return None
    return spec.with_(**params) if params else spec


def default_specs(techniques: Iterable[type[Technique]]) -> tuple[Spec, ...]:
    """Every technique at its defaults."""
    return tuple(Spec(technique, technique.Params()) for technique in techniques)
