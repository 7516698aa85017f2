"""What the window shows, as one immutable value: made from a scene, a saved state or a cell of a run, and saved.

A saved state is a scene file with the moved camera and light, and what was shown of it in a table `[viewer]`.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from shadowbench.errors import InputError
from shadowbench.extremes.axes import AXES
from shadowbench.files import check_outputs, data_folder, replace_file
from shadowbench.measure.rows import read_rows, read_run_file, size_of
from shadowbench.options import DEFAULT_SIZE, FIRST, SceneOptions, ViewSize
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.assumed import GROUND_SIDE, content_of
from shadowbench.scenes.library import builtin_names, load_scene, read_document
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, View, view_of
from shadowbench.scenes.opening import named, opened
from shadowbench.scenes.scene_tables import LIGHT_TABLES, camera_from_table, light_from_table
from shadowbench.scenes.sequences import frames_of, motions_of
from shadowbench.strict import Strict, ViewSizeField, validated
from shadowbench.studies.crossing import Techniques
from shadowbench.truths.embree import tracer_of

Layout = Literal["wipe", "side by side"]
Source = Literal["A", "B", "truth"]
Overlay = Literal["picture", "error", "mask"]


@dataclass(frozen=True)
class Origin:
    """Where a scene was loaded from: the arguments of `opened`."""

    source: str
    options: SceneOptions = FIRST

    @property
    def file(self) -> Path:
        """The scene's own file."""
        is_builtin = self.source in builtin_names()
        return data_folder("scenes") / f"{self.source}.toml" if is_builtin else Path(self.source)

    def load(self) -> Scene:
        """The scene, as it is on disk now. Raises InputError, as `opened` does."""
        return opened(self.source, self.options, tracer_of)


@dataclass(frozen=True)
class ViewerState:
    """What the window shows.

    size: of the image; origin: of the scene, None for a sweep's, which no file has; sequence: name of one that begins
    with the view, empty for a still view, and frame: of it; left, right: of the wipe; wipe: the share of the picture
    that `left` takes.
    """

    scene: Scene
    camera: Camera
    light: Light
    specs: tuple[Spec, ...]
    size: ViewSize = DEFAULT_SIZE
    origin: Origin | None = None
    coordinates: Coordinates = "relative"
    phase: int = 0
    sequence: str = ""
    frame: int = 0
    layout: Layout = "wipe"
    left: Source = "A"
    right: Source = "truth"
    wipe: float = 0.5
    overlay: Overlay = "picture"

    @property
    def frames(self) -> tuple[View, ...]:
        """The frames of the sequence; of a still view the one. Raises InputError."""
        return _frames(self.scene, self.camera, self.light, self.size, self.sequence)

    def view(self, size: ViewSize | None = None) -> View:
        """The view of the frame, by default of `size`. Raises InputError."""
        return replace(self.frames[self.frame], size=size or self.size)

    @property
    def start(self) -> tuple[object, ...]:
        """What the first frame is seen of; equal for states of the same view or sequence."""
        return (self.scene, self.camera, self.light, self.size, self.sequence)

    @property
    def viewed(self) -> tuple[object, ...]:
        """What the truth depends on; equal for states that have the same one."""
        return (*self.start, self.frame)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The pictures that the layout shows, from the left."""
        if self.layout == "wipe":
            return (self.left, self.right)
        return ("A", "B", "truth") if len(self.specs) > 1 else ("A", "truth")

    def with_spec(self, index: int, spec: Spec) -> "ViewerState":
        """With another spec as A (0) or B (1)."""
        return replace(self, specs=(*self.specs[:index], spec, *self.specs[index + 1 :]))


@lru_cache(2)
def _frames(scene: Scene, camera: Camera, light: Light, size: ViewSize, sequence: str) -> tuple[View, ...]:
    view = view_of(scene, camera, light, size)
    return frames_of(view, motions_of(scene, [sequence])[0]) if sequence else (view,)


class ViewerTable(Strict):
    """The table `[viewer]` of a state file: the fields of `ViewerState` that no scene has."""

    techniques: list[str] = Field(["shadow-map"], min_length=1, max_length=2)
    size: ViewSizeField = DEFAULT_SIZE
    phase: int = Field(0, ge=0, strict=True)
    layout: Layout = "wipe"
    left: Source = "A"
    right: Source = "truth"
    wipe: float = Field(0.5, ge=0, le=1)
    overlay: Overlay = "picture"


def holds_state(file: Path) -> bool:
    """Whether a file is a scene file with a table `[viewer]`. Raises InputError for a `.toml` that is no scene."""
    return file.suffix.lower() == ".toml" and bool(read_document(file).viewer)


def read_state(file: Path, techniques: Techniques, assets: Path | None = None) -> ViewerState:
    """The state that a file holds. Raises InputError, as `load_scene` does, and for an invalid table `[viewer]`."""
    scene = load_scene(file, assets)
    table = dict(validated(ViewerTable, read_document(file).viewer, f"{file.name}: [viewer]"))
    specs = tuple(parse_spec(text, techniques) for text in table.pop("techniques"))
    origin = Origin(str(file), SceneOptions(assets))
    return ViewerState(scene, scene.cameras[0], scene.lights[0], specs, origin=origin, **table)


def save_state(state: ViewerState, file: Path) -> ViewerState:
    """Write a state; returns it with camera and light as the file has them: its degrees are not radians to the bit.

    Raises InputError if the file cannot be written or would not find the scene's meshes, and for a sweep's scene.
    """
    import tomli_w  # of the extra `viewer`, which states are read without

    check_outputs(".toml", file)
    if state.origin is None or state.coordinates != "relative":
        raise InputError(f"{file}: the scene of a sweep, and absolute coordinates, are not for a scene file")
    camera = asdict(state.camera) | {"fov_y": math.degrees(state.camera.fov_y) or None}
    camera |= {} if state.camera.converging else {"kind": "orthographic"}
    camera = {name: value for name, value in camera.items() if value}
    angles = {"angle": math.degrees(state.light.angle), "angular_radius": math.degrees(state.light.radius)}
    light = asdict(state.light) | angles
    light = {name: light[name] for name in LIGHT_TABLES[state.light.kind].model_fields}
    saved = replace(state, camera=camera_from_table(camera, str(file)), light=light_from_table(light, str(file)))
    viewer = {name: getattr(state, name) for name in ViewerTable.model_fields if name != "techniques"}
    viewer["size"] = state.size.written
    document: dict[str, Any] = {
        "name": state.scene.name,
        "viewer": {"techniques": [spec.text for spec in state.specs], **viewer},
        "camera": camera,
        "light": light,
        "mesh": _mesh_tables(state.scene, state.origin, file),
    }
    if state.scene.motions:
        document["sequence"] = read_document(state.origin.file).sequence
    with replace_file(file) as temporary:
        temporary.write_text(tomli_w.dumps(document), encoding="utf-8")
    return saved


def _mesh_tables(scene: Scene, origin: Origin, file: Path) -> list[dict[str, Any]]:
    """The tables of a scene's meshes for a file: those of its own scene file, or its mesh file and assumed ground."""
    own, options = origin.file, origin.options
    if own.suffix.lower() == ".toml":
        tables = read_document(own).mesh
    else:
        chosen = {"time": options.time, "clip": options.clip}
        turned = {"rotate": [-90.0, 0.0, 0.0]} if options.up == "z" else {}
        tables = [{"file": own.name, **{name: value for name, value in chosen.items() if value is not None}, **turned}]
    tables = [_moved(table, own.parent, file) for table in tables]
    if scene.ground is not None:
        low, high = content_of(scene).geometry.bounds
        side = GROUND_SIDE * math.dist(low, high)
        place = [float((low[0] + high[0]) / 2), float(low[1]), float((low[2] + high[2]) / 2)]
        tables.append({"name": "ground", "shape": "plane", "scale": side, "translate": place})
    return tables


