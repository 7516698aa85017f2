"""Makes docs/techniques.md and its pictures from the registered techniques; --check says whether the text is stale.

Numbers and pictures change with the renderer, so that --check looks at neither.
"""

import argparse
import difflib
import inspect
import io
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image

from shadowbench.extremes.axes.model import NAMES
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, Scene, View, view_of
from shadowbench.scores.metrics import score
from shadowbench.techniques.base import Technique
from shadowbench.techniques.params import Row, TechniqueParams, allowed
from shadowbench.techniques.registry import source_file, techniques
from shadowbench.techniques.spec import format_value
from shadowbench.truths.cache import cached_truth

ROOT = Path(__file__).resolve().parent.parent
RANGES = ROOT / "results" / "ranges.csv"  # of a full `shadowbench stress`
PAGE, PICTURES = ROOT / "docs" / "techniques.md", ROOT / "docs" / "techniques"
SIZE, LARGEST = 512, 250_000  # pixels along a side, bytes of a picture
SHOWN = {"iou": "IoU", "ssim": "SSIM"}
FALLBACK = ("cube-on-plane", "room-with-lamp", "spot-lamp")  # a scene for each kind of light
LIGHTS = (
    Light("sun", "directional", direction=(0.5, -1.0, -0.3)),
    Light("spot", "spot", direction=(-1.0, -2.0, -1.0), position=(1.5, 3.0, 1.5), angle=1.0),
    Light("point", "point", position=(1.5, 3.0, 1.5)),
)
HEAD = """\
# Techniques

What each computes, what it needs and what its parameters are. Made by `python tools/technique_docs.py` from the
techniques themselves; `shadowbench list techniques` prints the same. A spec is a name and parameters:
`shadow-map:size=2048,filter=pcf(taps=5)`. Biases that act together are joined by a plus:
`bias=polygon-offset(2,4)+normal-offset`.

Pictures are {size}² pixels, at default parameters. The numbers below them are of the machine that made them. Where a
technique breaks is what a full `shadowbench stress` found on small scenes of its own: IoU below 0.95, acne or leak
above 1%, or more than 1% of the receivers at true edges that flip where the truth does not.
[results/ranges.csv](../results/ranges.csv) has all ranges.
"""
NUMBERS = re.compile(r"-?\d+\.\d+|…")


@dataclass(frozen=True)
class Shown:
    """A technique at its defaults in a scene that suits it; `drawn` only where pictures are made."""

    scene: str
    reasons: dict[str, str | None]
    drawn: Rendering | None
    scores: dict[str, float | None]


def main() -> int:
    """Write page and pictures, or with --check compare the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit 1 if the committed text is stale")
    check = parser.parse_args().check
    with Worker() as worker:
        ours = _ours()
        shown = {one.name: _show(worker, one, draw=not check) for one in ours}
    page = _page(ours, shown)
    if check:
        return compare(PAGE.read_text(encoding="utf-8") if PAGE.exists() else "", page)
    PICTURES.mkdir(parents=True, exist_ok=True)
    for file in PICTURES.glob("*.png"):
        if file.stem not in shown:
            file.unlink()
    for name, one in shown.items():
        if one.drawn is not None:
            (PICTURES / f"{name}.png").write_bytes(_png(one.drawn.picture))
    PAGE.write_text(page, encoding="utf-8")
    print(PAGE)
    return 0


def without_numbers(page: str) -> str:
    """The page as --check sees it: lines of measured numbers keep their names alone."""
    return "\n".join(NUMBERS.sub("…", line) if line.startswith("Measured") else line for line in page.splitlines())


def _ours() -> list[type[Technique]]:
    """Every registered technique of this repository; an installed package's are documented by it."""
    return [one for one in techniques().values() if source_file(one).resolve().is_relative_to(ROOT)]


def compare(committed: str, made: str) -> int:
    """1 and a word where pages differ in more than measured numbers, else 0."""
    old, new = without_numbers(committed).splitlines(), without_numbers(made).splitlines()
    lines = list(difflib.unified_diff(old, new, "docs/techniques.md", "as it should be", lineterm="", n=0))
    if lines:
        print("\n".join(lines))
        print("stale: run python tools/technique_docs.py", file=sys.stderr)
    return int(bool(lines))


def _show(worker: Worker, technique: type[Technique], draw: bool) -> Shown:
    """Why it declines each kind of light, and how it looks where it does not."""
    cube = load_scene("cube-on-plane")
    reasons = {str(light.kind): _declined(worker, technique, _view(cube, light, 16)) for light in LIGHTS}
    wanted = technique.shown_in
    for name in (wanted,) if wanted else FALLBACK:
        scene = load_scene(name)
        view = _view(scene, scene.lights[0], SIZE)
        if not wanted and _declined(worker, technique, view) is not None:
            continue
        if not draw:
            return Shown(name, reasons, None, dict.fromkeys(SHOWN))
        drawn = worker.call(Session.draw, PlacedView(view), CellRequest(technique.name))
        return Shown(name, reasons, drawn, score(drawn.visibility, prepare_truth(cached_truth(view))))
    raise SystemExit(f"{technique.name} declines {', '.join(FALLBACK)}: give it `shown_in`, the name of one it draws")


def _view(scene: Scene, light: Light, size: int) -> View:
    return view_of(scene, scene.cameras[0], light, size)


