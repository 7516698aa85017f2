"""Run folders for reports: rows as written by a run, with given scores and times."""

import base64
import hashlib
import io
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vl_convert
from PIL import Image

from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import NAMES, Value, value_label
from shadowbench.measure.rows import STILL
from shadowbench.reports.stability import Stability, analyse
from shadowbench.results.frame import read_folders, read_runs
from shadowbench.results.summary import Summary, summaries
from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of

RECEIVERS = 1000
SIDE = 32
TRUTH_ERROR = 0.002  # of soft cells
SCORE = {
    "schema": 1, "kind": "score", "view": "camera", "phase": 0, "view_size": SIDE, "view_width": SIDE, **STILL,
    "coordinates": "relative", "renderer": "a renderer",
}  # fmt: skip
MEASURED = {
    "receivers": RECEIVERS, "undecided": 3, "work": {"draws": 1}, "facts": {}, "gpu_bytes": 1, "mask_sha256": "0",
}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """A cell with an error and a time, None if not timed; edge: by default a hundred times the error.

    reference_ms: time of the reference in the cell's block; rmse_pen: None if the truth has no penumbra; work: None if
    it is not counted; predicted: milliseconds that ON_RECORD gives.
    """

    spec: str
    map_size: int | None
    error: float | None
    ms: float | None
    edge: float | None = None
    status: str = "ok"
    phase: int = 0
    scene: str = "stairs"
    passes: tuple[tuple[str, float], ...] = (("depth", 1.0), ("resolve", 2.0))
    machine: str = "m1"
    version: int = 0
    reference_ms: float = 10.0
    ratio_iqr: float = 0.02
    rmse_pen: float | None = None
    work: float | None = None
    predicted: float | None = None

    @property
    def key(self) -> str:
        return key_of(self.scene, self.spec, self.map_size, self.phase, self.version)

    def records(self) -> list[dict[str, Any]]:
        score = SCORE | {
            "key": self.key, "scene": self.scene, "light": "sun", "phase": self.phase, "status": self.status,
            "technique": self.spec.split(":")[0], "spec": self.spec, "full_spec": f"{self.spec}[{self.map_size}]",
            "map_size": self.map_size,
        }  # fmt: skip
        if self.status == "ok":
            values = dict.fromkeys(METRICS, 0.5) | {"iou": None if self.error is None else 1 - self.error}
            values |= {"rmse": self.rmse_pen and self.rmse_pen / 4, "rmse_pen": self.rmse_pen, "terminator": None}
            if self.rmse_pen is not None:
                score |= {"truth_error": TRUTH_ERROR, "truth_error_pen": 4 * TRUTH_ERROR, "penumbra": 9}
            values["edge_px"] = 100 * self.error if self.edge is None and self.error is not None else self.edge
            score |= MEASURED | {"metrics": values, "assumptions": ["no light: assumed a sun"]}
            score |= {"work": {"draws": 1} | ({} if self.work is None else {"cost": round(self.work)})}
            score |= {"predicted": self.predicted}
        if self.ms is None:
            return [score]
        passes = {name: {"ms": ms, "iqr_ms": 0.1, "n": 3, "changes": "frame"} for name, ms in self.passes}
        time = {
            "schema": 1, "kind": "time", "key": self.key, "machine": self.machine, "clock": "finish+wall", "n": 9,
            "frame_ms": self.ms, "frame_iqr_ms": 0.2, "wall_ms": None, "added_ms": self.ms, "prepare_ms": 1.0,
            "reference": "shadow-map:size=1024", "reference_ms": self.reference_ms, "passes": passes,
            "ratio": self.ms / self.reference_ms, "ratio_iqr": self.ratio_iqr,
        }  # fmt: skip
        return [score, time]


CELLS = (
    Cell("unshadowed", None, 1.0, 1.0),
    Cell("shadow-map", 512, 0.04, 5.0),
    Cell("shadow-map", 1024, 0.02, 8.0),
    Cell("shadow-map", 2048, 0.005, 20.0),
    Cell("shadow-map:bias=none", 512, 0.7, 4.5),
    Cell("shadow-map:bias=none", 1024, 0.6, 9.0),
    Cell("ray-traced", None, 0.0, 60.0, passes=(("trace", 59.0),)),
    Cell("planar-projection", None, None, None, status="unsupported: no receiver is a plane"),
    Cell("cube-map", 512, None, None, status="failed: the worker died"),
)
"""A scene as most are: a floor, a family at several sizes, ray tracing, and what cannot answer."""


class OnRecord:
    """A device whose times the cells themselves say."""

    device = "a device on record"

    def of_row(self, row: Mapping[str, Any]) -> float | None:
        """Time of a row; None of one that says none, as without a law."""
        found: float | None = row["predicted"]
        return found


