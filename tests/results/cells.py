"""Rows of run folders with known values."""

import json
from pathlib import Path
from typing import Any

from shadowbench.measure.rows import STILL, Result
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of

GOOD = {name: 0.9 if metric.better == "higher" else 0.1 for name, metric in METRICS.items()}
WORSE = GOOD | {"iou": 0.8, "ssim": 0.85}
SIDE = 16
TIME = {"machine": "m", "clock": "wall", "reference": "shadow-map:size=1024", "n": 9, "ratio": 2.0, "ratio_iqr": 0.02}


def cell(spec: str = "shadow-map", scene: str = "s", size: int | None = 512, **score: Any) -> dict[str, Any]:
    """The score record of a cell; score: other fields."""
    return {
        "schema": 1, "kind": "score", "key": key_of(scene, spec, size), "scene": scene,
        "view": "camera", "light": "sun", "phase": 0, "technique": spec.partition(":")[0], "spec": spec,
        "full_spec": spec, "map_size": size, "view_size": SIDE, "view_width": SIDE, **STILL,
        "coordinates": "relative", "renderer": "llvmpipe",
        "status": "ok", "metrics": GOOD, "receivers": 9, "undecided": 1, "mask_sha256": None, "gpu_bytes": 100,
        "work": {"draws": 2, "primitives": 100, "fragments": 1000}, "facts": {}, "assumptions": [],
    } | score  # fmt: skip


def timed(score: dict[str, Any], **time: Any) -> dict[str, Any]:
    """The time record of a cell."""
    return {"schema": 1, "kind": "time", "key": score["key"], "frame_ms": 2.0, "passes": {}, **TIME} | time


def result(time: dict[str, Any] | None = None, **score: Any) -> Result:
    """A cell with its time record, if any."""
    return Result(cell(**score), time)


def rows(folder: Path, *records: dict[str, Any]) -> Path:
    """Write a folder of these records."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rows.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    return folder


def read(folder: Path, kind: str = "score") -> list[dict[str, Any]]:
    """The records of one kind in a folder."""
    lines = (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()
    return [row for row in map(json.loads, lines) if row["kind"] == kind]
