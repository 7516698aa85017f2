"""Study files: their text, checked, and the study that it makes."""

import itertools
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from shadowbench.data import data_folder
from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Coordinates, Light
from shadowbench.scenes.tables import camera_from_table, light_from_table
from shadowbench.strict import Strict, explain, read_toml
from shadowbench.studies.study import BiasSweep, Study
from shadowbench.techniques.base import Technique
from shadowbench.techniques.biases import Bias
from shadowbench.techniques.params import Row
from shadowbench.techniques.spec import Spec, format_value, parse_spec

Techniques = Mapping[str, type[Technique]]


def _listed(value: object) -> list[Any]:
    return value if isinstance(value, list) else [value]


Sizes = Annotated[
    list[Annotated[int, Field(ge=1, le=65536, strict=True)]], BeforeValidator(_listed), Field(min_length=1)
]


MOST_NAMED = 1000
"""Scenes, views, lights and tables of techniques of a study."""

MOST_SPECS = 10_000
"""Specs of a study, each map size counted."""

MOST_CELLS = 1_000_000
"""Cells of a study in one view, each phase counted."""


_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of a bias sweep that names none


class StudyFile(Strict):
    """The text of a study file; `technique` absent means every technique at its defaults."""

    about: str = ""
    scenes: list[str] = Field(min_length=1, max_length=MOST_NAMED)
    map_size: Sizes | None = None
    view_size: int = Field(512, ge=1, le=16384, strict=True)
    rounds: int = Field(9, ge=0, le=10_000, strict=True)
    phases: int = Field(1, ge=1, le=10_000, strict=True)
    coordinates: Coordinates = "relative"
    reference: str = "shadow-map:size=1024"
    time_limit: float = Field(120.0, gt=0, le=86_400)
    memory_limit: float = Field(8.0, gt=0, le=4096)
    views: list[str | dict[str, Any]] = Field(["file"], min_length=1, max_length=MOST_NAMED)
    lights: list[str | dict[str, Any]] = Field(["file"], min_length=1, max_length=MOST_NAMED)
    technique: list[dict[str, Any]] | None = Field(None, min_length=1, max_length=MOST_NAMED)


def read_study(file: Path, techniques: Techniques) -> Study:
    """The study of a file; raises InputError for anything wrong in it."""
    table = read_toml(file, str(file), f"no such study file{alternatives(file, study_names(), 'ours')}")
    try:
        text = StudyFile.model_validate(table)
    except ValidationError as error:
        raise explain(str(file), error) from None
    return resolve(text, techniques, str(file), file.parent)


def resolve(text: StudyFile, techniques: Techniques, where: str, folder: Path) -> Study:
    """A study from its text: specs crossed and validated, scenes relative to `folder`."""
    notes: list[str] = []
    sweeps: list[BiasSweep] = []
    own_phases: dict[Spec, int] = {}
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
        specs = []
        for number, lists in enumerate(text.technique, start=1):
            table = f"{where}: technique {number}"
            made = _crossed(lists, techniques, table, notes, sweeps)
            phases = _phases(lists, table) or text.phases
            own_phases |= {spec: max(phases, own_phases.get(spec, 1)) for spec in made}  # named twice: the larger
            specs += made
    own_phases = {spec: phases for spec, phases in own_phases.items() if phases != text.phases}
    _check_size(specs, own_phases, text, where)
    return Study(
        scenes=tuple(_scene_reference(scene, folder) for scene in text.scenes),
        specs=tuple(specs),
        reference=_parsed(text.reference, techniques, f"{where}: reference"),
        map_sizes=tuple(text.map_size or ()),
        view_size=text.view_size,
        rounds=text.rounds,
        phases=text.phases,
        own_phases=own_phases,
        coordinates=text.coordinates,
        time_limit=text.time_limit,
        memory_limit=text.memory_limit,
        views=tuple(cameras),
        lights=tuple(lights),
        about=text.about,
        sweeps=tuple(sweeps),
        notes=tuple(notes),
    )


