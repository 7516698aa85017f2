"""The pictures of a section, as small as a page can carry them: picture, mask, truth, signed difference."""

import base64
import io
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import uniform_filter

from shadowbench.reports.analysis import Section, front
from shadowbench.reports.folder import Run
from shadowbench.reports.words import digits
from shadowbench.scores.difference import difference_over
from shadowbench.scores.masks import read_mask
from shadowbench.studies.runner import Result

PIXELS = 160 * 512 * 512  # of all masks in a report: more cells, or larger ones, are shown smaller
_SMALLEST = 128  # pixels a side
_STEPS = 16  # of a difference's colour


@dataclass(frozen=True)
class Gallery:
    """What a page needs to show a section's pictures.

    `cells`: dicts of spec, map size, place (view and light), scores and images; `truths` images by place; images are
    data URIs, None where the folder lacks the file. `start` is the cell to begin with; `missing` says what is lacking.
    """

    cells: tuple[dict[str, Any], ...]
    truths: dict[str, str | None]
    start: int
    size: int
    view_size: int
    missing: str | None


def shown(section: Section) -> list[Result]:
    """The cells that a gallery shows: those that held, in their first phase."""
    results = [section.run.results[int(index)] for index in section.frame.index]
    held = [result for result in results if result.score["status"] == "ok"]
    first = min((result.score.get("phase") or 0 for result in held), default=0)
    return [result for result in held if (result.score.get("phase") or 0) == first]


def side(sections: Sequence[Section]) -> int:
    """The most pixels a side at which the pictures of all sections stay within PIXELS."""
    areas = [int(result.score["view_size"]) ** 2 for section in sections for result in shown(section)]
    return max(_SMALLEST, int((PIXELS / max(len(areas), 1)) ** 0.5)) if sum(areas) > PIXELS else 1 << 14


def gallery(section: Section, most: int) -> Gallery:
    """The section's pictures, at most `most` pixels a side. InputError for a file that is no mask or picture."""
    results, folder = shown(section), section.run.folder
    view_size = int(section.frame["view_size"].iloc[0])
    files = {_place(result): folder / "truth" / f"{_view(result)}.png" for result in results}
    truths = {place: read_mask(file) if file.exists() else None for place, file in files.items()}
    undecided = {place: _undecided(file.with_suffix(".undecided.png")) for place, file in files.items()}
    with ThreadPoolExecutor() as threads:
        cells = list(
            threads.map(lambda r: _cell(r, section.run, truths[_place(r)], undecided[_place(r)], most), results)
        )
    lacking = [name for name in ("picture", "mask", "difference") if any(cell[name] is None for cell in cells)]
    return Gallery(
        cells=tuple(cells),
        truths={place: None if truth is None else _grey(truth, most) for place, truth in truths.items()},
        start=_start(section, results),
        size=min(view_size, most),
        view_size=view_size,
        missing=f"{folder.name} has no {' and no '.join(lacking)} of some of these cells" if lacking else None,
    )


def _cell(
    result: Result, run: Run, truth: NDArray[np.float32] | None, undecided: NDArray[np.bool_] | None, most: int
) -> dict[str, Any]:
    score, time = result.score, result.time or {}
    software = " (software renderer)" if run.software else ""
    picture, mask = (run.folder / kind / f"{score['key']}.png" for kind in ("pictures", "masks"))
    visibility = read_mask(mask) if mask.exists() else None
    drawn = None if visibility is None or truth is None else difference(visibility, truth, undecided)
    iou, edge = (score["metrics"].get(name) for name in ("iou", "edge_px"))
    return {
        "spec": score["spec"],
        "size": score["map_size"],
        "place": _place(result),
        "iou": "–" if iou is None else f"{iou:.5f}",
        "edge": "–" if edge is None else f"{digits(edge)} px",
        "ms": f"{digits(time['frame_ms'])} ms{software}" if time else "not timed",
        "worst": None if visibility is None or truth is None else _worst(np.abs(visibility - truth)),
        "picture": _picture(picture, most) if picture.exists() else None,
        "mask": None if visibility is None else _grey(visibility, most),
        "difference": None if drawn is None else _webp(_shrunk(Image.fromarray(drawn), most), lossless=True),
    }


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


def _worst(error: NDArray[np.float32]) -> tuple[float, float]:
    """Where the most of it lies, in percent from the left and from the top."""
    window = max(3, len(error) // 12)
    row, column = np.unravel_index(int(np.argmax(uniform_filter(error, window, mode="constant"))), error.shape)
    return round(100 * float(column) / len(error), 1), round(100 * float(row) / len(error), 1)


def _start(section: Section, results: Sequence[Result]) -> int:
    """The cell to begin with: on the front, the last before the errors can no longer be seen."""
    best = [one for one in front(section) if one.error and 0.004 < one.error.median < 0.5] or section.held
    for index, result in enumerate(results):
        if best and (result.score["spec"], result.score["map_size"]) == (best[-1].spec, best[-1].map_size):
            return index
    return 0


def _place(result: Result) -> str:
    return f"{result.score['view']}, {result.score['light']}"


def _view(result: Result) -> str:
    return ".".join(str(result.score[name]) for name in ("scene", "view", "light", "view_size"))


def _undecided(file: Path) -> NDArray[np.bool_] | None:
    return read_mask(file) >= 0.5 if file.exists() else None


def _picture(file: Path, most: int) -> str:
    with Image.open(file) as image:
        return _webp(_shrunk(image.convert("RGB"), most), lossless=False)


def _grey(visibility: NDArray[np.float32], most: int) -> str:
    return _webp(_shrunk(Image.fromarray(np.rint(visibility * 255).astype(np.uint8)), most), lossless=True)


def _shrunk(image: Image.Image, most: int) -> Image.Image:
    return image if image.width <= most else image.resize((most, most), Image.Resampling.BOX)


def _webp(image: Image.Image, lossless: bool) -> str:
    file = io.BytesIO()
    image.save(file, format="WEBP", lossless=lossless, quality=60 if lossless else 80, method=3)
    return "data:image/webp;base64," + base64.b64encode(file.getvalue()).decode()
