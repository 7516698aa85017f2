"""`export`: a view for another renderer."""

from pathlib import Path

from shadowbench.commands.console import ConsoleReporter, check_folder, out
from shadowbench.engines.export import DESCRIPTION, export_view
from shadowbench.scenes.views import chosen_view, notes_on
from shadowbench.truth.cache import cached_truth


def export_command(
    scene: str,
    folder: Path,
    view_size: int,
    view: str | None,
    light: str | None,
    assets: Path | None,
    up: str | None,
    quiet: bool,
) -> None:
    """Write a view's model, description and truth into a folder."""
    check_folder(folder, DESCRIPTION)
    with ConsoleReporter(quiet) as reporter:
        chosen = chosen_view(scene, view_size, view, light, assets, up)
        for note in notes_on(chosen, view, light):
            reporter.note(note)
        for mesh in chosen.scene.meshes:
            lacking = [what for what, holds in (("cast", mesh.casts), ("receive", mesh.receives)) if not holds]
            if lacking:
                reporter.note(
                    f"{mesh.name} is to {' and '.join(lacking)} no shadow, which glTF cannot say: see view.json"
                )
        files = export_view(chosen, cached_truth(chosen), folder, scene)
    if not quiet:
        triangles = sum(len(mesh.faces) for mesh in chosen.scene.meshes)
        for file, what in zip(
            files,
            (
                f"{len(chosen.scene.meshes)} meshes, {triangles} triangles, the camera, the light",
                "matrices, pixels, conventions",
                "the truth, as an example of a mask",
            ),
            strict=True,
        ):
            out.print(f"{file}: {what}", markup=False, soft_wrap=True)
