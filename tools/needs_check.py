"""Measures what `needs` predicts, on built-in scenes and larger ones: sizes of a map and of cascades, bits, bias.

python tools/needs_check.py [SCENE…] [--json FILE]: a line for each scene; a ratio is predicted over measured.
"""

import argparse
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import Session, Unsupported
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view
from shadowbench.survey.depth import LOST
from shadowbench.survey.maps import REFERENCE_SIZE
from shadowbench.survey.survey import Needs, needs
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
SIZES = tuple(round(256 * 2 ** (k / 2)) for k in range(13))  # to 16384
BIASES = tuple(2 ** (k / 2) for k in range(-8, 7))  # of the predicted
CASCADES = 5  # as the technique defaults to
FORMATS = {16: "depth=d16", 24: "depth=d24", 32: "depth=d32f,reversed=true"}
WITHIN = 2.0

Metrics = dict[str, float | None]


@dataclass(frozen=True)
class Pair:
    """A number as predicted and as measured; None where there is none, or none in the range that was walked."""

    predicted: float | None
    measured: float | None

    @property
    def ratio(self) -> float | None:
        """Predicted over measured."""
        return self.predicted / self.measured if self.predicted and self.measured else None


@dataclass(frozen=True)
class Checked:
    """A scene's predictions beside what was measured."""

    scene: str
    map_size: Pair
    cascade_size: Pair
    bias: Pair
    bits: Pair


def main() -> None:
    """Check the scenes that are named, or all, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = options.scenes or [*builtin_names(), *(str(larger / name) for name in LARGER)]
    columns = ("map size", f"{CASCADES} cascades", "bias, m", "depth bits")
    print(f"{'scene':18}" + "".join(f"{what:>12} {'measured':>9} {'ratio':>6}" for what in columns))
    rows = []
    with Worker() as worker:
        for scene in scenes:
            rows.append(check(chosen_view(scene, 512), worker))
            print(_line(rows[-1]), flush=True)
    for name in ("map_size", "cascade_size", "bias", "bits"):
        pairs = [pair for row in rows if (pair := getattr(row, name)).predicted]
        within = sum(pair.ratio is not None and 1 / WITHIN <= pair.ratio <= WITHIN for pair in pairs)
        same = sum(pair.predicted == pair.measured for pair in pairs)
        found = f"the same on {same}" if name == "bits" else f"within a factor of {WITHIN:g} on {within}"
        print(f"{name}: {found} of {len(pairs)} scenes")
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


def check(view: View, worker: Worker) -> Checked:
    """One scene, by shadow-map or under a point light by cube-map, at their defaults but for what is walked."""
    technique = "cube-map:depth=d32f" if view.light.kind == "point" else "shadow-map:depth=d32f"
    predicted = needs(view)
    truth = cached_truth(view)
    prepared = prepare_truth(truth)

    def measure(spec: str) -> Metrics:
        drawn = worker.call(Session.draw, PlacedView(view), CellRequest(spec))
        metrics: Metrics = mask_record(drawn.visibility, truth, prepared)["metrics"]
        return metrics

    def edge_p95(spec: str) -> float | None:
        try:
            return measure(spec)["edge_p95"]
        except Unsupported:  # a map that the driver refuses
            return None

    def edge_size(spec: str) -> float | None:
        return first_below(SIZES, 1.0, lambda size: edge_p95(f"{spec},size={size}"))

    edges, several = predicted.texels.edge_size, predicted.cascades
    return Checked(
        scene=view.scene.name,
        map_size=Pair(edges.value if edges else None, edge_size(technique) if edges else None),
        cascade_size=Pair(
            several.edge_size.get(CASCADES) if several else None,
            edge_size(f"cascades:count={CASCADES}") if several else None,
        ),
        bias=Pair(predicted.bias.needed.value if predicted.bias else None, _bias(measure, technique, predicted)),
        bits=Pair(predicted.bits.bits if predicted.bits else None, _bits(measure, technique)),
    )


def first_below(values: Sequence[float], limit: float, measure: Callable[[float], float | None]) -> float | None:
    """Where, walking up the values, a measurement first falls below a limit: the middle of that step, on a log scale.

    The middle, as `edge_p95` is a distance between pixels: it falls from 1 to 0 at once. None where it never does, or
    before the first value.
    """
    before: float | None = None
    for value in values:
        found = measure(value)
        if found is not None and found < limit:
            return None if before is None else float(np.sqrt(before * value))
        before = value
    return None


def _bits(measure: Callable[[str], Metrics], technique: str) -> int | None:
    """The fewest bits whose IoU is within LOST of the best format's."""
    name = technique.partition(":")[0]
    formats = FORMATS if name == "shadow-map" else {**FORMATS, 32: "depth=d32f"}
    scores = {bits: measure(f"{name}:size={REFERENCE_SIZE},{depth}")["iou"] for bits, depth in formats.items()}
    best = max((score for score in scores.values() if score is not None), default=None)
    if best is None:
        return None
    return next(bits for bits, score in scores.items() if score is not None and score >= best - LOST)


def _bias(measure: Callable[[str], Metrics], technique: str, predicted: Needs) -> float | None:
    """The least constant bias whose acne is below LOST, compared hard."""
    if predicted.bias is None:
        return None
    needed = predicted.bias.needed.value
    return first_below(
        [needed * factor for factor in BIASES],
        LOST,
        lambda bias: measure(f"{technique},size={REFERENCE_SIZE},bias=constant(world={bias:.9g}),filter=hard")["acne"],
    )


def _line(row: Checked) -> str:
    def text(value: float | None, form: str, width: int) -> str:
        return f"{'-' if value is None else format(value, form):>{width}}"

    line = f"{row.scene:18}"
    for pair, form in ((row.map_size, ".0f"), (row.cascade_size, ".0f"), (row.bias, ".3g"), (row.bits, ".0f")):
        line += f"{text(pair.predicted, form, 12)} {text(pair.measured, form, 9)} {text(pair.ratio, '.2f', 6)}"
    return line


if __name__ == "__main__":
    main()
