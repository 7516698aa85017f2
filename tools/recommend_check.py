"""Compares the choices of `recommend` with exhaustive search over the same space.

python tools/recommend_check.py [SCENE…] [-o DIR]: measures every spec of the space in each scene, 512 × 512 pixels,
into DIR, once; then searches for each target in these rows, and prints the table of docs/explanation/recommend.md and
each choice that is not the cheapest, by the device on record, of all that meet the target. Exits with 1 if there is
one, or if a search measured too many specs.
"""

import argparse
import os
import sys
from pathlib import Path

import pandas as pd

from shadowbench.advice.recommend import Cost, find_cheapest
from shadowbench.advice.search import SIZES, cheapest, full_space
from shadowbench.measure.campaign import Block, Campaign, Cell, LogReporter
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.results.law import law_on_record
from shadowbench.results.summary import Target
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.metrics import METRICS
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
TARGETS = [Target("iou", limit) for limit in (0.9, 0.95, 0.98, 0.99)] + [
    Target("edge_px", limit) for limit in (1.0, 0.5)
]
MAX_RATIO, MAX_SHARE = 1.01, 0.2  # largest cost relative to the cheapest, and largest share of the space to measure


def main() -> int:
    """Measure, search and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/recommend-check"))
    asked = parser.parse_args()
    larger, known = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes")), techniques()
    cost, searches = Cost("predicted_ms", law_on_record()), []
    with Worker() as worker:
        for scene in asked.scenes or [*hard_names(), *(str(larger / name) for name in LARGER)]:
            view = chosen_view(scene, 512)
            space = full_space(known, view.light.kind, max(SIZES))
            with Campaign(asked.output, GLDrawer(worker), LogReporter()) as campaign:
                (results,) = campaign.measure([Block((view,), tuple(map(Cell, space)))])
            rows = dict(zip(space, results, strict=True))
            able = [(spec, row) for spec, row in rows.items() if row.status == "ok" and not cost.unranked(spec)]
            for target in TARGETS:
                trials, _ = cost.compared([cost.trial(spec, row, target, view) for spec, row in able])
                best = cheapest(trials, METRICS[target.metric].error(target.limit))
                advice = find_cheapest(view, cached_truth(view), target, cost, known, max(SIZES), rows.__getitem__)
                choice = advice.choice if advice.choice and advice.choice.ranked else None
                ratio = choice.cost / best.cost if choice and best else 1.0 if choice is best else float("inf")
                texts = (one and one.spec.text for one in (choice, best))
                searches.append((view.scene.name, advice.asked, *texts, ratio, advice.measured / len(space)))
    frame = pd.DataFrame(searches, columns=["scene", "target", "choice", "cheapest", "ratio", "share"])
    print("| target | scenes | cheapest chosen | measured, at most | on average |\n|---|---:|---:|---:|---:|")
    for target, own in frame.groupby("target", sort=False):
        right, share = (own["ratio"] <= MAX_RATIO).sum(), own["share"]
        print(f"| {target} | {len(own)} | {right} | {share.max():.1%} | {share.mean():.1%} |")
    wrong = frame[(frame["ratio"] > MAX_RATIO) | (frame["share"] > MAX_SHARE)]
    print("" if wrong.empty else wrong.to_string(index=False))
    return int(not wrong.empty)


if __name__ == "__main__":
    sys.exit(main())
