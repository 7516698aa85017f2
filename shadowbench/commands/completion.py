"""Shell completion of arguments: scenes, specs, studies, axes, metrics. Imports are in the bodies, as in commands.

Each function takes the word so far and yields whole words, or pairs of a word and its help; typer drops those that do
not begin with the word so far. Where nothing matches, shells complete file names.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel
    from pydantic.fields import FieldInfo

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


def spec(incomplete: str) -> Iterator[str | tuple[str, str]]:
    """Techniques, their parameters after a colon or comma, and values after an equals sign."""
    from shadowbench.techniques.registry import techniques

    known = techniques()
    name, colon, parameters = incomplete.partition(":")
    if not colon:
        yield from ((one.name, " ".join((one.__doc__ or "").split("\n\n")[0].split())) for one in known.values())
    elif name in known:
        one = known[name]
        yield from _parameters(one.Params, f"{name}:", parameters, {"preset": one.presets})


def parameters(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of the parameters of the technique that `tune` tunes, separated by commas."""
    from shadowbench.techniques.registry import techniques

    technique = techniques().get(str(ctx.params.get("technique")).partition(":")[0])
    return _after_comma(incomplete, technique.Params.model_fields if technique else ())


def _after_comma(incomplete: str, names: Iterable[str]) -> list[str]:
    before = incomplete[: incomplete.rfind(",") + 1]
    return [before + name for name in names]


def _parameters(
    model: "type[BaseModel]", before: str, text: str, more: dict[str, Iterable[str]]
) -> Iterator[str | tuple[str, str]]:
    """`before` and `text` with the last parameter completed: those of `model`, and `more` by their values."""
    from shadowbench.techniques.params import Component

    last = _last_begin(text)
    before, (key, equals, value) = before + text[:last], text[last:].partition("=")
    fields = model.model_fields
    if not equals:
        yield from ((f"{before}{name}=", str(info.description)) for name, info in fields.items())
        yield from (f"{before}{name}=" for name in more)
        return
    before += f"{key}="
    default: Any = fields[key].default if key in fields else None
    if isinstance(default, Component):
        family = default.family().table
        name, bracket, inner = value.partition("(")
        if bracket and name in family:
            yield from _parameters(family[name], f"{before}{name}(", inner, {})
        else:
            yield from (before + one for one in family if one != "+")
    else:
        yield from (before + one for one in (_choices(fields[key]) if key in fields else more.get(key, ())))


def _choices(field: "FieldInfo") -> Iterable[str]:
    if field.annotation is bool:
        return ("true", "false")
    return map(str, get_args(field.annotation)) if get_origin(field.annotation) is Literal else ()


def _last_begin(text: str) -> int:
    """Where the last parameter of a list begins: after its last comma outside brackets."""
    depth = begin = 0
    for index, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            begin = index + 1
    return begin
