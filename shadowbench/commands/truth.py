"""`truth`: a view, ray-traced."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Assets, LightName, Quiet, SceneArgument, Up, ViewName, ViewSize

app = typer.Typer()


@app.command(epilog="For example  shadowbench truth stairs -o stairs.npz --view-size 1024")
def truth(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.npz", help="Where the arrays go.")],
    view_size: ViewSize = None,
    pixel_samples: Annotated[
        int,
        typer.Option(metavar="N", min=1, max=64, help="Rays along a side of a pixel, over which `area` is averaged."),
    ] = 4,
    view: ViewName = None,
    light: LightName = None,
    assets: Assets = None,
    up: Up = None,
    quiet: Quiet = False,
) -> None:
    """Ray-trace the shadows of a view, and write them as NumPy arrays.

    Row 0 is at the top. visibility: 1 lit, 0 in shadow. receivers: the surface faces camera and light. undecided: the
    answer hangs on rounding. area: visibility averaged over the pixel. blocker: metres to the nearest occluder, inf for
    none. triangle: its index, -1 for a miss. cosine: of the light's incidence. diagonal: of casters and receivers,
    metres.
    """
    from shadowbench.files import check_outputs
    from shadowbench.truths.cache import cached_truth, write_truth

    check_outputs(".npz", output)
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, view_size, view, light, assets, up)
        found = cached_truth(chosen, pixel_samples)
    write_truth(output, found)
    if not quiet:
        receivers, shadowed = int(found.receivers.sum()), int((found.visibility < 0.5).sum())
        undecided = int((found.receivers & found.undecided).sum())
        pixels = f"{receivers} receivers of {found.receivers.size} pixels"
        console.say(f"{output}: {pixels}, {shadowed} in shadow, {undecided} undecided")
