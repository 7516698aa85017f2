"""Rows of engines of known scores, for tests of what reads rows."""

from typing import Any

from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import parse_spec
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of
from tests.reports.conftest import MEASURED, SCORE

LLVMPIPE = "llvmpipe (LLVM 15.0.6, 256 bits)"


def row(name: str, scene: str, error: float = 0.0, version: str = "1", **given: Any) -> dict[str, Any]:
    """The row of a spec at 1024 in a scene; given: its status or metrics."""
    spec = parse_spec(name, engines()).with_(size=1024)
    status = given.pop("status", "ok")
    made = SCORE | {
        "key": key_of(name, scene, version), "scene": scene, "light": "sun", "status": status,
        "technique": spec.technique.name, "spec": spec.sizeless_text, "full_spec": spec.full_text, "map_size": 1024,
    }  # fmt: skip
    if status == "ok":
        made |= MEASURED | {"metrics": dict.fromkeys(METRICS, 0.0) | {"iou": 1 - error, "rmse_pen": None} | given}
        made["engine"] = {"version": version, "renderer": LLVMPIPE, "box": "given", "phase": "box"}
    return made


ROWS = [
    row("three", "stairs", 0.5, acne=0.4, edge_px=8.0),
    row("three", "street", 0.1),
    row("three", "terrain", 0.2),
    row("three:preset=documented", "stairs", 0.25, acne=0.3),
    row("three:preset=documented", "street", 0.2),
    row("three:sides=double", "stairs", 0.125, leak=0.1),
    row("three:bias=-0.5", "stairs", 0.3125),
    row("ogre", "stairs", status="unsupported: no such light"),
    row("ogre", "street", status="unsupported: no such light"),
]
