"""Cells of run folders as states: a row names its spec and view, and a row of a sweep the recipe of its scene."""

from collections.abc import Sequence
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.extremes.axes import AXES
from shadowbench.measure.rows import Record, read_run_file, stream_rows
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.views import named
from shadowbench.studies.crossing import Techniques
from shadowbench.techniques.spec import parse_spec
from shadowbench.viewer.state import Origin, ViewerState


def cell_state(folder: Path, key: str, techniques: Techniques, assets: Path | None = None) -> ViewerState:
    """The state that shows a cell of a folder of `run` or `stress`.

    key: of its row, or the beginning of it. Raises InputError if there is no such row, or if its scene is not found.
    """
    row = _row(folder, key)
    spec = parse_spec(row["full_spec"], techniques)
    shown = {"size": row["view_size"], "phase": row["phase"], "coordinates": row["coordinates"]}
    if "axis" in row:
        axis = AXES.get(row["axis"])
        if axis is None or row["axis_value"] not in axis.values:
            raise InputError(f"{folder}: cell {row['key']} is of an axis that stress no longer has: {row['axis']!r}")
        view = axis.at(row["axis_value"], row["light_kind"]).views[0]
        return ViewerState(view.scene, view.camera, view.light, (spec,), **shown)
    about = folder / "run.json"
    study = read_run_file(about).get("study", {}) if about.exists() else {}
    own = [row["scene"]] if row["scene"] in builtin_names() else []
    for source in sorted({*study.get("scenes", ()), *own}, key=lambda source: Path(source).stem != row["scene"]):
        origin = Origin(source, assets, study.get("up"), study.get("sun", False), study.get("no_ground", False))
        scene = origin.load()
        if scene.name == row["scene"]:
            where = f"{folder}: cell {row['key']} is of a camera or a light of its study, not of the scene: "
            camera = named(scene.cameras, row["view"], f"{where}view")
            light = named(scene.lights, row["light"], f"{where}light")
            return ViewerState(scene, camera, light, (spec,), origin=origin, **shown)
    raise InputError(f"{folder}: found no file of the scene {row['scene']!r}; allowed: one that run.json names")


def _row(folder: Path, key: str) -> Record:
    rows = stream_rows(folder / "rows.jsonl")
    found = {row["key"]: row for row, _ in rows if row["kind"] == "score" and row["key"].startswith(key)}
    if len(found) != 1:
        raise InputError(f"--cell {key!r:.60}: {_several(list(found))} in {folder}; allowed: a key of its rows.jsonl")
    return next(iter(found.values()))


def _several(keys: Sequence[str]) -> str:
    return f"{len(keys)} cells begin so" if keys else "no such cell"
