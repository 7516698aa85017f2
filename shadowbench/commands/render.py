"""`render`: draw a view once with a technique."""

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.commands import completion, console
from shadowbench.commands.options import SPEC, Plugins, Quiet, SceneArgument, ViewSize, grouped
from shadowbench.errors import InputError
from shadowbench.options import ViewOptions

app = typer.Typer()


@app.command(
    epilog="\b\nFor example\n"
    "  shadowbench render spot-lamp -t 'shadow-map:size=2048,filter=pcf' -o lamp.png --mask lamp-mask.png"
)
@grouped
def render(
    scene: SceneArgument,
    technique: Annotated[
        list[str],
        typer.Option(
            "-t",
            "--technique",
            metavar="SPEC",
            autocompletion=completion.spec,
            help=f"The technique to draw with: {SPEC}.",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PICTURE.png", help="File for the shaded picture.")],
    mask: Annotated[
        Path | None,
        typer.Option(metavar="MASK.png", help="File for the shadow mask: visibility as 16-bit grey, white is lit."),
    ] = None,
    map: Annotated[
        Path | None,
        typer.Option(metavar="MAP.png", help="File for the shadow map: linear depth, near is dark."),
    ] = None,
    tint: Annotated[
        bool, typer.Option("--tint", help="Show the technique's debug colours, such as one per cascade.")
    ] = False,
    view_size: ViewSize = None,
    plugin: Plugins = None,
    quiet: Quiet = False,
    *,
    options: ViewOptions,
) -> None:
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

    if len(technique) > 1:
        raise InputError(f"--technique: found {' and '.join(technique)}; allowed: one; `run` takes several")
    check_outputs(".png", output, mask, map)
    (name,) = technique
    known = techniques_with(plugin or ())
    spec = parse_spec(name, known)
    tinted = [name for name, one in known.items() if one.tint is not Technique.tint]
    if tint and spec.technique.name not in tinted:
        raise InputError(f"--tint: {spec.technique.name} has no colours of its own; allowed: {', '.join(tinted)}")
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, view_size, options)
    with Worker(plugin or ()) as worker:
        drawn = drawn_once(chosen, spec, worker, name=name, with_map=map is not None, tint=tint)
    if map is not None and drawn.map is None:
        raise InputError(f"--map {map}: {spec.technique.name} has no map")
    write_picture(output, drawn.picture)
    if mask is not None:
        write_mask(mask, drawn.visibility)
    if map is not None and drawn.map is not None:
        write_picture(map, np.round(np.clip(drawn.map, 0, 1) * 255).astype(np.uint8))
    if not quiet:
        console.print_line(f"{output}: {name} on {chosen.scene.name}")
