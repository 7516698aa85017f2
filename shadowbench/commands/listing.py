"""`list` and `doctor`: what there is, and whether it can run here."""

from typing import TYPE_CHECKING, Annotated

from shadowbench.commands import console, options
from shadowbench.options import KINDS

if TYPE_CHECKING:
    from shadowbench.studies.catalogue import Entry

EXAMPLE = "shadow-map:size=2048,filter=pcf(taps=5)"
TOGETHER = "bias=polygon-offset(2,4)+normal-offset"


@options.command(name="list")
def list_things(
    what: Annotated[str, options.argument("WHAT", f"{', '.join(KINDS)}  [all].")] = "",
    name: Annotated[str, options.argument("NAME", "Show only this entry  [all].")] = "",
    plugin: options.Plugins = None,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """List techniques, scenes, metrics, studies and more.

    Techniques with their parameters and presets, built-in scenes, metrics (columns of result tables), built-in studies,
    the axes of `stress`, along which it varies a scene, and the devices whose times `recommend` predicts.

    \b
    Columns of metrics
      better     whether higher or lower values are better
      for        the kind of shadows that it suits: hard, soft or both
      tolerance  largest change for the worse that `check` allows
    """
    from shadowbench.studies.catalogue import catalogue

    known = catalogue(plugin or (), what, name)
    if json:
        console.print_json(known[what] if what else known)
        return
    for kind, entries in known.items():
        if kind in ("techniques", "engines"):
            _print_techniques(entries)
        else:
            rows = [
                [" ".join(value) if isinstance(value, list) else str(value) for value in entry.values()]
                for entry in entries
            ]
            console.print_table("" if quiet and what else kind, list(entries[0]), rows)
            console.print_text("")


def _print_techniques(entries: list["Entry"]) -> None:
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


def _print_parameters(parameters: list["Entry"], indent: str) -> None:
    for parameter in parameters:
        allowed = parameter["allowed"] or ", ".join(value["name"] for value in parameter.get("values", ()))
        limits = f" ({allowed})" if allowed else ""
        console.print_text(f"{indent}{parameter['name']} = {parameter['default']}{limits}: {parameter['help']}")


@options.command()
def doctor(json: options.Json = False, quiet: options.Quiet = False) -> int:
    """Check that shadowbench can run here.

    Prints the machine, library versions, the OpenGL renderer and its limits, the timer in use and its noise, how many
    rays Embree traces at once, and the cache of ray-traced truths. Exit code 3 if nothing can be drawn.
    """
    from shadowbench.measure.machine import diagnosis

    known = diagnosis()
    missing = "missing" in known["opengl"]
    if json:
        console.print_json(known)
    else:
        for title, values in known.items():
            console.out().print(title.replace("_", " "))
            for name, value in values.items():
                console.print_line(f"  {name.replace('_', ' ')}: {value}")
        if missing:
            console.out().print("no technique can be drawn here; `truth`, `needs`, `score`, `check` and `report` work")
        elif "problem" in known["truth_cache"]:
            console.out().print("ready, but each command must trace its truths again: the cache cannot be used")
        elif not quiet:
            console.out().print("ready")
    return 3 if missing else 0
