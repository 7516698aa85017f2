"""Scoring a mask of any renderer against a truth; needs no GL."""

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import facet_normals
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.masks import mask_sha256
from shadowbench.scores.metrics import values_of
from shadowbench.truths.trace import Truth


def prepare_truth(truth: Truth) -> PreparedTruth:
    """Truth as the input of metrics."""
    return PreparedTruth(truth.arrays(), None if truth.view is None else partial(positions, truth.view, truth.triangle))


def positions(view: View, triangle: NDArray[np.int32]) -> Floats:
    """(H, W, 3) points at the pixels' centres, on the planes of triangles (H, W), in metres from the camera.

    0 for misses. A plane seen edge-on, which receivers cannot be, has points anywhere.
    """
    width = triangle.shape[1]
    points = np.empty((*triangle.shape, 3))
    for row, hit in enumerate(triangle):
        on_surface = surface_points(view, np.arange(row * width, (row + 1) * width), np.maximum(hit, 0))
        points[row] = np.where(hit[:, np.newaxis] < 0, 0, on_surface)
    return points


def surface_points(view: View, pixel: NDArray[Any], triangle: NDArray[Any]) -> Floats:
    """(N, 3) points at the centres of pixels (N,), row by row, on the planes of triangles (N,), as `positions`."""
    camera, (width, height) = view.camera, view.size
    row, column = np.divmod(pixel, width)
    x = (column + 0.5) * (2 / height) - width / height
    y = (row + 0.5) * (2 / height) - 1
    right, up, back = camera.basis()
    beside = x[:, np.newaxis] * right - y[:, np.newaxis] * up
    rays, starts = camera.slope * beside - back, camera.height / 2 * beside  # of length 1 along the camera's axis
    corners = view.scene.geometry.corners(triangle)
    normals = facet_normals(corners)
    toward = np.einsum("ix,ix->i", normals, rays)
    away = np.einsum("ix,ix->i", normals, corners[:, 0] - camera.position - starts)
    depth = away / np.where(toward == 0, 1, toward)
    points: Floats = starts + rays * depth[:, np.newaxis]
    return points


def mask_record(
    visibility: NDArray[np.float32], truth: Truth, prepared: PreparedTruth, surface: NDArray[np.int32] | None = None
) -> dict[str, Any]:
    """Fields of a score record that describe a mask: metrics, digest and pixel counts.

    visibility: (H, W), quantised to 16 bits; prepared: `prepare_truth(truth)`, shared by many masks; surface: (H, W)
    triangle ids of the G-buffer that the mask was drawn over, None if there is none. Row 0 is at the top.
    A soft truth adds its own error, root mean square over receivers and over the penumbra, what widths are from, and
    whether they are too wide or too narrow.
    """
    return comparison_record(Comparison(visibility, prepared), truth, surface)


def comparison_record(comparison: Comparison, truth: Truth, surface: NDArray[np.int32] | None = None) -> dict[str, Any]:
    """`mask_record` of a mask that is compared with the prepared truth already."""
    prepared, visibility = comparison.truth, comparison.visibility
    record: dict[str, Any] = {
        "metrics": values_of(comparison),
        "receivers": int(np.count_nonzero(truth.receivers)),
        "undecided": int(np.count_nonzero(truth.receivers & truth.undecided)),
        "mask_sha256": mask_sha256(visibility),
        **truth_record(prepared),
    }
    if prepared.soft:
        record["width_bias"] = comparison.width_bias
    if surface is not None:
        decided = truth.receivers & ~truth.undecided
        record["surface_mismatch"] = int(np.count_nonzero(decided & (surface != truth.triangle)))
    return record


def truth_record(prepared: PreparedTruth) -> dict[str, Any]:
    """Fields about a soft truth: its error, the pixels of its penumbra, and the share of crossings with a width."""
    if not prepared.soft:
        return {}
    across = prepared.crossings
    return {
        "truth_error": math.sqrt(prepared.mean_variance),
        "truth_error_pen": math.sqrt(prepared.mean_variance_pen),
        "penumbra": int(np.count_nonzero(prepared.penumbra)),
        "width_share": len(across.width) / across.tried if across is not None and across.tried else None,
    }
