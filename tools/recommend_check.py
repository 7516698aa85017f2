"""Holds `recommend` against exhaustive search over the same space, and makes docs/recommend.md of it.

python tools/recommend_check.py [SCENE…] [--view-size N] [-o DIR] [--docs FILE]: every spec of the space is measured in
each scene, once and for all into DIR; then each target is searched for on those rows, counting what the search asks.
"""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from shadowbench.advice.recommendation import MARGINS, Target, find_cheapest, trial_of
from shadowbench.advice.search import Trial
from shadowbench.advice.space import full_space, grid_of
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.measurer import Measurer
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import Result
from shadowbench.measure.timing import Conditions
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.views import chosen_view
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import own_techniques, techniques
from shadowbench.techniques.spec import Spec
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
TARGETS = (
    Target("iou", 0.95),
    Target("iou", 0.9),
    Target("iou", 0.98),
    Target("iou", 0.99),
    Target("edge_px", 1.0),
    Target("edge_px", 0.5),
)
DEARER, SHARE = 1.15, 0.2  # what a recommendation may cost, and how much of the space it may measure

HEAD = """\
# Recommendations

`shadowbench recommend SCENE` finds the cheapest technique, parameters and map size that meet a target. Cost is a GPU's
milliseconds; on a software renderer, whose times are not a GPU's, it is `work_cost` (shader invocations, texture reads,
rays), then bytes. Costs are compared with exhaustive search over the space of
[techniques](techniques.md) below. Made by `python tools/recommend_check.py`.

## The space

{space}

Other parameters are at their defaults, biases among them: they cost alike. `ray-traced` and `unshadowed` are no choice,
but for a view without any shadow. The default target is an IoU of 0.99.

## The search

1. `needs` leaves out what its numbers exclude: techniques that do not answer the light, a depth format that is too
   coarse, or wider than needed, `planar-projection` where too little of what is seen is planar.
2. What has no map is measured.
3. Each map's group (a technique, its fit or its number of cascades) is looked at once, near the size that `needs`
   predicts, unless even its least work, a read and a write for each pixel, costs more than what meets the target.
4. From then on cost and error of all that is left are predicted. Texels cost a power of the size, known from two sizes
   of the group; errors fall on a line in logarithms; one filter's error against another's is taken from other groups.
   Left out is what costs more than the best so far, and what cannot meet the target even if its error is {same:g} times
   below the predicted ({other:g} times, of a filter that was not seen yet; {edges:g} times for `edge_px`, which single
   specks move). The cheapest that is expected to meet the target is measured next, else what comes closest, until
   nothing is left. An error below that of one wrong pixel counts as none.

Nothing makes an error fall as a map grows: a grid that happens to lie well may beat one twice its size, all the more
where few edges are seen. What is missed for it stands in bold.

## Against exhaustive search

{size} × {size} pixels, the first camera and light of each scene. `× cheapest` is the cost of the choice against that of
the cheapest of the whole space that meets the target; it may be at most {dearer:g}, at most {share:.0%} of the space
measured.
"""


@dataclass(frozen=True)
class Line:
    """One scene and target: the choice, the true cheapest (None: nothing meets it), specs measured and in all."""

    scene: str
    choice: Trial | None
    cheapest: Trial | None
    measured: int
    whole: int

    @property
    def ratio(self) -> float:
        """Cost of the choice over the cheapest's; 1 where both find nothing, infinite where one of them does."""
        if self.choice is None or self.cheapest is None:
            return 1.0 if self.choice is self.cheapest else float("inf")
        return self.choice.cost / self.cheapest.cost

    @property
    def holds(self) -> bool:
        """Whether it is cheap enough, and was found with few enough measurements."""
        return self.ratio <= DEARER and self.measured <= SHARE * self.space_size


class _Silent:
    def note(self, line: str) -> None:
        """Nothing."""

    def stage(self, name: str, total: int) -> None:
        """Nothing."""

    def step(self, what: str) -> None:
        """Nothing."""


