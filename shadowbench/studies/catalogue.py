"""What there is: every technique, engine, scene, metric, study, stress axis and device, and what is said of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError, alternatives
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import Axis, value_label
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.options import KINDS
from shadowbench.plugin.base import Subject
from shadowbench.plugin.params import Component, SubjectParams, allowed
from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import format_value
from shadowbench.results.law import laws
from shadowbench.scenes.library import builtin_about, builtin_light, builtin_names
from shadowbench.studies.study import find_study, read_study, study_names

Entry = dict[str, Any]
"""What there is, by name, with further fields by kind."""


def catalogue(plugins: Sequence[Path] = (), what: str = "", name: str = "") -> dict[str, list[Entry]]:
    """The entries of each kind (techniques, engines, scenes, metrics, studies, axes, devices), each with its `name`.

    plugins: Python files that add techniques and metrics; what: only this kind; name: only this entry. Raises
    InputError for an unknown kind or name.
    """
    listed = {kind: entries(kind, plugins) for kind in ([what] if what else KINDS)}
    if name:
        for kind, every in listed.items():
            names = [entry["name"] for entry in every]
            if name not in names:
                raise InputError(f"list {kind}: found {name!r:.60}{alternatives(name, names)}")
            listed[kind] = [every[names.index(name)]]
    return listed


def entries(kind: str, plugins: Sequence[Path] = ()) -> list[Entry]:
    """What there is of one of KINDS. plugins: Python files that add techniques and metrics. Raises InputError."""
    if kind not in KINDS:
        raise InputError(f"list: found {kind!r:.60}{alternatives(kind, KINDS)}")
    known = techniques_with(plugins)
    if kind == "techniques":
        return [_technique(one) for one in known.values()]
    if kind == "engines":
        return [_technique(one) for one in engines().values()]
    if kind == "scenes":
        return [{"name": name, "light": builtin_light(name), "about": builtin_about(name)} for name in builtin_names()]
    if kind == "studies":
        return [{"name": name, "about": read_study(find_study(name), known).about} for name in study_names()]
    if kind == "axes":
        return [_axis(axis) for axis in AXES.values()]
    if kind == "devices":
        return [{"name": law.device, "cells": law.cells, "timed": law.timed} for law in laws().values()]
    return [
        {"name": one.name, "better": one.better, "for": one.kind, "tolerance": one.tolerance, "help": one.help}
        for one in ROW_METRICS.values()
    ]


def _technique(one: type[Subject]) -> Entry:
    parameters = _parameters(one.Params)
    lights = sorted(one.lights)
    return {"name": one.name, "help": _help(one), "lights": lights, "parameters": parameters, "presets": one.presets}


def _axis(axis: Axis) -> Entry:
    return {
        "name": axis.name,
        "unit": axis.unit,
        "values": [value_label(value) for value in axis.values],
        "home": value_label(axis.default),
        "lights": list(axis.lights),
        "about": axis.about,
    }


def _help(described: type) -> str:
    return " ".join((described.__doc__ or "").split())


def _parameters(model: type[SubjectParams] | type[Component]) -> list[Entry]:
    """Name, default, allowed values and help of every field; a component field lists its family with parameters."""
    listed: list[Entry] = []
    for name, info in model.model_fields.items():
        default = format_value(info.default)
        listed.append({"name": name, "default": default, "allowed": allowed(info), "help": info.description})
        if isinstance(info.default, Component):
            listed[-1]["values"] = [
                {"name": one.name, "help": _help(one), "parameters": _parameters(one), "presets": one.presets}
                for one in info.default.family().table.values()
            ]
    return listed
