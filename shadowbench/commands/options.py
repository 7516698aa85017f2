"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import completion
from shadowbench.errors import InputError

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results and errors only, no notes and no progress.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="A Python file that adds techniques; repeatable."),
]
Assets = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="A second folder in which the meshes of a scene file may lie."),
]
Up = Annotated[
    str | None,
    typer.Option(
        metavar="y|z",
        autocompletion=completion.up,
        help="Which axis points up in an OBJ, PLY, STL or OFF file, formats that do not say  [y].",
    ),
]
ViewSize = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=16384, help="Width and height of the picture in pixels  [512].")
]
ViewName = Annotated[
    str | None, typer.Option("--view", metavar="NAME", help="A camera of the scene, by name  [the first].")
]
LightName = Annotated[
    str | None, typer.Option("--light", metavar="NAME", help="A light of the scene, by name  [the first].")
]
SCENE = "a built-in name (shadowbench list scenes), a scene file (.toml), or a mesh file"
SPEC = "a technique and its parameters (shadowbench list techniques)"
SceneArgument = Annotated[
    str, typer.Argument(metavar="SCENE", autocompletion=completion.scene, help=f"The scene: {SCENE}.")
]


def map_sizes(text: str | None) -> tuple[int, ...] | None:
    """The sizes that --map-size names; raises InputError."""
    if text is None:
        return None
    try:
        sizes = [int(part) for part in text.split(",")]
    except ValueError:
        sizes = []
    if not sizes or min(sizes) < 1 or max(sizes) > 65536:
        raise InputError(f"--map-size: found {text!r:.60}; allowed: whole numbers from 1 to 65536, separated by commas")
    return tuple(sizes)


def listed(text: str | None) -> tuple[str, ...]:
    """The parts of a text that commas separate, none of them empty."""
    return tuple(part.strip() for part in text.split(",") if part.strip()) if text else ()