def _moved(table: dict[str, Any], folder: Path, file: Path) -> dict[str, Any]:
    """A mesh table of a scene file in a folder for a file that may be in another. Raises InputError."""
    moved = dict(table)
    for key in ("file", "mask"):
        name = table.get(key)
        if isinstance(name, str) and (folder / name).is_file():
            path = os.path.relpath((folder / name).resolve(), file.parent.resolve())
            if path.startswith(".."):
                raise InputError(f"{file}: meshes must be in its folder, where {name} is not; allowed: {folder}")
            moved[key] = Path(path).as_posix()
    return moved


def cell_state(folder: Path, key: str, techniques: Techniques, assets: Path | None = None) -> ViewerState:
    """The state that shows a cell of a folder of `run` or `stress`.

    key: of its row, or the beginning of it. Raises InputError if there is no such row, or if its scene is not found.
    """
    rows = [row for row in read_rows(folder / "rows.jsonl")[0] if row["kind"] == "score"]
    cells = {row["key"]: row for row in rows if row["key"].startswith(key)}
    if len(cells) != 1:
        count = f"{len(cells)} cells begin so" if cells else "no such cell"
        raise InputError(f"--cell {key!r:.60}: {count} in {folder}; allowed: a key of its rows.jsonl")
    (row,) = cells.values()
    spec = parse_spec(row["full_spec"], techniques)
    shown = {"size": size_of(row), "phase": row["phase"], "coordinates": row["coordinates"]}
    if "axis" in row:
        view = AXES[row["axis"]].at(row["axis_value"], row["light_kind"]).views[0]
        return ViewerState(view.scene, view.camera, view.light, (spec,), **shown)
    study: Mapping[str, Any] = read_run_file(folder / "run.json").get("study", {})
    names = {field.name for field in fields(SceneOptions)} - {"assets"}
    options = SceneOptions(assets, **{name: study[name] for name in names & study.keys()})
    sources = {*study.get("scenes", ()), *({row["scene"]} & set(builtin_names()))}
    for source in sorted(sources, key=lambda source: Path(source).stem != row["scene"]):
        origin = Origin(source, options)
        scene = origin.load()
        if scene.name == row["scene"]:
            where = f"{folder}: cell {row['key']} is of a camera or a light of its study, not of the scene: "
            camera = named(scene.cameras, row["view"], f"{where}view")
            light = named(scene.lights, row["light"], f"{where}light")
            sequence = row.get("sequence") or ""
            return ViewerState(scene, camera, light, (spec,), origin=origin, sequence=sequence, **shown)
    raise InputError(f"{folder}: no file of the scene {row['scene']!r} found; allowed: one that run.json names")
