"""`new-technique` and `export`: what a technique or an engine of your own begins with."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from shadowbench.commands import console, options
from shadowbench.errors import InputError
from shadowbench.options import ViewOptions


@options.command(
    "\b\nFor example\n"
    "  shadowbench new-technique my-shadows\n"
    "  shadowbench run cube-on-plane -t my-shadows -t shadow-map --plugin my-shadows.py"
)
def new_technique(
    name: Annotated[str, options.argument("NAME", "Name of the technique in specs and tables.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for NAME.py  [the current one].")
    ] = None,
) -> None:
    """Write NAME.py, a minimal technique to start from.

    It is a shadow map with its shader, and runs unmodified. An existing file is not overwritten.
    """
    from shadowbench.plugin.template import write_technique

    file = write_technique(name, output or Path())
    console.print_line(f"{file}: try it with")
    for command in ("run", "view"):
        console.print_line(f"  shadowbench {command} cube-on-plane -t {name} -t shadow-map --plugin {file}")


@options.command("For example  shadowbench export stairs for-my-engine/ --view-size 1024")
def export(
    scene: options.Scene,
    folder: Annotated[Path, options.argument("DIR", "Folder for the files.")],
    view_size: options.ViewSize = None,
    sequence: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Write the frames of a sequence, one of those of `run`."),
    ] = None,
    frames: options.Frames = None,
    sides: Annotated[
        Literal["closed", "double"],
        typer.Option(help="Which materials are double-sided: those of meshes that are not closed, or all."),
    ] = "double",
    quiet: options.Quiet = False,
    *,
    view: ViewOptions,
) -> None:
    """Write a scene for your engine: glTF, matrices, truth.

    \b
    scene.glb  meshes with flat normals, the camera, the light; of a sequence an animation
    view.json  view and projection matrices, size, pixel convention, the light's box; of a sequence those of each frame
    truth.png  the ray-traced shadow mask, as an example of a mask for `score`; of a sequence truth/000.png …
    """
    from shadowbench.files import check_folder, make_folder
    from shadowbench.masks.export import DESCRIPTION, EXAMPLE, EXAMPLES, clip_of, export_view, inexpressible_in_gltf
    from shadowbench.masks.inputs import PICTURE
    from shadowbench.scores.masks import write_mask
    from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth

    check_folder(folder, DESCRIPTION)
    if frames is not None and sequence is None:
        raise InputError(f"--frames {frames}: is for a --sequence, which is not given")
    with console.Reporter(quiet) as reporter:
        chosen = reporter.view(scene, view_size, view)
        clip = clip_of(chosen, sequence, frames) if sequence else None
        for line in inexpressible_in_gltf(chosen, clip):
            reporter.note(line)
        model, description = export_view(chosen, folder, scene, sides=sides, options=view, clip=clip)
        views = clip.frames if clip else (chosen,)
        reporter.stage("truth", len(views))
        for index, frame in enumerate(views):
            example = folder / EXAMPLES / PICTURE.format(index) if clip else folder / EXAMPLE
            make_folder(example.parent)
            write_mask(example, cached_truth(frame, 1 if index else PIXEL_SAMPLES).visibility)
            reporter.step(example.name)
    if not quiet:
        meshes = chosen.scene.meshes
        triangles = sum(len(mesh.faces) for mesh in meshes)
        console.print_line(f"{model}: {len(meshes)} meshes, {triangles} triangles, the camera, the light")
        console.print_line(f"{description}: matrices{f' of {len(views)} frames' if clip else ''}, size, conventions")
        console.print_line(f"{example}: the ray-traced mask{' of the last one' if clip else ''}, as an example")
