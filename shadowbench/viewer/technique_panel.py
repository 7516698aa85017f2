"""The panel of a technique, made of its parameters' pydantic models alone, and the widgets that all panels have."""

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import cache
from typing import Any, Literal, TypeVar, get_args, get_origin

from imgui_bundle import imgui
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.grammar import parse_value
from shadowbench.plugin.params import Component, TechniqueParams, allowed
from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, format_value, spec_of
from shadowbench.scenes.triangles import LARGEST
from shadowbench.strict import explain
from shadowbench.studies.crossing import Techniques

BEYOND = 2**30
"""Numbers of this magnitude or more are texts: sliders take 32 bits, and no limits near them."""
DIGITS = 6  # that a slider keeps: its numbers are float32
SUM = "+"  # the name of the sum of two biases
DEFAULT, CUSTOM = "default", "custom"  # beside the names of presets
Model = TypeVar("Model", TechniqueParams, Component)


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
    for key, info in type(model).model_fields.items():
        value = getattr(model, key)
        shown = name_of(value)
        new = _input(key, info, shown, choices_of(info, value))
        if new != shown:
            return with_value(model, key, new)
        inner = value.params if isinstance(value, Spec) else value
        if isinstance(inner, BaseModel) and type(inner).model_fields:
            imgui.indent()
            imgui.push_id(key)
            changed = _edited(inner)  # type: ignore[type-var]  # parameters or a component
            imgui.pop_id()
            imgui.unindent()
            if changed is not inner:
                return with_inner(model, key, changed)
    return model


def name_of(value: Any) -> Any:
    """What is shown of a value: of a component or a spec its name."""
    if isinstance(value, Component):
        return SUM if isinstance(value, Sum) else value.name
    return value.technique.name if isinstance(value, Spec) else value


def choices_of(info: FieldInfo, value: Any) -> Mapping[Any, str]:
    """What a parameter is chosen from: components, techniques or words, each with its help; empty if it is entered."""
    if isinstance(value, Component):
        family = type(value).family()
        names = {name: summary(component) for name, component in family.table.items()}
        return names | ({SUM: "two that act together"} if issubclass(Sum, family) else {})
    if isinstance(value, Spec):
        return {one.name: summary(one) for one in own_techniques() if not one.catalogue.soft_only}
    return dict.fromkeys(get_args(info.annotation), "") if get_origin(info.annotation) is Literal else {}


def _input(key: str, info: FieldInfo, value: Any, choices: Mapping[Any, str]) -> Any:
    """Draw the widget of a parameter and return its value."""
    told = allowed(info)
    help = f"{info.description or key}{f' ({told})' if told else ''}"
    if choices:
        return choice(key, value, choices, help)
    is_slid = isinstance(value, int | float) and abs(value) < BEYOND
    if isinstance(value, bool):
        value = imgui.checkbox(key, value)[1]
    elif is_slid and isinstance(value, int):
        return _whole(key, info, value, help)
    elif is_slid:
        value = number(key, value, *limits(info), _spans_decades(info, value))
    else:  # every type without a widget of its own: as in a spec
        changed, text = imgui.input_text(key, format_value(value), imgui.InputTextFlags_.enter_returns_true)
        value = parse_value(text) if changed else value
    tooltip(help)
    return value


def _whole(key: str, info: FieldInfo, value: int, help: str) -> int:
    """A number of the limits, or one that is dragged; of one that spans decades also buttons for half and double."""
    low, high = limits(info)
    least = 1 - BEYOND if low is None else max(int(low), 1 - BEYOND)
    most = BEYOND - 1 if high is None else min(int(high), BEYOND - 1)
    decades = _spans_decades(info, value)
    if low is None or high is None:
        value = int(imgui.drag_int(key, value, 0.1, least, most, "%d", imgui.SliderFlags_.always_clamp)[1])
    else:
        value = int(imgui.slider_int(key, value, least, most, "%d", _flags(decades))[1])
    tooltip(help)
    for text, factor in (("½", 0.5), ("×2", 2.0)) if decades else ():
        imgui.same_line()
        if imgui.small_button(f"{text}##{key}"):
            value = min(max(int(value * factor), least), most)
    return value


def _flags(decades: bool) -> int:
    return int(imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if decades else 0))


def _spans_decades(info: FieldInfo, value: float) -> bool:
    """Whether a number's range, or the place of its default in it, asks for a logarithmic slider."""
    low, high = limits(info)
    default = info.default if isinstance(info.default, int | float) else value
    return low is not None and high is not None and (high - low > 100 or abs(default) < high / 50)


def limits(info: FieldInfo) -> tuple[float | None, float | None]:
    """The limits that a number may reach, None if there is none: of an open one, a millionth of it inside."""
    found: dict[str, float] = {}
    for constraint in info.metadata:
        for name, end, inside in (("ge", "low", 0.0), ("gt", "low", 1e-6), ("le", "high", 0.0), ("lt", "high", -1e-6)):
            limit = getattr(constraint, name, None)
            if limit is not None:
                found[end] = limit + (abs(limit) or 1.0) * inside
    return found.get("low"), found.get("high")


def number(label: str, value: float, low: float | None, high: float | None, decades: bool = False) -> float:
    """A slider, or without limits a number that is dragged; the value itself unless it was edited."""
    least, most = -LARGEST if low is None else low, min(LARGEST if high is None else high, LARGEST)
    if low is not None and high is not None:
        changed, new = imgui.slider_float(label, value, least, most, "%.6g", _flags(decades))
    else:
        changed, new = imgui.drag_float(label, value, max(abs(value), 1e-3) / 100, least, most, "%.6g", _flags(decades))
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


def summary(one: type[Subject | Component]) -> str:
    """The first line of a docstring; empty if there is none."""
    return (one.__doc__ or "").partition("\n")[0]
