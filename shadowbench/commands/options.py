"""Options of commands: each is described once, by its name; groups of them are the fields of one value."""

import inspect
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand

from shadowbench.commands import completion
from shadowbench.errors import InputError
from shadowbench.options import MAP_SIZE, PHASES, ROUNDS, VIEW_SIZE, Measuring, SceneOptions

SCENE = "a built-in name (shadowbench list scenes), a scene file (.toml), or a mesh file"
SPEC = "a technique and its parameters (shadowbench list techniques)"
SceneArgument = Annotated[
    str, typer.Argument(metavar="SCENE", autocompletion=completion.scene, help=f"The scene: {SCENE}.")
]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="A Python file with techniques, filters or metrics; repeatable."),
]
PartOption = Annotated[
    str | None,
    typer.Option(
        "--part",
        metavar="K/N",
        rich_help_panel="Machines",
        help="Measure only part K of N, such as 3/16, for machines that share nothing, or array jobs; each needs a "
        "folder of its own, and `merge` joins them.",
    ),
]
KeepGoing = Annotated[
    bool,
    typer.Option(
        "--keep-going",
        rich_help_panel="Measurement",
        help="Leave out scenes that cannot be read, and what else would stop the command, and measure the rest; a "
        "summary names them, and the exit code is 3. A cell that fails never stops it.",
    ),
]


@dataclass(frozen=True)
class Printed:
    """What is printed of a result, and whether anything else is."""

    json: bool = False
    quiet: bool = False


@dataclass(frozen=True)
class Machines:
    """The Dask cluster that measures. Raises InputError for an option about it without `--dask`."""

    dask: str | None = None
    renderer: str | None = None

    def __post_init__(self) -> None:
        others = [field.name for field in fields(self)[1:] if getattr(self, field.name)]
        if self.dask is None and others:
            raise InputError(f"--{others[0].replace('_', '-')}: is for --dask, which is not given")


@dataclass(frozen=True)
class TimingMachines(Machines):
    """Also the worker that takes times."""

    time_on: str | None = None


@dataclass(frozen=True)
class StudyMachines(TimingMachines):
    """Also whether workers of any renderer are used."""

    any_renderer: bool = False


HEADINGS = {
    SceneOptions: "Scene",
    Measuring: "Measurement",
    Machines: "Machines",
    Printed: "Output",
}
OPTIONS: dict[str, Any] = {
    "view": typer.Option("--view", metavar="NAME", help="Name of a camera of the scene  [the first]."),
    "light": typer.Option("--light", metavar="NAME", help="Name of a light of the scene  [the first; `run`: each]."),
    "assets": typer.Option(metavar="DIR", help="Additional folder to search for a scene file's meshes."),
    "up": typer.Option(
        metavar="y|z",
        autocompletion=completion.up,
        help="Up axis of OBJ, PLY, STL and OFF files, which do not specify it  [y].",
    ),
    "sun": typer.Option(
        "--sun", help="Give directional lights without a size that of the sun: an angular radius of 0.2665°."
    ),
    "no_ground": typer.Option(
        "--no-ground",
        help="Assume no ground below a mesh file that has none; the assumed one receives shadows that count.",
    ),
    "view_size": typer.Option(
        metavar="N", min=VIEW_SIZE.least, max=VIEW_SIZE.most, help="Width and height of the image in pixels  [512]."
    ),
    "rounds": typer.Option(
        metavar="N",
        min=ROUNDS.least,
        max=ROUNDS.most,
        help="Number of times that each cell is timed; 0 for no timing  [9].",
    ),
    "phases": typer.Option(
        metavar="N",
        min=PHASES.least,
        max=PHASES.most,
        help="Sub-texel offsets of the shadow map at which each cell is scored; with more than one, the table shows "
        "medians and intervals. Only the first is timed  [the study's; with -t and neither study nor --map-size, 1].",
    ),
    "step": typer.Option(
        metavar="camera|light",
        autocompletion=completion.step,
        help="Draw each cell again after a small step of the camera or the light, and count the pixels that flip "
        "although the truth does not (shimmering). A step of the camera needs a truth and drawings of three times "
        "the view size  [the study's; none].",
    ),
    "dask": typer.Option(
        "--dask",
        metavar="ADDRESS|local:N",
        help="Measure on the workers of the Dask cluster with this scheduler, such as tcp://host:8786, or on N workers "
        "on this machine; needs the extra `dask`.",
    ),
    "renderer": typer.Option(
        metavar="NAME",
        help="With --dask, the renderer of the workers that measure; others are left out  [that of most of them].",
    ),
    "any_renderer": typer.Option(
        "--any-renderer", help="With --dask, use workers of every renderer; each makes rows and tables of its own."
    ),
    "time_on": typer.Option(
        metavar="here|WORKER",
        help="With --dask, where cells are timed, after all are scored: in this process, or on one worker, by its "
        "address or machine  [nowhere].",
    ),
    "json": typer.Option("--json", help="Print JSON instead of tables."),
    "quiet": typer.Option("--quiet", "-q", help="Print results and errors only, without notes or progress."),
}

Json = Annotated[bool, OPTIONS["json"]]
Quiet = Annotated[bool, OPTIONS["quiet"]]
ViewSize = Annotated[int | None, OPTIONS["view_size"]]


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command with an option for each field of the parameters that are dataclasses, by its name in OPTIONS."""
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            parameters.append(parameter.replace(annotation=hints[name], kind=parameter.KEYWORD_ONLY))
            continue
        kinds = get_type_hints(groups[name])
        heading = next(text for group, text in HEADINGS.items() if issubclass(groups[name], group))
        for field in fields(groups[name]):
            option = copy(OPTIONS[field.name])
            option.rich_help_panel = heading
            kind: Any = Annotated[kinds[field.name], option]
            made = inspect.Parameter(field.name, parameter.KEYWORD_ONLY, default=field.default, annotation=kind)
            parameters.append(made)

    @wraps(command)
    def flat(**values: Any) -> None:
        for name, kind in groups.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        command(**values)

    flat.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return flat


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
        for heading, records in sections.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)


def map_sizes(text: str | None) -> tuple[int, ...] | None:
    """The sizes of --map-size. Raises InputError."""
    if text is None:
        return None
    try:
        sizes = [int(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    least, most = MAP_SIZE
    if not all(least <= size <= most for size in sizes or [0]):
        raise InputError(
            f"--map-size: found {text!r:.60}; allowed: whole numbers from {least} to {most}, separated by commas"
        )
    return tuple(sizes)


def listed(text: str | None) -> tuple[str, ...]:
    """The non-empty parts of a comma-separated text."""
    return tuple(part.strip() for part in text.split(",") if part.strip()) if text else ()
