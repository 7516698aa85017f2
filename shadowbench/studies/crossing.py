"""What names and tables of a study file stand for; of a `[[technique]]` table, the product of its lists as specs."""

import itertools
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from shadowbench.errors import InputError, alternatives
from shadowbench.maps.biases import Bias
from shadowbench.options import PHASES
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.spec import Spec, format_value, parse_spec
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Light
from shadowbench.scenes.scene_tables import camera_from_table, light_from_table
from shadowbench.strict import explain

Techniques = Mapping[str, type[Subject]]

_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # default factors of a bias sweep


def to_list(value: object) -> list[Any]:
    """A list or tuple as a list; any other value as a list of one."""
    return list(value) if isinstance(value, list | tuple) else [value]


def _factors(written: object) -> list[Any]:
    if isinstance(written, bool):
        return list(_FACTORS) if written else []
    if not (factors := to_list(written)):
        raise ValueError("found an empty list; allowed: true, or numbers above 0")
    return factors


class _Table(BaseModel):
    """A `[[technique]]` table, in whose `model_extra` are its parameters."""

    model_config = ConfigDict(extra="allow", strict=True)

    spec: str
    bias_sweep: Annotated[list[Annotated[float, Field(gt=0, lt=math.inf)]], BeforeValidator(_factors)] = []
    phases: int | None = Field(None, ge=PHASES.least, le=PHASES.most)
    soft: bool | None = None


@dataclass(frozen=True)
class CrossedSpecs:
    """Specs of a `[[technique]]` table, its number of phases (None for the study's), and its bias sweeps.

    sweeps: (spec, factor, spec with its bias multiplied by it), by increasing factor for each spec; soft: whether they
    are measured under lights with a size only, or without one only; None for both.
    """

    specs: tuple[Spec, ...]
    phases: int | None = None
    sweeps: tuple[tuple[Spec, float, Spec], ...] = ()
    soft: bool | None = None


def cross(table: dict[str, Any], techniques: Techniques, where: str, notes: list[str]) -> CrossedSpecs:
    """Specs for every combination of the table's lists.

    Invalid combinations are dropped with a line in `notes`. Raises InputError, its message beginning with `where`, for
    an invalid table and for a value that is valid in no combination.
    """
    try:
        read = _Table.model_validate(table)
    except ValidationError as error:
        raise explain(where, error) from None
    base = parse_spec_at(read.spec, techniques, where)
    lists = {key: to_list(value) for key, value in (read.model_extra or {}).items()}
    _check_lists(lists, base, where)
    dropped: list[InputError] = []
    specs = _combined(base, lists, dropped, where)
    sweeps = [(spec, *variant) for spec in specs for variant in _variants(spec, read.bias_sweep, dropped).items()]
    made = [variant for _, _, variant in sweeps] if read.bias_sweep else specs
    if not made:
        raise InputError(f"{where}: {dropped[0]}")
    notes.extend(dict.fromkeys(f"{where}: dropped: {error}" for error in dropped))
    return CrossedSpecs(tuple(made), read.phases, tuple(sweeps), read.soft)


def _check_lists(lists: Mapping[str, list[Any]], base: Spec, where: str) -> None:
    """Raises InputError for what is no parameter of the technique, and for an empty list."""
    for key, choices in lists.items():
        if key not in base.technique.Params.model_fields:
            names = [*base.technique.Params.model_fields, "bias_sweep", "soft"]
            known = alternatives(key, names, f"parameters of {base.technique.name}")
            raise InputError(f"{where}: unknown parameter {key!r:.60}{known}")
        if not choices:
            raise InputError(f"{where}: {key}: found an empty list; allowed: one value or more")


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
    variants = {}
    for factor in sorted(factors):
        try:
            variants[factor] = _with_bias_times(spec, factor)
        except InputError as error:
            dropped.append(error)
    return variants


def _with_bias_times(spec: Spec, factor: float) -> Spec:
    """The spec with its bias multiplied by a factor. Raises InputError if it has no bias that can be multiplied."""
    bias = getattr(spec.params, "bias", None)
    if not isinstance(bias, Bias) or not any(term.swept for term in bias.terms):
        written = f", found bias={format_value(bias)}" if isinstance(bias, Component) else ""
        raise InputError(f"bias_sweep: {spec.technique.name} has no bias here that can be multiplied{written}")
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


def convert(table: dict[str, Any], where: str, folder: Path, techniques: Techniques, notes: list[str]) -> None:
    """Replace names and tables of a study file by what they stand for; without `technique`, by all techniques.

    folder: base of relative scene paths; notes: receives lines to show to the user. Raises InputError.
    """

    def scene(entry: str, number: int) -> str:
        # A bare word that names no file is a misspelt built-in name, which `load_scene` reports.
        bare = not Path(entry).suffix and Path(entry).name == entry and not os.path.lexists(folder / entry)
        return entry if bare or entry in builtin_names() else str(folder / entry)

    def camera(entry: dict[str, Any], number: int) -> Camera:
        return camera_from_table(entry, f"{where}: views {number}", f"view-{number}")

    def light(entry: dict[str, Any], number: int) -> Light:
        return light_from_table(entry, f"{where}: lights {number}", f"light-{number}")

    def crossed(entry: dict[str, Any], number: int) -> CrossedSpecs:
        return cross(entry, techniques, f"{where}: technique {number}", notes)

    _replace(table, "scenes", scene, (str,), where)
    _replace(table, "views", camera, (dict, str), where)
    _replace(table, "lights", light, (dict, str), where)
    _replace(table, "technique", crossed, (dict,), where)
    if isinstance(table.get("reference"), str):
        table["reference"] = parse_spec_at(table["reference"], techniques, f"{where}: reference")
    if "technique" not in table:
        table["technique"] = [
            CrossedSpecs((parse_spec(name, techniques),), soft=one.catalogue.soft_only or None)
            for name, one in techniques.items()
            if issubclass(one, Technique)
        ]


def _replace(
    table: dict[str, Any], name: str, made: Callable[[Any, int], object], kinds: tuple[type, ...], where: str
) -> None:
    """Replace entries of the first of these types in a list of the table by what is made of them and their number."""
    entries = table.get(name)
    if not isinstance(entries, list):
        return
    for number, entry in enumerate(entries, start=1):
        if not isinstance(entry, kinds):
            allowed = " or ".join("text" if kind is str else "a table" for kind in kinds)
            raise InputError(f"{where}: {name} {number}: found {entry!r:.60}; allowed: {allowed}")
        if isinstance(entry, kinds[0]):
            entries[number - 1] = made(entry, number)
