"""The panel of a technique, made of the widgets of its parameters alone."""

import math
from collections.abc import Collection, Mapping
from typing import Any

from imgui_bundle import imgui

from shadowbench.plugin.base import Technique
from shadowbench.plugin.grammar import parse_value
from shadowbench.plugin.spec import Spec, spec_of
from shadowbench.scenes.geometry import LARGEST
from shadowbench.viewer.widgets import (
    BEYOND,
    CUSTOM,
    Model,
    Widget,
    preset_of,
    presets,
    summary,
    widgets,
    with_inner,
    with_params,
    with_value,
)

DIGITS = 6  # that a slider keeps: its numbers are float32


def edited_spec(spec: Spec, techniques: Mapping[str, type[Technique]]) -> Spec:
    """The spec after this frame's edits. Raises InputError for a value that is not allowed."""
    names = {name: summary(techniques[name]) for name in sorted(techniques)}
    name = choice("technique", spec.technique.name, names)
    if name != spec.technique.name:
        return spec_of(techniques[name], (), name)
    if type(spec.params).model_fields:
        named, now = presets(spec.technique), preset_of(spec)
        helps = {name: one.text.partition(":")[2].replace(",", ", ") for name, one in named.items()}
        chosen = choice("preset", now, helps, "all parameters at once")
        if chosen not in (now, CUSTOM):
            return named[chosen]
    params = edited(spec.params)
    return spec if params is spec.params else with_params(spec, params)


def edited(model: Model) -> Model:
    """Parameters after this frame's edits; the same object if there were none."""
    for widget in widgets(model):
        value = _input(widget)
        if value != widget.value:
            return with_value(model, widget.key, value)
        if widget.inner is not None and type(widget.inner).model_fields:
            imgui.indent()
            imgui.push_id(widget.key)
            inner = edited(widget.inner)  # type: ignore[type-var]  # parameters or a component
            imgui.pop_id()
            imgui.unindent()
            if inner is not widget.inner:
                return with_inner(model, widget.key, inner)
    return model


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
    tooltip("\n".join(line for line in lines if line))
    return value


def tooltip(text: str) -> None:
    """What the last item says when the pointer rests on it."""
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.delay_short):
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(360)
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def number(label: str, value: float, low: float | None, high: float | None, decades: bool = False) -> float:
    """A slider, or without limits a number that is dragged; the value itself unless it was edited."""
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if decades else 0)
    least, most = -LARGEST if low is None else low, min(LARGEST if high is None else high, LARGEST)
    if low is not None and high is not None:
        changed, new = imgui.slider_float(label, value, least, most, "%.6g", flags)
    else:
        changed, new = imgui.drag_float(label, value, max(abs(value), 1e-3) / 100, least, most, "%.6g", flags)
    return float(f"{new:.{DIGITS}g}") if changed and math.isfinite(new) else value  # "nan" can be typed


def _input(widget: Widget) -> Any:
    """Draw a widget and return its value."""
    if widget.kind in ("choice", "component", "spec"):
        return choice(widget.key, widget.value, widget.choices, widget.help)
    if widget.kind == "whole":
        return _whole(widget)
    if widget.kind == "flag":
        value: Any = imgui.checkbox(widget.key, widget.value)[1]
    elif widget.kind == "text":
        changed, text = imgui.input_text(widget.key, widget.value, imgui.InputTextFlags_.enter_returns_true)
        value = parse_value(text) if changed else widget.value
    else:
        value = number(widget.key, widget.value, widget.low, widget.high, widget.decades)
    tooltip(widget.help)
    return value


def _whole(widget: Widget) -> int:
    """A number of the limits, or one that is dragged; of one that spans decades also buttons for half and double."""
    value = int(widget.value)
    if widget.low is None or widget.high is None:
        least = 1 - BEYOND if widget.low is None else int(widget.low)
        flags = imgui.SliderFlags_.always_clamp
        value = int(imgui.drag_int(widget.key, value, 0.1, least, BEYOND - 1, "%d", flags)[1])
        tooltip(widget.help)
        return value
    low, high = max(int(widget.low), 1 - BEYOND), min(int(widget.high), BEYOND - 1)
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if widget.decades else 0)
    value = int(imgui.slider_int(widget.key, value, low, high, "%d", flags)[1])
    tooltip(widget.help)
    if widget.decades:
        for text, factor in (("½", 0.5), ("×2", 2.0)):
            imgui.same_line()
            if imgui.small_button(f"{text}##{widget.key}"):
                value = min(max(int(value * factor), low), high)
    return value
