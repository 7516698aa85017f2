"""Search space of `tune`, derived from a technique's parameters, and conversion of its points to specs and back.

A component parameter is a choice within its family; the chosen component adds its own parameters to the space.
"""

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from shadowbench.errors import InputError, alternatives
from shadowbench.plugin.params import Component, TechniqueParams, in_metres
from shadowbench.plugin.spec import Spec

if TYPE_CHECKING:
    from optuna import Trial


DEFAULT_PARAMETERS = ("bias", "filter", "fit")
"""Parameters searched by default, if a technique has them."""

SEARCH_FACTOR = 16.0
"""Numbers are searched on a log scale from default / SEARCH_FACTOR to default · SEARCH_FACTOR, within their limits."""

DIGITS = 3  # significant digits of searched numbers, for readable specs

Span = tuple[float, float, bool]  # lowest, highest, whether on a log scale


class SearchSpace:
    """Search space over some parameters of a spec; its other parameters are fixed.

    excluded: by parameter, names of components that are excluded; fixed: by path, choices that are fixed.
    """

    def __init__(
        self,
        base: Spec,
        names: Sequence[str],
        excluded: Mapping[str, frozenset[str]] | None = None,
        fixed: Mapping[str, Any] | None = None,
    ) -> None:
        self.base, self.names, self._excluded, self._fixed = base, tuple(names), excluded or {}, fixed or {}
        self._fields = {name: base.technique.Params.model_fields[name] for name in names}

    def spec(self, trial: "Trial") -> Spec:
        """Spec of the point suggested by a trial. Raises InputError for an invalid combination of values."""
        return self.base.with_(**{name: self._suggest(trial, name, info) for name, info in self._fields.items()})

    def point(self, spec: Spec) -> dict[str, Any] | None:
        """Point of a spec, as suggestions by path; None if it lies outside the space."""
        coordinates = self._coordinates(spec)
        if coordinates is None:
            return None
        values = {coordinate.path: coordinate.value for coordinate in coordinates}
        if not self._fixed.items() <= values.items():
            return None
        return {path: value for path, value in values.items() if path not in self._fixed}

    def around(self, spec: Spec) -> "SearchSpace":
        """The subspace of the numeric parameters, with all choices fixed to those of a spec of this space."""
        fixed = {coordinate.path: coordinate.value for coordinate in self._coordinates(spec) or () if coordinate.choice}
        return SearchSpace(self.base, self.names, self._excluded, fixed)

    def _coordinates(self, spec: Spec) -> "list[Coordinate] | None":
        if spec.technique is not self.base.technique:
            return None
        return self._coordinates_of(spec.params, self._fields, "")

    def components(self, name: str) -> list[type[Component]]:
        """Components that a parameter is chosen from; empty if it is not a component parameter."""
        return [one for one in family_of(self._fields[name]) if one.name not in self._excluded.get(name, ())]

    def _suggest(self, trial: "Trial", path: str, info: FieldInfo) -> Any:
        if family_of(info):
            table = {one.name: one for one in (self.components(path) if path in self._fields else family_of(info))}
            component = table[self._choice(trial, path, list(table))]
            return component(
                **{
                    key: self._suggest(trial, f"{path}.{component.name}.{key}", own)
                    for key, own in component.model_fields.items()
                }
            )
        choices = choices_of(info)
        if choices:
            return self._choice(trial, path, choices)
        found = span(info)
        if found is None:
            return info.default
        low, high, log = found
        if info.annotation is int:
            return trial.suggest_int(path, int(low), int(high), log=log)
        value = float(f"{trial.suggest_float(path, low, high, log=log):.{DIGITS}g}")
        return min(max(value, low), high)

    def _choice(self, trial: "Trial", path: str, choices: list[Any]) -> Any:
        return self._fixed[path] if path in self._fixed else trial.suggest_categorical(path, choices)

    def _coordinates_of(
        self, params: TechniqueParams | Component, fields: Mapping[str, FieldInfo], prefix: str
    ) -> "list[Coordinate] | None":
        coordinates: list[Coordinate] = []
        for name, info in fields.items():
            value, path = getattr(params, name), prefix + name
            if isinstance(value, Component):
                if type(value) not in family_of(info):  # a sum of biases
                    return None
                inner = self._coordinates_of(value, type(value).model_fields, f"{path}.{value.name}.")
                if inner is None or value.name in self._excluded.get(path, ()):
                    return None
                coordinates += [Coordinate(path, value.name, True), *inner]
                continue
            if choices_of(info):
                coordinates.append(Coordinate(path, value, True))
                continue
            found = span(info)
            if (value != info.default) if found is None else not found[0] <= value <= found[1]:
                return None
            if found is not None:
                coordinates.append(Coordinate(path, value, False))
        return coordinates


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of a point: its path (`bias.texel.scale`), value, and whether it is a choice or a number."""

    path: str
    value: Any
    choice: bool


def family_of(info: FieldInfo) -> list[type[Component]]:
    """All components of a field's family; empty if it is not a component field."""
    family = info.annotation
    return list(family.table.values()) if inspect.isclass(family) and issubclass(family, Component) else []


