"""Study files: what is crossed with what, and the cells that come of it."""

import itertools
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BeforeValidator, Field, ValidationError

from shadowbench.data import data_folder
from shadowbench.errors import InputError
from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, View, view_of
from shadowbench.scenes.tables import camera_from_table, light_from_table
from shadowbench.strict import Strict, explain
from shadowbench.techniques.base import Technique
from shadowbench.techniques.params import Row
from shadowbench.techniques.spec import Spec, parse_spec

Techniques = Mapping[str, type[Technique]]
Named = TypeVar("Named", Camera, Light)


def _listed(value: object) -> list[Any]:
    return value if isinstance(value, list) else [value]


Sizes = Annotated[
    list[Annotated[int, Field(ge=1, le=65536, strict=True)]], BeforeValidator(_listed), Field(min_length=1)
]


class StudyFile(Strict):
    """The text of a study file; `technique` absent means every technique at its defaults."""

    about: str = ""
    scenes: list[str] = Field(min_length=1)
    map_size: Sizes | None = None
    view_size: int = Field(512, ge=1, le=16384, strict=True)
    rounds: int = Field(9, ge=0, le=10_000, strict=True)
    phases: int = Field(1, ge=1, le=10_000, strict=True)
    coordinates: Coordinates = "relative"
    reference: str = "shadow-map:size=1024"
    time_limit: float = Field(120.0, gt=0, le=86_400)
    memory_limit: float = Field(8.0, gt=0, le=4096)
    views: list[str | dict[str, Any]] = Field(["file"], min_length=1)
    lights: list[str | dict[str, Any]] = Field(["file"], min_length=1)
    technique: list[dict[str, Any]] | None = Field(None, min_length=1)


@dataclass(frozen=True)
class Cell:
    """One measurement: a spec at a phase, in a block's view."""

    spec: Spec
    phase: int


@dataclass(frozen=True, eq=False)
class Block:
    """A view and the cells of all phases, which share its truth and its G-buffer."""

    view: View
    cells: tuple[Cell, ...]

    @property
    def scene(self) -> Scene:
        """The view's scene."""
        return self.view.scene


@dataclass(frozen=True, eq=False)
class Study:
    """A study with everything resolved but the scenes, which are loaded one at a time."""

    scenes: tuple[str, ...]
    specs: tuple[Spec, ...]
    reference: Spec
    map_sizes: tuple[int, ...] = ()
    view_size: int = 512
    rounds: int = 9
    phases: int = 1
    coordinates: Coordinates = "relative"
    time_limit: float = 120.0
    memory_limit: float = 8.0
    views: tuple[str | dict[str, Any], ...] = ("file",)
    lights: tuple[str | dict[str, Any], ...] = ("file",)
    assets: Path | None = None
    about: str = ""
    notes: tuple[str, ...] = field(default=())

    def cells(self) -> tuple[Cell, ...]:
        """The cells of one view: phases of techniques that have a grid, one cell of the others."""
        return tuple(
            Cell(spec, phase)
            for phase in range(self.phases)
            for spec in sized(self.specs, self.map_sizes)
            if phase == 0 or spec.technique.phased
        )

    def blocks(self) -> Iterator[Block]:
        """All blocks, scene by scene; raises InputError for a scene that cannot be read."""
        for reference in self.scenes:
            scene = load_scene(reference, self.assets)
            for camera, light in itertools.product(self.cameras(scene), self.lights_of(scene)):
                yield Block(view_of(scene, camera, light, self.view_size), self.cells())

    def cameras(self, scene: Scene) -> list[Camera]:
        """The study's cameras in a scene; "file" is the first that its file has."""
        cameras = []
        for number, entry in enumerate(self.views, start=1):
            if isinstance(entry, dict):
                cameras.append(camera_from_table(entry, f"views {number}", f"view-{number}"))
            elif entry == "file":
                cameras.append(scene.cameras[0])
            else:
                cameras.append(named(scene.cameras, entry, f"views of {scene.name}"))
        return cameras

    def lights_of(self, scene: Scene) -> list[Light]:
        """The study's lights in a scene; "file" is all that its file has."""
        lights: list[Light] = []
        for number, entry in enumerate(self.lights, start=1):
            if isinstance(entry, dict):
                lights.append(light_from_table(entry, f"lights {number}", f"light-{number}")[0])
            elif entry == "file":
                lights.extend(scene.lights)
            else:
                lights.append(named(scene.lights, entry, f"lights of {scene.name}"))
        return lights


def scenes_of(blocks: Sequence[Block]) -> list[Scene]:
    """The scenes of blocks, each once."""
    return list(dict.fromkeys(block.scene for block in blocks))


