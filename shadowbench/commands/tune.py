"""`tune`: search a technique's parameters on some scenes, and score what was found and its default on others."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.commands import console, options
from shadowbench.errors import counted, number
from shadowbench.options import PHASES, Bounds, SceneOptions, option, view_size

if TYPE_CHECKING:
    from shadowbench.advice.tune_search import Setting, Tuning


@dataclass(frozen=True)
class TuneOptions:
    """What is searched, and on which scenes."""

    technique: str = options.technique(
        f"Technique to tune: {options.SPEC}; parameters outside the search keep their values.",
        default=options.REQUIRED,
    )
    scenes: str | None = option(
        f"Each is {options.SCENE}  [all built-in scenes that the technique supports and whose lights have no size].",
        "SCENE,SCENE,...",
    )
    held_out: str | None = option(
        "Scenes held out of the search, on which its result is judged  [a third, chosen by a hash of the names].",
        "NAME,NAME,...",
    )
    params: str | None = option(
        "Parameters to search  [those of bias, filter, fit that the technique has].",
        "NAME,NAME,...",
    )
    trials: int = option("Number of settings that the search tries.", "N", default=100, bounds=Bounds(1, 100_000))
    map_size: str = option("Map sizes to average over.", "N,N,...", default="2048")
    view_size: int | None = view_size()
    phases: int = option("Sub-texel offsets of the map to average over.", "N", default=2, bounds=PHASES)
    plugin: list[Path] = options.plugins()
    output: Path = options.output("Folder for the measured cells.", default=Path("results/tune"))
    keep_going: bool = options.keep_going()


@options.command(
    "\b\nFor example\n"
    "  shadowbench tune -t shadow-map --scenes stairs,statue,street,my.glb --held-out statue,my\n"
    "  shadowbench tune -t cube-map --params bias --trials 50"
)
def tune(asked: TuneOptions, view: SceneOptions, machines: options.Machines, printed: options.Printed) -> int:
    """Search a technique's parameters for the best accuracy.

    Finds the most accurate setting at each cost on some scenes, and scores it beside the default on others, held out
    of the search. The error combines IoU, or RMSE of soft shadows, and SSIM; the cost is counted work
    (shader invocations, texture reads). Every camera and light of a scene is used. An interrupted search resumes when
    the command is repeated.

    \b
    Columns
      cost                work relative to the default's
      tuning, held out    error √((1 − IoU) · (1 − SSIM)), of soft shadows
                          √(RMSE · (1 − SSIM)), on the scenes of the search, and
                          on those held out; geometric means
      acne, leak, contact means over the held-out scenes (shadowbench list metrics)
    """
    from shadowbench.advice.tune import no_image, tune_parameters, values
    from shadowbench.campaigns import campaign_in
    from shadowbench.measure.plugin_output import subjects_with
    from shadowbench.plugin.spec import parse_spec

    known = subjects_with(asked.plugin)
    spec = parse_spec(asked.technique, known)
    of_campaigns: dict[str, Any] = {"keep_going": asked.keep_going, "keeps_images": no_image}
    with (
        console.Reporter(printed.quiet) as reporter,
        campaign_in(asked.output, reporter, asked.plugin, **asdict(machines), **of_campaigns) as campaign,
    ):
        found = tune_parameters(
            spec,
            campaign,
            scenes=options.listed(asked.scenes),
            held_out=options.listed(asked.held_out),
            params=asked.params,
            trials=asked.trials,
            map_size=options.map_sizes(asked.map_size) or (),
            view_size=asked.view_size or 512,
            phases=asked.phases,
            **asdict(view),
        )
    if printed.json:
        console.print_json(values(found))
    else:
        _print(found)
        if not printed.quiet:
            console.print_line(f"{asked.output / 'table.csv'}: {counted(len(found.results), 'cell')}")
    return console.exit_code_of(found.results, campaign.failures)


def _print(found: "Tuning") -> None:
    numbers = ("cost", "tuning", "held out", "acne", "leak", "contact")
    lines = [_line("", one) for one in found.front] + [_line("default", found.default)]
    title = f"best at each cost, cheapest first; held out: {', '.join(found.split.held_out)}"
    console.print_table(title, ("", "spec", *numbers), lines, numbers=numbers)


def _line(name: str, one: "Setting") -> list[str]:
    values = (one.tuning, one.held_out, one.acne, one.leak, one.contact)
    return [name, one.spec.sizeless_text, f"{one.cost:.2f}", *map(number, values)]
