"""Shell completion of arguments: scenes, techniques, studies, axes, metrics. Imports are in the bodies, as in commands.

Each function takes the word so far and yields whole words, or pairs of a word and its help; typer drops those that do
not begin with the word so far. Where nothing matches, shells complete file names.
"""

from collections.abc import Iterable, Iterator

import typer

KINDS = ("techniques", "scenes", "metrics", "studies", "axes")


def scene(incomplete: str) -> list[str]:
    """Built-in scenes."""
    from shadowbench.scenes.library import builtin_names

    return list(builtin_names())


def scenes(incomplete: str) -> list[str]:
    """Built-in scenes, separated by commas."""
    return _after_comma(incomplete, scene(incomplete))


def study(incomplete: str) -> list[str]:
    """Built-in studies."""
    from shadowbench.studies.study import study_names

    return list(study_names())


def axis(incomplete: str) -> list[tuple[str, str]]:
    """Axes of `stress`."""
    from shadowbench.extremes.axes import AXES

    return [(one.name, one.about) for one in AXES.values()]


def tolerance(incomplete: str) -> list[str]:
    """Metric names, each followed by `=`."""
    from shadowbench.measure.flips import ROW_METRICS

    return [f"{name}=" for name in ROW_METRICS]


def step(incomplete: str) -> list[str]:
    """What takes a small step."""
    return ["camera", "light"]


def up(incomplete: str) -> list[str]:
    """Values of `--up`."""
    return ["y", "z"]


def file_format(incomplete: str) -> list[str]:
    """Formats of `report`."""
    return ["html", "md", "csv", "png"]


def kind(incomplete: str) -> list[str]:
    """Kinds of entries of `list`."""
    return list(KINDS)


def entry(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of the entries of the kind given to `list`."""
    from shadowbench.catalogue import catalogue

    what = ctx.params.get("what")
    return [one["name"] for one in catalogue(what=what)[what]] if what in KINDS else []


def spec(incomplete: str) -> Iterator[tuple[str, str]]:
    """Techniques."""
    from shadowbench.plugin.registry import techniques

    for one in techniques().values():
        yield one.name, " ".join((one.__doc__ or "").split("\n\n")[0].split())


def parameters(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of the parameters of the technique that `tune` tunes, separated by commas."""
    from shadowbench.plugin.registry import techniques

    technique = techniques().get(str(ctx.params.get("technique")).partition(":")[0])
    return _after_comma(incomplete, technique.Params.model_fields if technique else ())


def _after_comma(incomplete: str, names: Iterable[str]) -> list[str]:
    before = incomplete[: incomplete.rfind(",") + 1]
    return [before + name for name in names]
