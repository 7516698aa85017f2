"""`needs` and `recommend`: what a view requires, and the cheapest technique that meets a target in it."""

from dataclasses import asdict, dataclass
from pathlib import Path

from shadowbench.commands import console, options
from shadowbench.options import ViewOptions, ViewSize, option, view_size


@options.command("For example  shadowbench needs street --view-size 1024")
def needs(
    scene: options.Scene, view_size: options.ViewSize = None, *, view: ViewOptions, printed: options.Printed
) -> None:
    """Predict map size, cascades, bias and depth bits.

    Map size, cascades, depth bits, bias, the width of penumbrae and the error of hard shadows. Nothing is drawn: they
    follow from the geometry and from the ray-traced truth, which `run` reads too, of at most 512 × 512 of the pixels.
    Each prediction has its reason. Needs no OpenGL.
    """
    from shadowbench.survey.survey import explanations_of, verdict_of
    from shadowbench.survey.survey import needs as needs_of

    with console.Reporter(printed.quiet) as reporter:
        chosen = reporter.view(scene, view_size, view)
        needed = needs_of(chosen)
        if needed.pixels < chosen.size.pixels:
            reporter.note(f"{needed.pixels / chosen.size.pixels:.1%} of the pixels were sampled")
    rows = explanations_of(needed)
    if printed.json:
        values = asdict(needed)
        names = {"scene": chosen.scene.name, "view": chosen.camera.name, "verdict": verdict_of(needed)}
        console.print_json(names | values | {"told": [row._asdict() for row in rows]})
        return
    title = f"{chosen.scene.name}, {chosen.size.width} × {chosen.size.height} pixels: {verdict_of(needed)}"
    console.print_table(title, ("need", "number", "why"), rows)


@dataclass(frozen=True)
class RecommendOptions:
    """The target, and what is searched for it."""

    min_iou: float | None = option("Target: minimum IoU  [0.99, if nothing is in penumbra].", "X")
    max_edge_px: float | None = option(
        "Target, instead of --min-iou: maximum mean distance between drawn and true shadow edges, in pixels.", "X"
    )
    max_rmse: float | None = option(
        "Target, instead of --min-iou: maximum root mean square error of visibility  [0.02, if any pixel is in "
        "penumbra].",
        "X",
    )
    max_flicker: float | None = option(
        "Besides: maximum flicker, in pixels, in the first sequence of the scene's file, else in pan.", "PX"
    )
    budget_ms: float | None = option(
        "Maximum time per frame, in ms; without a GPU, of what shadows add, as predicted.", "X"
    )
    device: str | None = option(
        "Device whose times rank without a GPU, predicted from work (shadowbench list devices)  [the first].",
        "NAME",
    )
    by: str | None = option(
        "What ranks: predicted times of the device on record, work, or time, even of a software renderer  [time on a "
        "GPU; without one device, or work where that has no times].",
        "device|work|time",
    )
    export: Path | None = option("Folder for the parameters and shaders (GLSL) of the choice.", "DIR")
    techniques: list[str] = options.technique(
        "Name of a technique to search (shadowbench list techniques), such as one that your engine has; repeatable  "
        "[all].",
        metavar="TECHNIQUE",
        default=(),
    )
    view_size: ViewSize | None = view_size()
    plugin: list[Path] = options.plugins()
    output: Path = options.output(
        "Folder for the measured cells, which later calls reuse.", default=Path("results/recommend")
    )


@options.command(
    "\b\nFor example\n"
    "  shadowbench recommend street\n"
    "  shadowbench recommend my.glb --max-edge-px 0.5 --export for-my-engine\n"
    "  shadowbench recommend my.glb --min-iou 0.98 --budget-ms 2 --device h100\n"
    "  shadowbench recommend my.glb -t shadow-map -t cascades"
)
def recommend(
    scene: options.Scene,
    asked: RecommendOptions,
    view: ViewOptions,
    machines: options.Machines,
    printed: options.Printed,
) -> int:
    """Search for the cheapest technique that meets a target.

    Searches techniques, parameters and map sizes. Few specs are measured: the scene's geometry rules some out (see
    `shadowbench needs`), and cost and error of the others are predicted from the measurements, so that a cheaper
    one may exist. Cost is the time of a frame; on a software renderer, the time that its
    work would take on the device on record, or work (shader invocations, texture reads) for lights with a size, which
    were not timed there. What has no cost is tried, too, and what predictions leave out
    if nothing else meets the target. Exit code 1 if nothing does; the closest is then shown with the reason.

    \b
    Lines of the table, all of specs that were measured
      choice    the cheapest that meets the target
      next      of each other technique, the cheapest that meets the target
      unranked  meets the target, at a cost that is not known
      too slow  meets the target, but over --budget-ms
      so far    of a technique of which none measured meets the target, the most
                accurate; others were not tried, by predictions below the table
      misses    the same, where all were tried but those ruled out below the table
      closest   the most accurate of all, if none meets the target
    Columns
      map         texels along a side of the shadow map
      iou         or edge_px, rmse: the target's metric
      work or ms  cost of a frame; ~ marks a time that varied widely
      × choice    cost relative to the choice's; > is a lower bound, where times are too short to be told apart
      MiB         memory of textures and buffers
      key         name of the cell's mask and picture in the output folder
    """
    from shadowbench.advice.recommend import recommend as measure_recommendation
    from shadowbench.advice.recommend import target_of
    from shadowbench.advice.search import technique_names
    from shadowbench.advice.words import export_choice, lines, table, values
    from shadowbench.files import make_folder
    from shadowbench.measure.gl_drawer import campaign_in
    from shadowbench.measure.plugin_output import techniques_with

    target = target_of(asked.min_iou, asked.max_edge_px, asked.max_rmse)
    known = techniques_with(asked.plugin)
    among = technique_names(asked.techniques, known)
    if asked.export is not None:
        make_folder(asked.export, "--export ")
    with (
        console.Reporter(printed.quiet) as reporter,
        campaign_in(asked.output, reporter, asked.plugin, **asdict(machines)) as campaign,
    ):
        chosen, timed = reporter.view(scene, asked.view_size, view), machines.dask is None
        limits = {name: getattr(asked, name) for name in ("by", "device", "budget_ms", "max_flicker")}
        advice, info = measure_recommendation(chosen, target, known, campaign, timed=timed, among=among, **limits)
        if asked.export is not None:
            export_choice(advice, asked.export, campaign.drawer)
    if printed.json:
        console.print_json(values(advice, info))
        return 0 if advice.choice is not None else 1
    title, headings, rows = table(advice, info)
    console.print_table(title, headings, rows, numbers=headings[2:-1], whole=headings)
    for line in lines(advice):
        console.print_line(line)
    measured = f"{len(advice.trials)} of {advice.space_size} specs measured"
    console.print_line(f"{measured}; masks and pictures, by key, in {asked.output}")
    if asked.export is not None and advice.choice is not None and not printed.quiet:
        console.print_line(f"{asked.export}: parameters.json and the GLSL of the choice")
    return 0 if advice.choice is not None else 1
