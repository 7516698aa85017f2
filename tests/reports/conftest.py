"""Run folders written for one test: rows as a run makes them, with the numbers that a test asks for."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.reports.analysis import Section, sections
from shadowbench.reports.folder import read_runs
from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import METRICS

RECEIVERS = 1000
SIDE = 32


@dataclass(frozen=True)
class Cell:
    """A cell with an error and a time; `edge` defaults to a hundred times the error. Times None: not timed."""

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

    @property
    def key(self) -> str:
        return f"{abs(hash((self.scene, self.spec, self.map_size, self.phase, self.version))):x}"

    def records(self) -> list[dict[str, Any]]:
        score = {
            "schema": 1, "kind": "score", "key": self.key, "scene": self.scene, "view": "camera", "light": "sun",
            "phase": self.phase, "technique": self.spec.split(":")[0], "spec": self.spec,
            "full_spec": f"{self.spec}[{self.map_size}]", "map_size": self.map_size, "view_size": SIDE,
            "coordinates": "relative", "renderer": "a renderer", "status": self.status,
        }  # fmt: skip
        if self.status == "ok":
            values = dict.fromkeys(METRICS, 0.5) | {"iou": None if self.error is None else 1 - self.error}
            values["edge_px"] = 100 * self.error if self.edge is None and self.error is not None else self.edge
            score |= {"metrics": values, "receivers": RECEIVERS, "undecided": 3, "work": {"draws": 1}, "facts": {}}
            score |= {"assumptions": ["no light: assumed a sun"], "gpu_bytes": 1, "mask_sha256": "0"}
        if self.ms is None:
            return [score]
        passes = {name: {"ms": ms, "iqr_ms": 0.1, "n": 3, "changes": "frame"} for name, ms in self.passes}
        time = {
            "schema": 1, "kind": "time", "key": self.key, "machine": self.machine, "clock": "finish+wall", "n": 9,
            "frame_ms": self.ms, "frame_iqr_ms": 0.2, "wall_ms": None, "added_ms": self.ms, "ratio": self.ms / 10,
            "ratio_iqr": 0.1, "prepare_ms": 1.0, "passes": passes,
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


def write_pictures(folder: Path, cells: Sequence[Cell]) -> None:
    """A square shadow as the truth, and masks that miss its upper rows in proportion to their error."""
    truth = np.ones((SIDE, SIDE), dtype=np.float32)
    truth[8:24, 8:24] = 0
    for kind in ("masks", "pictures", "truth"):
        (folder / kind).mkdir()
    for name, image in (("", truth), (".undecided", np.zeros_like(truth))):
        for scene in {cell.scene for cell in cells}:
            write_mask(folder / "truth" / f"{scene}.camera.sun.{SIDE}{name}.png", image)
    for cell in cells:
        if cell.status == "ok":
            mask = truth.copy()
            mask[8 : 8 + round(16 * (cell.error or 0)), 8:24] = 1
            write_mask(folder / "masks" / f"{cell.key}.png", mask)
            picture = np.rint(mask[..., None] * np.array([200, 180, 160])).astype(np.uint8)
            Image.fromarray(picture).save(folder / "pictures" / f"{cell.key}.png")


@pytest.fixture
def run_folder(tmp_path: Path) -> Callable[..., Path]:
    """Writes a run folder."""

    def write(
        cells: Sequence[Cell] = CELLS,
        name: str = "run",
        software: bool = True,
        processor: str = "A processor",
        pictures: bool = False,
        about: bool = True,
    ) -> Path:
        folder = tmp_path / name
        folder.mkdir(parents=True)
        lines = [json.dumps(record) + "\n" for cell in cells for record in cell.records()]
        (folder / "rows.jsonl").write_text("".join(lines), encoding="utf-8")
        if about:
            (folder / "run.json").write_text(json.dumps(run_file(software, processor)), encoding="utf-8")
        if pictures:
            write_pictures(folder, cells)
        return folder

    return write


@pytest.fixture
def section_of(run_folder: Callable[..., Path]) -> Callable[..., Section]:
    """The only section of a run with these cells."""

    def make(cells: Sequence[Cell] = CELLS, **options: Any) -> Section:
        ((section,),) = sections(read_runs([run_folder(cells, **options)])).values()
        return section

    return make
