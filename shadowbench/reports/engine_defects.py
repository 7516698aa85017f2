"""The worst defect of an engine, by one rule, what cures it, and pictures of both."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.files import make_folder
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record
from shadowbench.reports.gallery import read_view
from shadowbench.reports.words import COLUMNS, optional
from shadowbench.results.engine_settings import ERROR, EngineResults, names_of
from shadowbench.results.folder import view_name
from shadowbench.scores.metrics import METRICS

TITLE = METRICS[ERROR].error_label
_NAMES = {name: title for title, name in COLUMNS[False].items()}
DEFECTS = {_NAMES.get(name, name): name for name in ("acne", "leak", "contact", "edge_px")}
"""Metrics that say what is wrong: heading and name."""
_LARGEST, _GAP, _GREY = 256, 4, 128  # pixels of a picture in a strip and between two, and the level of those between
PLACE = ("view", "light", "phase", "view_size", "coordinates")
"""Fields of rows that have the same truth, in a scene."""

RULE = (
    f"The worst defect of an engine is the setting and scene of its largest {TITLE}. What stands out there is the "
    "largest of acne, leak, contact and edge px, the last as a share of the picture's width. The cure is the engine's "
    f"setting, of those measured, that has the smallest {TITLE} in that scene, if that is at most half as large. "
    "Values are medians over a scene's views, lights and phases."
)


def worst_defect(one: EngineResults, target: Path) -> list[str]:
    """An engine's worst defect, its cure, and pictures of them in a folder beside the page `target`."""
    if one.worst is None:
        return ["No setting has a score."]
    setting, scene = one.worst
    if not (before := setting.value(scene, ERROR)):
        return [f"No defect: {TITLE} is 0 in every scene and setting with a score."]
    values = {title: setting.value(scene, name) for title, name in DEFECTS.items()}
    width = setting.rows[scene][0]["view_size"]
    shares = {title: (value or 0.0) / (width if DEFECTS[title] == "edge_px" else 1) for title, value in values.items()}
    most = max(shares, key=lambda title: shares[title])
    told = [f"{title} {optional(value)}" for title, value in values.items()]
    lines = [f"Worst defect: {most}, of {setting.label} in {scene}, {TITLE} {optional(before)}; {', '.join(told)}."]
    cure = one.best_in(scene)
    after = cure.value(scene, ERROR) or 0.0
    cured = f"{cure.label}, {TITLE} {optional(before)} before and {optional(after)} after"
    none = "none of the measured settings" + (f"; the best is {cured}" if after < before else "")
    lines.append(f"Cure: {cured if after <= before / 2 else none}.")
    return [" ".join(lines), *_strip(one, target)]


def strip_rows(one: EngineResults) -> dict[str, Record]:
    """The rows of which an engine's strip shows masks, by setting; nothing if the engine has no defect.

    In the scene of its worst defect: that setting, its cure, and presets with the sides and size of the worst.
    """
    if one.worst is None or not one.worst[0].value(one.worst[1], ERROR):
        return {}
    worst, scene = one.worst
    presets, cure = names_of(one.engine), one.best_in(scene)
    first = next(row for row in worst.rows[scene] if row["status"] == "ok")
    found = {}
    for setting in one.settings:
        alike = setting.spec in presets and (setting.sides, setting.map_size) == (worst.sides, worst.map_size)
        for row in setting.rows.get(scene, ()) if alike or setting in (worst, cure) else ():
            if row["status"] == "ok" and all(row[part] == first[part] for part in PLACE):
                found[setting.label] = row
    return found


def _strip(one: EngineResults, target: Path) -> list[str]:
    """A picture of the truth beside the masks of `strip_rows`."""
    name, folder, rows = one.engine.name, one.run.folder, strip_rows(one)
    first = next(iter(rows.values()))
    stem = view_name(first)
    files = {"truth": folder / "truth" / f"{stem}.png"}
    files |= {label: folder / "masks" / f"{row['key']}.png" for label, row in rows.items()}
    if lacking := [file for file in files.values() if not file.exists()]:
        return [f"No picture: there is no {lacking[0].relative_to(folder)} in {one.run.label}."]
    make_folder(target.with_suffix(""))
    masks = [read_view(file, first["view_size"]) for file in files.values()]
    write_picture(target.with_suffix("") / f"{name}.png", strip(masks))
    shown = f"{first['scene']}, from left to right: {'; '.join(files)}"
    return [f"![{shown.replace('`', '')}]({target.stem}/{name}.png)", f"*{shown}*"]


def strip(masks: Sequence[NDArray[np.float32]]) -> NDArray[np.uint8]:
    """Masks of one size side by side in grey, each of at most 256 pixels a side."""
    side = min(len(masks[0]), _LARGEST)
    grey = [Image.fromarray(np.rint(mask * 255).astype(np.uint8)) for mask in masks]
    tiles = [np.asarray(image.resize((side, side), Image.Resampling.BOX)) for image in grey]
    between = np.full((side, _GAP), _GREY, np.uint8)
    return np.hstack([part for tile in tiles for part in (between, tile)][1:])
