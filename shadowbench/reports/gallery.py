"""Pictures of cells, as small as a page can carry them: picture, mask, truth, signed difference."""

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
from scipy.ndimage import uniform_filter

from shadowbench.errors import InputError
from shadowbench.extremes.ranges import value_text
from shadowbench.measure.rows import Record
from shadowbench.reports.analysis import Section, front
from shadowbench.reports.stability import Stability
from shadowbench.reports.words import digits
from shadowbench.scores.difference import difference_over
from shadowbench.scores.masks import read_mask

PIXELS = 160 * 512 * 512  # of all masks in a report: more cells, or larger ones, are shown smaller
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
    """What a page needs to show pictures.

    `cells`: dicts of spec, map size, place, scores and images; `truths` images by place; images are data URIs, None
    where the folder lacks the file. `start` is the cell to begin with; `missing` says what is lacking.
    """

    cells: tuple[dict[str, Any], ...]
    truths: dict[str, str | None]
    start: int
    size: int
    view_size: int
    missing: str | None


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


def gallery(folder: Path, shots: Sequence[Shot], most: int, start: int = 0) -> Gallery | None:
    """The pictures that a folder holds of some cells, at most `most` pixels a side; None where it holds none.

    InputError for a file that is no mask or picture.
    """
    files = {shot.place: (folder / "truth" / f"{shot.truth}.png", int(shot.row["view_size"])) for shot in shots}
    truths = {place: _visibility(file, size) for place, (file, size) in files.items()}
    undecided = {place: _undecided(file.with_suffix(".undecided.png"), size) for place, (file, size) in files.items()}
    with ThreadPoolExecutor() as threads:
        cells = list(
            threads.map(lambda shot: _cell(shot, folder, truths[shot.place], undecided[shot.place], most), shots)
        )
    if not any(cell["picture"] or cell["mask"] for cell in cells):
        return None
    lacking = [name for name in ("picture", "mask", "difference") if any(cell[name] is None for cell in cells)]
    view_size = max(int(shot.row["view_size"]) for shot in shots)
    return Gallery(
        cells=tuple(cells),
        truths={place: None if truth is None else _grey(truth, most) for place, truth in truths.items()},
        start=start,
        size=min(view_size, most),
        view_size=view_size,
        missing=f"{folder.name} has no {' and no '.join(lacking)} of some of these cells" if lacking else None,
    )


def _cell(
    shot: Shot, folder: Path, truth: NDArray[np.float32] | None, undecided: NDArray[np.bool_] | None, most: int
) -> dict[str, Any]:
    picture, mask = (folder / kind / f"{shot.row['key']}.png" for kind in ("pictures", "masks"))
    visibility = _visibility(mask, int(shot.row["view_size"]))
    drawn = None if visibility is None or truth is None else difference(visibility, truth, undecided)
    return {
        "spec": shot.spec,
        "size": shot.map_size,
        "place": shot.place,
        "iou": _iou(shot.row["metrics"].get("iou")),
        "said": shot.said,
        "worst": None if visibility is None or truth is None else _worst(_wrong(visibility, truth, undecided)),
        "picture": _picture(picture, most) if picture.exists() else None,
        "mask": None if visibility is None else _grey(visibility, most),
        "difference": None if drawn is None else _webp(_shrunk(Image.fromarray(drawn), most), lossless=True),
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


def _wrong(
    visibility: NDArray[np.float32], truth: NDArray[np.float32], undecided: NDArray[np.bool_] | None
) -> NDArray[np.float32]:
    """How far each pixel is off, where that is decided."""
    error: NDArray[np.float32] = np.abs(visibility - truth)
    return error if undecided is None else np.where(undecided, np.float32(0), error)


def _worst(error: NDArray[np.float32]) -> tuple[float, float]:
    """Where the most of it lies, in percent from the left and from the top."""
    window = max(3, len(error) // 12)
    row, column = np.unravel_index(int(np.argmax(uniform_filter(error, window, mode="constant"))), error.shape)
    return round(100 * float(column) / len(error), 1), round(100 * float(row) / len(error), 1)


def start_of_section(section: Section, shots: Sequence[Shot]) -> int:
    """The cell to begin with: on the front, the last before the errors can no longer be seen."""
    best = [one for one in front(section) if one.error and 0.004 < one.error.median < 0.5] or section.held
    for index, shot in enumerate(shots):
        if best and (shot.spec, shot.map_size) == (best[-1].spec, best[-1].map_size):
            return index
    return 0


def read_view(file: Path, size: int) -> NDArray[np.float32]:
    """A mask of a view, (size, size) as `read_mask` gives it; InputError for one of another size."""
    visibility = read_mask(file)
    if visibility.shape != (size, size):
        found = " × ".join(map(str, reversed(visibility.shape)))
        raise InputError(f"{file}: found {found} pixels; allowed: {size} × {size}, the view's size")
    return visibility


def _visibility(file: Path, size: int) -> NDArray[np.float32] | None:
    return read_view(file, size) if file.exists() else None


def _undecided(file: Path, size: int) -> NDArray[np.bool_] | None:
    return read_view(file, size) >= 0.5 if file.exists() else None


def _picture(file: Path, most: int) -> str:
    try:
        with Image.open(file, formats=["PNG"]) as image:
            return _webp(_shrunk(image.convert("RGB"), most), lossless=False)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError(f"{file}: cannot be read as an image; allowed: a PNG") from None


def _grey(visibility: NDArray[np.float32], most: int) -> str:
    return _webp(_shrunk(Image.fromarray(np.rint(visibility * 255).astype(np.uint8)), most), lossless=True)


def _shrunk(image: Image.Image, most: int) -> Image.Image:
    return image if image.width <= most else image.resize((most, most), Image.Resampling.BOX)


def _webp(image: Image.Image, lossless: bool) -> str:
    file = io.BytesIO()
    image.save(file, format="WEBP", lossless=lossless, quality=60 if lossless else 80, method=3)
    return "data:image/webp;base64," + base64.b64encode(file.getvalue()).decode()
