"""Picture strips for papers: the truth beside techniques, with the place where they are most wrong enlarged below."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.reports.gallery import difference, read_facets, read_view, scored_cells
from shadowbench.reports.verdict import real_time
from shadowbench.reports.words import median_text
from shadowbench.results.configurations import Configuration, Section
from shadowbench.results.folder import view_name
from shadowbench.results.ranking import candidates, cost_row, targets_of

_MOST = 3  # techniques beside the truth, so that a strip fits a page's width
GAP = 8
"""White pixels between pictures."""
ENLARGED = 8
"""How many times the worst place is enlarged."""
_LEAST = 8  # pixels of what is enlarged
_FRAME = (230, 159, 0)  # Okabe & Ito 2008: orange
COLORS = {False: "false shadow is vermillion, false light blue", True: "too dark is vermillion, too light blue"}
"""What the colours of a difference mean, of hard shadows and of soft ones."""


class Strip(NamedTuple):
    """A strip of pictures, (H, W, 3) uint8 sRGB, and the sentences below it, which name them from left to right."""

    picture: NDArray[np.uint8]
    caption: str


class Truth(NamedTuple):
    """The truth of a view in a run folder: its file, (N, N) visibility, and pixels that are undecided or facets."""

    file: Path
    visibility: NDArray[np.float32]
    undecided: NDArray[np.bool_]
    facets: NDArray[np.bool_] | None


def read_truth(file: Path, size: int) -> Truth | None:
    """The truth of a view of so many pixels a side; None without the file. Raises InputError for another size."""
    if not file.exists():
        return None
    apart = file.with_suffix(".undecided.png")
    undecided = read_view(apart, size) >= 0.5 if apart.exists() else np.zeros((size, size), bool)
    return Truth(file, read_view(file, size), undecided, read_facets(file, size))


def strip_of(section: Section, labels: Sequence[str] = ()) -> Strip | None:
    """The strip of a section: the truth, then the cheapest real-time configuration for each target of accuracy.

    labels: other configurations, as tables name them (`shadow-map at 1024`). Pictures are of the first phase and view.
    None if the folder lacks the masks or the truth. Raises InputError for a label that the section does not have.
    """
    chosen = _named(section, labels) if labels else _cheapest(section)
    rows = {(row["spec"], row["map_size"]): row for row, _ in reversed(scored_cells(section))}
    found = [(one, rows[key]) for one in chosen if (key := (one.spec, one.map_size)) in rows]
    if not found:
        return None
    folder, first, size = section.run.folder, found[0][1], found[0][1]["view_size"]
    truth_file = folder / "truth" / f"{view_name(first)}.png"
    masks = [folder / "masks" / f"{row['key']}.png" for _, row in found]
    truth = read_truth(truth_file, size)
    if truth is None or not all(file.exists() for file in (truth_file.with_suffix(".undecided.png"), *masks)):
        return None
    shown = [truth.visibility, *(read_view(file, size) for file in masks)]
    wrong = sum(np.abs(np.where(truth.undecided, 0, mask - truth.visibility)) for mask in shown[1:])
    place = worst_place(np.asarray(wrong))
    columns = [column(truth, mask, section.soft, place) for mask in shown]
    return Strip(beside(columns), _caption(section, [one for one, _ in found], size))


def _cheapest(section: Section) -> list[Configuration]:
    cells = cost_row(real_time(candidates([section])), targets_of(section.ranked_by))
    found = {id(one.mean): one.mean for cell in cells if (one := cell.cheapest or cell.closest)}
    return list(found.values())[:_MOST]


def _named(section: Section, labels: Sequence[str]) -> list[Configuration]:
    known = {one.label: one for one in section.scored}
    for label in labels:
        if label not in known:
            raise InputError(f"--picture: found {label!r:.80}; allowed in {section.title}: {', '.join(known):.400}")
    return [known[label] for label in labels]


class Place(NamedTuple):
    """A square in a picture, in pixels."""

    top: int
    left: int
    side: int

    @property
    def pixels(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return slice(self.top, self.top + self.side), slice(self.left, self.left + self.side)


def worst_place(wrong: NDArray[np.floating]) -> Place:
    """The square with the largest sum, of those half a side apart, whose side is an eighth of (N, N) errors."""
    side = max(_LEAST, len(wrong) // ENLARGED)
    total = np.pad(wrong, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    step = max(1, side // 2)
    at = np.arange(0, len(wrong) - side + 1, step)
    low, high = np.ix_(at, at), np.ix_(at + side, at + side)
    sums = total[high] - total[low[0], high[1]] - total[high[0], low[1]] + total[low]
    row, column = np.unravel_index(int(sums.argmax()), sums.shape)
    return Place(int(at[row]), int(at[column]), side)


def framed(picture: NDArray[np.uint8], place: Place) -> NDArray[np.uint8]:
    """A (N, N, 3) picture with a frame around a place."""
    found, line = picture.copy(), max(1, len(picture) // 256)
    top, left, side = place
    found[max(0, top - line) : top + side + line, max(0, left - line) : left + side + line] = _FRAME
    found[place.pixels] = picture[place.pixels]
    return found


def column(truth: Truth, mask: NDArray[np.float32], soft: bool, place: Place) -> NDArray[np.uint8]:
    """A mask's picture with the worst place framed, that place enlarged, and there the difference from the truth."""
    picture, width = _shaded(truth.file, mask), len(mask)
    wrong = difference(mask, truth.visibility, truth.undecided, soft, truth.facets)
    below = [
        np.asarray(Image.fromarray(of[place.pixels]).resize((width, width), Image.Resampling.NEAREST))
        for of in (picture, wrong)
    ]
    gap = np.full((GAP, width, 3), 255, dtype=np.uint8)
    return np.vstack([framed(picture, place), gap, below[0], gap, below[1]])


def beside(columns: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Columns of one height side by side, with gaps."""
    gap = np.full((len(columns[0]), GAP, 3), 255, dtype=np.uint8)
    return np.hstack([part for one in columns for part in (gap, one)][1:])


def _shaded(truth_file: Path, mask: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(N, N, 3) sRGB: the view between full shadow and none; the mask in greys without these pictures."""
    files = [truth_file.with_suffix(f".{name}.png") for name in ("ambient", "lit")]
    if not all(file.exists() for file in files):
        return np.repeat(np.rint(mask * 255).astype(np.uint8)[..., np.newaxis], 3, axis=2)
    dark, lit = (_linear(np.asarray(Image.open(file).convert("RGB")) / 255) for file in files)
    light = dark + mask[..., np.newaxis] * np.maximum(lit - dark, 0)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    shaded: NDArray[np.uint8] = np.rint(255 * encoded).astype(np.uint8)
    return shaded


def _linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light of sRGB in [0, 1] (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _caption(section: Section, shown: Sequence[Configuration], size: int) -> str:
    metric, times = section.ranked_by, size // max(_LEAST, size // ENLARGED)
    named = "; ".join(f"{one.label} ({metric.label} {median_text(one, metric.name)})" for one in shown)
    return (
        f"{section.title}. From left to right: ray-traced truth; {named}. Below, enlarged {times} times, the framed "
        f"place, where these are most wrong, and there the difference from the truth: {COLORS[section.soft]}."
    )
