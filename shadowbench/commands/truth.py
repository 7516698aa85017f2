"""`truth`: ray-trace the shadows of a view."""

from dataclasses import dataclass
from pathlib import Path

from shadowbench.commands import console, options
from shadowbench.options import PIXEL_SAMPLES, ViewOptions, option, view_size


@dataclass(frozen=True)
class TruthOptions:
    """The file, and what is traced for it."""

    output: Path = options.output("File for the arrays.", metavar="FILE.npz", default=options.REQUIRED)
    view_size: int | None = view_size()
    pixel_samples: int = option("`area` averages N × N rays per pixel.", "N", default=4, bounds=PIXEL_SAMPLES)


@options.command("For example  shadowbench truth stairs -o stairs.npz --view-size 1024")
def truth(scene: options.Scene, asked: TruthOptions, quiet: options.Quiet = False, *, view: ViewOptions) -> None:
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
      shading_cosine  N·L by the smooth normal, where a surface has one
      facet_shadow    whether a smooth surface's own triangles shadow it there

    Scenes of flat surfaces lack the last two; facet_shadow is also absent
    under a light with a size.
    """
    from shadowbench.files import check_outputs
    from shadowbench.truths.cache import cached_truth, write_truth

    check_outputs(".npz", asked.output)
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, asked.view_size, view)
        traced = cached_truth(chosen, asked.pixel_samples)
    write_truth(asked.output, traced)
    if not quiet:
        receivers, shadowed = int(traced.receivers.sum()), int((traced.receivers & (traced.visibility < 0.5)).sum())
        undecided = int((traced.receivers & traced.undecided).sum())
        pixels = f"{receivers} of {traced.receivers.size} pixels show a receiver"
        console.print_line(f"{asked.output}: {pixels}, {shadowed} in shadow, {undecided} undecided")
