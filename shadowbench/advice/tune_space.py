"""Search space of `tune`, derived from a technique's parameters, and conversion of its points to specs and back.

A row parameter is a choice among its family, with the chosen row's parameters below it: a conditional space.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from shadowbench.errors import InputError, alternatives
from shadowbench.techniques.params import Row, TechniqueParams, in_metres
from shadowbench.techniques.spec import Spec

if TYPE_CHECKING:
    from optuna import Trial

DEFAULT_PARAMETERS = ("bias", "filter", "fit")
"""Parameters searched by default, if a technique has them."""

REACH = 16.0
"""Numbers are searched from default / REACH to default · REACH, on a log scale, within their limits."""

DIGITS = 3  # significant digits of searched numbers, for readable specs

Span = tuple[float, float, bool]  # lowest, highest, whether on a log scale


class SearchSpace:
    """Search space over some parameters of a spec; its other parameters are fixed.

    excluded_rows: by parameter, names of rows that are excluded; fixed: by path, choices that are fixed.
    """

    def __init__(
        self,
        base: Spec,
        names: Sequence[str],
        excluded_rows: Mapping[str, frozenset[str]] | None = None,
        fixed: Mapping[str, Any] | None = None,
    ) -> None:
        self.base, self.names, self._excluded_rows, self._fixed = base, tuple(names), excluded_rows or {}, fixed or {}
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
        return SearchSpace(self.base, self.names, self._excluded_rows, fixed)

    def _coordinates(self, spec: Spec) -> "list[Coordinate] | None":
        if spec.technique is not self.base.technique:
            return None
        return self._coordinates_of(spec.params, self._fields, "")

    def rows(self, name: str) -> list[type[Row]]:
        """Rows that a parameter is chosen from; empty if it is no row parameter."""
        return [row for row in rows_of(self._fields[name]) if row.name not in self._excluded_rows.get(name, ())]

    def _suggest(self, trial: "Trial", path: str, info: FieldInfo) -> Any:
        if rows_of(info):
            table = {row.name: row for row in (self.rows(path) if path in self._fields else rows_of(info))}
            row = table[self._choice(trial, path, list(table))]
            return row(
                **{key: self._suggest(trial, f"{path}.{row.name}.{key}", own) for key, own in row.model_fields.items()}
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
        self, params: TechniqueParams | Row, fields: Mapping[str, FieldInfo], prefix: str
    ) -> "list[Coordinate] | None":
        coordinates: list[Coordinate] = []
        for name, info in fields.items():
            value, path = getattr(params, name), prefix + name
            if isinstance(value, Row):
                if type(value) not in rows_of(info):  # a sum of biases
                    return None
                inner = self._coordinates_of(value, type(value).model_fields, f"{path}.{value.name}.")
                if inner is None or value.name in self._excluded_rows.get(path, ()):
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


def rows_of(info: FieldInfo) -> list[type[Row]]:
    """All rows of a field's family; empty if it is no row field."""
    family = info.annotation
    return list(family.table.values()) if inspect.isclass(family) and issubclass(family, Row) else []


def choices_of(info: FieldInfo) -> list[Any]:
    """Values of a Boolean or literal field; empty for a number or a row."""
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
        least, most = info.default / REACH, info.default * REACH
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
    return bool(rows_of(info) or choices_of(info) or span(info))


__all__ = ["DEFAULT_PARAMETERS", "REACH", "SearchSpace", "choices_of", "rows_of", "searched_parameters", "span"]
