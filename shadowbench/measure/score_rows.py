"""The score record of a cell, whoever drew it: its identity, and what was measured or why nothing was. Needs no GL."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shadowbench.measure.rows import CellIdentity
from shadowbench.scenes.model import Coordinates, View


@dataclass(frozen=True, eq=False)
class Measured:
    """A cell that held: what `mask_record` says of its mask, and what drawing it took. gpu_bytes None: nobody knows."""

    mask: Mapping[str, Any]
    gpu_bytes: int | None
    work: Mapping[str, int]
    facts: Mapping[str, float]


def identity(
    view: View,
    *,
    technique: str,
    spec: str,
    full_spec: str,
    map_size: int | None = None,
    phase: int = 0,
    coordinates: Coordinates = "relative",
) -> CellIdentity:
    """What names a cell for people and for `check`, whatever its sources."""
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        "phase": phase,
        "technique": technique,
        "spec": spec,
        "full_spec": full_spec,
        "map_size": map_size,
        "view_size": view.size,
        "coordinates": coordinates,
    }


def score_row(
    key: str,
    cell: CellIdentity,
    renderer: str,
    outcome: Measured | str,
    axis_fields: Mapping[str, Any] = {},
    more: Mapping[str, Any] = {},
) -> dict[str, Any]:
    """A score record. outcome: as text, the status of a cell that did not hold.

    axis_fields: the value of the axis that `stress` walks along, if any; more: further fields of a cell that is ok.
    """
    row = {"kind": "score", "key": key, **cell, **axis_fields, "renderer": renderer}
    if isinstance(outcome, str):
        return row | {"status": outcome}
    drawn = {"gpu_bytes": outcome.gpu_bytes, "work": dict(outcome.work), "facts": dict(outcome.facts)}
    return row | {"status": "ok", **outcome.mask, **drawn, **more}
