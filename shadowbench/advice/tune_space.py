"""What `tune` may change: the search space that a technique's parameters declare, a point of it made a spec and back.

A row is a choice of its family with the chosen one's own parameters below it, so the space is conditional.
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

USUAL = ("bias", "filter", "fit")
"""The parameters that are searched where nothing else is said, of those that a technique has."""

REACH = 16.0
"""A number is searched from its default over this to its default times this, on a log scale, within its limits."""

DIGITS = 3  # significant ones that a searched number keeps, so that a spec can be read

Span = tuple[float, float, bool]  # lowest, highest, whether on a log scale


class Space:
    """The searched parameters of a spec; the others stay as they are.

    `refused`: names of rows that no view takes, by parameter; `made`: choices that are made already, by their path.
    """

    def __init__(
        self,
        home: Spec,
        names: Sequence[str],
        refused: Mapping[str, frozenset[str]] | None = None,
        made: Mapping[str, Any] | None = None,
    ) -> None:
        self.home, self.names, self._refused, self._made = home, tuple(names), refused or {}, made or {}
        self._fields = {name: home.technique.Params.model_fields[name] for name in names}

    def spec(self, trial: "Trial") -> Spec:
        """The spec of the point that a trial suggests; raises InputError for values that do not go together."""
        return self.home.with_(**{name: self._suggested(trial, name, info) for name, info in self._fields.items()})

    def point(self, spec: Spec) -> dict[str, Any] | None:
        """The suggestions that make a spec's values; None where one lies outside the space, or of another technique."""
        steps = self._steps(spec)
        if steps is None or not self._made.items() <= {step.path: step.value for step in steps}.items():
            return None
        return {step.path: step.value for step in steps if step.path not in self._made}

    def around(self, spec: Spec) -> "Space":
        """The numbers alone, with the choices that a spec of this space has made."""
        made = {step.path: step.value for step in self._steps(spec) or () if step.choice}
        return Space(self.home, self.names, self._refused, made)

    def _steps(self, spec: Spec) -> "list[Step] | None":
        if spec.technique is not self.home.technique:
            return None
        return self._steps_of(spec.params, self._fields, "")

    def rows(self, name: str) -> list[type[Row]]:
        """The rows that a parameter chooses from; empty for one that is no row."""
        return [row for row in rows_of(self._fields[name]) if row.name not in self._refused.get(name, ())]

    def _suggested(self, trial: "Trial", path: str, info: FieldInfo) -> Any:
        if rows_of(info):
            table = {row.name: row for row in (self.rows(path) if path in self._fields else rows_of(info))}
            row = table[self._choice(trial, path, list(table))]
            return row(
                **{
                    key: self._suggested(trial, f"{path}.{row.name}.{key}", own)
                    for key, own in row.model_fields.items()
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
        return self._made[path] if path in self._made else trial.suggest_categorical(path, choices)

    def _steps_of(
        self, params: TechniqueParams | Row, fields: Mapping[str, FieldInfo], above: str
    ) -> "list[Step] | None":
        steps: list[Step] = []
        for name, info in fields.items():
            value, path = getattr(params, name), above + name
            if isinstance(value, Row):
                if type(value) not in rows_of(info):  # biases that act together
                    return None
                inner = self._steps_of(value, type(value).model_fields, f"{path}.{value.name}.")
                if inner is None or value.name in self._refused.get(path, ()):
                    return None
                steps += [Step(path, value.name, True), *inner]
                continue
            if choices_of(info):
                steps.append(Step(path, value, True))
                continue
            found = span(info)
            if (value != info.default) if found is None else not found[0] <= value <= found[1]:
                return None
            if found is not None:
                steps.append(Step(path, value, False))
        return steps


@dataclass(frozen=True)
class Step:
    """One value of a point: where it stands (`bias.texel.scale`), and whether it is one of a few or a number."""

    path: str
    value: Any
    choice: bool


def rows_of(info: FieldInfo) -> list[type[Row]]:
    """All rows of a field's family; empty for a field that is no row."""
    family = info.annotation
    return list(family.table.values()) if inspect.isclass(family) and issubclass(family, Row) else []


def choices_of(info: FieldInfo) -> list[Any]:
    """The values of a field that has a few; empty for a number or a row."""
    if info.annotation is bool:
        return [False, True]
    return list(get_args(info.annotation)) if get_origin(info.annotation) is Literal else []


def span(info: FieldInfo) -> Span | None:
    """Where a number is searched: around its default, or where that is 0 over its limits; None where it has not both.

    What has no span stays at its default, as lengths in metres do, which belong to a scene and not to a technique.
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
    limits = (getattr(one, name, None) for one in info.metadata for name in names)
    return next((float(limit) for limit in limits if limit is not None), None)


def searched(home: Spec, text: str | None) -> tuple[str, ...]:
    """The parameters that `--params` names, or the usual ones; raises InputError for none, or one that cannot be."""
    fields: Mapping[str, FieldInfo] = home.technique.Params.model_fields
    able = [name for name, info in fields.items() if _searchable(info) and name != "size"]
    none = f"none, as {home.technique.name} has no parameter that can be searched"
    if text is None:
        usual = tuple(name for name in USUAL if name in fields)
        if not usual:
            lacking = f"{', '.join(USUAL[:-1])} or {USUAL[-1]}"
            raise InputError(f"{home.technique.name} has no {lacking}; --params: {', '.join(able) or none}")
        return usual
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    for name in names:
        if name not in able:
            why = "; the map's size is what --map-size states" if name == "size" else ""
            raise InputError(f"--params: found {name!r:.60}{alternatives(name, able, none=none)}{why}")
    return names


def _searchable(info: FieldInfo) -> bool:
    return bool(rows_of(info) or choices_of(info) or span(info))


__all__ = ["REACH", "USUAL", "Space", "choices_of", "rows_of", "searched", "span"]