def named(things: Sequence[Named], name: str, where: str) -> Named:
    """The camera or light of a name; raises InputError, beginning with `where`, that lists the names."""
    for thing in things:
        if thing.name == name:
            return thing
    raise InputError(f"{where}: found {name!r}; allowed: {', '.join(thing.name for thing in things)}")


def read_study(file: Path, techniques: Techniques) -> Study:
    """The study of a file; raises InputError for anything wrong in it."""
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{file}: no such study file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{file}: not TOML: {error}") from None
    try:
        text = StudyFile.model_validate(table)
    except ValidationError as error:
        raise explain(str(file), error) from None
    return resolve(text, techniques, str(file), file.parent)


def resolve(text: StudyFile, techniques: Techniques, where: str, folder: Path) -> Study:
    """A study from its text: specs crossed and validated, scenes relative to `folder`."""
    notes: list[str] = []
    if text.technique is None:
        specs = [parse_spec(name, techniques) for name in techniques]
    else:
        specs = [
            spec
            for number, table in enumerate(text.technique, start=1)
            for spec in _crossed(table, techniques, f"{where}: technique {number}", notes)
        ]
    return Study(
        scenes=tuple(_scene_reference(scene, folder) for scene in text.scenes),
        specs=tuple(specs),
        reference=parse_spec(text.reference, techniques),
        map_sizes=tuple(text.map_size or ()),
        view_size=text.view_size,
        rounds=text.rounds,
        phases=text.phases,
        coordinates=text.coordinates,
        time_limit=text.time_limit,
        memory_limit=text.memory_limit,
        views=tuple(text.views),
        lights=tuple(text.lights),
        about=text.about,
        notes=tuple(notes),
    )


def sized(specs: Sequence[Spec], sizes: Sequence[int]) -> tuple[Spec, ...]:
    """The specs at each map size, where a technique has one and its spec does not name it; each only once."""
    grown = [
        spec.with_(size=size) if size is not None else spec
        for spec in specs
        for size in (sizes if sizes and spec.has_size and "size" not in spec.named else [None])
    ]
    return tuple(dict.fromkeys(grown))


def find_study(name: str) -> Path:
    """A study file by path, or one of ours by name."""
    path = Path(name)
    ours = data_folder("benchmarks") / f"{name}.toml"
    return ours if not path.exists() and ours.is_file() else path


def study_names() -> list[str]:
    """The studies that travel with the package."""
    return sorted(path.stem for path in data_folder("benchmarks").glob("*.toml"))


def _scene_reference(reference: str, folder: Path) -> str:
    return reference if reference in builtin_names() else str(folder / reference)


def _crossed(table: dict[str, Any], techniques: Techniques, where: str, notes: list[str]) -> list[Spec]:
    """The specs of one [[technique]]: every combination of its lists; those that fail are dropped, and said."""
    if not isinstance(table.get("spec"), str):
        raise InputError(f"{where}: spec: found {table.get('spec')!r}; allowed: a technique's spec, as text")
    base = parse_spec(table["spec"], techniques)
    sweep = table.get("bias_sweep", [None])
    lists = {key: _listed(value) for key, value in table.items() if key not in ("spec", "bias_sweep")}
    for key in lists:
        if key not in base.technique.Params.model_fields:
            allowed = ", ".join(base.technique.Params.model_fields) or "none"
            raise InputError(f"{where}: unknown parameter {key!r}; parameters of {base.technique.name}: {allowed}")
    made, dropped = [], []
    for values in itertools.product(*lists.values()):
        for factor in _listed(sweep):
            try:
                made.append(_swept(base.with_(**dict(zip(lists, values, strict=True))), factor))
            except InputError as error:
                dropped.append(f"{where}: dropped: {error}")
    if not made:
        raise InputError(dropped[0].replace("dropped: ", "") if dropped else f"{where}: an empty list leaves no spec")
    notes.extend(dropped)
    return made


def _swept(spec: Spec, factor: float | None) -> Spec:
    """The spec with its computed bias times a factor; raises InputError for a bias that is not computed."""
    if factor is None:
        return spec
    bias = getattr(spec.params, "bias", None)
    if not isinstance(bias, Row) or "scale" not in type(bias).model_fields:
        raise InputError(f"bias_sweep: {spec.technique.name} has no computed bias here, found {bias!r:.60}")
    try:
        row = type(bias)(**{**dict(bias), "scale": bias.scale * factor})  # type: ignore[attr-defined]
    except (ValidationError, TypeError) as error:
        raise InputError(f"bias_sweep: {factor!r} is no factor ({type(error).__name__})") from None
    return spec.with_(bias=row)
