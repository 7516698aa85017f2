"""`stress`: every technique along every axis, a row for each value, in a worker that may die of any of them."""

import hashlib
import itertools
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.measure.drawn import Drawn
from shadowbench.measure.keys import cell_key, view_key
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Record
from shadowbench.measure.runner import Reporter, write_picture
from shadowbench.measure.scoring import mask_record, reference_of
from shadowbench.measure.session import CellRequest, DeviceInfo, Unsupported
from shadowbench.measure.timing import ViewStage
from shadowbench.measure.worker import CellFailed, Worker
from shadowbench.scenes.model import LightKind, View
from shadowbench.scores.masks import write_mask
from shadowbench.stress.axes import Axis, Setting, Value, shown
from shadowbench.stress.ranges import failure
from shadowbench.studies.study import Cell
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec, format_spec
from shadowbench.truth.cache import cached_truth
from shadowbench.truth.trace import Truth

EDGE = 2  # pixels around a true edge in which flips are looked for
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

    def __init__(self, specs: Sequence[Spec], folder: Path, worker: Worker, reporter: Reporter) -> None:
        self.specs, self.folder, self.worker, self.reporter = specs, folder, worker, reporter
        self.info: DeviceInfo = worker.call("info")
        self._stage = ViewStage(worker)
        self._bytes: dict[tuple[str, str, LightKind], tuple[int, int]] = {}  # of a map of some size

    def run(self, axes: Sequence[Axis], quick: bool) -> list[Record]:
        """The rows of all values, in the order of the axes."""
        points = [Point(axis, value, light) for axis in axes for light in axis.lights for value in axis.swept(quick)]
        store = RowStore(self.folder, sweep=True)
        try:
            self.reporter.stage("stress", len(points))
            rows = []
            for point in points:
                rows += self._at(point, store)
                self.reporter.step(point.name)
            return rows
        finally:
            store.close()

    def _at(self, point: Point, store: RowStore) -> list[Record]:
        setting = point.axis.at(point.value, point.light)
        changed = [(spec, changed_spec(spec, setting)) for spec in self.specs if point.light in spec.technique.lights]
        cells = [(home, spec) for home, spec in changed if spec is not None]
        if not cells:
            return []
        views = [view_key(view) for view in setting.views]
        rows: list[Record] = []
        truths: list[Truth] = []
        for home, spec in cells:
            key = self._key(point, spec, setting, views)
            row = store.scores.get(key)
            if row is None or row["status"].startswith("failed"):  # which may have been the machine
                truths = truths or [cached_truth(view) for view in setting.views]
                about = _about(point, home, spec, setting)
                row = {"kind": "score", "key": key, **about, "renderer": self.info.renderer}
                row |= self._measured(point, home, spec, setting, truths, key)
                store.append(row)
                row = store.scores[key]
            if row["status"] == "ok" and spec.map_size:
                self._bytes[format_spec(home), point.axis.name, point.light] = spec.map_size, row["gpu_bytes"]
            rows.append(row)
        return rows

    def _key(self, point: Point, spec: Spec, setting: Setting, views: Sequence[str]) -> str:
        """Of all frames, and of the place on the axis: the base scene is a value of many."""
        parts = [cell_key(Cell(spec, 0), view, setting.coordinates, self.info.renderer) for view in views]
        place = json.dumps([point.axis.name, point.value, point.light, parts])
        return hashlib.sha256(place.encode()).hexdigest()[:24]

    def _measured(
        self, point: Point, home: Spec, spec: Spec, setting: Setting, truths: Sequence[Truth], key: str
    ) -> dict[str, Any]:
        """What a row says beyond its identity: status, and of the first frame the scores."""
        try:
            self._refuse_too_large(point, home, spec)
            drawn, surface = self._draw(spec, setting, 0)
            masks = [drawn.visibility, *(self._draw(spec, setting, k)[0].visibility for k in range(1, len(truths)))]
        except Unsupported as reason:
            return {"status": f"unsupported: {reason}"}
        except CellFailed as reason:
            return {"status": f"failed: {reason}"}
        truth = truths[0]
        row: dict[str, Any] = {
            "status": "ok",
            **mask_record(drawn.visibility, truth, reference_of(truth), surface),
            "gpu_bytes": drawn.gpu_bytes,
            "work": drawn.work,
            "facts": drawn.facts,
        }
        if len(truths) > 1:
            row["flips"] = flips(masks, truths)
        if failure(row) is not None:
            self._keep(setting.views[0], drawn, truth, key)
        return row

    def _refuse_too_large(self, point: Point, home: Spec, spec: Spec) -> None:
        """Raise Unsupported for a map beyond the device's sides or the worker's memory, before it is allocated.

        What it would take is told from the last smaller map of the same cell: bytes grow with the square of the size.
        """
        size = spec.map_size
        if size is None:
            return
        if size > self.info.max_map_size:
            raise Unsupported(f"map size {size}: {self.info.renderer} allows 1 to {self.info.max_map_size}")
        smaller, taken = self._bytes.get((format_spec(home), point.axis.name, point.light), (size, 0))
        needed, limit = taken * (size / smaller) ** 2, SHARE * self.worker.limits.bytes
        if size > smaller and needed > limit:
            raise Unsupported(
                f"map size {size} takes about {needed / 2**30:.1f} GiB; a cell may take {limit / 2**30:g} GiB, half of "
                "the worker's memory limit"
            )

    def _draw(self, spec: Spec, setting: Setting, frame: int) -> tuple[Drawn, NDArray[np.int32]]:
        """A frame's draw, and the triangle ids of its G-buffer."""
        surface = self._stage.open(setting.views[frame], setting.coordinates)
        drawn: Drawn = self.worker.call("draw", CellRequest(format_spec(spec, full=True)))
        return drawn, surface

    def _keep(self, view: View, drawn: Drawn, truth: Truth, key: str) -> None:
        """Mask, picture and truth of a cell that is out of tolerance, to be looked at."""
        for name in ("masks", "pictures", "truth"):
            (self.folder / name).mkdir(exist_ok=True)
        write_mask(self.folder / "masks" / f"{key}.png", drawn.visibility)
        write_picture(self.folder / "pictures" / f"{key}.png", drawn.picture)
        write_mask(self.folder / "truth" / f"{view.name}.png", truth.visibility)
        write_mask(self.folder / "truth" / f"{view.name}.undecided.png", truth.undecided.astype(np.float32))


