"""What a check says: tables for the terminal and in Markdown, annotations of a CI's log, strips of the worst cells."""

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from shadowbench.errors import counted, number
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record, size_of
from shadowbench.reports.gallery import difference, read_facets, read_view
from shadowbench.reports.texts import table
from shadowbench.results.baseline import MISSING, Change, Findings, Verdict
from shadowbench.results.frame import Run, identity, view_name
from shadowbench.scores.metrics import is_soft, leading_error

COLUMNS = ("scene, view, light", "spec", "map", "what", "before", "", "after", "× tolerance", "also")
_LONGEST = 40  # characters of a status
LINES = 40
"""Of a table, one per cell."""
_ANNOTATIONS = 10  # that GitHub shows of a step
_TITLES: Mapping[Verdict, str] = {
    "regressed": "regressed, worst first",
    "slower": "slower; ratios to the reference",
    "improved": "improved, largest change first",
    "faster": "faster; ratios to the reference",
}


def by_cell(changes: Iterable[Change]) -> list[list[Change]]:
    """The changes of each cell, the largest first, but the kind of error that leads them before all others."""
    cells: dict[int, list[Change]] = {}  # by the record, which the changes of a cell share
    for change in changes:
        cells.setdefault(id(change.score), []).append(change)
    leading = [leading_error(cell[0].score.get("metrics", {}), {one.what for one in cell}) for cell in cells.values()]
    return [
        sorted(cell, key=lambda one: one.what != first) for cell, first in zip(cells.values(), leading, strict=True)
    ]


def tables(findings: Findings, time: bool) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """The title of each verdict's table, and a row for each cell: the largest change, and the names of the others.

    time: whether slower cells make the check fail.
    """
    for verdict, title in _TITLES.items():
        if cells := by_cell(findings.of(verdict)):
            warning = "; a warning only (--time makes it fail)" if verdict == "slower" and not time else ""
            yield title + warning, [_row(*cell) for cell in cells]


def _row(worst: Change, *others: Change) -> tuple[str, ...]:
    excess = "" if math.isinf(worst.excess) else f"{worst.excess:.1f}"
    values = (worst.what, change_text(worst.before), "→", change_text(worst.after), excess)
    score = worst.score
    return (_place(score), score["spec"], str(score["map_size"] or ""), *values, " ".join(one.what for one in others))


def _place(score: Record) -> str:
    phase = f" phase {score['phase']}" if score["phase"] else ""
    return f"{score['scene']} {score['view']} {score['light']}{phase}"


def cell_name(score: Record) -> str:
    """A cell for a reader: its spec and map size, and where."""
    size = f" at {score['map_size']}" if score["map_size"] else ""
    return f"{score['spec']}{size} in {_place(score)}"


def change_text(value: Any) -> str:
    """A value of a change: a number, a status, or None."""
    if value is None:
        return "none"
    if isinstance(value, str):
        return textwrap.shorten(value, _LONGEST, placeholder="…")
    return str(value) if isinstance(value, int) else number(value)


def counts(findings: Findings, baseline: Path) -> str:
    """How many cells were compared, and how many have each verdict."""
    cells = {verdict: len(by_cell(findings.of(verdict))) for verdict in _TITLES}
    missing = sum(change.after == MISSING for change in findings.changes)
    cells["regressed"] -= missing
    numbers = {"regressed": cells["regressed"], "missing": missing, "improved": cells["improved"]}
    numbers |= {"slower": cells["slower"]}
    parts = [f"{count} {what}" for what, count in numbers.items() if count or what in ("regressed", "improved")]
    same = f", {findings.equal} of them identical" if findings.equal else ""
    return f"{counted(findings.compared, 'cell')} compared with {baseline}{same}: {', '.join(parts)}"


def markdown(findings: Findings, baseline: Path, folder: Path, pictures: Mapping[str, Path], time: bool) -> str:
    """A summary of a run folder's check: a table of each verdict, every value of the worst cells, and what to do next.

    pictures: files by the key of a row.
    """
    failed = bool(findings.of("regressed") or (time and findings.of("slower")))
    blocks = [f"## Shadows {'got worse' if failed else 'are as good as they were'}", counts(findings, baseline) + "."]
    for title, rows in tables(findings, time):
        lines = table(COLUMNS, [[row[0], f"`{row[1]}`", *row[2:]] for row in rows[:LINES]], ("spec", "what", "also"))
        more = [f"and {len(rows) - LINES} more"] if len(rows) > LINES else []
        blocks += [f"### {title[:1].upper()}{title[1:]}", *lines, *more]
    regressed = [cell for cell in by_cell(findings.of("regressed")) if cell[0].score["key"] in pictures]
    for cell in regressed:
        blocks += _details(cell, pictures[cell[0].score["key"]].relative_to(folder))
    blocks += [f"- {note}" for note in findings.notes]
    if failed:
        masks = " --masks" if (baseline / "masks").exists() else ""
        accept = f"shadowbench check {folder} --baseline {baseline} --update{masks}"
        blocks.append(f"If this is meant to be: `{accept}` makes these results the baseline.")
    return "\n\n".join(blocks) + "\n"


