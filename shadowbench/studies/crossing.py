"""Specs of a study file's `[[technique]]` table: the product of its lists, with a bias sweep if requested."""

import itertools
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetPydanticSchema,
    InstanceOf,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import PydanticKnownError

from shadowbench.errors import InputError, alternatives
from shadowbench.maps.biases import Bias
from shadowbench.options import MAP_SIZE
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.spec import Spec, format_value, parse_spec
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Light, Scene
from shadowbench.scenes.tables import camera_from_table, light_from_table
from shadowbench.strict import explain

Techniques = Mapping[str, type[Technique]]

MOST_SPECS = 10_000
"""Most specs of a study, counting each map size."""

_NO_PARAMETERS = ("spec", "bias_sweep", "phases", "soft")
_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # default factors of a bias sweep


@dataclass(frozen=True)
class BiasSweep:
    """A spec, and copies of it with its bias multiplied: (factor, spec) pairs by increasing factor."""

    base: Spec
    variants: tuple[tuple[float, Spec], ...]


@dataclass(frozen=True)
class CrossedSpecs:
    """Specs of a `[[technique]]` table, its number of phases (None for the study's), and its bias sweeps.

    soft: whether they are measured under lights with a size only, or without one only; None for both.
    """

    specs: tuple[Spec, ...]
    phases: int | None = None
    sweeps: tuple[BiasSweep, ...] = ()
    soft: bool | None = None


def cross(table: dict[str, Any], techniques: Techniques, where: str, notes: list[str]) -> CrossedSpecs:
    """Specs for every combination of the table's lists.

    Invalid combinations are dropped with a line in `notes`. Raises InputError, its message beginning with `where`, for
    an invalid table and for a value that is valid in no combination.
    """
    if not isinstance(table.get("spec"), str):
        raise InputError(
            f"{where}: spec: found {table.get('spec', 'none')!r:.60}; allowed: a technique's spec, as text"
        )
    base = parse_spec_at(table["spec"], techniques, where)
    lists = {key: to_list(value) for key, value in table.items() if key not in _NO_PARAMETERS}
    factors = _factors(table, where)
    for key, choices in lists.items():
        if key not in base.technique.Params.model_fields:
            names = [*base.technique.Params.model_fields, "bias_sweep", "soft"]
            known = alternatives(key, names, f"parameters of {base.technique.name}")
            raise InputError(f"{where}: unknown parameter {key!r:.60}{known}")
        if not choices:
            raise InputError(f"{where}: {key}: found an empty list; allowed: one value or more")
    count = math.prod(len(choices) for choices in lists.values()) * max(1, len(factors))
    if count > MOST_SPECS:
        raise InputError(f"{where}: its lists combine to {count} specs; allowed are at most {MOST_SPECS}")
    dropped: list[InputError] = []
    specs = _combined(base, lists, dropped, where)
    swept = [(spec, variants) for spec in specs if (variants := _variants(spec, factors, dropped))]
    sweeps = [BiasSweep(spec, tuple(sorted(variants.items(), key=lambda pair: pair[0]))) for spec, variants in swept]
    made = [variant for _, variants in swept for variant in variants.values()] if factors else specs
    if not made:
        raise InputError(f"{where}: {dropped[0]}")
    notes.extend(dict.fromkeys(f"{where}: dropped: {error}" for error in dropped))
    soft = table.get("soft")
    if soft is not None and not isinstance(soft, bool):
        raise InputError(f"{where}: soft: found {soft!r:.60}; allowed: true or false")
    return CrossedSpecs(tuple(made), _phases(table, where), tuple(sweeps), soft)


def _combined(base: Spec, lists: dict[str, list[Any]], dropped: list[InputError], where: str) -> list[Spec]:
    """The valid combinations. Raises InputError for a value that is valid in none; others are appended to `dropped`."""
    made: list[Spec] = []
    taken: set[tuple[str, str]] = set()
    refused: dict[tuple[str, str], InputError] = {}
    for row in itertools.product(*lists.values()):
        chosen = {(key, repr(value)) for key, value in zip(lists, row, strict=True)}
        try:
            made.append(base.with_(**dict(zip(lists, row, strict=True))))
            taken |= chosen
        except InputError as error:
            dropped.append(error)
            refused |= dict.fromkeys(chosen - refused.keys(), error)
    for choice, reason in refused.items():
        if choice not in taken:
            raise InputError(f"{where}: {reason}")
    return made


def _variants(spec: Spec, factors: Iterable[float], dropped: list[InputError]) -> dict[float, Spec]:
    """The spec with its bias multiplied by each factor that is possible."""
    found = {}
    for factor in factors:
        try:
            found[factor] = _with_bias_times(spec, factor)
        except InputError as error:
            dropped.append(error)
    return found


def _phases(table: dict[str, Any], where: str) -> int | None:
    """Number of phases of the table itself; None for the study's."""
    phases = table.get("phases")
    if phases is not None and (isinstance(phases, bool) or not isinstance(phases, int) or not 1 <= phases <= 10_000):
        raise InputError(f"{where}: phases: found {phases!r:.60}; allowed: a whole number from 1 to 10000")
    return phases