def choices_of(info: FieldInfo) -> list[Any]:
    """Values of a Boolean or literal field; empty for a number or a component."""
    if info.annotation is bool:
        return [False, True]
    return list(get_args(info.annotation)) if get_origin(info.annotation) is Literal else []


def span(info: FieldInfo) -> Span | None:
    """Search range of a number: around its default, or, if that is 0, between its limits; None if it is not searched.

    Lengths in metres are not searched, since they suit a scene rather than a technique.
    """
    if info.annotation not in (int, float) or in_metres(info):
        return None
    low, high = _limit(info, "ge", "gt"), _limit(info, "le", "lt")
    if info.default > 0:
        least, most = info.default / SEARCH_FACTOR, info.default * SEARCH_FACTOR
        if info.annotation is int:
            least = max(1, round(least))
        return (least if low is None else max(low, least), most if high is None else min(high, most), True)
    return None if low is None or high is None else (low, high, False)


def _limit(info: FieldInfo, *names: str) -> float | None:
    limits = (getattr(constraint, name, None) for constraint in info.metadata for name in names)
    return next((float(limit) for limit in limits if limit is not None), None)


def searched_parameters(base: Spec, text: str | None) -> tuple[str, ...]:
    """Parameters named by `--params`, by default DEFAULT_PARAMETERS. Raises InputError if one cannot be searched."""
    fields: Mapping[str, FieldInfo] = base.technique.Params.model_fields
    searchable = [name for name, info in fields.items() if _searchable(info) and name != "size"]
    none = f"none, as {base.technique.name} has no parameter that can be searched"
    if text is None:
        present = tuple(name for name in DEFAULT_PARAMETERS if name in fields)
        if not present:
            lacking = f"{', '.join(DEFAULT_PARAMETERS[:-1])} or {DEFAULT_PARAMETERS[-1]}"
            raise InputError(f"{base.technique.name} has no {lacking}; --params: {', '.join(searchable) or none}")
        return present
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    for name in names:
        if name not in searchable:
            why = "; the map's size is what --map-size states" if name == "size" else ""
            raise InputError(f"--params: found {name!r:.60}{alternatives(name, searchable, none=none)}{why}")
    return names


def _searchable(info: FieldInfo) -> bool:
    return bool(family_of(info) or choices_of(info) or span(info))


__all__ = [
    "DEFAULT_PARAMETERS",
    "SEARCH_FACTOR",
    "SearchSpace",
    "choices_of",
    "family_of",
    "searched_parameters",
    "span",
]


_THIRD = 3  # by default, every third scene is held out


@dataclass(frozen=True)
class SceneSplit:
    """Names of the tuning and the held-out scenes, in the order of the scenes."""

    tuning: tuple[str, ...]
    held_out: tuple[str, ...]


def split_scenes(scenes: Sequence[str], held_out: Sequence[str] = ()) -> SceneSplit:
    """Hold out the named scenes, by default every third in the order of the names' hashes.

    Raises InputError for an unknown name, and unless both parts have a scene.
    """
    for name in held_out:
        if name not in scenes:
            raise InputError(f"--held-out: found {name!r:.60}; allowed are scenes that take part: {', '.join(scenes)}")
    dealt = sorted(scenes, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    kept = held_out or dealt[1::_THIRD]
    tuning = tuple(name for name in scenes if name not in kept)
    if not tuning or not kept:
        raise InputError(
            f"--scenes: {len(tuning)} to tune on, {len(kept)} held out ({', '.join(scenes) or 'none takes part'}); "
            "allowed: at least one of each"
        )
    return SceneSplit(tuning, tuple(name for name in scenes if name in kept))
