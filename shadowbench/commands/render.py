"""`render` and `truth`: a view drawn once with a technique, and its shadows ray-traced."""

from dataclasses import dataclass
from pathlib import Path

from shadowbench.commands import console, options
from shadowbench.errors import InputError
from shadowbench.options import PIXEL_SAMPLES, ViewOptions, ViewSize, option, view_size


@dataclass(frozen=True)
class RenderOptions:
    """The technique, and the files that are written."""

    technique: list[str] = options.technique(f"The technique to draw with: {options.SPEC}.", default=options.REQUIRED)
    output: Path = options.output("File for the shaded picture.", metavar="PICTURE.png", default=options.REQUIRED)
    mask: Path | None = option("File for the shadow mask: visibility as 16-bit grey, white is lit.", "MASK.png")
    map: Path | None = option("File for the shadow map: linear depth, near is dark.", "MAP.png")
    tint: bool = options.flag("Show the technique's debug colours, such as one per cascade.")
    view_size: ViewSize | None = view_size()
    plugin: list[Path] = options.plugins()


@options.command(
    "\b\nFor example\n"
    "  shadowbench render spot-lamp -t 'shadow-map:size=2048,filter=pcf' -o lamp.png --mask lamp-mask.png"
)
def render(scene: options.Scene, asked: RenderOptions, quiet: options.Quiet = False, *, view: ViewOptions) -> None:
    """Draw one picture with a technique's shadows.

    Optionally writes the shadow mask and the shadow map as well.
    """
    import numpy as np

    from shadowbench.files import check_outputs
    from shadowbench.measure.gl_drawer import render as drawn_once
    from shadowbench.measure.pictures import write_picture
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.measure.worker import Worker
    from shadowbench.plugin.base import Technique
    from shadowbench.plugin.spec import parse_spec
    from shadowbench.scores.masks import write_mask

    if len(asked.technique) > 1:
        raise InputError(f"--technique: found {' and '.join(asked.technique)}; allowed: one; `run` takes several")
    check_outputs(".png", asked.output, asked.mask, asked.map)
    (name,) = asked.technique
    known = techniques_with(asked.plugin)
    spec = parse_spec(name, known)
    tinted = [name for name, one in known.items() if one.tint is not Technique.tint]
    if asked.tint and spec.technique.name not in tinted:
        raise InputError(f"--tint: {spec.technique.name} has no colours of its own; allowed: {', '.join(tinted)}")
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, asked.view_size, view)
    with Worker(asked.plugin) as worker:
        drawn = drawn_once(chosen, spec, worker, name=name, with_map=asked.map is not None, tint=asked.tint)
    if asked.map is not None and drawn.map is None:
        raise InputError(f"--map {asked.map}: {spec.technique.name} has no map")
    write_picture(asked.output, drawn.picture)
    if asked.mask is not None:
        write_mask(asked.mask, drawn.visibility)
    if asked.map is not None and drawn.map is not None:
        write_picture(asked.map, np.round(np.clip(drawn.map, 0, 1) * 255).astype(np.uint8))
    if not quiet:
        console.print_line(f"{asked.output}: {name} on {chosen.scene.name}")


@dataclass(frozen=True)
class TruthOptions:
    """The file, and what is traced for it."""

    output: Path = options.output("File for the arrays.", metavar="FILE.npz", default=options.REQUIRED)
    view_size: ViewSize | None = view_size()
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
