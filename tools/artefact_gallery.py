"""Generates docs/explanation/gallery.md and its pictures from docs/gallery/artefacts.toml; --check finds stale text."""

import argparse
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

import ages
import numpy as np
from numpy.typing import NDArray
from pages import LABEL, compare, labelled, png

import shadowbench as sb
from shadowbench.measure.flips import FLIPS, ROW_METRICS
from shadowbench.measure.session import Rendering
from shadowbench.reports.gallery import difference
from shadowbench.studies.artefacts import Artefact, artefacts
from shadowbench.truths.trace import Truth

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURES = DOCS / "explanation" / "gallery.md", DOCS / "pictures" / "gallery"
SIZE, LARGEST = 256, 40_000  # pixels along a side of a panel, bytes of a picture
PARTS = 8  # of a panel's side, in which a crop is given
FRAME = (204, 0, 102)
HEAD = f"""\
# Gallery of artefacts

How real-time shadows go wrong, a sheet for each artefact: what is seen in a minimal scene, its cause, the metric that
detects it, the setting that cures it, and the price; then a question to answer in the window or from a table. Generated
by `python tools/artefact_gallery.py` from [gallery/artefacts.toml](../gallery/artefacts.toml).

A picture has four panels: the broken setting, the ray-traced truth, the difference between the two (orange is false
shadow, blue is false light, purple dark facets), and the cured setting. A framed part is enlarged below. In a clone of
the repository, the first command of a sheet shows both settings in the window, where the list *artefact* has every
sheet too; the second prints their scores. [From a chapter to a spec](course.md) finds the sheet for a setting of course
notes. Pictures and texts are under the [MIT licence](../../LICENSE).

All numbers are for {SIZE}² images. Work is the number of shader invocations, texture reads and rays, which
does not depend on the GPU's speed; memory is that of the technique's textures and buffers. *Real-Time Rendering* is
Akenine-Möller, Haines, Hoffman, Pesce, Iwanicki and Hillaire, 4th edition, 2018.
"""


@dataclass(frozen=True)
class Drawn:
    """An artefact's frames, one for each camera of its scene, and its metric's values, broken and cured."""

    truths: list[Truth]
    traced: list[Rendering]
    broken: list[Rendering]
    cured: list[Rendering]
    values: tuple[float, float]


def draw(artefact: Artefact, size: int) -> Drawn:
    """Truth, and renderings by ray tracing and with the broken and cured settings; size: pixels along a side."""
    scene = sb.load(artefact.file)
    views = [camera.name for camera in scene.cameras]
    traced, broken, cured = (
        [sb.render(scene, spec, view_size=size, view=view) for view in views]
        for spec in ("ray-traced", artefact.broken, artefact.cured)
    )
    truths = [sb.truth(scene, view_size=size, view=view) for view in views]
    if artefact.metric == FLIPS.name:
        specs = [artefact.broken, artefact.cured]
        values = sb.run(scene, specs, view=views[0], view_size=size, rounds=0, step="camera")[FLIPS.name].tolist()
    else:
        values = [value(artefact.metric, frames[0], truths[0]) for frames in (broken, cured)]
    return Drawn(truths, traced, broken, cured, (values[0], values[1]))


def value(metric: str, frame: Rendering, truth: Truth) -> float:
    """The value of a metric of one frame."""
    found = sb.score(frame.visibility, truth)[metric]
    if found is None:
        raise SystemExit(f"{metric} is undefined: its denominator is 0")
    return found


def picture(artefact: Artefact, drawn: Drawn) -> bytes:
    """The four panels as a PNG, animated if there are several frames."""
    several = len(drawn.truths) > 1
    frames = [_panels(artefact, drawn, index) for index in range(int(several), len(drawn.truths))]
    return png(frames, LARGEST)


def _panels(artefact: Artefact, drawn: Drawn, index: int) -> NDArray[np.uint8]:
    panels = {
        "broken": drawn.broken[index].picture,
        "ray traced": drawn.traced[index].picture,
        "broken, change since the last frame" if index else "difference": _difference(drawn, index),
        "cured": drawn.cured[index].picture,
    }
    columns = [_column(title, panel, artefact.crop) for title, panel in panels.items()]
    return np.hstack(columns)


def _difference(drawn: Drawn, index: int) -> NDArray[np.uint8]:
    """Difference from the truth or, after the first frame, from the previous one where the truth is unchanged."""
    now, mask = drawn.truths[index], drawn.broken[index].visibility
    if not index:
        return difference(mask, now.visibility, now.undecided, facets=now.facet_shadow)
    was = drawn.truths[index - 1]
    moved = now.undecided | was.undecided | (now.visibility != was.visibility)
    return difference(mask, drawn.broken[index - 1].visibility, moved)


