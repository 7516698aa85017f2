"""Study files: what is crossed with what, and the cells that come of it."""

import itertools
import math
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
from shadowbench.techniques.spec import Spec, format_value, parse_spec

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
    views: tuple[str | Camera, ...] = ("file",)
    lights: tuple[str | Light, ...] = ("file",)
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
        files: dict[str, str] = {}
        for reference in dict.fromkeys(self.scenes):
            scene = load_scene(reference, self.assets)
            first = files.setdefault(scene.name, reference)
            if first != reference:
                raise InputError(f"two scenes are called {scene.name!r}: {first} and {reference}; names must differ")
            for camera, light in itertools.product(self.cameras(scene), self.lights_of(scene)):
                yield Block(view_of(scene, camera, light, self.view_size), self.cells())

    def cameras(self, scene: Scene) -> list[Camera]:
        """The study's cameras in a scene; "file" is the first that its file has."""
        return _chosen(self.views, scene.cameras, scene.cameras[:1], f"views of {scene.name}")

    def lights_of(self, scene: Scene) -> list[Light]:
        """The study's lights in a scene; "file" is all that its file has."""
        return _chosen(self.lights, scene.lights, scene.lights, f"lights of {scene.name}")


def _chosen(
    entries: Sequence[str | Named], known: Sequence[Named], of_file: Sequence[Named], where: str
) -> list[Named]:
    """What entries name, each once: "file" stands for `of_file`, another word for one of `known`."""
    found: list[Named] = []
    for entry in entries:
        if not isinstance(entry, str):
            found.append(entry)
        else:
            found.extend(of_file if entry == "file" else [named(known, entry, where)])
    found = list(dict.fromkeys(found))
    names = [thing.name for thing in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{where}: two are called {name!r}; names must differ")
    return found


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
    cameras: list[str | Camera] = []
    for number, view in enumerate(text.views, start=1):
        table = f"{where}: views {number}"
        cameras.append(view if isinstance(view, str) else camera_from_table(view, table, f"view-{number}"))
    lights: list[str | Light] = []
    for number, entry in enumerate(text.lights, start=1):
        if isinstance(entry, str):
            lights.append(entry)
        else:
            light, lines = light_from_table(entry, f"{where}: lights {number}", f"light-{number}")
            lights.append(light)
            notes.extend(lines)
    if text.technique is None:
        specs = [parse_spec(name, techniques) for name in techniques]
    else:
        specs = [
            spec
            for number, lists in enumerate(text.technique, start=1)
            for spec in _crossed(lists, techniques, f"{where}: technique {number}", notes)
        ]
    return Study(
        scenes=tuple(_scene_reference(scene, folder) for scene in text.scenes),
        specs=tuple(specs),
        reference=_parsed(text.reference, techniques, f"{where}: reference"),
        map_sizes=tuple(text.map_size or ()),
        view_size=text.view_size,
        rounds=text.rounds,
        phases=text.phases,
        coordinates=text.coordinates,
        time_limit=text.time_limit,
        memory_limit=text.memory_limit,
        views=tuple(cameras),
        lights=tuple(lights),
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
    return ours if not path.is_file() and ours.is_file() else path


def study_names() -> list[str]:
    """The studies that travel with the package."""
    return sorted(path.stem for path in data_folder("benchmarks").glob("*.toml"))


def _scene_reference(reference: str, folder: Path) -> str:
    # A word that names no file here is a built-in name misspelt, which `load_scene` knows how to tell.
    bare = not Path(reference).suffix and Path(reference).name == reference and not (folder / reference).exists()
    return reference if bare or reference in builtin_names() else str(folder / reference)


def _parsed(text: str, techniques: Techniques, where: str) -> Spec:
    try:
        return parse_spec(text, techniques)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _crossed(table: dict[str, Any], techniques: Techniques, where: str, notes: list[str]) -> list[Spec]:
    """The specs of one [[technique]]: every combination of its lists.

    Combinations that mean nothing are dropped, and said; a value that no combination takes is an InputError.
    """
    if not isinstance(table.get("spec"), str):
        raise InputError(f"{where}: spec: found {table.get('spec')!r}; allowed: a technique's spec, as text")
    base = _parsed(table["spec"], techniques, where)
    lists = {key: _listed(value) for key, value in table.items() if key not in ("spec", "bias_sweep")}
    factors = _factors(table, where)
    for key, choices in lists.items():
        if key not in base.technique.Params.model_fields:
            allowed = ", ".join(base.technique.Params.model_fields) or "none"
            raise InputError(f"{where}: unknown parameter {key!r}; parameters of {base.technique.name}: {allowed}")
        if not choices:
            raise InputError(f"{where}: {key}: found an empty list; allowed: one value or more")
    made: list[Spec] = []
    dropped: list[InputError] = []
    taken: set[tuple[str, str]] = set()
    refused: dict[tuple[str, str], InputError] = {}
    for row in itertools.product(*lists.values()):
        chosen = {(key, repr(value)) for key, value in zip(lists, row, strict=True)}
        try:
            crossed = base.with_(**dict(zip(lists, row, strict=True)))
        except InputError as error:
            dropped.append(error)
            refused |= dict.fromkeys(chosen - refused.keys(), error)
            continue
        taken |= chosen
        for factor in factors:
            try:
                made.append(_swept(crossed, factor))
            except InputError as error:
                dropped.append(error)
    for choice, reason in refused.items():
        if choice not in taken:
            raise InputError(f"{where}: {reason}")
    if not made:
        raise InputError(f"{where}: {dropped[0]}")
    notes.extend(dict.fromkeys(f"{where}: dropped: {error}" for error in dropped))
    return made


def _factors(table: dict[str, Any], where: str) -> list[float | None]:
    """The factors of `bias_sweep`, or one None without it."""
    if "bias_sweep" not in table:
        return [None]
    factors = _listed(table["bias_sweep"])
    for factor in factors or [None]:
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not 0 < factor < math.inf:
            found = "an empty list" if factor is None else repr(factor)
            raise InputError(f"{where}: bias_sweep: found {found}; allowed: numbers above 0")
    return factors


def _swept(spec: Spec, factor: float | None) -> Spec:
    """The spec with its computed bias times a factor; raises InputError for a bias that is not computed."""
    if factor is None:
        return spec
    bias = getattr(spec.params, "bias", None)
    if not isinstance(bias, Row) or "scale" not in type(bias).model_fields:
        found = f", found bias={format_value(bias)}" if isinstance(bias, Row) else ""
        raise InputError(f"bias_sweep: {spec.technique.name} has no computed bias here{found}")
    try:
        row = type(bias)(**{**dict(bias), "scale": bias.scale * factor})  # type: ignore[attr-defined]
    except ValidationError as error:
        raise explain(f"bias_sweep {factor:g}: {format_value(bias)}", error) from None
    return spec.with_(bias=row)
