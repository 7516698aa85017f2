"""Pictures of cells for the HTML page, compressed and encoded as data URIs.

Only a mask is stored per cell. The page's script shades it, from images of the view without shadow and in full shadow,
and computes its difference from the truth.
"""

import base64
import io
import os
import shlex
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record, size_of
from shadowbench.options import ViewSize
from shadowbench.reports.stability import Stability
from shadowbench.reports.texts import cost_text, digits, fault_lines, median_text
from shadowbench.results.frame import view_name
from shadowbench.results.ranges import value_text
from shadowbench.results.summary import Setting, Summary, known
from shadowbench.scores.difference import difference_over, weight, with_facets
from shadowbench.scores.masks import read_mask
from shadowbench.scores.metrics import METRICS, is_soft

_SHOWN_FAULTS = 2  # below a picture
_STEPS = 16  # quantisation of a difference's colour, for compression

Picture = tuple[Record, dict[str, Any]]
"""The row of a cell whose picture is shown, and what the page says of it.

view: camera and light, or axis value and light; cells of the same view share a truth. score: of its configuration, a
median over views and phases if it has several; caption: text below the picture; faults: what is wrong with its soft
shadows.
"""


def scored_cells(summary: Summary) -> list[Picture]:
    """The pictures of a scene's successful cells, of its first phase only."""
    rows = [summary.run.results[int(index)].score for index in summary.cells.index]
    drawn = [row for row in rows if row["status"] == "ok"]
    first = min((row.get("phase") or 0 for row in drawn), default=0)
    settings = {(one.spec, one.map_size): one for one in summary.lines}
    return [
        (row, _scored_cell(row, settings[row["spec"], row["map_size"]], summary))
        for row in drawn
        if (row.get("phase") or 0) == first
    ]


def _scored_cell(row: Record, one: Setting, summary: Summary) -> dict[str, Any]:
    metrics, phase, own = row["metrics"], row.get("phase") or 0, _score(row)
    if is_soft(metrics):
        others = [f"{METRICS['rmse_pen'].text(metrics.get('rmse_pen'), digits, row)} in the penumbra", _iou(metrics)]
    else:
        edge = metrics.get("edge_px")
        others = ["edge –" if edge is None else f"edge {digits(edge)} px"]
    if row["frames"] > 1:
        others.append(f"means of {row['frames']} frames, of which the first is shown")
    how = {"predicted_ms": " (predicted)", "work_cost": " of work"}
    software = " (software renderer)" if summary.run.software else ""
    cost = "not timed" if summary.cost in ("frame_ms", "map_size") else "not ranked"
    cost = cost_text(summary, one) + how.get(summary.cost, software) if known(one.cost) else cost
    score, caption = own, ", ".join([own, *others, cost])
    if one.cells > 1:
        score = f"median {summary.ranked_by.label} {median_text(one, summary.ranked_by.name)}"
        own = f"picture: {f'phase {phase}' if one.phases > 1 else 'this view'}, {own}"
        caption = f"{score} of {one.cells}, {cost}; {', '.join([own, *others])}"
    return {
        "spec": one.spec,
        "size": one.map_size,
        "view": ", ".join(filter(None, (row["view"], row["light"], row["sequence"]))),
        "score": score,
        "caption": caption,
        "faults": fault_lines(summary, one)[:_SHOWN_FAULTS],
    }


def breaking_cells(stability: Stability) -> list[Picture]:
    """The cells at the breaking points of a sweep that have a picture."""
    return [
        (
            row,
            {
                "spec": one.spec,
                "size": None,
                "view": f"{one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}",
                "score": _score(row),
                "caption": f"{broken.failure}: {_iou(row['metrics'])}",
            },
        )
        for one, broken, row in stability.breaking_points()
        if row["status"] == "ok"
    ]


def _score(row: Record) -> str:
    """The metric by which a row is ranked: `IoU 0.97120`, `RMSE 0.0123`."""
    metrics = row["metrics"]
    return f"RMSE {METRICS['rmse'].text(metrics.get('rmse'), digits, row)}" if is_soft(metrics) else _iou(metrics)


def _iou(metrics: Mapping[str, float | None]) -> str:
    value = metrics.get("iou")
    return "no IoU" if value is None else f"IoU {value:.5f}"


