"""Generates docs/explanation/gallery.md and its pictures from docs/gallery/artefacts.toml; --check finds stale text.

What stands above the list of artefacts is written by hand, on the page.
"""

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pages import LABEL, MEASURED, checks, completed, labelled, measured, png, write
from PIL import Image, ImageDraw

import shadowbench as sb
from shadowbench.measure.pictures import Rendering
from shadowbench.reports.gallery import difference
from shadowbench.scores.motion import MOTION
from shadowbench.studies.artefacts import Artefact, artefacts
from shadowbench.truths.trace import Truth

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURES = DOCS / "explanation" / "gallery.md", DOCS / "pictures" / "gallery"
SIZE, LARGEST = 256, 40_000  # pixels along a side of a panel, bytes of a picture
PARTS = 8  # of a panel's side, in which a crop is given
FRAME = (204, 0, 102)


@dataclass(frozen=True)
class Drawn:
    """An artefact's frames, one for each camera, and the metric's values: broken, cured, of other cures."""

    truths: list[Truth]
    traced: list[Rendering]
    broken: list[Rendering]
    cured: list[Rendering]
    values: list[float]


def draw(artefact: Artefact, size: int) -> Drawn:
    """Truth, and renderings by ray tracing and with the broken and cured settings, of size × size pixels."""
    scene = sb.load(artefact.file)
    views = [camera.name for camera in scene.cameras]
    traced, broken, cured = (
        [sb.render(scene, spec, view_size=size, view=view) for view in views]
        for spec in ("ray-traced", artefact.broken, artefact.cured)
    )
    truths = [sb.truth(scene, view_size=size, view=view) for view in views]
    if artefact.metric in MOTION:
        specs = [artefact.broken, artefact.cured]
        table = sb.run(scene, specs, view=views[0], view_size=size, rounds=0, sequence="pan", frames=8)
        values = table[artefact.metric].tolist()
    else:
        others = [sb.render(scene, spec, view_size=size, view=views[0]) for spec in artefact.others]
        masks = [one.visibility for one in (broken[0], cured[0], *others)]
        values = [sb.score(mask, truths[0])[artefact.metric] for mask in masks]
    return Drawn(truths, traced, broken, cured, values)


def _panels(artefact: Artefact, drawn: Drawn, index: int) -> NDArray[np.uint8]:
    panels = {
        "broken": drawn.broken[index].picture,
        "ray traced": drawn.traced[index].picture,
        "broken, change since the last frame" if index else "difference": _difference(drawn, index),
        "cured": drawn.cured[index].picture,
    }
    columns = []
    for title, panel in panels.items():
        tiles = [np.full((LABEL, SIZE, 3), 255, np.uint8), panel]
        if artefact.crop:
            left, top, side = (part * SIZE // PARTS for part in artefact.crop)
            enlarged = panel[top : top + side, left : left + side].repeat(SIZE // side, 0).repeat(SIZE // side, 1)
            tiles = [tiles[0], _framed(panel, left, top, side), _framed(enlarged, 0, 0, SIZE)]
        columns.append(labelled(np.vstack(tiles), title))
    return np.hstack(columns)


def _difference(drawn: Drawn, index: int) -> NDArray[np.uint8]:
    """Difference from the truth or, after the first frame, from the previous one where the truth is unchanged."""
    now, mask = drawn.truths[index], drawn.broken[index].visibility
    if not index:
        return difference(mask, now.visibility, now.undecided, facets=now.facet_shadow)
    was = drawn.truths[index - 1]
    moved = now.undecided | was.undecided | (now.visibility != was.visibility)
    return difference(mask, drawn.broken[index - 1].visibility, moved)


def _framed(panel: NDArray[np.uint8], left: int, top: int, side: int) -> NDArray[np.uint8]:
    """A copy with a square drawn by a line one pixel wide."""
    image = Image.fromarray(panel)
    ImageDraw.Draw(image).rectangle((left, top, left + side - 1, top + side - 1), outline=FRAME)
    return np.asarray(image)


def section(artefact: Artefact, values: Sequence[str]) -> str:
    """The section of an artefact; values: how often the work and memory its cure takes, and the metric as `Drawn`'s."""
    work, memory, broken, cured, *others = values
    also = ", ".join(f"{value} with `{spec}`" for spec, value in zip(artefact.others, others, strict=True))
    file = artefact.file.relative_to(DOCS.parent).as_posix()
    third = "change since the last frame" if artefact.metric in MOTION else "their difference"
    paragraphs = [
        f"### {artefact.name}",
        f"![{artefact.name}: broken, ray traced, {third}, cured](../pictures/gallery/{artefact.scene}.png)",
        _wrapped(artefact.see),
        _wrapped(f"**Cause.** {artefact.cause}"),
        _wrapped(f"**Cure.** {artefact.cure}"),
        f"Measured: `{artefact.metric}` {broken} broken, {cured} cured, for {work} times work, {memory} times memory"
        f"{also and f'; {also}'}.",
        _wrapped(f"**Question.** {artefact.question}"),
        f"```sh\nshadowbench run {file} -t '{artefact.broken}' -t '{artefact.cured}'\n```",
        _wrapped(f"{artefact.source}."),
    ]
    return "\n\n".join(paragraphs) + "\n"


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


def page(values: Mapping[str, Sequence[str]]) -> str:
    """The whole page; values: as those of `section`, by scene."""
    contents, sheets = [], []
    for chapter in dict.fromkeys(one.chapter for one in artefacts()):
        own = [one for one in artefacts() if one.chapter == chapter]
        anchors = {one.name: one.name.lower().replace(":", "").replace(" ", "-") for one in own}
        contents.append(f"- {chapter}: {', '.join(f'[{name}](#{anchor})' for name, anchor in anchors.items())}")
        sheets += [f"## {chapter}", "", *(section(one, values[one.scene]) for one in own)]
    return completed(PAGE, MEASURED, [measured(f"python tools/{Path(__file__).name}"), "", *contents, "", *sheets])


def main() -> int:
    """Write the page and pictures, or with --check compare the page without its numbers."""
    if checks(__doc__):
        return write({PAGE: page({one.scene: "…" * (4 + len(one.others)) for one in artefacts()})}, check=True)
    shutil.rmtree(PICTURES, ignore_errors=True)
    PICTURES.mkdir(parents=True)
    values = {}
    for one in artefacts():
        drawn = draw(one, SIZE)
        frames = range(int(len(drawn.truths) > 1), len(drawn.truths))  # the first of several has no change to show
        (PICTURES / f"{one.scene}.png").write_bytes(png([_panels(one, drawn, index) for index in frames], LARGEST))
        before, after = drawn.broken[0], drawn.cured[0]
        costs = after.work["cost"] / before.work["cost"], after.gpu_bytes / before.gpu_bytes
        values[one.scene] = [*(f"{cost:.2f}" for cost in costs), *(f"{value:.4f}" for value in drawn.values)]
        print(f"{one.name}: {', '.join(values[one.scene])}")
    return write({PAGE: page(values)}, check=False)


if __name__ == "__main__":
    sys.exit(main())
