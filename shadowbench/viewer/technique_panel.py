"""The panel of a technique, made of its parameters' pydantic models alone, and the widgets that all panels have."""

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, TypeVar, get_args, get_origin

from imgui_bundle import imgui
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum
from shadowbench.plugin.base import Technique
from shadowbench.plugin.grammar import parse_value
from shadowbench.plugin.params import Component, TechniqueParams, allowed
from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, format_value, spec_of
from shadowbench.scenes.geometry import LARGEST
from shadowbench.strict import explain
from shadowbench.studies.crossing import Techniques

BEYOND = 2**30
"""Numbers of this magnitude or more are texts: sliders take 32 bits, and no limits near them."""
DIGITS = 6  # that a slider keeps: its numbers are float32
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


def edited_spec(spec: Spec, techniques: Techniques) -> Spec:
    """The spec after this frame's edits. Raises InputError for a value that is not allowed."""
    name = choice("technique", spec.technique.name, {name: summary(techniques[name]) for name in sorted(techniques)})
    if name != spec.technique.name:
        return spec_of(techniques[name], (), name)
    if type(spec.params).model_fields:
        named, now = presets(spec.technique), preset_of(spec)
        helps = {name: one.text.partition(":")[2].replace(",", ", ") for name, one in named.items()}
        chosen = choice("preset", now, helps, "all parameters at once")
        if chosen not in (now, CUSTOM):
            return named[chosen]
    params = _edited(spec.params)
    return spec if params is spec.params else with_params(spec, params)


def _edited(model: Model) -> Model:
    """Parameters after this frame's edits; the same object if there were none."""
    for widget in widgets(model):
        value = _input(widget)
        if value != widget.value:
            return with_value(model, widget.key, value)
        if widget.inner is not None and type(widget.inner).model_fields:
            imgui.indent()
            imgui.push_id(widget.key)
            inner = _edited(widget.inner)  # type: ignore[type-var]  # parameters or a component
            imgui.pop_id()
            imgui.unindent()
            if inner is not widget.inner:
                return with_inner(model, widget.key, inner)
    return model


def _input(widget: Widget) -> Any:
    """Draw a widget and return its value."""
    value: Any = widget.value
    match widget.kind:
        case "choice" | "component" | "spec":
            return choice(widget.key, value, widget.choices, widget.help)
        case "flag":
            value = imgui.checkbox(widget.key, value)[1]
        case "text":
            changed, text = imgui.input_text(widget.key, value, imgui.InputTextFlags_.enter_returns_true)
            value = parse_value(text) if changed else value
        case "whole":
            return _whole(widget)
        case "number":
            value = number(widget.key, value, widget.low, widget.high, widget.decades)
    tooltip(widget.help)
    return value


def _whole(widget: Widget) -> int:
    """A number of the limits, or one that is dragged; of one that spans decades also buttons for half and double."""
    low = 1 - BEYOND if widget.low is None else max(int(widget.low), 1 - BEYOND)
    high = BEYOND - 1 if widget.high is None else min(int(widget.high), BEYOND - 1)
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if widget.decades else 0)
    if widget.low is None or widget.high is None:
        value = int(imgui.drag_int(widget.key, widget.value, 0.1, low, high, "%d", flags)[1])
    else:
        value = int(imgui.slider_int(widget.key, widget.value, low, high, "%d", flags)[1])
    tooltip(widget.help)
    for text, factor in (("½", 0.5), ("×2", 2.0)) if widget.decades else ():
        imgui.same_line()
        if imgui.small_button(f"{text}##{widget.key}"):
            value = min(max(int(value * factor), low), high)
    return value


def number(label: str, value: float, low: float | None, high: float | None, decades: bool = False) -> float:
    """A slider, or without limits a number that is dragged; the value itself unless it was edited."""
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if decades else 0)
    least, most = -LARGEST if low is None else low, min(LARGEST if high is None else high, LARGEST)
    if low is not None and high is not None:
        changed, new = imgui.slider_float(label, value, least, most, "%.6g", flags)
    else:
        changed, new = imgui.drag_float(label, value, max(abs(value), 1e-3) / 100, least, most, "%.6g", flags)
    return float(f"{new:.{DIGITS}g}") if changed and math.isfinite(new) else value  # "nan" can be typed


def choice(label: str, value: Any, names: Collection[Any], help: str = "") -> Any:
    """A combo box; the value that was chosen. names: as a mapping, with the help of each."""
    helps = names if isinstance(names, Mapping) else {}
    lines = (help, f"{value}: {helps[value]}" if helps.get(value) else "")
    if imgui.begin_combo(label, str(value), imgui.ComboFlags_.height_largest):
        for name in names:
            if imgui.selectable(str(name), name == value)[0]:
                value = name
            tooltip(helps.get(name, ""))
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        imgui.end_combo()
    tooltip("\n".join(filter(None, lines)))
    return value


def tooltip(text: str) -> None:
    """What the last item says when the pointer rests on it."""
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.delay_short):
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(360)
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def widgets(model: BaseModel) -> list[Widget]:
    """The widgets of a technique's or a component's parameters."""
    return [_widget(key, info, getattr(model, key)) for key, info in type(model).model_fields.items()]


def _widget(key: str, info: FieldInfo, value: Any) -> Widget:
    told = allowed(info)
    help = f"{info.description or key}{f' ({told})' if told else ''}"
    if isinstance(value, Component):
        family = type(value).family()
        names = {name: summary(component) for name, component in family.table.items()}
        names |= {SUM: "two that act together"} if issubclass(Sum, family) else {}
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
        return _number(key, info, value, help)
    return Widget(key, "text", format_value(value), help)


def _number(key: str, info: FieldInfo, value: float, help: str) -> Widget:
    low, high = _limit(info, "ge", "gt"), _limit(info, "le", "lt")
    default = info.default if isinstance(info.default, int | float) else value
    decades = low is not None and high is not None and (high - low > 100 or abs(default) < high / 50)
    return Widget(key, "whole" if isinstance(value, int) else "number", value, help, low, high, decades)


def _limit(info: FieldInfo, closed: str, open: str) -> float | None:
    """A limit that a number may reach: of an open one, a millionth of it inside."""
    for one in info.metadata:
        if getattr(one, closed, None) is not None:
            return float(getattr(one, closed))
        if getattr(one, open, None) is not None:
            limit = float(getattr(one, open))
            return limit + (abs(limit) or 1.0) * (1e-6 if open == "gt" else -1e-6)
    return None


def with_value(model: Model, key: str, value: Any) -> Model:
    """A copy of parameters with another value from a widget. Raises InputError for one that is not allowed.

    value: of a component or a spec its name, which gives it its defaults; a sum begins with the bias that was there.
    """
    if value == SUM:
        old = getattr(model, key)
        value = old if isinstance(old, Sum) else Sum(first=old, second=NoBias())
    try:
        return type(model)(**dict(model) | {key: value})
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