def _details(cell: Sequence[Change], picture: Path) -> list[str]:
    """Every value of a cell that became worse, with what it means, and the name of its picture."""
    rows = [
        [
            change.what,
            change_text(change.before),
            change_text(change.after),
            "" if math.isinf(change.excess) else f"{change.excess:.1f}",
            ROW_METRICS[change.what].help if change.what in ROW_METRICS else "",
        ]
        for change in cell
    ]
    lines = table(["what", "before", "after", "× tolerance", "what it is"], rows, ["what it is"])
    return [f"### {cell_name(cell[0].score)}", f"Picture: `{picture}`", *lines]


def annotations(findings: Findings, pictures: Mapping[str, Path], time: bool) -> list[str]:
    """Workflow commands of GitHub's log: an error for each of the worst cells, a warning for slower ones."""
    kinds: dict[Verdict, str] = {"regressed": "error", "slower": "error" if time else "warning"}
    lines = [(kind, cell) for verdict, kind in kinds.items() for cell in by_cell(findings.of(verdict))]
    return [_annotation(kind, cell, pictures.get(cell[0].score["key"])) for kind, cell in lines[:_ANNOTATIONS]]


def _annotation(kind: str, cell: Sequence[Change], picture: Path | None) -> str:
    worst, *others = cell
    parts = [f"{worst.what} {change_text(worst.before)} → {change_text(worst.after)}"]
    parts += [f"{worst.excess:.1f} times its tolerance"] if not math.isinf(worst.excess) else []
    parts += [f"also {' '.join(one.what for one in others)}"] if others else []
    parts += [f"picture {picture}"] if picture else []
    title = _escaped(cell_name(worst.score)).replace(":", "%3A").replace(",", "%2C")
    return f"::{kind} title={title}::{_escaped('; '.join(parts))}"


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


# Pictures

_MOST = 8  # pictures
_SHOWN = 3  # changes of a cell above its picture
_UNSAFE = re.compile(r"[^\w.+=-]+")  # not allowed in file names everywhere
WIDTH, GAP = 384, 8
"""Pixels of each picture of a strip, and between them."""
_ENLARGED = 8  # how many times the worst place is enlarged
_LEAST_SIDE = 8  # pixels of what is enlarged
_FONT, _LINE, _MARGIN = 16, 22, 6  # pixels
_FRAME = (230, 159, 0)  # Okabe & Ito 2008: orange
_COLORS = {False: "false shadow is vermillion, false light blue", True: "too dark is vermillion, too light blue"}


def write_pictures(findings: Findings, run: Run, baseline: Run, folder: Path) -> dict[str, Path]:
    """Write a strip of each of the worst cells that have a mask into a folder; the files by the rows' keys."""
    before = {identity(row): row for row in baseline.rows}
    regressed = (change for change in findings.of("regressed") if change.what in ROW_METRICS)
    files: dict[str, Path] = {}
    for cell in by_cell(regressed):
        score, key = cell[0].score, cell[0].score["key"]
        picture = _strip(run, baseline, cell, before[identity(score)])
        if picture is not None:
            name = f"{len(files) + 1}.{score['scene']}.{score['spec']}.{score['map_size'] or ''}".removesuffix(".")
            files[key] = folder / f"{_UNSAFE.sub('_', name):.120}.png"
            write_picture(files[key], picture)
        if len(files) == _MOST:
            break
    return files


