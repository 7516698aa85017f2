"""The widgets of a technique's parameters, from their pydantic models alone: what a panel draws, without a window."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component, TechniqueParams, allowed
from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, format_value, spec_of
from shadowbench.strict import explain

BEYOND = 2**30
"""Numbers of this magnitude or more are texts: sliders take 32 bits, and no limits near them."""
SUM = "+"  # the name of the sum of two biases
DEFAULT, CUSTOM = "default", "custom"  # beside the names of presets
Model = TypeVar("Model", TechniqueParams, Component)
Kind = Literal["flag", "choice", "whole", "number", "component", "spec", "text"]


@dataclass(frozen=True)
class Widget:
    """The widget of one parameter.

    value: of the parameter; of a component or a spec its name; of a text, the kind of every type without a widget of
    its own, what a spec says and `parse_value` reads; low, high: limits of a number, None if there is none; decades:
    whether a number's range, or the place of its default in it, asks for a logarithmic slider; choices: of a choice,
    the names of components or of techniques, each with its help; help: with what is allowed; inner: the model whose
    widgets unfold below.
    """

    key: str
    kind: Kind
    value: Any
    help: str
    low: float | None = None
    high: float | None = None
    decades: bool = False
    choices: Mapping[Any, str] = field(default_factory=dict)
    inner: BaseModel | None = None


def widgets(model: BaseModel) -> list[Widget]:
    """The widgets of a technique's or a component's parameters."""
    return [_widget(key, info, getattr(model, key)) for key, info in type(model).model_fields.items()]


def with_value(model: Model, key: str, value: Any) -> Model:
    """A copy of parameters with another value from a widget. Raises InputError for one that is not allowed.

    value: of a component or a spec its name, which gives it its defaults; a sum begins with the bias that was there.
    """
    values = {name: getattr(model, name) for name in type(model).model_fields}
    if value == SUM:
        old = values[key]
        value = old if isinstance(old, Sum) else Sum(first=old, second=NoBias())
    try:
        return type(model)(**values | {key: value})
    except ValidationError as error:
        raise explain(f"{key}={format_value(value)}", error) from None


def with_inner(model: Model, key: str, inner: Any) -> Model:
    """A copy of parameters with other parameters of the component or the spec that one of them is."""
    old = getattr(model, key)
    return with_value(model, key, with_params(old, inner) if isinstance(old, Spec) else inner)


def with_params(spec: Spec, params: TechniqueParams) -> Spec:
    """A spec with other parameters."""
    return Spec(spec.technique, params, frozenset(type(params).model_fields))


@cache
def presets(technique: type[Technique]) -> Mapping[str, Spec]:
    """A technique's defaults, as the preset DEFAULT unless a parameter has none, and its presets."""
    named = {}
    for name in (DEFAULT, *technique.presets):
        with suppress(InputError):  # a parameter that must be given
            named[name] = spec_of(technique, (() if name == DEFAULT else (("preset", name),)), technique.name)
    return named


def preset_of(spec: Spec) -> str:
    """The preset whose parameters a spec has; CUSTOM if there is none."""
    return next((name for name, one in presets(spec.technique).items() if one.params == spec.params), CUSTOM)


def summary(one: type[Technique | Component]) -> str:
    """The first line of a docstring; empty if there is none."""
    return (one.__doc__ or "").partition("\n")[0]


def _widget(key: str, info: FieldInfo, value: Any) -> Widget:
    told = allowed(info)
    help = f"{info.description or key}{f' ({told})' if told else ''}"
    if isinstance(value, Component):
        family = type(value).family()
        names = {name: summary(component) for name, component in family.table.items()}
        if issubclass(Sum, family):
            names[SUM] = "two that act together"
        name = SUM if isinstance(value, Sum) else value.name
        return Widget(key, "component", name, help, choices=names, inner=value)
    if isinstance(value, Spec):
        names = {one.name: summary(one) for one in own_techniques() if not one.catalogue.soft_only}
        return Widget(key, "spec", value.technique.name, help, choices=names, inner=value.params)
    if get_origin(info.annotation) is Literal:
        return Widget(key, "choice", value, help, choices=dict.fromkeys(get_args(info.annotation), ""))
    if isinstance(value, bool):
        return Widget(key, "flag", value, help)
    if isinstance(value, int | float) and abs(value) < BEYOND:
        kind: Kind = "whole" if isinstance(value, int) else "number"
        low, high = _limit(info, "ge", "gt"), _limit(info, "le", "lt")
        default = info.default if isinstance(info.default, int | float) else value
        decades = low is not None and high is not None and (high - low > 100 or abs(default) < high / 50)
        return Widget(key, kind, value, help, low, high, decades)
    return Widget(key, "text", format_value(value), help)


def _limit(info: FieldInfo, closed: str, open: str) -> float | None:
    """A limit that a number may reach: of an open one, a millionth of it inside."""
    for one in info.metadata:
        if getattr(one, closed, None) is not None:
            return float(getattr(one, closed))
        if getattr(one, open, None) is not None:
            limit = float(getattr(one, open))
            return limit + (abs(limit) or 1.0) * (1e-6 if open == "gt" else -1e-6)
    return None
