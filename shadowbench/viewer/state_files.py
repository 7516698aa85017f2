"""State files: a scene file with the moved camera and light, and what was shown of it in a table `[viewer]`."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from shadowbench.errors import InputError
from shadowbench.extremes.axes import AXES
from shadowbench.files import check_outputs, replace_file
from shadowbench.gl.picture import Shading
from shadowbench.measure.row_store import read_run_file, stream_rows
from shadowbench.measure.rows import Record
from shadowbench.options import PLACES, VIEW_SIZE, SceneOptions
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import builtin_names, load_scene, read_document
from shadowbench.scenes.model import Mesh
from shadowbench.scenes.opening import named
from shadowbench.scenes.scene_tables import LIGHT_TABLES, Color
from shadowbench.strict import Strict, explain
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer.state import Layout, Origin, Overlay, Source, ViewerState

_ATTRIBUTES = ("color", "casts", "receives", "planar")  # of a mesh, besides its shape
_PLY = """\
ply
format binary_little_endian 1.0
element vertex {}
property double x
property double y
property double z
element face {}
property list uchar int vertex_indices
end_header
"""


class ShadingTable(Strict):
    """The table `[viewer.shading]`: fields of `Shading`, by default its values."""

    ambient: float = Field(1.0, ge=0)
    diffuse: float = Field(1.0, ge=0)
    specular: float = Field(0.12, ge=0)
    shininess: float = Field(32.0, ge=1)
    light_color: Color = Shading.light_color
    sky: Color = Shading.sky
    ground: Color = Shading.ground
    horizon: Color = Shading.horizon
    zenith: Color = Shading.zenith


class ViewerTable(Strict):
    """The table `[viewer]` of a state file: the fields of `ViewerState` that no scene has."""

    techniques: list[str] = Field(["shadow-map"], min_length=1, max_length=2)
    size: int = Field(512, ge=VIEW_SIZE.least, le=VIEW_SIZE.most, strict=True)
    phase: int = Field(0, ge=0, strict=True)
    shadows: bool = Field(True, strict=True)
    layout: Layout = "wipe"
    left: Source = "A"
    right: Source = "truth"
    wipe: float = Field(0.5, ge=0, le=1)
    overlay: Overlay = "picture"
    colors: dict[str, Color] = Field({})
    shading: ShadingTable = ShadingTable()


SHOWN = [name for name in ViewerTable.model_fields if name not in ("techniques", "colors", "shading")]


def holds_state(file: Path) -> bool:
    """Whether a file is a scene file with a table `[viewer]`. Raises InputError for a `.toml` that is no scene."""
    return file.suffix.lower() == ".toml" and bool(read_document(file).viewer)


def read_state(file: Path, techniques: Techniques, assets: Path | None = None) -> ViewerState:
    """The state that a file holds. Raises InputError, as `load_scene` does, and for an invalid table `[viewer]`."""
    scene = load_scene(file, assets)
    try:
        table = ViewerTable.model_validate(read_document(file).viewer)
    except ValidationError as error:
        raise explain(f"{file.name}: [viewer]", error) from None
    shown = {name: getattr(table, name) for name in SHOWN}
    specs = tuple(parse_spec(text, techniques) for text in table.techniques)
    shown |= {"shading": Shading(**dict(table.shading)), "colors": tuple(table.colors.items())}
    origin = Origin(str(file), SceneOptions(assets))
    return ViewerState(scene, scene.cameras[0], scene.lights[0], specs, origin=origin, **shown)


def save_state(state: ViewerState, file: Path) -> None:
    """Write a state, and the meshes that no scene file describes beside it.

    Degrees of a file are not radians to the last bit: what is drawn afterwards must be what `read_state` gives. Raises
    InputError if the file cannot be written, if the meshes of the scene's file would not be found from there, and for
    raw coordinates, which no file has.
    """
    if state.coordinates != "relative":
        raise InputError(f"{file}: the scene is drawn in absolute coordinates, which no scene file can say")
    check_outputs(".toml", file)
    viewer = {name: getattr(state, name) for name in SHOWN}
    viewer |= {"colors": dict(state.colors), "shading": asdict(state.shading)}
    camera = asdict(state.camera) | {"fov_y": math.degrees(state.camera.fov_y)}
    angles = {"angle": math.degrees(state.light.angle), "angular_radius": math.degrees(state.light.radius)}
    light = asdict(state.light) | angles
    document: dict[str, Any] = {
        "name": state.scene.name,
        "viewer": {"techniques": [spec.text for spec in state.specs], **viewer},
        "camera": {name: value for name, value in camera.items() if value is not None},
        "light": {name: light[name] for name in LIGHT_TABLES[state.light.kind].model_fields},
        "mesh": _mesh_tables(state, file),
    }
    with replace_file(file) as temporary:
        temporary.write_text(toml_of(document), encoding="utf-8")


def append_to_study(file: Path, state: ViewerState, index: int, techniques: Techniques) -> None:
    """Append a spec of a state to a study file, which is made for the state's scene if there is none.

    Raises InputError if the file is no study, or would not be one with it.
    """
    from shadowbench.studies.study import read_study  # with pandas, only when it is needed

    check_outputs(".toml", file)
    before = toml_of(_study_of_scene(state, file)).encode()
    if file.exists():
        read_study(file, techniques)
        before = file.read_bytes()
    added = f"\n[[technique]]\n{toml_of({'spec': state.specs[index].text})}"
    with replace_file(file.resolve()) as temporary:  # a link remains one
        temporary.write_bytes(before + (b"" if before.endswith(b"\n") else b"\n") + added.encode())
        try:
            read_study(temporary, techniques, file.parent)
        except InputError as error:
            raise InputError(f"{file}: takes no further [[technique]]: {error}".replace(str(temporary), "it")) from None


def toml_of(document: Mapping[str, Any]) -> str:
    """A document as TOML."""
    import tomli_w  # of the extra `viewer`, which states are read without

    return tomli_w.dumps(document)


def _study_of_scene(state: ViewerState, file: Path) -> dict[str, Any]:
    """The part of a study file that names the scene."""
    origin = state.origin
    if origin is None or origin.options.up:
        missing = "no file has" if origin is None else "no study file can turn (--up)"
        raise InputError(f"{file}: {missing} the scene {state.scene.name!r}; save the state, and open it")
    names = ("sun", "no_ground", "time", "clip", *PLACES)
    asked = {name: value for name in names if (value := getattr(origin.options, name)) not in (None, False)}
    is_builtin = origin.source in builtin_names()
    return {"scenes": [origin.source if is_builtin else os.path.relpath(origin.source, file.parent)], **asked}


def _mesh_tables(state: ViewerState, file: Path) -> list[dict[str, Any]]:
    """The tables of a scene's meshes for a file: as its own file has them, or written as PLY files beside it.

    A mesh file in the folder is named, and one whose meshes are cut out, which no PLY says, must be there.
    """
    own, meshes = state.origin.file if state.origin else None, state.scene.meshes
    if own is not None and own.suffix.lower() == ".toml":
        return [_moved(table, own.parent, file) for table in read_document(own).mesh]
    is_cut_out = any(mesh.cutout for mesh in meshes)
    if own is None and is_cut_out:
        raise InputError(f"{file}: the scene's meshes are cut out, which only a file of their own can say; it has none")
    is_inside = own is not None and own.resolve().is_relative_to(file.parent.resolve())
    if own is None or not (is_cut_out or (is_inside and any(mesh.texture for mesh in meshes))):
        return _written_meshes(meshes, file)
    assert state.origin is not None
    options = state.origin.options
    chosen = {name: value for name in ("time", "clip") if (value := getattr(options, name)) is not None}
    turned = {"rotate": [-90.0, 0.0, 0.0]} if options.up == "z" else {}
    ground = [] if state.scene.ground is None else _written_meshes([state.scene.ground[0]], file)
    return [_moved({"file": own.name, **chosen, **turned}, own.parent, file), *ground]


def _moved(table: dict[str, Any], folder: Path, file: Path) -> dict[str, Any]:
    """A mesh table of a scene file in a folder for a file that may be in another. Raises InputError."""
    moved = dict(table)
    for key in ("file", "mask"):
        named = table.get(key)
        if isinstance(named, str) and (folder / named).is_file():
            path = os.path.relpath((folder / named).resolve(), file.parent.resolve())
            if path.startswith(".."):
                raise InputError(f"{file}: meshes must be in its folder, where {named} is not; allowed: {folder}")
            moved[key] = Path(path).as_posix()
    return moved


def _written_meshes(shown: Sequence[Mesh], file: Path) -> list[dict[str, Any]]:
    """The tables of meshes, written as PLY files beside a file."""
    tables = []
    for number, (values, group) in enumerate(groupby(shown, key=attrgetter(*_ATTRIBUTES)), start=1):
        meshes = list(group)
        ply = file.with_name(f"{file.stem}-{number}.ply")
        with replace_file(ply) as temporary:
            temporary.write_bytes(ply_of(meshes))
        tables.append({"name": meshes[0].name, "file": ply.name, **dict(zip(_ATTRIBUTES, values, strict=True))})
    return tables


def ply_of(meshes: Sequence[Mesh]) -> bytes:
    """Meshes one after another as a binary PLY with float64 positions, so that no bit is lost."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype("<f8")
    faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)])
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("indices", "<i4", 3)])
    rows["count"], rows["indices"] = 3, faces
    return _PLY.format(len(vertices), len(faces)).encode() + vertices.tobytes() + rows.tobytes()


