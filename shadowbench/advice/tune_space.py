"""Search space of `tune`, derived from a technique's parameters, and conversion of its points to specs and back.

A component parameter is a choice within its family; the chosen component adds its own parameters to the space.
"""

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from shadowbench.errors import InputError, alternatives
from shadowbench.plugin.params import Component, in_metres
from shadowbench.plugin.spec import Spec

if TYPE_CHECKING:
    from optuna.trial import BaseTrial

DEFAULT_PARAMETERS = ("bias", "filter", "fit")
"""Parameters searched by default, if a technique has them."""

DEFAULT_OF_ENGINES = ("bias", "normal_bias", "slope_bias", "offset", "cast", "cull", "back_faces")
"""Of another engine, those that cost nothing: its work is not counted."""

SEARCH_FACTOR = 16.0
"""Numbers are searched on a log scale from default / SEARCH_FACTOR to default · SEARCH_FACTOR, within their limits."""

DIGITS = 3  # significant digits of searched numbers, for readable specs
_THIRD = 3  # by default, every third scene is held out


class SearchSpace:
    """Search space over some parameters of a spec; its other parameters are fixed.

    excluded: by parameter, names of components that are excluded; fixed: by path (`bias.texel.scale`), choices that are
    fixed.
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

    def spec(self, trial: "BaseTrial | _SpecTrial") -> Spec:
        """Spec of the point suggested by a trial. Raises InputError for an invalid combination of values."""
        return self.base.with_(**{name: self._suggest(trial, name, info) for name, info in self._fields.items()})

    def point(self, spec: Spec) -> dict[str, Any] | None:
        """Point of a spec, as suggestions by path; None if it lies outside the space."""
        asked = self._asked(spec)
        return None if asked is None else asked.choices | asked.numbers

    def around(self, spec: Spec) -> "SearchSpace":
        """The subspace of the numeric parameters, with all choices fixed to those of a spec of this space."""
        asked = self._asked(spec)
        return SearchSpace(self.base, self.names, self._excluded, asked.choices if asked else {})

    def components(self, name: str) -> list[type[Component]]:
        """Components that a parameter is chosen from; empty if it is not a component parameter."""
        return [one for one in family_of(self._fields[name]) if one.name not in self._excluded.get(name, ())]

    def _asked(self, spec: Spec) -> "_SpecTrial | None":
        """A spec's values of the space's parameters; None if it lies outside the space."""
        asked = _SpecTrial(spec)
        try:
            made = self.spec(asked).params if spec.technique is self.base.technique else None
        except InputError:
            return None
        same = made is not None and all(getattr(made, name) == getattr(spec.params, name) for name in self.names)
        return asked if same else None

    def _suggest(self, trial: "BaseTrial | _SpecTrial", path: str, info: FieldInfo) -> Any:
        if family_of(info):
            table = {one.name: one for one in (self.components(path) if path in self._fields else family_of(info))}
            component = table[self._choice(trial, path, list(table))]
            fields = component.model_fields.items()
            return component(
                **{key: self._suggest(trial, f"{path}.{component.name}.{key}", own) for key, own in fields}
            )
        choices, found = choices_of(info), span(info)
        if choices:
            return self._choice(trial, path, choices)
        if found is None:
            return info.default
        low, high, log = found
        if info.annotation is int:
            return trial.suggest_int(path, int(low), int(high), log=log)
        value = float(f"{trial.suggest_float(path, low, high, log=log):.{DIGITS}g}")
        return min(max(value, low), high)

    def _choice(self, trial: "BaseTrial | _SpecTrial", path: str, choices: list[Any]) -> Any:
        return self._fixed[path] if path in self._fixed else trial.suggest_categorical(path, choices)


class _SpecTrial:
    """Suggests what a spec has, and keeps it by path. Raises InputError for what is not allowed."""

    def __init__(self, spec: Spec) -> None:
        self._params = spec.params
        self.choices: dict[str, Any] = {}
        self.numbers: dict[str, Any] = {}

    def suggest_categorical(self, name: str, choices: Sequence[Any]) -> Any:
        value = self._value(name)
        self.choices[name] = getattr(value, "name", "+") if isinstance(value, Component) else value  # + is a sum
        if self.choices[name] not in choices:
            raise InputError(f"{name}: found {value}")
        return self.choices[name]

    def suggest_float(self, name: str, low: float, high: float, *, log: bool) -> Any:
        self.numbers[name] = self._value(name)
        if not low <= self.numbers[name] <= high:
            raise InputError(f"{name}: found {self.numbers[name]}")
        return self.numbers[name]

    suggest_int = suggest_float

    def _value(self, path: str) -> Any:
        try:
            return reduce(getattr, path.split(".")[::2], self._params)  # between them the components' names
        except AttributeError:  # of a component that is fixed, where the spec has another one
            raise InputError(f"{path}: found none") from None


def family_of(info: FieldInfo) -> list[type[Component]]:
    """All components of a field's family; empty if it is not a component field."""
    family = info.annotation
    return list(family.table.values()) if inspect.isclass(family) and issubclass(family, Component) else []


def choices_of(info: FieldInfo) -> list[Any]:
    """Values of a Boolean or literal field; empty for a number or a component."""
    if info.annotation is bool:
        return [False, True]
    return list(get_args(info.annotation)) if get_origin(info.annotation) is Literal else []


def span(info: FieldInfo) -> tuple[float, float, bool] | None:
    """Lowest and highest value to search of a number, and whether on a log scale; None if it is not searched.

    It is searched where it says, else around its default, or, if that is 0, between its limits; lengths in metres are
    not searched, since they suit a scene rather than a technique.
    """
    extra: Any = info.json_schema_extra
    if told := isinstance(extra, dict) and extra.get("search"):
        return told[0], told[1], False
    if info.annotation not in (int, float) or in_metres(info):
        return None
    low, high, below = _limit(info, "ge", "gt"), _limit(info, "le"), _limit(info, "lt")
    if below is not None:  # which rounding must not reach
        high = below * (1 - 10**-DIGITS)
    if info.default <= 0:
        return None if low is None or high is None else (low, high, False)
    least, most = info.default / SEARCH_FACTOR, info.default * SEARCH_FACTOR
    if info.annotation is int:
        least = max(1, round(least))
    return (least if low is None else max(low, least), most if high is None else min(high, most), True)


def _limit(info: FieldInfo, *names: str) -> float | None:
    limits = (getattr(constraint, name, None) for constraint in info.metadata for name in names)
    return next((float(limit) for limit in limits if limit is not None), None)


def searched_parameters(base: Spec, text: str | None) -> tuple[str, ...]:
    """Parameters named by `--params`, by default DEFAULT_PARAMETERS. Raises InputError if one cannot be searched."""
    fields: Mapping[str, FieldInfo] = base.technique.Params.model_fields
    searchable = [
        name for name, info in fields.items() if name != "size" and (family_of(info) or choices_of(info) or span(info))
    ]
    none = f"none, as {base.technique.name} has no parameter that can be searched"
    if text is None:
        wanted = DEFAULT_PARAMETERS if base.technique.own else DEFAULT_OF_ENGINES
        present = tuple(name for name in wanted if name in (fields if base.technique.own else searchable))
        if not present:
            raise InputError(
                f"{base.technique.name} has no bias, filter or fit; --params: {', '.join(searchable) or none}"
            )
        return present
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    for name in names:
        if name not in searchable:
            why = "; the map's size is what --map-size states" if name == "size" else ""
            raise InputError(f"--params: found {name!r:.60}{alternatives(name, searchable, none=none)}{why}")
    return names


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
