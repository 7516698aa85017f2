"""`list`: techniques, scenes, metrics, studies and axes."""

from typing import Annotated, Any

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import Json, Plugins, Quiet

EXAMPLE = "shadow-map:size=2048,filter=pcf(taps=5)"
TOGETHER = "bias=polygon-offset(2,4)+normal-offset"

app = typer.Typer()


@app.command("list")
def list_things(
    what: Annotated[
        str,
        typer.Argument(metavar="WHAT", autocompletion=completion.kind, help=f"{', '.join(completion.KINDS)}  [all]."),
    ] = "",
    name: Annotated[
        str, typer.Argument(metavar="NAME", autocompletion=completion.entry, help="Show only this entry  [all].")
    ] = "",
    plugin: Plugins = None,
    json: Json = False,
    quiet: Quiet = False,
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
    from shadowbench.catalogue import catalogue

    found = catalogue(plugin or (), what, name)
    if json:
        console.print_json(found[what] if what else found)
        return
    for kind, entries in found.items():
        if kind == "techniques":
            _print_techniques(entries)
        elif kind == "axes":
            _print_axes(entries, "" if quiet and what else kind)
        else:
            rows = [[str(value) for value in entry.values()] for entry in entries]
            console.print_table("" if quiet and what else kind, list(entries[0]), rows)
            console.out().print()


def _print_techniques(rows: list[dict[str, Any]]) -> None:
    """Print techniques with their parameters and presets; then biases, filters and fits with theirs."""
    console.out().print(f"A spec is written name:parameter=value,… such as {EXAMPLE}", markup=False)
    console.out().print(f"Biases that are applied together are joined by a plus: {TOGETHER}\n", markup=False)
    families: list[tuple[str, list[dict[str, Any]]]] = []
    for row in rows:
        console.out().print(f"{row['name']}: {row['help']}", markup=False)
        console.out().print(f"  supports {', '.join(row['lights'])} lights", markup=False)
        _print_parameters(row["parameters"], "  ")
        for name, items in row["presets"].items():
            console.out().print(f"  preset={name}: {items}", markup=False)
        console.out().print()
        used = [(one["name"], one["values"]) for one in row["parameters"] if "values" in one]
        families += [family for family in used if family not in families]
    for key, values in families:
        console.out().print(f"{key}=", markup=False)
        for value in values:
            console.out().print(f"  {value['name']}: {value['help']}", markup=False)
            _print_parameters(value["parameters"], "    ")
        console.out().print()


def _print_axes(rows: list[dict[str, Any]], title: str) -> None:
    """Print what each axis varies, its values and its default value."""
    if title:
        console.out().print(title, markup=False)
    for row in rows:
        console.out().print(f"{row['name']}: {row['about']}", markup=False)
        unit = f", {row['unit']}" if row["unit"] else ""
        console.out().print(f"  values{unit}: {' '.join(row['values'])}; default {row['home']}", markup=False)
        console.out().print(f"  swept under {', '.join(row['lights'])} lights", markup=False)
    console.out().print()


def _print_parameters(parameters: list[dict[str, Any]], indent: str) -> None:
    for parameter in parameters:
        allowed = parameter["allowed"] or ", ".join(value["name"] for value in parameter.get("values", ()))
        limits = f" ({allowed})" if allowed else ""
        line = f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}"
        console.out().print(line, markup=False)