def adopted(state: ViewerState, file: Path) -> ViewerState:
    """The state with camera and light as a file that was saved from it has them, to the last bit.

    Raises InputError if the file's meshes are not those of the state, whose own files have changed in the meantime.
    """
    saved = load_scene(file, None if state.origin is None else state.origin.options.assets)
    ours, theirs = (scene.geometry.vertices[scene.geometry.faces] for scene in (state.scene, saved))
    if not np.array_equal(ours, theirs):
        raise InputError(f"{file}: holds the scene as it is on disk now, which is not what is shown; save it once more")
    return replace(state, camera=saved.cameras[0], light=saved.lights[0])


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
    study: Mapping[str, Any] = read_run_file(folder / "run.json").get("study", {})
    asked = ("up", "sun", "no_ground", "time", "clip", *PLACES)
    options = SceneOptions(assets, **{name: study[name] for name in asked if name in study})
    own = [row["scene"]] if row["scene"] in builtin_names() else []
    for source in sorted({*study.get("scenes", ()), *own}, key=lambda source: Path(source).stem != row["scene"]):
        origin = Origin(source, options)
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
        count = f"{len(found)} cells begin so" if found else "no such cell"
        raise InputError(f"--cell {key!r:.60}: {count} in {folder}; allowed: a key of its rows.jsonl")
    return next(iter(found.values()))
