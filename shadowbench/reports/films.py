"""Cells of sequences on the HTML page: their frames, slices of them over time, and curves by frame."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from PIL import Image

from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.frames import FILMED
from shadowbench.measure.pictures import read_film
from shadowbench.measure.rows import Record
from shadowbench.reports.charts import PARAMS, SHOWN_ONLY, TOOLTIP, Chart, chart_of, looks, mark, quantity
from shadowbench.reports.gallery import Picture, data_uri
from shadowbench.reports.texts import digits
from shadowbench.scores.metrics import is_soft

_UNITS = {"flicker": " px", "pop": " px", "swim": " px", "lag": " frames"}
_SLICE = 128  # columns, so that an edge that moves by one is seen


def sequences(folder: Path, pictures: Sequence[Picture]) -> dict[str, Any]:
    """The cells of sequences as JSON data, by view; empty without any.

    films: of each cell with a film in the folder, what the page says of it, `scores`, a text, its `frames` and `slice`;
    charts: curves by frame of all cells. Raises InputError for a file that is no film.
    """
    views: dict[str, list[Picture]] = {}
    for row, about in pictures:
        if "by_frame" in row:
            views.setdefault(about["view"], []).append((row, about))
    return {
        view: {"films": list(_films(folder, cells)), "charts": list(_charts(cells))} for view, cells in views.items()
    }


def _films(folder: Path, cells: Sequence[Picture]) -> Iterator[dict[str, Any]]:
    for row, about in cells:
        file = folder / "masks" / f"{row['key']}.frames.png"
        if file.exists():
            film = read_film(file, min(row["frames"], FILMED))
            frames = [data_uri(Image.fromarray(frame), lossless=True) for frame in film]
            yield about | {"scores": _scores(row), "frames": frames, "slice": _slice(film)}


def _scores(row: Record) -> str:
    """Scores of motion that a row has: `flicker 0.0123 px, pop 9.00 px in frame 5`."""
    known = {name: row["metrics"].get(name) for name in _UNITS}
    at = {"pop": f" in frame {row['pop_frame']}"} if row.get("pop_frame") is not None else {}
    texts = [
        f"{name} {digits(value)}{_UNITS[name]}{at.get(name, '')}" for name, value in known.items() if value is not None
    ]
    return f"{row['frames']} frames: {', '.join(texts) or 'too few for scores of motion'}"


def changing_place(film: NDArray[np.uint8]) -> tuple[int, slice]:
    """The row and the columns, _SLICE at most, whose change over time is most beyond the truth's.

    Of equals, those in which the truth changes most. film: (F, H, 3 W, 3), truth, mask and difference side by side.
    """
    # In all over columns and time: of an edge that is displaced but moves as the truth's does, nothing is left.
    changes = [np.abs(np.diff(images.astype(np.int64), axis=0)) for images in np.split(film[..., 0], 3, axis=2)[:2]]
    width = min(film.shape[2] // 3, _SLICE)
    weights = np.bartlett(width + 2)[1:-1]  # most in the middle
    truth, drawn = (sliding_window_view(change.sum(axis=0), width, axis=1) @ weights for change in changes)
    row, left = divmod(int(np.lexsort((truth.ravel(), (drawn - truth).ravel()))[-1]), truth.shape[1])
    return row, slice(left, left + width)


def _slice(film: NDArray[np.uint8]) -> dict[str, Any]:
    """A piece of a row of pixels over time: images of truth and mask, (F, columns), and its place in the view.

    box: left edge, middle and width as shares of the view.
    """
    row, columns = changing_place(film)
    width = film.shape[2] // 3
    images = [Image.fromarray(image[:, columns]) for image in np.split(film[:, row, :, 0], 3, axis=1)[:2]]
    return {
        "place": f"row {row}, columns {columns.start} to {columns.stop - 1}",
        "box": [columns.start / width, (row + 0.5) / film.shape[1], (columns.stop - columns.start) / width],
        "images": [data_uri(image, lossless=True) for image in images],
    }


def _charts(cells: Sequence[Picture]) -> Iterator[Chart]:
    """Curves of the error, flicker and pop of cells by frame; the page sets `frame`, where a line is drawn."""
    last = max(row["frames"] for row, _ in cells) - 1
    ranked_by = "rmse" if is_soft(cells[0][0]["metrics"]) else "iou"
    for name in (ranked_by, "flicker", "pop"):
        metric = ROW_METRICS[name]
        title = metric.error_label or f"{name}{_UNITS[name]}"
        points = [
            {"spec": row["spec"], "cell": row["key"], "frame": frame, "value": metric.error(value)}
            | {"tooltip": {"full spec": row["full_spec"], "frame": frame, title: digits(metric.error(value))}}
            for row, _ in cells
            for frame, value in enumerate(row["by_frame"][name])
            if value is not None
        ]
        x = quantity(
            "frame", "frame", axis={"format": "d", "tickMinStep": 1}, scale={"domain": [0, last], "nice": False}
        )
        at = {"x": x, "y": quantity("value", title)}
        look = looks(None, ())
        now = mark("rule", {"x": {"datum": {"expr": "frame"}, "type": "quantitative"}}, strokeDash=[3, 3], color="gray")
        layer: list[Chart] = [
            {"data": {"values": [{}]}, **now},
            mark("line", at | {"color": look["color"], "detail": {"field": "cell"}}, SHOWN_ONLY, strokeWidth=1.5),
            mark("point", at | look | TOOLTIP, SHOWN_ONLY, filled=True, size=40, cursor="pointer"),
        ]
        chart = chart_of(f"{title} by frame", points, layer, 170)
        yield chart | {"params": [*PARAMS, {"name": "frame", "value": 0}]}