def _column(title: str, panel: NDArray[np.uint8], crop: tuple[int, int, int] | None) -> NDArray[np.uint8]:
    tiles = [np.full((LABEL, SIZE, 3), 255, np.uint8), panel]
    if crop:
        left, top, side = (part * SIZE // PARTS for part in crop)
        enlarged = panel[top : top + side, left : left + side].repeat(SIZE // side, axis=0).repeat(SIZE // side, axis=1)
        tiles = [tiles[0], _framed(panel, left, top, side), _framed(enlarged, 0, 0, SIZE)]
    return labelled(np.vstack(tiles), title)


def _framed(panel: NDArray[np.uint8], left: int, top: int, side: int) -> NDArray[np.uint8]:
    """A copy with a square drawn by a line one pixel wide."""
    framed, inside = panel.copy(), np.s_[top + 1 : top + side - 1, left + 1 : left + side - 1]
    framed[top : top + side, left : left + side] = FRAME
    framed[inside] = panel[inside]
    return framed


def section(artefact: Artefact, measured: str) -> str:
    """The section of an artefact."""
    explained = ROW_METRICS[artefact.metric].help
    file = artefact.file.relative_to(DOCS.parent).as_posix()
    third = "change since the last frame" if artefact.metric == "flips" else "their difference"
    both = f"{file} -t '{artefact.broken}' -t '{artefact.cured}'"
    step = " --step camera" if artefact.metric == FLIPS.name else ""
    lines = [
        f"### {artefact.name}",
        "",
        f"![{artefact.name}: broken, ray traced, {third}, cured](../pictures/gallery/{artefact.scene}.png)",
        "",
        _paragraph(f"**What you see.** {artefact.see}"),
        "",
        _paragraph(f"**Cause.** {artefact.cause}"),
        "",
        _paragraph(f"**Metric.** `{artefact.metric}`: {explained}"),
        "",
        measured,
        "",
        _paragraph(f"**Cure.** {artefact.cure}"),
        "",
        _paragraph(f"**Question.** {artefact.question}"),
        "",
        f"In the window: `shadowbench view {both}`",
        "",
        *["```sh", f"shadowbench run {both}{step} --view-size {SIZE}", "```", ""],
        _paragraph(f"{artefact.source}. Scene: [{artefact.file.name}](../gallery/{artefact.file.name})."),
        "",
    ]
    return "\n".join(lines)


def _paragraph(text: str) -> str:
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


def measured(artefact: Artefact, drawn: Drawn) -> str:
    """A line with the metric of both settings and the cost of the cure."""
    broken, cured = drawn.values
    before, after = drawn.broken[0], drawn.cured[0]
    work, memory = after.work["cost"] / before.work["cost"], after.gpu_bytes / before.gpu_bytes
    return _measured(artefact, f"{broken:.4f}", f"{cured:.4f}", f"{work:.2f}", f"{memory:.2f}")


def _measured(artefact: Artefact, broken: str, cured: str, work: str, memory: str) -> str:
    return (
        f"Measured: `{artefact.metric}` {broken} broken, {cured} cured, "
        f"for {work} times the work and {memory} times the memory."
    )


def page(lines: dict[str, str]) -> str:
    """The whole page; lines: those of `measured`, by scene."""
    chapters = dict.fromkeys(one.chapter for one in artefacts())
    contents, sheets = [], []
    for chapter in chapters:
        own = [one for one in artefacts() if one.chapter == chapter]
        contents.append(f"- {chapter}: {', '.join(f'[{one.name}](#{_anchor(one.name)})' for one in own)}")
        sheets += [f"## {chapter}", "", *(section(one, lines[one.scene]) for one in own)]
    return "\n".join([HEAD, ages.record(f"python tools/{Path(__file__).name}"), "", *contents, "", *sheets])


def _anchor(name: str) -> str:
    return name.lower().replace(":", "").replace(" ", "-")


def main() -> int:
    """Write the page and pictures, or with --check compare the page without its numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit 1 if the committed text is stale; draws nothing")
    if parser.parse_args().check:
        made = page({one.scene: _measured(one, "…", "…", "…", "…") for one in artefacts()})
        return compare(PAGE, made, Path(__file__).name)
    PICTURES.mkdir(parents=True, exist_ok=True)
    lines = {}
    for one in artefacts():
        drawn = draw(one, SIZE)
        (PICTURES / f"{one.scene}.png").write_bytes(picture(one, drawn))
        lines[one.scene] = measured(one, drawn)
        print(f"{one.name}: {lines[one.scene]}")
    for file in PICTURES.glob("*.png"):
        if file.stem not in lines:
            file.unlink()
    PAGE.write_text(page(lines), encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