def _declined(worker: Worker, technique: type[Technique], view: View) -> str | None:
    """Why a technique at its defaults has no answer for a view."""
    return worker.call(Session.unsupported, PlacedView(view), CellRequest(technique.name))


def _page(ours: list[type[Technique]], shown: dict[str, Shown]) -> str:
    families = _families(one.Params for one in ours)
    contents = [f"- [`{one.name}`](#{one.name}): {_first_line(one)}" for one in ours]
    contents += [f"- [{_title(family)}](#{_title(family).lower()})" for family in families]
    sections = [_technique(one, shown[one.name]) for one in ours] + [_family(family, ours) for family in families]
    return "\n".join([HEAD.format(size=SIZE), *contents, "", *sections])


def _technique(technique: type[Technique], shown: Shown) -> str:
    picture = f"techniques/{technique.name}.png"
    file = source_file(technique).resolve().relative_to(ROOT).as_posix()
    numbers = ", ".join(f"{label} {_number(shown.scores[key])}" for key, label in SHOWN.items())
    lines = [
        f"## {technique.name}",
        "",
        *_paragraphs(inspect.getmodule(technique)),
        *_paragraphs(technique),
        f"![{technique.name} on {shown.scene}]({picture})",
        "",
        f"Measured on `{shown.scene}`: {numbers}.",
        "",
        "| light | draws it |",
        "|---|---|",
        *(f"| {kind} | {reason or 'yes'} |" for kind, reason in shown.reasons.items()),
        "",
        *_broken(technique),
        *_parameters(technique.Params, "No parameters."),
    ]
    if technique.presets:
        lines += ["| preset | stands for |", "|---|---|"]
        lines += [f"| `{name}` | `{items}` |" for name, items in technique.presets.items()] + [""]
    return "\n".join([*lines, f"Source: [{file}](../{file})", ""])


def _broken(technique: type[Technique]) -> list[str]:
    """A line for each axis along which the technique leaves tolerance, a column for each kind of light."""
    ranges = pd.read_csv(RANGES)
    ranges = ranges[ranges["spec"] == technique.name]
    broken = ranges[ranges["breaks_at"].notna()]
    if broken.empty:
        return [f"Holds along all {ranges['axis'].nunique()} axes of `shadowbench stress`.", ""]
    lights = [light for light in NAMES if (ranges["light"] == light).any()]
    lines = [f"| breaks along | {' | '.join(NAMES[light] for light in lights)} |", "|---" * (len(lights) + 1) + "|"]
    for axis in dict.fromkeys(broken["axis"]):
        texts = ranges[ranges["axis"] == axis].set_index("light")["range"]
        lines.append(f"| {axis} | {' | '.join(str(texts.get(light, '')) for light in lights)} |")
    return [*lines, ""]


def _family(family: type[Row], ours: list[type[Technique]]) -> str:
    users = [
        f"`{key}` of [{one.name}](#{one.name})"
        for one in ours
        for key, info in one.Params.model_fields.items()
        if isinstance(info.default, family)
    ]
    lines = [f"## {_title(family)}", "", f"What may stand as {', '.join(users)}.", ""]
    for row in family.table.values():
        maps = sorted(getattr(row, "maps", ()))
        served = [f"Maps: {', '.join(maps)}.", ""] if maps else []
        lines += [f"### {row.name}", "", *_paragraphs(row), *served, *_parameters(row, "")]
    return "\n".join(lines)


def _parameters(model: type[TechniqueParams] | type[Row], none: str) -> list[str]:
    if not model.model_fields:
        return [none, ""] if none else []
    lines = ["| parameter | allowed | default | what |", "|---|---|---|---|"]
    for key, info in model.model_fields.items():
        values = allowed(info)
        if isinstance(info.default, Row):
            family = info.default.family()
            values = f"one of the [{_title(family).lower()}](#{_title(family).lower()})"
        cells = (f"`{key}`", values or "any number", f"`{format_value(info.default)}`", info.description or "")
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return [*lines, ""]


def _families(models: Iterable[type[TechniqueParams]]) -> list[type[Row]]:
    """The families that parameters draw from, each once, in the order of their first use."""
    defaults = [info.default for model in models for info in model.model_fields.values()]
    return list(dict.fromkeys(default.family() for default in defaults if isinstance(default, Row)))


def _title(family: type[Row]) -> str:
    name = family.__name__
    return name + ("es" if name.endswith("s") else "s")


def _paragraphs(thing: object) -> list[str]:
    text = inspect.cleandoc(getattr(thing, "__doc__", None) or "")
    return [text, ""] if text else []


def _first_line(technique: type[Technique]) -> str:
    """The docstring's first sentence, its paragraph made one line."""
    paragraph = " ".join(inspect.cleandoc(technique.__doc__ or "").split("\n\n")[0].split())
    return re.split(r"(?<=\.)\s", paragraph)[0]


def _number(value: float | None) -> str:
    return "…" if value is None else f"{value:.4f}"


def _png(picture: NDArray[np.uint8]) -> bytes:
    """An optimised PNG; in 256 colours where true colour takes more room than a page should ask for."""
    for image in (Image.fromarray(picture), Image.fromarray(picture).quantize(256)):
        stream = io.BytesIO()
        image.save(stream, format="PNG", optimize=True)
        if stream.tell() < LARGEST:
            return stream.getvalue()
    raise SystemExit(f"a picture takes {stream.tell()} bytes; allowed are {LARGEST}")


if __name__ == "__main__":
    sys.exit(main())