ON_RECORD = OnRecord()


def run_file(software: bool, processor: str) -> dict[str, Any]:
    return {
        "schema": 1,
        "command": "shadowbench run stairs -t 'shadow-map:bias=<b>'",
        "finished": "2026-01-02T03:04:05+00:00",
        "versions": {"shadowbench": "0.1.0"},
        "machine": {"processor": processor, "cores": 2, "memory_gib": 8.0, "system": "Linux"},
        "device": {"renderer": f"renderer of {processor}", "software": software, "version": 450, "subpixel_bits": 8},
        "clock": "finish+wall",
        "assumptions": ["no camera: assumed one"],
        "study": {"reference": "shadow-map", "rounds": 9, "phases": 1},
    }


def color_of(name: str) -> np.ndarray:
    """(3,) colour unique to a file name, with levels of at least 100."""
    return 100 + np.frombuffer(hashlib.sha256(name.encode()).digest()[:3], np.uint8) * (150 / 255)


def write_picture(file: Path) -> None:
    """Write an image of the colour of its file name."""
    file.parent.mkdir(exist_ok=True)
    Image.fromarray(np.full((SIDE, SIDE, 3), color_of(file.name)).astype(np.uint8)).save(file)


FACETS = np.zeros((SIDE, SIDE), dtype=np.float32)
FACETS[20:24, 8:24] = 1  # in the shadow's lower rows, which all masks have


def write_pictures(folder: Path, records: Sequence[dict[str, Any]]) -> None:
    """Write a square shadow as the truth, and masks that lack its upper rows in proportion to their error."""
    truth = np.ones((SIDE, SIDE), dtype=np.float32)
    truth[8:24, 8:24] = 0
    for kind in ("masks", "truth"):
        (folder / kind).mkdir()
    for record in records:
        if record.get("status") == "ok":
            stem = ".".join(str(record[name]) for name in ("scene", "view", "light", "view_size"))
            write_mask(folder / "truth" / f"{stem}.png", truth)
            write_mask(folder / "truth" / f"{stem}.undecided.png", np.zeros_like(truth))
            write_mask(folder / "truth" / f"{stem}.facets.png", FACETS)
            for file in (f"truth/{stem}.lit.png", f"truth/{stem}.ambient.png", f"pictures/{record['key']}.png"):
                write_picture(folder / file)
            mask = truth.copy()
            iou = record["metrics"]["iou"]
            mask[8 : 8 + round(16 * (0 if iou is None else 1 - iou)), 8:24] = 1
            write_mask(folder / "masks" / f"{record['key']}.png", mask)


@dataclass(frozen=True)
class Point:
    """A cell on an axis, under a sun; flicker: on axes of motion only."""

    spec: str
    axis: str
    value: Value
    iou: float | None = 0.99
    acne: float | None = 0.0
    leak: float | None = 0.0
    flicker: float | None = None
    status: str = "ok"
    light: str = "directional"
    version: int = 0

    @property
    def key(self) -> str:
        return key_of(self.spec, self.axis, self.value, self.light, self.version)

    def record(self) -> dict[str, Any]:
        row = SCORE | {
            "key": self.key, "scene": f"{self.axis}-{value_label(self.value)}", "light": dict(NAMES)[self.light],
            "technique": self.spec.split(":")[0], "spec": self.spec, "full_spec": f"{self.spec}[1024]",
            "map_size": 1024, "status": self.status, "axis": self.axis, "axis_value": self.value, "axis_unit": "",
            "light_kind": self.light, "home_spec": self.spec,
        }  # fmt: skip
        if self.status == "ok":
            hard = [name for name, metric in METRICS.items() if metric.kind != "soft"]
            values = dict.fromkeys(METRICS) | dict.fromkeys(hard, 0.5) | {"terminator": None}
            row |= MEASURED | {"metrics": values | {"iou": self.iou, "acne": self.acne, "leak": self.leak}}
            row["metrics"] |= {} if self.flicker is None else {"flicker": self.flicker}
        return row


def swept(spec: str, axis: str, *changed: Point) -> list[Point]:
    """Points at all values of an axis, with some replaced."""
    points = {one.value: one for one in (*(Point(spec, axis, value) for value in AXES[axis].values), *changed)}
    return list(points.values())


