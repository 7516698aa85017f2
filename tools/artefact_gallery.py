"""Generates docs/explanation/gallery.md and its pictures from docs/gallery/artefacts.toml; --check finds stale text.

What stands above the artefacts is written by hand, on the page.
"""

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pages import LABEL, MEASURED, checks, completed, labelled, measured, png, write
from PIL import Image, ImageDraw

import shadowbench as sb
from shadowbench.measure.campaign import Block, Cell
from shadowbench.measure.gl_drawer import GLDrawer, shared_worker
from shadowbench.measure.points import motion_scores
from shadowbench.measure.session import Rendering
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.reports.gallery import difference
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.sequences import frames_of, motions_of
from shadowbench.studies.artefacts import Artefact, artefacts
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURES = DOCS / "explanation" / "gallery.md", DOCS / "pictures" / "gallery"
SIZE, LARGEST = 256, 40_000  # pixels along a side of a panel, bytes of a picture, twice as many if it moves
FILMED = 6  # most frames of a picture
PARTS = 8  # of a panel's side, in which a crop is given
FRAME = (204, 0, 102)
_wrapped = partial(textwrap.fill, width=120, break_long_words=False, break_on_hyphens=False)


@dataclass(frozen=True)
class Drawn:
    """An artefact's frames, one if nothing moves, and the metric's values: broken, cured, of other cures."""

    truths: list[Truth]
    traced: list[Rendering]
    broken: list[Rendering]
    cured: list[Rendering]
    values: list[float]


def draw(artefact: Artefact, size: int) -> Drawn:
    """Truth, and renderings by ray tracing and with the broken and cured settings, of size × size pixels."""
    view = chosen_view(str(artefact.file), size)
    motions = motions_of(view.scene, [artefact.sequence] if artefact.sequence else [])
    views = frames_of(view, motions[0], artefact.frames) if motions else (view,)
    truths = [cached_truth(view) for view in views]

    def drawn(spec: str) -> list[Rendering]:
        cell = Cell(parse_spec(spec, techniques()))
        with shared_worker(()) as worker:
            return list(GLDrawer(worker).draw(Block(views, (cell,)), cell))

    def value(frames: list[Rendering]) -> float:
        masks = [one.visibility for one in frames]
        scores = motion_scores(zip(masks, truths, strict=True)) if motions else sb.score(masks[0], truths[0])
        return scores[artefact.metric]

    traced, *others = (drawn(spec) for spec in ("ray-traced", artefact.broken, artefact.cured, *artefact.others))
    return Drawn(truths, traced, *others[:2], list(map(value, others)))


def _panels(artefact: Artefact, drawn: Drawn, index: int) -> NDArray[np.uint8]:
    truth, broken = drawn.truths[index], drawn.broken[index]
    panels = {
        "broken": broken.picture,
        "ray traced": drawn.traced[index].picture,
        "difference": difference(broken.visibility, truth.visibility, truth.undecided, facets=truth.facet_shadow),
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


def _framed(panel: NDArray[np.uint8], left: int, top: int, side: int) -> NDArray[np.uint8]:
    """A copy with a square drawn by a line one pixel wide."""
    image = Image.fromarray(panel)
    ImageDraw.Draw(image).rectangle((left, top, left + side - 1, top + side - 1), outline=FRAME)
    return np.asarray(image)


def section(artefact: Artefact, values: Sequence[str]) -> str:
    """The section of an artefact; values: how often the work and memory its cure takes, and the metric as `Drawn`'s."""
    work, memory, broken, cured, *others = values
    also = ", ".join(f"{value} `{spec}`" for spec, value in zip(artefact.others, others, strict=True))
    file = artefact.file.relative_to(DOCS.parent).as_posix()
    moves = f" --sequence {artefact.sequence} --frames {artefact.frames}" if artefact.sequence else ""
    paragraphs = [
        f"### {artefact.name}",
        f"![{artefact.name}](../pictures/gallery/{artefact.scene}.png)",
        _wrapped(artefact.see),
        _wrapped(f"**Cause.** {artefact.cause}"),
        _wrapped(f"**Cure.** {artefact.cure}"),
        f"Measured: `{artefact.metric}` {broken}, cured {cured}; work ×{work}, memory ×{memory}{also and f'; {also}'}.",
        _wrapped(f"**Question.** {artefact.question}"),
        f"```sh\nshadowbench run {file} -t '{artefact.broken}' -t '{artefact.cured}'{moves}\n```",
        _wrapped(f"{artefact.source}."),
    ]
    return "\n\n".join(paragraphs) + "\n"


def page(values: Mapping[str, Sequence[str]]) -> str:
    """The whole page; values: as those of `section`, by scene."""
    sheets: list[str] = []
    for one in artefacts():
        chapter = f"## {one.chapter}\n"
        sheets += [*([] if chapter in sheets else [chapter]), section(one, values[one.scene])]
    return completed(PAGE, MEASURED, [measured(f"python tools/{Path(__file__).name}"), "", *sheets])


def main() -> int:
    """Write the page and pictures, or with --check compare the page without its numbers."""
    if checks(__doc__):
        return write({PAGE: page({one.scene: "…" * (4 + len(one.others)) for one in artefacts()})}, check=True)
    shutil.rmtree(PICTURES, ignore_errors=True)
    PICTURES.mkdir(parents=True)
    values = {}
    for one in artefacts():
        drawn = draw(one, SIZE)
        frames = range(0, len(drawn.truths), -(-len(drawn.truths) // FILMED))
        film = png([_panels(one, drawn, index) for index in frames], LARGEST * (2 if len(frames) > 1 else 1))
        (PICTURES / f"{one.scene}.png").write_bytes(film)
        before, after = drawn.broken[0], drawn.cured[0]
        costs = after.work["cost"] / before.work["cost"], after.gpu_bytes / before.gpu_bytes
        values[one.scene] = [*(f"{cost:.2f}" for cost in costs), *(f"{value:.4f}" for value in drawn.values)]
        print(f"{one.name}: {', '.join(values[one.scene])}")
    return write({PAGE: page(values)}, check=False)


if __name__ == "__main__":
    sys.exit(main())
