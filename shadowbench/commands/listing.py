"""`list`: every technique, scene, metric, study and stress axis."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from shadowbench.commands import console, options
from shadowbench.errors import InputError, alternatives

if TYPE_CHECKING:
    from shadowbench.extremes.model import Axis
    from shadowbench.plugin.base import Subject
    from shadowbench.plugin.params import Component, TechniqueParams

Entry = dict[str, Any]
KINDS = ("techniques", "engines", "scenes", "metrics", "studies", "axes")
EXAMPLE = "shadow-map:size=2048,filter=pcf(taps=5)"
TOGETHER = "bias=polygon-offset(2,4)+normal-offset"


@options.command(name="list")
def list_things(
    what: Annotated[str, options.argument("WHAT", f"{', '.join(KINDS)}  [all].", lambda: KINDS)] = "",
    name: Annotated[str, options.argument("NAME", "Show only this entry  [all].")] = "",
    plugin: options.Plugins = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """List techniques, scenes, metrics, studies and stress axes.

    Techniques with their parameters and presets, built-in scenes, metrics (columns of result tables), built-in studies,
    and the axes of `stress`, along which it varies a scene.

    \b
    Columns of metrics
      better     whether higher or lower values are better
      for        the kind of shadows that it suits: hard, soft or both
      tolerance  largest change for the worse that `check` allows
    """
    found = catalogue(plugin or (), what, name)
    if json:
        console.print_json(found[what] if what else found)
        return
    for kind, entries in found.items():
        title = "" if quiet and what else kind
        if kind in ("techniques", "engines"):
            _print_techniques(entries)
        elif kind == "axes":
            _print_axes(entries, title)
        else:
            rows = [[str(value) for value in entry.values()] for entry in entries]
            console.print_table(title, list(entries[0]), rows)
            console.print_text("")


def catalogue(plugins: Sequence[Path] = (), what: str = "", name: str = "") -> dict[str, list[Entry]]:
    """The entries of each kind (techniques, scenes, metrics, studies, axes), each with its `name`.

    plugins: Python files that add techniques and metrics; what: only this kind; name: only this entry. Raises
    InputError for an unknown kind or name.
    """
    if what and what not in KINDS:
        raise InputError(f"list: found {what!r:.60}{alternatives(what, KINDS)}")
    found = {kind: _entries(kind, plugins) for kind in KINDS if what in ("", kind)}
    if name:
        for kind, entries in found.items():
            names = [entry["name"] for entry in entries]
            if name not in names:
                raise InputError(f"list {kind}: found {name!r:.60}{alternatives(name, names)}")
            found[kind] = [entries[names.index(name)]]
    return found


def _entries(kind: str, plugins: Sequence[Path]) -> list[Entry]:
    from shadowbench.extremes.axes import AXES
    from shadowbench.measure.flips import ROW_METRICS
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.plugin.registry import engines
    from shadowbench.scenes.library import builtin_about, builtin_light, builtin_names
    from shadowbench.studies.study import find_study, read_study, study_names

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
    return [
        {"name": one.name, "better": one.better, "for": one.kind, "tolerance": one.tolerance, "help": one.help}
        for one in ROW_METRICS.values()
    ]


def _technique(one: "type[Subject]") -> Entry:
    parameters = _parameters(one.Params)
    lights = sorted(one.lights)
    return {"name": one.name, "help": _help(one), "lights": lights, "parameters": parameters, "presets": one.presets}


def _axis(axis: "Axis") -> Entry:
    from shadowbench.extremes.model import value_label

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


def _parameters(model: "type[TechniqueParams] | type[Component]") -> list[Entry]:
    """Name, default, allowed values and help of every field; a component field lists its family with parameters."""
    from shadowbench.plugin.params import Component, allowed
    from shadowbench.plugin.spec import format_value

    found: list[Entry] = []
    for name, info in model.model_fields.items():
        default = format_value(info.default)
        found.append({"name": name, "default": default, "allowed": allowed(info), "help": info.description})
        if isinstance(info.default, Component):
            found[-1]["values"] = [
                {"name": one.name, "help": _help(one), "parameters": _parameters(one)}
                for one in info.default.family().table.values()
            ]
    return found


def _print_techniques(entries: list[Entry]) -> None:
    """Print techniques with their parameters and presets; then biases, filters and fits with theirs."""
    console.print_text(f"A spec is written name:parameter=value,… such as {EXAMPLE}")
    console.print_text(f"Biases that are applied together are joined by a plus: {TOGETHER}\n")
    families: dict[str, list[Entry]] = {}
    for entry in entries:
        console.print_text(f"{entry['name']}: {entry['help']}")
        console.print_text(f"  supports {', '.join(entry['lights'])} lights")
        _print_parameters(entry["parameters"], "  ")
        for name, items in entry["presets"].items():
            console.print_text(f"  preset={name}: {items}")
        console.print_text("")
        families |= {one["name"]: one["values"] for one in entry["parameters"] if "values" in one}
    for key, values in families.items():
        console.print_text(f"{key}=")
        for value in values:
            console.print_text(f"  {value['name']}: {value['help']}")
            _print_parameters(value["parameters"], "    ")
        console.print_text("")


def _print_axes(entries: list[Entry], title: str) -> None:
    """Print what each axis varies, its values and its default value."""
    if title:
        console.print_text(title)
    for entry in entries:
        unit = f", {entry['unit']}" if entry["unit"] else ""
        console.print_text(f"{entry['name']}: {entry['about']}")
        console.print_text(f"  values{unit}: {' '.join(entry['values'])}; default {entry['home']}")
        console.print_text(f"  swept under {', '.join(entry['lights'])} lights")
    console.print_text("")


def _print_parameters(parameters: list[Entry], indent: str) -> None:
    for parameter in parameters:
        allowed = parameter["allowed"] or ", ".join(value["name"] for value in parameter.get("values", ()))
        limits = f" ({allowed})" if allowed else ""
        console.print_text(f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}")