POINTS = (
    # Breaks at 0.2°, on one side; what lies beyond is no second break.
    *swept("shadow-map", "elevation", Point("shadow-map", "elevation", 0.2, iou=0.8, acne=0.25)),
    *(replace(one, light="spot") for one in swept("shadow-map", "elevation")),
    # Draws as far as 4096, and is refused beyond.
    *swept(
        "shadow-map",
        "map-size",
        Point("shadow-map", "map-size", 16, leak=0.5),
        Point("shadow-map", "map-size", 8192, status="unsupported: too large"),
        Point("shadow-map", "map-size", 16384, status="unsupported: too large"),
    ),
    *(replace(one, flicker=0.0) for one in swept("shadow-map", "camera-step")),
    *swept("shadow-map", "volume-wall", Point("shadow-map", "volume-wall", 0.0, status="failed: crashed")),
    *swept("cube-map", "mesh", Point("cube-map", "mesh", "open", leak=0.03)),
    *(replace(one, status="unsupported: no sun") for one in swept("cube-map", "elevation")),
    *(replace(one, iou=0.0, leak=1.0, acne=None) for one in swept("planar-projection", "elevation")),
)
"""A sweep with all there is: ranges that are whole, that end on one side, hold nothing, crash or are refused."""


def write_folder(folder: Path, records: Sequence[dict[str, Any]], about: dict[str, Any], pictures: bool) -> Path:
    """A folder with these records, and this `run.json` unless it is empty."""
    folder.mkdir(parents=True)
    lines = [json.dumps(record) + "\n" for record in records]
    (folder / "rows.jsonl").write_text("".join(lines), encoding="utf-8")
    if about:
        (folder / "run.json").write_text(json.dumps(about), encoding="utf-8")
    if pictures:
        write_pictures(folder, records)
    return folder


@pytest.fixture
def run_folder(tmp_path) -> Callable[..., Path]:
    """Writes a run folder."""

    def write(
        cells: Sequence[Cell] = CELLS,
        name: str = "run",
        software: bool = True,
        processor: str = "A processor",
        pictures: bool = False,
        about: dict[str, Any] | None = None,
    ) -> Path:
        records = [record for cell in cells for record in cell.records()]
        return write_folder(tmp_path / name, records, run_file(software, processor) | (about or {}), pictures)

    return write


@pytest.fixture
def measured(run_folder) -> Callable[..., list[Summary]]:
    """The summaries of a run with these cells, one per scene."""
    count = itertools.count()

    def make(*cells: Cell, **options: Any) -> list[Summary]:
        folder = run_folder(cells or CELLS, **({"name": f"run {next(count)}"} | options))
        return summaries(read_runs([folder])[0], ON_RECORD)  # type: ignore[arg-type]

    return make


@pytest.fixture
def sweep_folder(tmp_path) -> Callable[..., Path]:
    """Writes a folder as written by `stress`."""

    def write(points: Sequence[Point] = POINTS, name: str = "sweep", pictures: bool = False) -> Path:
        about = run_file(True, "A processor") | {"command": "shadowbench stress", "assumptions": []}
        return write_folder(tmp_path / name, [point.record() for point in points], about, pictures)

    return write


@pytest.fixture
def stability_of(sweep_folder) -> Callable[..., Stability]:
    """Stability of a sweep with these points."""
    count = itertools.count()

    def make(*points: Point) -> Stability:
        _, (sweep,) = read_folders([sweep_folder(points or POINTS, name=f"sweep {next(count)}")])
        return analyse(sweep)

    return make


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium."""
    from tests.reports.browsing import chromium  # playwright, of slow tests alone

    with chromium() as opened:
        yield opened


def marks(chart: dict[str, Any]) -> list[dict[str, Any]]:
    """The marks of a drawn chart, groups among them."""
    groups = [vl_convert.vegalite_to_scenegraph({**chart, "width": 600})["scenegraph"]]
    found = []
    while groups:
        group = groups.pop()
        groups += group.get("items", [])
        found.append(group)
    return found


def texts(chart: dict[str, Any]) -> list[str]:
    """The texts of a drawn chart."""
    found = [mark.get("text", []) for mark in marks(chart)]
    return [str(line) for text in found for line in (text if isinstance(text, list) else [text])]


def data_of(page: str) -> dict[str, Any]:
    """The data of a page."""
    found: dict[str, Any] = json.loads(page.partition('id="page">')[2].partition("</script>")[0])
    return found


def parts_of(page: str) -> list[Any]:
    """The data of a page's panels, then of its sweeps."""
    return list(data_of(page)["data"].values())


def galleries(page: str) -> list[Any]:
    """The galleries of a page."""
    return [part["gallery"] for part in parts_of(page) if part["gallery"]]


def image_of(uri: str) -> Image.Image:
    """An image in a page."""
    return Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2])))


@pytest.fixture
def page_of(shadowbench, tmp_path) -> Callable[..., str]:
    """The HTML report of folders, with apostrophes unescaped."""

    def make(*folders: Path) -> str:
        answer = shadowbench("report", *folders, "-o", tmp_path / "report.html")
        assert (answer.code, answer.err) == (0, "")
        return (tmp_path / "report.html").read_text(encoding="utf-8").replace("&#39;", "'")

    return make
