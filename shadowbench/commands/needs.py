"""`needs`: predict what a scene requires of a shadow technique."""

from shadowbench.commands import console, options
from shadowbench.options import ViewOptions


@options.command("For example  shadowbench needs street --view-size 1024")
def needs(
    scene: options.Scene, view_size: options.ViewSize = None, *, view: ViewOptions, printed: options.Printed
) -> None:
    """Predict map size, cascades, bias and depth bits.

    Map size, cascades, depth bits, bias, the width of penumbrae and the error of hard shadows. Nothing is drawn: they
    follow from the geometry and from shadow rays for the visible pixels, or for a sample of them; ± is then the
    standard error. The error of hard shadows is that of the ray-traced truth, which `run` reads too. Each prediction
    has its reason. Needs no OpenGL.
    """
    from dataclasses import asdict

    from shadowbench.survey.explanations import explanations_of
    from shadowbench.survey.survey import needs as needs_of

    with console.Reporter(printed.quiet) as reporter:
        chosen = reporter.view(scene, view_size, view)
        found = needs_of(chosen)
        if found.pixels < found.view_size**2:
            part = found.pixels / found.view_size**2
            reporter.note(f"{part:.1%} of the pixels were sampled; ± is one standard error")
    rows = explanations_of(found)
    if printed.json:
        values = asdict(found)
        values["reach"].pop("matters")
        names = {"scene": chosen.scene.name, "view": chosen.camera.name}
        console.print_json(names | values | {"told": [asdict(row) for row in rows]})
        return
    title = f"{chosen.scene.name}, {chosen.size} × {chosen.size} pixels"
    lines = [(row.need, row.number, row.reason) for row in rows]
    console.print_table(title, ("need", "number", "why"), lines, padded=True)
