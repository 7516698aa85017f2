"""Images of cells, as small as a page can carry them: masks, and what a page blends them with.

A page shades a mask itself, from its view lit and in shadow everywhere, and takes differences from the truth: a cell
costs it one small mask.
"""

import base64
import io
import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.extremes.ranges import value_text
from shadowbench.measure.rows import Record
from shadowbench.reports.analysis import Section
from shadowbench.reports.stability import Stability
from shadowbench.reports.words import digits
from shadowbench.scores.difference import difference_over
from shadowbench.scores.masks import read_mask
from shadowbench.studies.folder import Folder

PIXELS = 160 * 1024 * 1024  # of all masks in a report, 28 MB of pure noise: more, or larger ones, are shown smaller
_SMALLEST = 128  # pixels a side
_STEPS = 16  # of a difference's colour


@dataclass(frozen=True)
class Shot:
    """A cell whose pictures are shown. `place` says where it stands; cells of one place share a truth.

    `said`: what stands above its pictures.
    """

    row: Record
    spec: str
    map_size: int | None
    place: str
    said: str

    @property
    def truth(self) -> str:
        """The name of its truth's file, without `.png`."""
        return ".".join(str(self.row[name]) for name in ("scene", "view", "light", "view_size"))


@dataclass(frozen=True)
class Gallery:
    """What a page needs to show pictures; images are data URIs, None where the folder lacks the file.

    `cells`: dicts of spec, map size, place, IoU, what is said, mask, and the picture where a view has no shading;
    `places`: by place, its truth, undecided pixels, and the view lit and in shadow everywhere. `notes` say what is
    lacking, and what is shown smaller than it is.
    """

    cells: tuple[dict[str, Any], ...]
    places: dict[str, dict[str, str | None]]
    notes: tuple[str, ...]


def shots_of_section(section: Section) -> list[Shot]:
    """The cells that held, in their first phase, by view and light."""
    times = section.frame["frame_ms"]
    cells = [(section.run.results[int(index)], float(times[index])) for index in section.frame.index]
    held = [(result.score, ms) for result, ms in cells if result.score["status"] == "ok"]
    first = min((score.get("phase") or 0 for score, _ in held), default=0)
    software = " (software renderer)" if section.run.software else ""
    shots = []
    for score, ms in held:
        if (score.get("phase") or 0) != first:
            continue
        iou, edge = (score["metrics"].get(name) for name in ("iou", "edge_px"))
        said = [
            _iou(iou),
            "edge –" if edge is None else f"edge {digits(edge)} px",
            "not timed" if math.isnan(ms) else f"{digits(ms)} ms{software}",
        ]
        place = f"{score['view']}, {score['light']}"
        shots.append(Shot(score, score["spec"], score["map_size"], place, ", ".join(said)))
    return shots


def shots_of_breaks(found: Stability) -> list[Shot]:
    """The cells at which ranges end and which drew something, by axis, value and light."""
    shots = []
    for one, broken, row in found.breaking_points():
        if row["status"] == "ok":
            place = f"{one.axis.name} {value_text(one.axis, broken.value)}, {row['light']}"
            shots.append(Shot(row, one.spec, None, place, f"{broken.failure}: {_iou(row['metrics'].get('iou'))}"))
    return shots


def side(shots: Iterable[Shot]) -> int:
    """The most pixels a side at which the pictures of all cells stay within PIXELS: small ones keep their size."""
    areas = sorted(int(shot.row["view_size"]) ** 2 for shot in shots)
    left = PIXELS
    for index, area in enumerate(areas):
        fair = left / (len(areas) - index)
        if area > fair:
            return max(_SMALLEST, int(fair**0.5))
        left -= area
    return 1 << 14