def main() -> None:
    """Measure, search, print; exit code 1 where a promise does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--view-size", type=int, default=512)
    parser.add_argument("-o", "--output", type=Path, default=Path("results/recommend-check"))
    parser.add_argument("--docs", type=Path, help="write the page here")
    options = parser.parse_args()
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = options.scenes or [*builtin_names(), *(str(larger / name) for name in LARGER)]
    known = techniques()
    lines: dict[Target, list[Line]] = {target: [] for target in TARGETS}
    with Worker() as worker:
        for scene in scenes:
            for target, line in check(scene, options.view_size, options.output, worker, known).items():
                lines[target].append(line)
                print(f"{line.scene:18} {target!s:28} {_text(line)}", flush=True)
    for target, found in lines.items():
        print(_summary(target, found))
    if options.docs:
        options.docs.write_text(page(lines, options.view_size), encoding="utf-8")
    sys.exit(0 if all(line.holds for found in lines.values() for line in found) else 1)


def check(
    scene: str, size: int, folder: Path, worker: Worker, known: Mapping[str, type[Technique]]
) -> dict[Target, Line]:
    """All targets in one scene."""
    view = chosen_view(scene, size)
    truth = cached_truth(view)
    largest = worker.info.max_map_size
    space = full_space(known, view.light.kind, largest)
    with closing(RowStore(folder)) as store:
        measurer = Measurer(worker, store, Conditions(), _Silent(), Pictures(folder))
        results = measurer.measure(Block(view, tuple(map(Cell, space))))
    rows: dict[Spec, Result] = dict(zip(space, results, strict=True))
    lines = {}
    for target in TARGETS:
        held = [trial_of(spec, row, target, "work") for spec, row in rows.items() if row.status == "ok"]
        met = [one for one in held if one.error <= target.limit]
        found = find_cheapest(view, truth, target, "work", known, largest, rows.__getitem__)
        cheapest = min(met, key=lambda one: (one.cost, one.bytes, one.error), default=None)
        lines[target] = Line(view.scene.name, found.choice, cheapest, found.measured, len(space))
    return lines


def page(lines: Mapping[Target, Sequence[Line]], size: int) -> str:
    """The whole page."""
    (same, other), (edges, _) = MARGINS["iou"], MARGINS["edge_px"]
    space = "\n".join(_space())
    parts = [HEAD.format(space=space, same=same, other=other, edges=edges, size=size, dearer=DEARER, share=SHARE)]
    for target, found in lines.items():
        parts += [
            f"### {target}\n",
            f"{_summary(target, found)}.\n",
            "| scene | choice | × cheapest | the cheapest, where it is another | measured | of | share |",
            "|---|---|---|---|---|---|---|",
            *(_row(line) for line in found),
            "",
        ]
    return "\n".join(parts)


def _space() -> list[str]:
    rows = ["| technique | values |", "|---|---|"]
    for one in own_techniques():
        values = "; ".join(f"`{key}` {', '.join(map(str, choices))}" for key, choices in grid_of(one).items())
        rows += [] if one.no_choice else [f"| `{one.name}` | {values or 'its defaults'} |"]
    return rows


def _row(line: Line) -> str:
    other = line.cheapest if line.ratio > 1 else None
    cells = (
        line.scene,
        _name(line.choice),
        f"{line.ratio:.2f}" if line.ratio <= DEARER else f"**{line.ratio:.2f}**",
        _name(other) if other else "",
        str(line.measured),
        str(line.space_size),
        f"{line.measured / line.space_size:.1%}"
        if line.measured <= SHARE * line.space_size
        else f"**{line.measured / line.space_size:.1%}**",
    )
    return f"| {' | '.join(cells)} |"


def _name(one: Trial | None) -> str:
    if one is None:
        return "none"
    size = f" at {one.spec.map_size}" if one.spec.map_size else ""
    return f"`{one.spec.sizeless_text}`{size}"


def _text(line: Line) -> str:
    other = f" | {_name(line.cheapest)}" if line.ratio > 1 else ""
    return f"{line.ratio:.3f} {line.measured}/{line.space_size} {_name(line.choice)}{other}"


def _summary(target: Target, found: Sequence[Line]) -> str:
    cheap = sum(line.ratio <= DEARER for line in found)
    shares = [line.measured / line.space_size for line in found]
    return (
        f"{target}: within {DEARER:g} × the cheapest on {cheap} of {len(found)} scenes; measured {max(shares):.1%} of "
        f"the space at most, {sum(shares) / len(shares):.1%} in the mean"
    )


if __name__ == "__main__":
    main()
