"""Score record of a cell of any renderer: its identity, and its measurements or failure status. Needs no GL."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shadowbench.measure.rows import CellIdentity
from shadowbench.scenes.model import Coordinates, View


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measurements of a successful cell; mask: fields made by `mask_record`; gpu_bytes: None if unknown."""

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
    """Identity of a cell for people and for `check`, independent of source code."""
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
    outcome: Measurement | str,
    axis_fields: Mapping[str, Any] = {},
    extra_fields: Mapping[str, Any] = {},
) -> dict[str, Any]:
    """Score record of a cell.

    outcome: its measurements, or its status if it was unsupported or failed; axis_fields: place on an axis of `stress`,
    if any; extra_fields: further fields of a successful cell.
    """
    row = {"kind": "score", "key": key, **cell, **axis_fields, "renderer": renderer}
    if isinstance(outcome, str):
        return row | {"status": outcome}
    drawn = {"gpu_bytes": outcome.gpu_bytes, "work": dict(outcome.work), "facts": dict(outcome.facts)}
    return row | {"status": "ok", **outcome.mask, **drawn, **extra_fields}
