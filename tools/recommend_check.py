"""Compares the choices of `recommend` with exhaustive search over the same space.

python tools/recommend_check.py [SCENE…] [--view-size N] [--largest N] [-o DIR]: measures every spec of the space in
each scene into DIR, once; then searches for each target in these rows, and prints the table of
docs/explanation/recommend.md and each choice that is not the cheapest, by the device on record, of all that meet the
target. Exits with 1 if there is one, or if a search measured too many specs.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shadowbench.advice.recommend import Cost, Target, find_cheapest
from shadowbench.advice.search import SIZES, Trial, full_space
from shadowbench.measure.campaign import Block, Campaign, Cell, LogReporter
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.results.law import law_on_record
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
TARGETS = [Target("iou", limit) for limit in (0.9, 0.95, 0.98, 0.99)] + [
    Target("edge_px", limit) for limit in (1.0, 0.5)
]
MAX_RATIO, MAX_SHARE = 1.01, 0.2  # largest cost relative to the cheapest, and largest share of the space to measure


@dataclass(frozen=True)
class Search:
    """A search in a scene: its choice, the cheapest spec (None if none meets the target), share of specs measured."""

    scene: str
    choice: Trial | None
    cheapest: Trial | None
    share: float

    @property
    def ratio(self) -> float:
        """Cost of the choice over the cheapest's; 1 if neither has one, infinite if only one of them has."""
        if self.cheapest is None:
            return 1.0 if self.choice is None or not self.choice.ranked else float("inf")
        return self.choice.cost / self.cheapest.cost if self.choice else float("inf")


def main() -> int:
    """Measure, search and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--view-size", type=int, default=512)
    parser.add_argument("--largest", type=int, default=max(SIZES), help="largest map size")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/recommend-check"))
    options = parser.parse_args()
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = options.scenes or [*hard_names(), *(str(larger / name) for name in LARGER)]
    searches: dict[Target, list[Search]] = {target: [] for target in TARGETS}
    with Worker() as worker:
        for scene in scenes:
            for target, search in searched(scene, options, worker):
                searches[target].append(search)
    print("| target | scenes | cheapest chosen | measured, at most | on average |\n|---|---:|---:|---:|---:|")
    for target, own in searches.items():
        right, shares = sum(one.ratio <= MAX_RATIO for one in own), [one.share for one in own]
        print(f"| {target} | {len(own)} | {right} | {max(shares):.1%} | {sum(shares) / len(shares):.1%} |")
    wrong = [one for own in searches.values() for one in own if one.ratio > MAX_RATIO or one.share > MAX_SHARE]
    for one in wrong:
        print(f"{one.scene}: {one.choice and one.choice.spec.text}, {one.ratio:.3g} × {one.cheapest}; {one.share:.1%}")
    return 1 if wrong else 0


def searched(scene: str, options: argparse.Namespace, worker: Worker) -> Iterator[tuple[Target, Search]]:
    """The search for each target in one scene."""
    view, largest, known = chosen_view(scene, options.view_size), options.largest, techniques()
    space = full_space(known, view.light.kind, largest)
    with Campaign(options.output, GLDrawer(worker), LogReporter()) as campaign:
        (results,) = campaign.measure([Block(view, tuple(map(Cell, space)))])
    rows, cost = dict(zip(space, results, strict=True)), Cost("ms", law_on_record())
    timed = [(spec, row) for spec, row in rows.items() if row.status == "ok" and not cost.unranked(spec)]
    for target in TARGETS:
        trials, _ = cost.compared([cost.trial(spec, row, target, view) for spec, row in timed])
        met = [trial for trial in trials if trial.error <= target.limit]
        cheapest = min(met, key=lambda trial: trial.rank, default=None)
        made = find_cheapest(view, cached_truth(view), target, cost, known, largest, rows.__getitem__)
        yield target, Search(view.scene.name, made.choice, cheapest, made.measured / len(space))


if __name__ == "__main__":
    sys.exit(main())
