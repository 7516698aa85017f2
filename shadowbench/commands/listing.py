"""`list`: what there is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.table import Table

from shadowbench.commands.console import out, print_json, print_table, techniques_with
from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.library import builtin_about, builtin_names
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.file import find_study, read_study, study_names
from shadowbench.techniques.params import Row, TechniqueParams, allowed
from shadowbench.techniques.spec import format_value

EXAMPLE = "shadow-map:size=2048,filter=pcf(taps=5)"
TOGETHER = "bias=polygon-offset(2,4)+normal-offset"


def list_command(what: str, plugins: tuple[Path, ...], as_json: bool, quiet: bool, name: str = "") -> None:
    """Print the tables, or all of them as one JSON object; `quiet` leaves out the title of one that was asked for.

    `name` is one of `what`, to be shown alone.
    """
    makers: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "techniques": lambda: _techniques(plugins),
        "scenes": _scenes,
        "metrics": _metrics,
        "studies": lambda: _studies(plugins),
    }
    if what and what not in makers:
        raise InputError(f"list: found {what!r:.60}{alternatives(what, makers)}")
    listed = {kind: make() for kind, make in makers.items() if what in ("", kind)}
    if name:
        listed = {kind: _only(name, rows, kind) for kind, rows in listed.items()}
    if as_json:
        print_json(listed[what] if what else listed)
        return
    for kind, rows in listed.items():
        _print_techniques(rows) if kind == "techniques" else _print_table("" if quiet and what else kind, rows)


def _only(name: str, rows: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    found = [row for row in rows if row["name"] == name]
    if not found:
        raise InputError(f"list {kind}: found {name!r:.60}{alternatives(name, [row['name'] for row in rows])}")
    return found


def _techniques(plugins: tuple[Path, ...]) -> list[dict[str, Any]]:
    return [
        {
            "name": technique.name,
            "help": " ".join((technique.__doc__ or "").split()),
            "lights": sorted(technique.lights),
            "parameters": _parameters(technique.Params),
            "presets": technique.presets,
        }
        for technique in techniques_with(plugins).values()
    ]


def _parameters(model: type[TechniqueParams] | type[Row]) -> list[dict[str, Any]]:
    """Name, default, help and values of every field; a row's field lists its rows, each with its own parameters."""
    found = []
    for name, info in model.model_fields.items():
        entry: dict[str, Any] = {
            "name": name,
            "default": format_value(info.default),
            "allowed": allowed(info),
            "help": info.description,
        }
        if isinstance(info.default, Row):
            entry["values"] = [
                {"name": row.name, "help": " ".join((row.__doc__ or "").split()), "parameters": _parameters(row)}
                for row in info.default.family().table.values()
            ]
        found.append(entry)
    return found


def _scenes() -> list[dict[str, Any]]:
    return [{"name": name, "about": builtin_about(name)} for name in builtin_names()]


def _metrics() -> list[dict[str, Any]]:
    return [
        {
            "name": metric.name,
            "better": metric.better,
            "for": metric.kind,
            "tolerance": metric.tolerance,
            "help": metric.help,
        }
        for metric in METRICS.values()
    ]


def _studies(plugins: tuple[Path, ...]) -> list[dict[str, Any]]:
    return [
        {"name": name, "about": read_study(find_study(name), techniques_with(plugins)).about} for name in study_names()
    ]


def _print_table(title: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
    for column in rows[0]:
        table.add_column(column)
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    print_table(table)
    out.print()


def _print_techniques(rows: list[dict[str, Any]]) -> None:
    """Each with its parameters and presets; then what may stand for a bias, a filter, a fit, each kind once."""
    out.print(f"Written name:parameter=value,… such as {EXAMPLE}", markup=False)
    out.print(f"Biases that act together are joined by a plus: {TOGETHER}\n", markup=False)
    families: list[tuple[str, list[dict[str, Any]]]] = []
    for row in rows:
        out.print(f"{row['name']}: {row['help']}", markup=False)
        out.print(f"  answers lights that are {', '.join(row['lights'])}", markup=False)
        _print_parameters(row["parameters"], "  ")
        for name, items in row["presets"].items():
            out.print(f"  preset={name}: {items}", markup=False)
        out.print()
        used = [(one["name"], one["values"]) for one in row["parameters"] if "values" in one]
        families += [family for family in used if family not in families]
    for key, values in families:
        out.print(f"{key}=", markup=False)
        for value in values:
            out.print(f"  {value['name']}: {value['help']}", markup=False)
            _print_parameters(value["parameters"], "    ")
        out.print()


def _print_parameters(parameters: list[dict[str, Any]], indent: str) -> None:
    for parameter in parameters:
        allowed = parameter["allowed"] or ", ".join(value["name"] for value in parameter.get("values", ()))
        limits = f" ({allowed})" if allowed else ""
        out.print(f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}", markup=False)