def changed_spec(spec: Spec, setting: Setting) -> Spec | None:
    """The spec with the setting's parameters, those that it has; None where an axis is of parameters it has not."""
    known = type(spec.params).model_fields
    params = {name: value for name, value in setting.params.items() if name in known}
    if len(params) < len(setting.params):
        return None
    return spec.with_(**params) if params else spec


def flips(masks: Sequence[NDArray[np.float32]], truths: Sequence[Truth]) -> float | None:
    """The largest share of edge receivers, over pairs of frames, that change sides where the truth stays.

    masks: (N, N) visibility of each frame. Pixels count that receive, are decided and lie within EDGE pixels of a true
    edge in both frames; None without any. Of all receivers the share would tell how long the edges are.
    """
    shares = []
    for (before, was), (after, now) in itertools.pairwise(zip(masks, truths, strict=True)):
        steady = was.receivers & now.receivers & ~was.undecided & ~now.undecided & (was.visibility == now.visibility)
        steady &= _near_edge(was) & _near_edge(now)
        if steady.any():
            shares.append(float(((before < 0.5) != (after < 0.5))[steady].mean()))
    return max(shares, default=None)


def _near_edge(truth: Truth) -> NDArray[np.bool_]:
    width = 2 * EDGE + 1
    near: NDArray[np.bool_] = maximum_filter(truth.visibility, width) != minimum_filter(truth.visibility, width)
    return near


def default_specs(techniques: Iterable[type[Technique]]) -> tuple[Spec, ...]:
    """Every technique at its defaults."""
    return tuple(Spec(technique, technique.Params()) for technique in techniques)


def _about(point: Point, home: Spec, spec: Spec, setting: Setting) -> dict[str, Any]:
    """What names a row for people, and where it stands on its axis."""
    view = setting.views[0]
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        "phase": 0,
        "technique": spec.technique.name,
        "spec": format_spec(spec, size=False),
        "full_spec": format_spec(spec, full=True),
        "map_size": spec.map_size,
        "view_size": view.size,
        "coordinates": setting.coordinates,
        "axis": point.axis.name,
        "axis_value": point.value,
        "axis_unit": point.axis.unit,
        "light_kind": point.light,
        "home_spec": format_spec(home),
    }
