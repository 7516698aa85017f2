"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import completion
from shadowbench.errors import InputError

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print results and errors only, without notes or progress.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="A Python file that adds techniques or filters; repeatable."),
]
Assets = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Additional folder to search for a scene file's meshes."),
]
Up = Annotated[
    str | None,
    typer.Option(
        metavar="y|z",
        autocompletion=completion.up,
        help="Up axis of OBJ, PLY, STL and OFF files, which do not specify it  [y].",
    ),
]
Sun = Annotated[
    bool,
    typer.Option("--sun", help="Give directional lights without a size that of the sun: an angular radius of 0.2665°."),
]
NoGround = Annotated[
    bool,
    typer.Option(
        "--no-ground",
        help="Assume no ground below a mesh file that has none; the assumed one receives shadows that count.",
    ),
]
ViewSize = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=16384, help="Width and height of the image in pixels  [512].")
]
ViewName = Annotated[
    str | None, typer.Option("--view", metavar="NAME", help="Name of a camera of the scene  [the first].")
]
LightName = Annotated[
    str | None, typer.Option("--light", metavar="NAME", help="Name of a light of the scene  [the first].")
]
PartOption = Annotated[
    str | None,
    typer.Option(
        "--part",
        metavar="K/N",
        help="Measure only part K of N, such as 3/16, for machines that share nothing, or array jobs; each needs a "
        "folder of its own, and `merge` joins them.",
    ),
]
KeepGoing = Annotated[
    bool,
    typer.Option(
        "--keep-going",
        help="Leave out scenes that cannot be read, and what else would stop the command, and measure the rest; a "
        "summary names them, and the exit code is 3. A cell that fails never stops it.",
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS|local:N",
        help="Measure on the workers of the Dask cluster with this scheduler, such as tcp://host:8786, or on N workers "
        "on this machine; needs the extra `dask`.",
    ),
]
Renderer = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="With --dask, the renderer of the workers that measure; others are left out  [that of most of them].",
    ),
]
SCENE = "a built-in name (shadowbench list scenes), a scene file (.toml), or a mesh file"
SPEC = "a technique and its parameters (shadowbench list techniques)"
SceneArgument = Annotated[
    str, typer.Argument(metavar="SCENE", autocompletion=completion.scene, help=f"The scene: {SCENE}.")
]


def map_sizes(text: str | None) -> tuple[int, ...] | None:
    """The sizes of --map-size. Raises InputError."""
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
    """The non-empty parts of a comma-separated text."""
    return tuple(part.strip() for part in text.split(",") if part.strip()) if text else ()
