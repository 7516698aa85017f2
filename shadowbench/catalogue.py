"""What `list` prints: every technique, scene, metric, study and stress axis."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError, alternatives
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import value_label
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.plugin.params import Component, TechniqueParams, allowed
from shadowbench.plugin.spec import format_value
from shadowbench.scenes.library import builtin_about, builtin_light, builtin_names
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import find_study, read_study, study_names

Entry = dict[str, Any]


def catalogue(plugins: Sequence[Path] = (), what: str = "", name: str = "") -> dict[str, list[Entry]]:
    """The entries of each kind (techniques, scenes, metrics, studies, axes), each with its `name`.

    plugins: Python files that add techniques; what: only this kind; name: only this entry. Raises InputError for an
    unknown kind or name.
    """
    makers: dict[str, Callable[[], list[Entry]]] = {
        "techniques": lambda: _techniques(techniques_with(plugins)),
        "scenes": lambda: [
            {"name": name, "light": builtin_light(name), "about": builtin_about(name)} for name in builtin_names()
        ],
        "metrics": lambda: _metrics(plugins),
        "studies": lambda: [
            {"name": name, "about": read_study(find_study(name), techniques_with(plugins)).about}
            for name in study_names()
        ],
        "axes": _axes,
    }
    if what and what not in makers:
        raise InputError(f"list: found {what!r:.60}{alternatives(what, makers)}")
    to_list = {kind: make() for kind, make in makers.items() if what in ("", kind)}
    return {kind: _only(name, rows, kind) for kind, rows in to_list.items()} if name else to_list


def _only(name: str, rows: list[Entry], kind: str) -> list[Entry]:
    found = [row for row in rows if row["name"] == name]
    if not found:
        raise InputError(f"list {kind}: found {name!r:.60}{alternatives(name, [row['name'] for row in rows])}")
    return found


def _techniques(known: Techniques) -> list[Entry]:
    return [
        {
            "name": technique.name,
            "help": " ".join((technique.__doc__ or "").split()),
            "lights": sorted(technique.lights),
            "parameters": _parameters(technique.Params),
            "presets": technique.presets,
        }
        for technique in known.values()
    ]


def _parameters(model: type[TechniqueParams] | type[Component]) -> list[Entry]:
    """Name, default, allowed values and help of every field; a component field lists its family with parameters."""
    found = []
    for name, info in model.model_fields.items():
        entry: Entry = {
            "name": name,
            "default": format_value(info.default),
            "allowed": allowed(info),
            "help": info.description,
        }
        if isinstance(info.default, Component):
            entry["values"] = [
                {"name": one.name, "help": " ".join((one.__doc__ or "").split()), "parameters": _parameters(one)}
                for one in info.default.family().table.values()
            ]
        found.append(entry)
    return found


def _metrics(plugins: Sequence[Path]) -> list[Entry]:
    techniques_with(plugins)
    return [
        {
            "name": metric.name,
            "better": metric.better,
            "for": metric.kind,
            "tolerance": metric.tolerance,
            "help": metric.help,
        }
        for metric in ROW_METRICS.values()
    ]


def _axes() -> list[Entry]:
    return [
        {
            "name": axis.name,
            "unit": axis.unit,
            "values": [value_label(value) for value in axis.values],
            "home": value_label(axis.default),
            "lights": list(axis.lights),
            "about": axis.about,
        }
        for axis in AXES.values()
    ]
