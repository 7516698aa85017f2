"""Makes docs/gallery.md and its pictures from docs/gallery/artefacts.toml; --check says whether the text is stale."""

import argparse
import sys
import textwrap
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pages import LABEL, compare, labelled, png

import shadowbench as sb
from shadowbench.measure.flips import flips
from shadowbench.measure.rendering import Rendering
from shadowbench.reports.gallery import difference
from shadowbench.scores.metrics import METRICS
from shadowbench.truths.trace import Truth

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, SCENES, PICTURES = DOCS / "gallery.md", DOCS / "gallery", DOCS / "pictures" / "gallery"
SIZE, LARGEST = 256, 40_000  # pixels along a side of a panel, bytes of a picture
PARTS = 8  # of a panel's side, in which a crop is given
FRAME = (204, 0, 102)
FLIPS = (
    "Share of the pixels near a true edge that change sides from one frame to the next where the truth does not; "
    "the largest of all pairs of frames."
)
HEAD = f"""\
# Gallery of artefacts

How real-time shadows go wrong: the smallest scene that shows it, the cause, the metric that catches it, the setting
that cures it and what that costs. Made by `python tools/artefact_gallery.py` from
[gallery/artefacts.toml](gallery/artefacts.toml).

A picture has four panels: the broken setting, the ray-traced truth, the difference between the two (orange is false
shadow, blue is false light), and the cured setting. Where a part is framed it is enlarged below. The commands draw the
broken and the cured panel; run them in the root of the repository.

Numbers are of views of {SIZE}² pixels. Work is what the GPU is asked to do (shader invocations, texture reads and rays)
and does not depend on its speed; memory is that of the technique's textures and buffers. *Real-Time Rendering* is
Akenine-Möller, Haines, Hoffman, Pesce, Iwanicki and Hillaire, 4th edition, 2018.
"""


@dataclass(frozen=True)
class Artefact:
    """A row of artefacts.toml. `crop`: left, top and side of the part that is enlarged, in parts of the panel."""

    name: str
    scene: str
    metric: str
    broken: str
    cured: str
    cause: str
    cure: str
    source: str
    crop: tuple[int, int, int] | None = None

    @property
    def file(self) -> Path:
        """Its scene's file."""
        return SCENES / f"{self.scene}.toml"


@dataclass(frozen=True)
class Drawn:
    """An artefact's frames, one for each camera of its scene."""

    truths: list[Truth]
    traced: list[Rendering]
    broken: list[Rendering]
    cured: list[Rendering]


def artefacts() -> list[Artefact]:
    """All of artefacts.toml, in its order."""
    tables = tomllib.loads((SCENES / "artefacts.toml").read_text(encoding="utf-8"))["artefact"]
    return [Artefact(**table) for table in tables]


def draw(artefact: Artefact, size: int) -> Drawn:
    """The truth, and the view as ray traced, broken and cured; `size` is in pixels along a side."""
    scene = sb.load(artefact.file)
    views = [camera.name for camera in scene.cameras]
    traced, broken, cured = (
        [sb.render(scene, spec, view_size=size, view=view) for view in views]
        for spec in ("ray-traced", artefact.broken, artefact.cured)
    )
    return Drawn([sb.truth(scene, view_size=size, view=view) for view in views], traced, broken, cured)


def value(metric: str, frames: list[Rendering], truths: list[Truth]) -> float:
    """The metric of what was drawn: of all frames for `flips`, of the first for those of the table."""
    if metric == "flips":
        found = flips([frame.visibility for frame in frames], truths)
    else:
        found = sb.score(frames[0].visibility, truths[0])[metric]
    if found is None:
        raise SystemExit(f"{metric} has nothing to divide by")
    return found


def picture(artefact: Artefact, drawn: Drawn) -> bytes:
    """The four panels as a PNG, which moves where there are several frames."""
    several = len(drawn.truths) > 1
    frames = [_panels(artefact, drawn, index) for index in range(int(several), len(drawn.truths))]
    return png(frames, LARGEST)


def _panels(artefact: Artefact, drawn: Drawn, index: int) -> NDArray[np.uint8]:
    panels = {
        "broken": drawn.broken[index].picture,
        "ray traced": drawn.traced[index].picture,
        "broken, changed since the frame before" if index else "difference": _difference(drawn, index),
        "cured": drawn.cured[index].picture,
    }
    columns = [_column(title, panel, artefact.crop) for title, panel in panels.items()]
    return np.hstack(columns)


def _difference(drawn: Drawn, index: int) -> NDArray[np.uint8]:
    """To the truth; of a frame with one before, to that, where the truth stays."""
    now, mask = drawn.truths[index], drawn.broken[index].visibility
    if not index:
        return difference(mask, now.visibility, now.undecided)
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
    """A copy with a line one pixel wide along the inside of a square."""
    framed, inside = panel.copy(), np.s_[top + 1 : top + side - 1, left + 1 : left + side - 1]
    framed[top : top + side, left : left + side] = FRAME
    framed[inside] = panel[inside]
    return framed


def section(artefact: Artefact, measured: str) -> str:
    """An artefact's part of the page."""
    explained = FLIPS if artefact.metric == "flips" else METRICS[artefact.metric].help
    file = artefact.file.relative_to(DOCS.parent).as_posix()
    view = " --view frame-2" if artefact.metric == "flips" else ""
    commands = [
        f"shadowbench render {file} -t '{spec}' --view-size {SIZE}{view} -o {name}.png"
        for name, spec in (("broken", artefact.broken), ("cured", artefact.cured))
    ]
    lines = [
        f"## {artefact.name}",
        "",
        f"![{artefact.name}: broken, ray traced, their difference, cured](pictures/gallery/{artefact.scene}.png)",
        "",
        *["```", *commands, "```", ""],
        _paragraph(f"**Cause.** {artefact.cause}"),
        "",
        _paragraph(f"**Metric.** `{artefact.metric}`: {explained}"),
        "",
        measured,
        "",
        _paragraph(f"**Cure.** {artefact.cure}"),
        "",
        _paragraph(f"{artefact.source}. Scene: [{artefact.file.name}](gallery/{artefact.file.name})."),
        "",
    ]
    return "\n".join(lines)


def _paragraph(text: str) -> str:
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


def measured(artefact: Artefact, drawn: Drawn) -> str:
    """The metric, broken and cured, and what the cure costs."""
    broken, cured = (value(artefact.metric, frames, drawn.truths) for frames in (drawn.broken, drawn.cured))
    before, after = drawn.broken[0], drawn.cured[0]
    work, memory = after.work["cost"] / before.work["cost"], after.gpu_bytes / before.gpu_bytes
    return _measured(artefact, f"{broken:.4f}", f"{cured:.4f}", f"{work:.2f}", f"{memory:.2f}")


def _measured(artefact: Artefact, broken: str, cured: str, work: str, memory: str) -> str:
    return (
        f"Measured: `{artefact.metric}` {broken} broken, {cured} cured, "
        f"for {work} times the work and {memory} times the memory."
    )


def page(lines: dict[str, str]) -> str:
    """The whole page; `lines` are the measured ones, by scene."""
    contents = [f"- [{one.name}](#{_anchor(one.name)})" for one in artefacts()]
    return "\n".join([HEAD, *contents, "", *(section(one, lines[one.scene]) for one in artefacts())])


def _anchor(name: str) -> str:
    return name.lower().replace(":", "").replace(" ", "-")


def main() -> int:
    """Write page and pictures, or with --check compare the page, whose numbers it leaves out."""
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
