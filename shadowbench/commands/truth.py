"""`truth`: ray-trace the shadows of a view."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console
from shadowbench.commands.options import Quiet, SceneArgument, ViewSize, grouped
from shadowbench.options import PIXEL_SAMPLES, ViewOptions

if TYPE_CHECKING:
    from shadowbench.truths.trace import Truth

app = typer.Typer()


@app.command(epilog="For example  shadowbench truth stairs -o stairs.npz --view-size 1024")
@grouped
def truth(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.npz", help="File for the arrays.")],
    view_size: ViewSize = None,
    pixel_samples: Annotated[
        int,
        typer.Option(
            metavar="N", min=PIXEL_SAMPLES.least, max=PIXEL_SAMPLES.most, help="`area` averages N × N rays per pixel."
        ),
    ] = 4,
    quiet: Quiet = False,
    *,
    options: ViewOptions,
) -> None:
    """Ray-trace the shadows of a view into NumPy arrays.

    \b
    Arrays of the .npz, one value per pixel, row 0 at the top
      visibility      share of the light that is seen: 1 lit, 0 in shadow, for a
                      ray through the pixel's centre
      standard_error  of visibility, where a light with a size is sampled, else 0
      irradiance      as visibility, each point of the light weighted by N·ω
      area            visibility averaged over the pixel
      receivers       whether the visible surface faces the light
      undecided       whether the visibility depends on rounding; not scored
      blocker         distance to the nearest occluder in metres, inf for none
      triangle        index of the visible triangle, -1 for none
      cosine          N·L at the visible point
      diagonal        one number: diagonal of casters and receivers in metres
      depth           distance of the visible point along the camera's axis
      about           names, camera and light of the view, as JSON text

    `shadowbench score` takes the file in place of the scene.
    """
    from shadowbench.engines.stored_truth import write_stored_truth
    from shadowbench.files import check_outputs
    from shadowbench.truths.cache import cached_truth

    check_outputs(".npz", output)
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, view_size, options)
        found = cached_truth(chosen, pixel_samples)
    write_stored_truth(output, found, chosen)
    if not quiet:
        receivers, shadowed = int(found.receivers.sum()), int((found.visibility < 0.5).sum())
        undecided = int((found.receivers & found.undecided).sum())
        pixels = f"{receivers} of {found.receivers.size} pixels show a receiver"
        console.print_line(f"{output}: {pixels}, {shadowed} in shadow, {undecided} undecided{_penumbra(found)}")


def _penumbra(truth: "Truth") -> str:
    """The size of the penumbra and the standard errors there; nothing without a penumbra."""
    if not truth.sampled:
        return ""
    import numpy as np

    from shadowbench.measure.scoring import prepare_truth

    prepared = prepare_truth(truth)
    penumbra = prepared.penumbra
    if not penumbra.any():
        return ""
    variance = prepared.variance[penumbra]
    median, high = np.sqrt(np.percentile(variance[variance > 0], [50, 95]))  # 0 where all points of the light agree
    share = penumbra.sum() / truth.receivers.sum()
    errors = f"{median:.2g} (median), {high:.2g} (95%)"
    return f", {penumbra.sum()} ({share:.0%}) in penumbra, where the standard error is {errors}"
