"""`list`: what there is."""

from typing import Annotated, Any

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Json, Plugins, Quiet

EXAMPLE = "shadow-map:size=2048,filter=pcf(taps=5)"
TOGETHER = "bias=polygon-offset(2,4)+normal-offset"

app = typer.Typer()


@app.command("list")
def list_things(
    what: Annotated[
        str, typer.Argument(metavar="WHAT", help="One of techniques, scenes, metrics, studies  [all].")
    ] = "",
    name: Annotated[str, typer.Argument(metavar="NAME", help="One of them alone  [all].")] = "",
    plugin: Plugins = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print what there is: techniques with parameters and presets, built-in scenes, metrics (the columns), studies."""
    from shadowbench.studies.catalogue import catalogue

    found = catalogue(plugin or (), what, name)
    if json:
        console.print_json(found[what] if what else found)
        return
    for kind, entries in found.items():
        if kind == "techniques":
            _print_techniques(entries)
        else:
            rows = [[str(value) for value in entry.values()] for entry in entries]
            console.print_table("" if quiet and what else kind, list(entries[0]), rows)
            console.out().print()


def _print_techniques(rows: list[dict[str, Any]]) -> None:
    """Each with its parameters and presets; then what may stand for a bias, a filter, a fit, each kind once."""
    console.out().print(f"Written name:parameter=value,… such as {EXAMPLE}", markup=False)
    console.out().print(f"Biases that act together are joined by a plus: {TOGETHER}\n", markup=False)
    families: list[tuple[str, list[dict[str, Any]]]] = []
    for row in rows:
        console.out().print(f"{row['name']}: {row['help']}", markup=False)
        console.out().print(f"  answers lights that are {', '.join(row['lights'])}", markup=False)
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


def _print_parameters(parameters: list[dict[str, Any]], indent: str) -> None:
    for parameter in parameters:
        allowed = parameter["allowed"] or ", ".join(value["name"] for value in parameter.get("values", ()))
        limits = f" ({allowed})" if allowed else ""
        line = f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}"
        console.out().print(line, markup=False)
