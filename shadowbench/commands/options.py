"""Options of commands: each is described once, and groups of them are the fields of one value."""

import inspect
from collections.abc import Callable
from dataclasses import Field, dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import typer
from typer.core import TyperCommand

from shadowbench import options as shared
from shadowbench.errors import InputError
from shadowbench.options import MAP_SIZE, Measuring, SceneOptions, option

SCENE = "a built-in name (shadowbench list scenes), a scene file (.toml), or a mesh file"
_PLUGIN = "A Python file with techniques, filters or metrics; repeatable."
SPEC = "a technique and its parameters (shadowbench list techniques)"


@dataclass(frozen=True)
class Printed:
    """What is printed of a result, and whether anything else is."""

    json: bool = option("Print JSON instead of tables.", default=False)
    quiet: bool = option(
        "Print results and errors only, without notes or progress.", default=False, names=("--quiet", "-q")
    )


@dataclass(frozen=True)
class Machines:
    """The Dask cluster that measures. Raises InputError for an option about it without `--dask`."""

    dask: str | None = option(
        "Measure on the workers of the Dask cluster with this scheduler, such as tcp://host:8786, or on N workers on "
        "this machine; nothing is timed. Needs the extra `dask`.",
        "ADDRESS|local:N",
    )
    renderer: str | None = option(
        "With --dask, the renderer of the workers that measure; others are left out  [that of the first].", "NAME"
    )

    def __post_init__(self) -> None:
        if self.dask is None and self.renderer is not None:
            raise InputError("--renderer: is for --dask, which is not given")


_HEADINGS = {SceneOptions: "Scene", Measuring: "Measurement", Machines: "Machines", Printed: "Output"}
REQUIRED: Any = ...
"""Default of an option that must be given."""


def _option_of(field: "Field[Any]", heading: str | None = None) -> Any:
    """Typer's option of a field of a group."""
    metadata = {"rich_help_panel": heading, **field.metadata}
    names = metadata.pop("names") or [f"--{field.name.replace('_', '-')}"]
    least, most = metadata.pop("bounds") or (None, None)
    return typer.Option(*names, min=least, max=most, **metadata)


# Options that several groups have.
technique = partial(option, metavar="SPEC", names=("-t", "--technique"))
output = partial(option, metavar="DIR", names=("-o", "--output"))
plugins = partial(option, _PLUGIN, "FILE.py", default=())
flag = partial(option, default=False)
part = partial(
    option,
    "Measure only part K of N, such as 3/16, for machines that share nothing, or array jobs; each needs a folder of "
    "its own, and `merge` joins them.",
    "K/N",
    heading="Machines",
)
keep_going = partial(
    option,
    "Leave out scenes that cannot be read, and what else would stop the command, and measure the rest; a summary names "
    "them, and the exit code is 3. A cell that fails never stops it.",
    default=False,
    heading="Measurement",
)


def argument(metavar: str, help: str) -> Any:
    """An argument of a command."""
    return typer.Argument(metavar=metavar, help=help, show_default=False)


Scene = Annotated[str, argument("SCENE", f"The scene: {SCENE}.")]
Plugins = Annotated[list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help=_PLUGIN)]
_FIELDS = {one.name: one for group in (Measuring, Printed) for one in fields(group)}
ViewSize = Annotated[shared.ViewSize | None, _option_of(_FIELDS["view_size"])]
Frames = Annotated[int | None, _option_of(_FIELDS["frames"])]
Json = Annotated[bool, _option_of(_FIELDS["json"])]
Quiet = Annotated[bool, _option_of(_FIELDS["quiet"])]


class Command(NamedTuple):
    """A command; function: with a parameter for each option; body: with the groups; epilog: the end of its help."""

    function: Callable[..., int | None]
    body: Callable[..., int | None]
    epilog: str


def command(epilog: str = "", name: str | None = None) -> Callable[[Callable[..., int | None]], Command]:
    """Decorator of a function that returns an exit code, None for 0: a command.

    A parameter that is a group becomes an option for each of its fields. name: that of the function by default.
    """

    def made(function: Callable[..., int | None]) -> Command:
        hints = get_type_hints(function, include_extras=True)
        groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}

        def flat(**values: Any) -> int | None:
            for name, kind in groups.items():
                values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
            return function(**values)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(function).parameters.values():
            kind = hints[parameter.name]
            parameters += _of_group(kind) if kind in groups.values() else [parameter.replace(annotation=kind)]
        signature = inspect.Signature([one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in parameters])
        flat.__signature__ = signature  # type: ignore[attr-defined]
        flat.__annotations__ = {name: parameter.annotation for name, parameter in signature.parameters.items()}
        flat.__name__, flat.__doc__ = name or function.__name__, function.__doc__
        return Command(flat, function, epilog)

    return made


def _of_group(group: Any) -> list[inspect.Parameter]:
    """A parameter for each field of a group."""
    kinds, made = get_type_hints(group), []
    heading = next((text for one, text in _HEADINGS.items() if issubclass(group, one)), None)
    for field in fields(group):
        kind: Any = Annotated[kinds[field.name], _option_of(field, heading)]
        default = inspect.Parameter.empty if field.default is REQUIRED else field.default
        made.append(inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind))
    return made


class GroupedCommand(TyperCommand):
    """Command whose --help has the options of a group under its heading, after those that matter most."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Sections of arguments, options, and one for each group."""
        sections: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                own = "Arguments" if parameter.param_type_name == "argument" else "Options"
                sections.setdefault(getattr(parameter, "rich_help_panel", None) or own, []).append(record)
        write_sections(formatter, sections)


def write_sections(formatter: Any, sections: dict[str, list[tuple[str, str]]]) -> None:
    """Write the non-empty sections of a help text, by heading: pairs of a name and its help."""
    for heading, records in sections.items():
        if records:
            with formatter.section(heading):
                formatter.write_dl(records)


def map_sizes(text: str | None) -> tuple[int, ...] | None:
    """The sizes of --map-size. Raises InputError."""
    if text is None:
        return None
    least, most = MAP_SIZE
    try:
        sizes = tuple(int(part) for part in text.split(","))
    except ValueError:
        sizes = (0,)
    if not all(least <= size <= most for size in sizes):
        raise InputError(
            f"--map-size: found {text!r:.60}; allowed: whole numbers from {least} to {most}, separated by commas"
        )
    return sizes
