"""Study files: their text, checked, and the study that it makes."""

import itertools
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from shadowbench.data import data_folder
from shadowbench.errors import InputError
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Coordinates, Light
from shadowbench.scenes.tables import camera_from_table, light_from_table
from shadowbench.strict import Strict, explain
from shadowbench.studies.study import Study
from shadowbench.techniques.base import Technique
from shadowbench.techniques.params import Row
from shadowbench.techniques.spec import Spec, format_value, parse_spec

Techniques = Mapping[str, type[Technique]]


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


def read_study(file: Path, techniques: Techniques) -> Study:
    """The study of a file; raises InputError for anything wrong in it."""
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{file}: no such study file; ours: {', '.join(study_names())}") from None
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
        raise InputError(f"{where}: spec: found {table.get('spec', 'none')!r}; allowed: a technique's spec, as text")
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
