"""Pictures of cells for the HTML page, compressed and encoded as data URIs, in the page or in files beside it.

Only a mask is stored per cell. The page's script shades it, from images of the view without shadow and in full shadow,
and computes its difference from the truth.
"""

import base64
import io
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record
from shadowbench.reports.data_files import DataFiles
from shadowbench.reports.stability import Stability
from shadowbench.reports.words import digits, fault_lines, median_text, value_of
from shadowbench.results.configurations import Section
from shadowbench.results.folder import Folder
from shadowbench.results.ranges import value_text
from shadowbench.scores.difference import difference_over, weight
from shadowbench.scores.masks import read_mask
from shadowbench.scores.metrics import METRICS, is_soft, ranking

MAX_PIXELS = 160 * 1024 * 1024  # of all masks in a report, 28 MB if they are noise; larger masks are scaled down
_MIN_SIZE = 128  # pixels along a side
SHOWN_FAULTS = 2  # below a small picture
_STEPS = 16  # quantisation of a difference's colour, for compression


@dataclass(frozen=True)
class GalleryCell:
    """A cell whose picture is shown.

    view_name: camera and light, or axis value and light; cells of the same view share a truth. score: of its
    configuration, a median over views and phases if it has several; own: then the picture's own score; caption: text
    below the picture; error: by which its configuration is ranked, None without one; faults: what is wrong with its
    soft shadows.
    """

    row: Record
    spec: str
    map_size: int | None
    view_name: str
    score: str
    caption: str
    error: float | None = None
    own: str = ""
    faults: tuple[str, ...] = ()

    @property
    def truth(self) -> str:
        """Name of the file of its truth, without `.png`."""
        return ".".join(str(self.row[name]) for name in ("scene", "view", "light", "view_size"))


@dataclass(frozen=True)
class Gallery:
    """The pictures of a section or sweep as JSON data.

    Images are data URIs, or names of data files beside the page that hold them; None if the file is missing.
    cells: dicts of spec, size, view, score, own, caption, error, faults, command (that shows it in the window), mask,
    soft (whether the truth is) and picture, which is used if the view has no shading images; views: by view name,
    images of the truth, the undecided pixels, and the view without shadow (lit) and in full shadow (ambient); notes:
    on missing files and on scaling.
    """

    cells: tuple[dict[str, Any], ...]
    views: dict[str, dict[str, str | None]]
    notes: tuple[str, ...]


def scored_cells(section: Section) -> list[GalleryCell]:
    """The successful cells of a section, of its first phase only."""
    cells = [section.run.results[int(index)].score for index in section.frame.index]
    scored = [score for score in cells if score["status"] == "ok"]
    first = min((score.get("phase") or 0 for score in scored), default=0)
    software = " (software renderer)" if section.run.software else ""
    configurations = {(one.spec, one.map_size): one for one in section.configurations}
    found = []
    for score in scored:
        if (score.get("phase") or 0) != first:
            continue
        metrics, edge = score["metrics"], score["metrics"].get("edge_px")
        penumbra = f"{METRICS['rmse_pen'].text(metrics.get('rmse_pen'), digits, score)} in the penumbra"
        others = (
            [penumbra, _iou(metrics)] if is_soft(metrics) else [f"edge {'–' if edge is None else f'{digits(edge)} px'}"]
        )
        view_name = f"{score['view']}, {score['light']}"
        one, ranked_by = configurations[score["spec"], score["map_size"]], ranking(is_soft(metrics))
        cost = "not timed" if one.value("frame_ms") is None else f"{value_of(one, 'frame_ms')} ms{software}"
        shown, own, caption = _score(score), "", ", ".join([_score(score), *others, cost])
        if one.cells > 1:
            text, which = median_text(one, ranked_by.name), f"phase {first}" if one.phases > 1 else "this view"
            shown = f"median {ranked_by.label} {text}"
            own = f"picture: {which}, {_score(score)}"
            caption = f"{shown} of {one.cells}, {cost}; {', '.join([own, *others])}"
        error = None if one.error is None else one.error.median
        told = tuple(fault_lines(one)[:SHOWN_FAULTS])
        found.append(GalleryCell(score, one.spec, one.map_size, view_name, shown, caption, error, own, told))
    return found


def breaking_cells(stability: Stability) -> list[GalleryCell]:
    """The cells at the breaking points of a sweep that have a picture."""
    found = []
    for one, broken, row in stability.breaking_points():
        if row["status"] == "ok":
            view_name = f"{one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}"
            caption = f"{broken.failure}: {_iou(row['metrics'])}"
            found.append(GalleryCell(row, one.spec, None, view_name, _score(row), caption))
    return found


def size_limit(cells: Iterable[GalleryCell]) -> int:
    """Side in pixels to which larger pictures are scaled down, so that all together have at most MAX_PIXELS."""
    areas = sorted(int(cell.row["view_size"]) ** 2 for cell in cells)
    remaining = MAX_PIXELS
    for index, area in enumerate(areas):
        share = remaining / (len(areas) - index)
        if area > share:
            return max(_MIN_SIZE, int(share**0.5))
        remaining -= area
    return 1 << 14