def gallery(folder: Path, pictures: Sequence[Picture]) -> dict[str, Any] | None:
    """The pictures from a folder as JSON data; None if it has none.

    cells: what the page says of each that has a picture, with its scene and key, its command (that shows it in the
    window), its mask, whether the truth is soft, and a picture, which is used if the view has no shading images; views:
    by view, images of the truth, the undecided pixels, those darkened by facets, and the view without shadow (lit) and
    in full shadow (ambient), None for missing files; notes: on missing pictures.

    Raises InputError for a file that is not a valid mask or picture.
    """
    rows = {about["view"]: row for row, about in pictures}
    views = {name: _view(folder / "truth", row) for name, row in rows.items()}

    def cell_of(one: Picture) -> dict[str, Any]:
        row, about = one
        return _cell(folder, row, about, views[about["view"]]["lit"] is not None)

    with ThreadPoolExecutor() as threads:
        cells = list(threads.map(cell_of, pictures))
    shown = [cell for cell in cells if cell["picture"] or cell["mask"]]
    if not shown:
        return None
    partial = len(shown) < len(cells)
    notes = [f"{folder.name} has pictures of {len(shown)} of these {len(cells)} cells."] if partial else []
    return {"cells": shown, "views": views, "notes": notes}


def _view(folder: Path, row: Record) -> dict[str, Any]:
    name, size = view_name(row), size_of(row)
    return {
        "truth": _image(folder / f"{name}.png", size),
        "undecided": _image(folder / f"{name}.undecided.png", size),
        "facets": _image(folder / f"{name}.facets.png", size),
        "lit": _image(folder / f"{name}.lit.png", None),
        "ambient": _image(folder / f"{name}.ambient.png", None),
    }


def _cell(folder: Path, row: Record, about: dict[str, Any], shaded: bool) -> dict[str, Any]:
    mask = _image(folder / "masks" / f"{row['key']}.png", size_of(row))
    command = shlex.join(["shadowbench", "view", os.path.relpath(folder), "--cell", row["key"]])
    return about | {
        "scene": row["scene"],
        "key": row["key"],
        "command": "" if "content" in row else command,  # not of a mask of another renderer
        "soft": is_soft(row["metrics"]),
        "mask": mask,
        "picture": None if mask and shaded else _image(folder / "pictures" / f"{row['key']}.png", None),
    }


def difference(
    mask: NDArray[np.float32],
    truth: NDArray[np.float32],
    undecided: NDArray[np.bool_] | None,
    soft: bool = False,
    facets: NDArray[np.bool_] | None = None,
) -> NDArray[np.uint8]:
    """The difference picture of a mask: false shadow orange, false light blue, over the truth in pale grey.

    mask, truth: (H, W) visibility in [0, 1]; undecided: (H, W), pixels that stay grey; facets: (H, W), pixels that the
    truth has in the shadow of a smooth surface's own triangles, purple where the mask is dark. The opacity of the
    colour is the size of the error, of soft shadows its root. Returns (H, W, 3) uint8 sRGB.
    """
    signed = np.rint(weight(mask - truth, soft) * _STEPS) / _STEPS
    if undecided is not None:
        signed[undecided] = 0
    picture = difference_over(np.rint(198 + 50 * np.rint(truth * 4) / 4), signed)
    return picture if facets is None else with_facets(picture, facets, mask)


def read_view(file: Path, size: ViewSize) -> NDArray[np.float32]:
    """Read a mask of a view, (height, width) float32 visibility. Raises InputError for another size."""
    visibility = read_mask(file)
    if visibility.shape != size.shape:
        found, allowed = (" × ".join(map(str, reversed(shape))) for shape in (visibility.shape, size.shape))
        raise InputError(f"{file}: found {found} pixels; allowed: {allowed}, the view's size")
    return visibility


def read_facets(truth: Path, size: ViewSize) -> NDArray[np.bool_] | None:
    """(height, width), the pixels that facets darken, from the file beside a truth's; None without it."""
    file = truth.with_suffix(".facets.png")
    return read_view(file, size) >= 0.5 if file.exists() else None


def _image(file: Path, size: ViewSize | None) -> str | None:
    """A mask of a view of a size, lossless, or a picture for None, as data URI; None without a file."""
    if not file.exists():
        return None
    if size is not None:
        image = Image.fromarray(np.rint(read_view(file, size) * 255).astype(np.uint8))
    else:
        try:
            with Image.open(file, formats=["PNG"]) as opened:
                image = opened.convert("RGB")
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
            raise InputError(f"{file}: cannot be read as an image; allowed: a PNG") from None
    return data_uri(image, lossless=size is not None)


def data_uri(image: Image.Image, lossless: bool) -> str:
    """An image as WebP in a data URI."""
    encoded = io.BytesIO()
    image.save(encoded, format="WEBP", lossless=lossless, quality=60 if lossless else 80, method=3)
    return "data:image/webp;base64," + base64.b64encode(encoded.getvalue()).decode()