def _check_size(specs: list[Spec], own_phases: Mapping[Spec, int], text: StudyFile, where: str) -> None:
    """Raises InputError for a study that is larger than anybody could run."""
    sizes = len(text.map_size or [None])
    sized = [sizes if spec.has_size and "size" not in spec.named else 1 for spec in specs]
    if sum(sized) > MOST_SPECS:
        raise InputError(f"{where}: {sum(sized)} specs, each map size counted; allowed are at most {MOST_SPECS}")
    cells = sum(count * own_phases.get(spec, text.phases) for count, spec in zip(sized, specs, strict=True))
    if cells > MOST_CELLS:
        raise InputError(
            f"{where}: {cells} cells, each map size and phase of {len(specs)} specs counted; "
            f"allowed are at most {MOST_CELLS}"
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
    bare = not Path(reference).suffix and Path(reference).name == reference and not os.path.lexists(folder / reference)
    return reference if bare or reference in builtin_names() else str(folder / reference)


def _parsed(text: str, techniques: Techniques, where: str) -> Spec:
    try:
        return parse_spec(text, techniques)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _crossed(
    table: dict[str, Any], techniques: Techniques, where: str, notes: list[str], sweeps: list[BiasSweep]
) -> list[Spec]:
    """The specs of one [[technique]]: every combination of its lists.

    Combinations that mean nothing are dropped, and said; a value that no combination takes is an InputError.
    """
    if not isinstance(table.get("spec"), str):
        raise InputError(
            f"{where}: spec: found {table.get('spec', 'none')!r:.60}; allowed: a technique's spec, as text"
        )
    base = _parsed(table["spec"], techniques, where)
    lists = {key: _listed(value) for key, value in table.items() if key not in ("spec", "bias_sweep", "phases")}
    factors = _factors(table, where)
    for key, choices in lists.items():
        if key not in base.technique.Params.model_fields:
            names = [*base.technique.Params.model_fields, "bias_sweep"]
            known = alternatives(key, names, f"parameters of {base.technique.name}")
            raise InputError(f"{where}: unknown parameter {key!r:.60}{known}")
        if not choices:
            raise InputError(f"{where}: {key}: found an empty list; allowed: one value or more")
    count = math.prod(len(choices) for choices in lists.values()) * max(1, len(factors))
    if count > MOST_SPECS:
        raise InputError(f"{where}: its lists cross to {count} specs; allowed are at most {MOST_SPECS}")
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
        if not factors:
            made.append(crossed)
        swept: dict[float, Spec] = {}
        for factor in factors:
            try:
                swept[factor] = _swept(crossed, factor)
            except InputError as error:
                dropped.append(error)
        made += swept.values()
        if swept:
            sweeps.append(BiasSweep(crossed, tuple(sorted(swept.items(), key=lambda pair: pair[0]))))
    for choice, reason in refused.items():
        if choice not in taken:
            raise InputError(f"{where}: {reason}")
    if not made:
        raise InputError(f"{where}: {dropped[0]}")
    notes.extend(dict.fromkeys(f"{where}: dropped: {error}" for error in dropped))
    return made


def _phases(table: dict[str, Any], where: str) -> int | None:
    """A table's own `phases`; None where it leaves them to the study."""
    phases = table.get("phases")
    if phases is not None and (isinstance(phases, bool) or not isinstance(phases, int) or not 1 <= phases <= 10_000):
        raise InputError(f"{where}: phases: found {phases!r:.60}; allowed: a whole number from 1 to 10000")
    return phases


def _factors(table: dict[str, Any], where: str) -> list[float]:
    """The factors of `bias_sweep`, ¼ to 4 where it is only asked for; none without it."""
    asked = table.get("bias_sweep", False)
    if isinstance(asked, bool):
        return list(_FACTORS) if asked else []
    factors = _listed(asked)
    for factor in factors or [None]:
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not 0 < factor < math.inf:
            found = "an empty list" if factor is None else f"{factor!r:.60}"
            raise InputError(f"{where}: bias_sweep: found {found}; allowed: true, or numbers above 0")
    return factors


def _swept(spec: Spec, factor: float) -> Spec:
    """The spec with its bias times a factor; raises InputError where there is none, or it has nothing to multiply."""
    bias = getattr(spec.params, "bias", None)
    if not isinstance(bias, Bias) or not any(part.swept for part in bias.parts):
        found = f", found bias={format_value(bias)}" if isinstance(bias, Row) else ""
        raise InputError(f"bias_sweep: {spec.technique.name} has no bias here that can be multiplied{found}")
    try:
        row = bias.times(factor)
    except ValidationError as error:
        raise explain(f"bias_sweep {factor:g}: {format_value(bias)}", error) from None
    return spec.with_(bias=row)
