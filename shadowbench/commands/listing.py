"""`list`: what there is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.table import Table

from shadowbench.commands.console import out, print_json, techniques_with
from shadowbench.errors import InputError
from shadowbench.scenes.library import builtin_about, builtin_names
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.study_file import find_study, read_study, study_names
from shadowbench.techniques.params import Row, TechniqueParams, allowed
from shadowbench.techniques.spec import format_value


def list_command(what: str, plugins: tuple[Path, ...], as_json: bool) -> None:
    """Print the tables, or all of them as one JSON object."""
    makers: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "techniques": lambda: _techniques(plugins),
        "scenes": _scenes,
        "metrics": _metrics,
        "studies": lambda: _studies(plugins),
    }
    if what and what not in makers:
        raise InputError(f"list: found {what!r}; allowed: {', '.join(makers)}")
    listed = {name: make() for name, make in makers.items() if what in ("", name)}
    if as_json:
        print_json(listed[what] if what else listed)
        return
    for name, rows in listed.items():
        _print_techniques(rows) if name == "techniques" else _print_table(name, rows)


def _techniques(plugins: tuple[Path, ...]) -> list[dict[str, Any]]:
    return [
        {
            "name": technique.name,
            "help": " ".join((technique.__doc__ or "").split()),
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
        {"name": metric.name, "better": metric.better, "for": metric.kind, "help": metric.help}
        for metric in METRICS.values()
    ]


def _studies(plugins: tuple[Path, ...]) -> list[dict[str, Any]]:
    return [
        {"name": name, "about": read_study(find_study(name), techniques_with(plugins)).about} for name in study_names()
    ]


def _print_table(name: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=name, title_justify="left", box=None, pad_edge=False)
    for column in rows[0]:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    out.print(table)
    out.print()


def _print_techniques(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        out.print(f"{row['name']}: {row['help']}", markup=False)
        _print_parameters(row["parameters"], "  ")
        for name, items in row["presets"].items():
            out.print(f"  preset={name}: {items}", markup=False)
        out.print()


def _print_parameters(parameters: list[dict[str, Any]], indent: str) -> None:
    for parameter in parameters:
        limits = f" ({parameter['allowed']})" if parameter["allowed"] else ""
        out.print(f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}", markup=False)
        for value in parameter.get("values", ()):
            out.print(f"{indent}  {value['name']}: {value['help']}", markup=False)
            _print_parameters(value["parameters"], indent + "    ")