def gallery(folder: Path, shots: Sequence[Shot], most: int) -> Gallery | None:
    """The images that a folder holds of some cells, at most `most` pixels a side; None where it holds none.

    InputError for a file that is no mask or picture.
    """
    one_of_each = {shot.place: shot for shot in shots}
    places = {place: _place(folder / "truth", shot, most) for place, shot in one_of_each.items()}
    with ThreadPoolExecutor() as threads:
        cells = list(threads.map(lambda shot: _cell(shot, folder, places[shot.place], most), shots))
    if not any(cell["picture"] or cell["mask"] for cell in cells):
        return None
    lacks = {
        "mask": any(cell["mask"] is None for cell in cells),
        "truth": any(place["truth"] is None for place in places.values()),
        "shading": any(places[cell["place"]]["lit"] is None and cell["picture"] is None for cell in cells),
    }
    lacking = " and no ".join(name for name, some in lacks.items() if some)
    size = max(int(shot.row["view_size"]) for shot in shots)
    notes = (
        f"{folder.name} has no {lacking} of some of these cells." if lacking else "",
        f"Shown at {most}² of {size}² pixels." if most < size else "",
    )
    return Gallery(tuple(cells), places, tuple(filter(None, notes)))


def no_pictures(folder: Folder) -> str:
    """Why nothing of a folder is shown."""
    return f"No pictures: {folder.folder.name} holds neither pictures/ nor masks/ of these cells."


def _place(folder: Path, shot: Shot, most: int) -> dict[str, str | None]:
    size = int(shot.row["view_size"])
    masks = {"truth": folder / f"{shot.truth}.png", "undecided": folder / f"{shot.truth}.undecided.png"}
    shading = {kind: folder / f"{shot.truth}.{kind}.png" for kind in ("lit", "ambient")}
    return {kind: _mask(file, size, most) for kind, file in masks.items()} | {
        kind: _picture(file, most) for kind, file in shading.items()
    }


def _cell(shot: Shot, folder: Path, place: dict[str, str | None], most: int) -> dict[str, Any]:
    picture, mask = (folder / kind / f"{shot.row['key']}.png" for kind in ("pictures", "masks"))
    shaded = mask.exists() and place["lit"] is not None
    return {
        "spec": shot.spec,
        "size": shot.map_size,
        "place": shot.place,
        "iou": _iou(shot.row["metrics"].get("iou")),
        "said": shot.said,
        "mask": _mask(mask, int(shot.row["view_size"]), most),
        "picture": None if shaded else _picture(picture, most),
    }


def _iou(value: float | None) -> str:
    return "no IoU" if value is None else f"IoU {value:.5f}"


def difference(
    mask: NDArray[np.float32], truth: NDArray[np.float32], undecided: NDArray[np.bool_] | None
) -> NDArray[np.uint8]:
    """False shadow in one colour, false light in another, over the truth in pale grey; undecided pixels stay grey.

    mask, truth: (N, N) visibility in [0, 1]; the colour is as strong as the error. Returns (N, N, 3) uint8 sRGB.
    """
    signed = np.rint((mask - truth) * _STEPS) / _STEPS
    if undecided is not None:
        signed[undecided] = 0
    return difference_over(np.rint(198 + 50 * np.rint(truth * 4) / 4), signed)


def read_view(file: Path, size: int) -> NDArray[np.float32]:
    """A mask of a view, (size, size) as `read_mask` gives it; InputError for one of another size."""
    visibility = read_mask(file)
    if visibility.shape != (size, size):
        found = " × ".join(map(str, reversed(visibility.shape)))
        raise InputError(f"{file}: found {found} pixels; allowed: {size} × {size}, the view's size")
    return visibility


def _mask(file: Path, size: int, most: int) -> str | None:
    if not file.exists():
        return None
    grey = Image.fromarray(np.rint(read_view(file, size) * 255).astype(np.uint8))
    return _webp(_shrunk(grey, most), lossless=True)


def _picture(file: Path, most: int) -> str | None:
    if not file.exists():
        return None
    try:
        with Image.open(file, formats=["PNG"]) as image:
            return _webp(_shrunk(image.convert("RGB"), most), lossless=False)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError(f"{file}: cannot be read as an image; allowed: a PNG") from None


def _shrunk(image: Image.Image, most: int) -> Image.Image:
    return image if image.width <= most else image.resize((most, most), Image.Resampling.BOX)


def _webp(image: Image.Image, lossless: bool) -> str:
    file = io.BytesIO()
    image.save(file, format="WEBP", lossless=lossless, quality=60 if lossless else 80, method=3)
    return "data:image/webp;base64," + base64.b64encode(file.getvalue()).decode()