def gallery(
    folder: Path, cells: Sequence[GalleryCell], max_size: int, beside: DataFiles | None = None
) -> Gallery | None:
    """The pictures of cells from a folder, scaled down to at most `max_size` pixels a side; None if it has none.

    beside: receives the images; None for images in the page.
    Raises InputError for a file that is not a valid mask or picture.
    """
    one_per_view = {cell.view_name: cell for cell in cells}
    images = _Images(max_size, beside)
    views = {name: _view(folder / "truth", cell, images) for name, cell in one_per_view.items()}
    with ThreadPoolExecutor() as threads:
        pictures = list(threads.map(lambda cell: _cell(cell, folder, views[cell.view_name], images), cells))
    if not any(picture["picture"] or picture["mask"] for picture in pictures):
        return None
    absent = {
        "mask": any(picture["mask"] is None for picture in pictures),
        "truth": any(view["truth"] is None for view in views.values()),
        "shading": any(views[one["view"]]["lit"] is None and one["picture"] is None for one in pictures),
    }
    missing = " and no ".join(name for name, some in absent.items() if some)
    size = max(int(cell.row["view_size"]) for cell in cells)
    notes = (
        f"{folder.name} has no {missing} for some of these cells." if missing else "",
        f"Scaled down from {size}² to {max_size}² pixels." if max_size < size else "",
    )
    return Gallery(tuple(pictures), views, tuple(filter(None, notes)))


def no_pictures(folder: Folder) -> str:
    """A note that a folder has no pictures."""
    return f"No pictures: {folder.folder.name} has neither pictures/ nor masks/ of these cells."


def _view(folder: Path, cell: GalleryCell, images: "_Images") -> dict[str, str | None]:
    size = int(cell.row["view_size"])
    masks = {"truth": folder / f"{cell.truth}.png", "undecided": folder / f"{cell.truth}.undecided.png"}
    shading = {kind: folder / f"{cell.truth}.{kind}.png" for kind in ("lit", "ambient")}
    return {kind: images.mask(file, size) for kind, file in masks.items()} | {
        kind: images.picture(file) for kind, file in shading.items()
    }


def _cell(cell: GalleryCell, folder: Path, view: dict[str, str | None], images: "_Images") -> dict[str, Any]:
    picture, mask = (folder / kind / f"{cell.row['key']}.png" for kind in ("pictures", "masks"))
    shaded = mask.exists() and view["lit"] is not None
    return {
        "spec": cell.spec,
        "size": cell.map_size,
        "view": cell.view_name,
        "score": cell.score,
        "own": cell.own,
        "caption": cell.caption,
        "error": cell.error,
        "faults": cell.faults,
        "command": _view_command(cell.row, folder),
        "soft": is_soft(cell.row["metrics"]),
        "mask": images.mask(mask, int(cell.row["view_size"])),
        "picture": None if shaded else images.picture(picture),
    }


def _view_command(row: Record, folder: Path) -> str:
    """The command line that shows a cell in the window; empty for a mask of another renderer."""
    if "content" in row:
        return ""
    return shlex.join(["shadowbench", "view", os.path.relpath(folder), "--cell", row["key"]])


def _score(row: Record) -> str:
    """The metric by which a row is ranked: `IoU 0.97120`, `RMSE 0.0123`."""
    metrics = row["metrics"]
    return f"RMSE {METRICS['rmse'].text(metrics.get('rmse'), digits, row)}" if is_soft(metrics) else _iou(metrics)


def _iou(metrics: Mapping[str, float | None]) -> str:
    value = metrics.get("iou")
    return "no IoU" if value is None else f"IoU {value:.5f}"


def difference(
    mask: NDArray[np.float32], truth: NDArray[np.float32], undecided: NDArray[np.bool_] | None, soft: bool = False
) -> NDArray[np.uint8]:
    """The difference picture of a mask: false shadow orange, false light blue, over the truth in pale grey.

    mask, truth: (N, N) visibility in [0, 1]; undecided: (N, N), pixels that stay grey. The opacity of the colour is
    the size of the error, of soft shadows its root. Returns (N, N, 3) uint8 sRGB.
    """
    signed = np.rint(weight(mask - truth, soft) * _STEPS) / _STEPS
    if undecided is not None:
        signed[undecided] = 0
    return difference_over(np.rint(198 + 50 * np.rint(truth * 4) / 4), signed)


def read_view(file: Path, size: int) -> NDArray[np.float32]:
    """Read a mask of a view, (size, size) float32 visibility. Raises InputError for another size."""
    visibility = read_mask(file)
    if visibility.shape != (size, size):
        found = " × ".join(map(str, reversed(visibility.shape)))
        raise InputError(f"{file}: found {found} pixels; allowed: {size} × {size}, the view's size")
    return visibility


@dataclass(frozen=True)
class _Images:
    """Images as they stand in the page's data: scaled down to `max_size`, as data URIs or in files beside the page."""

    max_size: int
    beside: DataFiles | None

    def mask(self, file: Path, size: int) -> str | None:
        """A mask of a view of `size` pixels; None without a file."""
        if not file.exists():
            return None
        grey = Image.fromarray(np.rint(read_view(file, size) * 255).astype(np.uint8))
        return self._placed(file, _webp(_scaled_down(grey, self.max_size), lossless=True))

    def picture(self, file: Path) -> str | None:
        """A picture; None without a file."""
        if not file.exists():
            return None
        try:
            with Image.open(file, formats=["PNG"]) as image:
                return self._placed(file, _webp(_scaled_down(image.convert("RGB"), self.max_size), lossless=False))
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
            raise InputError(f"{file}: cannot be read as an image; allowed: a PNG") from None

    def _placed(self, file: Path, uri: str) -> str:
        return uri if self.beside is None else self.beside.write(str(file), uri)


def _scaled_down(image: Image.Image, max_size: int) -> Image.Image:
    return image if image.width <= max_size else image.resize((max_size, max_size), Image.Resampling.BOX)


def _webp(image: Image.Image, lossless: bool) -> str:
    file = io.BytesIO()
    image.save(file, format="WEBP", lossless=lossless, quality=60 if lossless else 80, method=3)
    return "data:image/webp;base64," + base64.b64encode(file.getvalue()).decode()
