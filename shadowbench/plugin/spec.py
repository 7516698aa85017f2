"""Parsing and formatting of specs: `shadow-map:bias=slope(max=0.05,min=0.005),filter=pcf(taps=3)`.

`preset=NAME` expands to the technique's parameters of that preset; later items override them. A formatted spec
contains no preset, and `parse_spec(spec.text, …) == spec`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, cast

from pydantic import ValidationError

from shadowbench.errors import InputError, alternatives
from shadowbench.plugin.params import (
    Component,
    Items,
    Reader,
    SubjectParams,
    components_of,
    format_items,
    parameters_of,
)
from shadowbench.plugin.params import format_value as format_value
from shadowbench.strict import explain

if TYPE_CHECKING:
    from shadowbench.plugin.base import Subject, Technique


@dataclass(frozen=True, eq=False)
class Spec:
    """A technique or engine and its parameters, compared as text. `explicit`: keys set by the user or by a preset."""

    technique: "type[Subject]"
    params: SubjectParams
    explicit: frozenset[str] = frozenset()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Spec) and (self.technique, self.full_text) == (other.technique, other.full_text)

    def __hash__(self) -> int:
        return hash((self.technique, self.full_text))

    @cached_property
    def text(self) -> str:
        """The spec as text, without parameters at their defaults."""
        return self._with_items(format_items(self.params))

    @cached_property
    def full_text(self) -> str:
        """The spec as text with all parameters."""
        return self._with_items(format_items(self.params, full=True))

    @cached_property
    def sizeless_text(self) -> str:
        """`text` without the map size, which has a column of its own in rows and tables."""
        return self._with_items(format_items(self.params, skip="size"))

    def _with_items(self, items: str) -> str:
        return f"{self.technique.name}:{items}" if items else self.technique.name

    def written(self, full: bool = False) -> str:
        """The spec as a value in another: `cube-map(size=512)`."""
        name, _, items = (self.full_text if full else self.text).partition(":")
        return f"{name}({items})" if items else name

    @property
    def drawn_here(self) -> "type[Technique]":
        """The technique. Raises InputError for another engine, which draws in a program of its own."""
        if not self.technique.own:
            raise InputError(f"{self.technique.name}: found another engine; allowed: a technique of shadowbench")
        return cast("type[Technique]", self.technique)

    @property
    def techniques(self) -> "tuple[type[Subject], ...]":
        """The technique, those that its parameters name, and those that they build on."""
        return tuple(used for one in self._specs for used in (one.technique, *one.technique.catalogue.builds_on))

    @property
    def components(self) -> tuple[Component, ...]:
        """The components among its parameters, and those of the specs and components among them."""
        return tuple(component for one in self._specs for component in components_of(one.params))

    @property
    def _specs(self) -> "tuple[Spec, ...]":
        values = (getattr(self.params, key) for key in type(self.params).model_fields)
        return (self, *(one for value in values if isinstance(value, Spec) for one in value._specs))

    @property
    def map_size(self) -> int | None:
        """Texels along a side of the technique's map; None for a technique without one."""
        return self.technique.map_size(self.params)

    def with_(self, **changes: Any) -> "Spec":
        """A copy with other parameter values. Raises InputError for invalid ones."""
        values = {key: getattr(self.params, key) for key in type(self.params).model_fields} | changes
        params = _validated(self.technique, values, self.technique.name)
        return replace(self, params=params, explicit=self.explicit | set(changes))


def has_size(technique: "type[Subject]") -> bool:
    """Whether a technique has a `size` parameter."""
    return "size" in technique.Params.model_fields


def parse_spec(text: str, techniques: "Mapping[str, type[Subject]]") -> Spec:
    """Parse a spec; results are cached. Raises InputError that lists the allowed values."""
    reader = Reader(text)
    name = reader.token("word")
    if name is None:
        raise reader.fail("a technique's name")
    if name not in techniques:
        own_first = sorted(techniques, key=lambda one: (not techniques[one].own, one))
        raise InputError(f"unknown technique {name!r:.60}{alternatives(name, own_first)}")
    return _parsed(text, techniques[name])


def forget_parsed() -> None:
    """Parse every spec anew: one whose components were loaded again must not keep the old ones."""
    _parsed.cache_clear()


@cache
def _parsed(text: str, technique: "type[Subject]") -> Spec:
    reader = Reader(text)
    reader.token("word")
    items = reader.items() if reader.token("mark", ":") else ()
    reader.end()
    return spec_of(technique, items, text)


def spec_of(technique: "type[Subject]", items: Items, where: str) -> Spec:
    """The spec of (key, value) items, with presets expanded. Raises InputError that quotes `where`."""
    values: dict[str, Any] = {}
    named = [(str(key), value) for key, value in items]
    for index, (key, value) in enumerate(named):
        if key in dict(named[:index]):
            raise InputError(f"spec {where!r:.300}: {key} is given twice")
        if key == "preset":
            if value not in technique.presets:
                known = alternatives(value, technique.presets, f"presets of {technique.name}")
                raise InputError(f"spec {where!r:.300}: unknown preset '{value!s:.60}'{known}")
            if preset := technique.presets[value]:  # else the defaults
                values |= parameters_of(f"{technique.name}:{preset}")[1]
        else:
            values[key] = value
    return Spec(technique, _validated(technique, values, f"spec {where!r:.300}"), frozenset(values))


def _validated(technique: "type[Subject]", values: dict[str, Any], where: str) -> SubjectParams:
    try:
        return technique.Params(**values)
    except ValidationError as error:
        raise explain(where, error) from None