def _strip(run: Run, baseline: Run, cell: Sequence[Change], old: Record) -> NDArray[np.uint8] | None:
    """The truth, the mask before if the baseline has it, and the mask now; None without the truth or that mask."""
    worst, score = cell[0], cell[0].score
    size, file = size_of(score), run.folder / "truth" / f"{view_name(score)}.png"
    after, before = (_mask(folder, row) for folder, row in ((run.folder, score), (baseline.folder, old)))
    if not file.exists() or after is None:
        return None
    truth, apart = read_view(file, size), file.with_suffix(".undecided.png")
    undecided = read_view(apart, size) >= 0.5 if apart.exists() else np.zeros(size.shape, bool)
    masks, wrong = {"ray-traced truth": truth}, np.abs(after - truth)
    if before is not None:
        masks[f"before: {worst.what} {change_text(worst.before)}"] = before
        more = np.maximum(wrong - np.abs(before - truth), 0)
        wrong = more if more.any() else wrong
    masks[f"now: {worst.what} {change_text(worst.after)}"] = after
    place = worst_place(np.where(undecided, 0, wrong))
    soft, facets = is_soft(score["metrics"]), read_facets(file, size)
    columns = []
    for label, mask in masks.items():
        shaded, differing = _shaded(file, mask), difference(mask, truth, undecided, soft, facets)
        parts = [_text(label, WIDTH), _fitted(shaded, place), _fitted(shaded[place]), _fitted(differing[place])]
        columns.append(_joined(parts, axis=0))
    strip = _joined(columns, axis=1)
    values = [f"{one.what} was {change_text(one.before)}, is {change_text(one.after)}" for one in cell[:_SHOWN]]
    title = "; ".join([f"{cell_name(score)}: {values[0]}", *values[1:]])
    title += "" if before is not None else "; the baseline has no mask of it (--update --masks keeps them)"
    legend = (
        f"Framed in orange: where most became worse. Below it that place, enlarged {_ENLARGED} times, and its "
        f"difference from the truth: {_COLORS[soft]}."
    )
    return np.vstack([_text(title, strip.shape[1]), strip, _text(legend, strip.shape[1])])


def _mask(folder: Path, row: Record) -> NDArray[np.float32] | None:
    file = folder / "masks" / f"{row['key']}.png"
    return read_view(file, size_of(row)) if file.exists() else None


def worst_place(wrong: NDArray[np.floating]) -> tuple[slice, slice]:
    """The square with the largest sum of (H, W) errors, of those half a side apart; its side is an eighth of W."""
    side = min(max(_LEAST_SIDE, wrong.shape[1] // _ENLARGED), *wrong.shape)
    total = np.pad(wrong, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    rows, columns = (np.arange(0, count - side + 1, max(1, side // 2)) for count in wrong.shape)
    low, high = np.ix_(rows, columns), np.ix_(rows + side, columns + side)
    sums = total[high] - total[low[0], high[1]] - total[high[0], low[1]] + total[low]
    row, column = np.unravel_index(int(sums.argmax()), sums.shape)
    top, left = int(rows[row]), int(columns[column])
    return slice(top, top + side), slice(left, left + side)


def _shaded(truth_file: Path, mask: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB: the view between full shadow and none; the mask in greys without these pictures."""
    files = [truth_file.with_suffix(f".{name}.png") for name in ("ambient", "lit")]
    share, dark, lit = mask[..., np.newaxis], np.zeros(3), np.full(3, 255)
    if all(file.exists() for file in files):
        dark, lit = (np.asarray(Image.open(file).convert("RGB"), dtype=float) for file in files)
    return np.asarray(np.rint(dark + share * (lit - dark)), dtype=np.uint8)


def _fitted(picture: NDArray[np.uint8], place: tuple[slice, slice] | None = None) -> NDArray[np.uint8]:
    """A picture WIDTH pixels wide, with a frame around a place of it."""
    height, width = picture.shape[:2]
    image = Image.fromarray(picture).resize(
        (WIDTH, max(1, round(WIDTH * height / width))),
        Image.Resampling.NEAREST if width < WIDTH else Image.Resampling.BOX,
    )
    if place is not None:
        top, bottom, left, right = (end * WIDTH / width for part in place for end in (part.start, part.stop))
        ImageDraw.Draw(image).rectangle((left - 1, top - 1, right, bottom), outline=_FRAME, width=2)
    return np.asarray(image)


def _joined(parts: Sequence[NDArray[np.uint8]], axis: int) -> NDArray[np.uint8]:
    """Pictures below or beside each other, with gaps between them."""
    gap = ((0, GAP), (0, 0), (0, 0)) if axis == 0 else ((0, 0), (0, GAP), (0, 0))
    return np.concatenate([*(np.pad(part, gap, constant_values=255) for part in parts[:-1]), parts[-1]], axis=axis)


def _text(text: str, width: int) -> NDArray[np.uint8]:
    """Black text on white, wrapped to a width, (22 · lines + 12, width, 3) uint8."""
    font = ImageFont.load_default(_FONT)
    lines = textwrap.wrap(text, int((width - 2 * _MARGIN) / font.getlength("n")), break_on_hyphens=False)
    image = Image.new("RGB", (width, len(lines) * _LINE + 2 * _MARGIN), "white")
    for at, line in enumerate(lines):
        ImageDraw.Draw(image).text((_MARGIN, _MARGIN + at * _LINE), line, "black", font)
    return np.asarray(image)