def _factors(table: dict[str, Any], where: str) -> list[float]:
    """Factors of `bias_sweep`: the default ones for `true`, empty without a sweep."""
    value = table.get("bias_sweep", False)
    if isinstance(value, bool):
        return list(_FACTORS) if value else []
    factors = to_list(value)
    for factor in factors or [None]:
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not 0 < factor < math.inf:
            found = "an empty list" if factor is None else f"{factor!r:.60}"
            raise InputError(f"{where}: bias_sweep: found {found}; allowed: true, or numbers above 0")
    return factors


def _with_bias_times(spec: Spec, factor: float) -> Spec:
    """The spec with its bias multiplied by a factor. Raises InputError if it has no bias that can be multiplied."""
    bias = getattr(spec.params, "bias", None)
    if not isinstance(bias, Bias) or not any(term.swept for term in bias.terms):
        found = f", found bias={format_value(bias)}" if isinstance(bias, Component) else ""
        raise InputError(f"bias_sweep: {spec.technique.name} has no bias here that can be multiplied{found}")
    try:
        scaled = bias.scaled(factor)
    except ValidationError as error:
        raise explain(f"bias_sweep {factor:g}: {format_value(bias)}", error) from None
    return spec.with_(bias=scaled)


def parse_spec_at(text: str, techniques: Techniques, where: str) -> Spec:
    """Parse a spec. Raises InputError whose message begins with `where`."""
    try:
        return parse_spec(text, techniques)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def to_list(value: object) -> list[Any]:
    """A list or tuple as a list; any other value as a list of one."""
    return list(value) if isinstance(value, list | tuple) else [value]


MOST_NAMED = 1000
"""Most entries of a study file's lists of scenes, views, lights and technique tables."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Source:
    """Context of reading a study file: its name and folder, the known techniques, and notes made on the way."""

    where: str
    folder: Path
    techniques: Techniques
    notes: list[str] = field(default_factory=list)


def _written(kind: Any) -> Any:
    """Schema of a field as written in files, for a field that holds a converted type."""
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(kind))


def _entries(kind: Any) -> Any:
    """Schema of a list field as written in files."""
    return _written(Annotated[list[kind], Field(min_length=1), AfterValidator(_few)])


def _few(entries: list[Any], info: ValidationInfo) -> list[Any]:
    if info.context is not None and len(entries) > MOST_NAMED:
        sizes = {"field_type": "List", "max_length": MOST_NAMED, "actual_length": len(entries)}
        raise PydanticKnownError("too_long", sizes)
    return entries


def _scenes(entries: list[str | Scene], info: ValidationInfo) -> tuple[str | Scene, ...]:
    """Scenes by name, or by path, made relative to the study file's folder."""
    if info.context is None:
        return tuple(entries)
    folder = info.context.folder
    return tuple(_scene_reference(entry, folder) if isinstance(entry, str) else entry for entry in entries)


def _scene_reference(reference: str, folder: Path) -> str:
    # A bare word that names no file is a misspelt built-in name, which `load_scene` reports.
    bare = not Path(reference).suffix and Path(reference).name == reference and not os.path.lexists(folder / reference)
    return reference if bare or reference in builtin_names() else str(folder / reference)


def _cameras(entries: list[Any], info: ValidationInfo) -> tuple[str | Camera, ...]:
    def made(entry: Any, number: int) -> str | Camera:
        return camera_from_table(entry, f"{_source(info).where}: views {number}", f"view-{number}")

    return _made_of_tables(entries, made)


def _lights(entries: list[Any], info: ValidationInfo) -> tuple[str | Light, ...]:
    def made(entry: Any, number: int) -> str | Light:
        return light_from_table(entry, f"{_source(info).where}: lights {number}", f"light-{number}")

    return _made_of_tables(entries, made)


def _crossings(entries: list[Any], info: ValidationInfo) -> tuple[CrossedSpecs, ...]:
    def made(entry: Any, number: int) -> CrossedSpecs:
        source = _source(info)
        return cross(entry, source.techniques, f"{source.where}: technique {number}", source.notes)

    return _made_of_tables(entries, made)


def _made_of_tables(entries: list[Any], made: Callable[[Any, int], Any]) -> tuple[Any, ...]:
    """The entries, with tables converted by `made`, which also takes their number."""
    return tuple(
        made(entry, number) if isinstance(entry, dict) else entry for number, entry in enumerate(entries, start=1)
    )


def _reference(written: Any, info: ValidationInfo) -> Spec:
    if isinstance(written, Spec):
        return written
    return parse_spec_at(written, _source(info).techniques, f"{_source(info).where}: reference")


def _source(info: ValidationInfo) -> Source:
    assert isinstance(info.context, Source)  # unconverted values come from files only
    return info.context


Sizes = Annotated[
    tuple[Annotated[int, Field(ge=MAP_SIZE.least, le=MAP_SIZE.most, strict=True)], ...],
    BeforeValidator(to_list),
    Field(min_length=1),
]
Scenes = Annotated[tuple[str | Scene, ...], _entries(str | InstanceOf[Scene]), AfterValidator(_scenes)]
Cameras = Annotated[tuple[str | Camera, ...], _entries(str | Table | InstanceOf[Camera]), AfterValidator(_cameras)]
Lights = Annotated[tuple[str | Light, ...], _entries(str | Table | InstanceOf[Light]), AfterValidator(_lights)]
Crossings = Annotated[tuple[CrossedSpecs, ...], _entries(Table | InstanceOf[CrossedSpecs]), AfterValidator(_crossings)]
Reference = Annotated[Spec, _written(str | InstanceOf[Spec]), AfterValidator(_reference)]
