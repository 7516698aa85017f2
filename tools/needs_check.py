"""Compares predictions of `needs` with measurements on built-in and larger scenes: map size, cascades, bits, bias.

python tools/needs_check.py [SCENE…] [--json FILE]: one line per scene; ratios are predicted over measured values.
"""

import argparse
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from shadowbench.errors import Unsupported
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.depth import TOLERATED
from shadowbench.survey.samples import REFERENCE_SIZE
from shadowbench.survey.survey import Needs, needs
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
SIZES = tuple(round(256 * 2 ** (k / 2)) for k in range(13))  # to 16384
BIASES = tuple(2 ** (k / 2) for k in range(-8, 7))  # factors of the predicted bias
CASCADES = 5  # the technique's default
FORMATS = {16: "depth=d16", 24: "depth=d24", 32: "depth=d32f,reversed=true"}
WITHIN = 2.0
COLUMNS = (  # heading, field of SceneCheck, format of values, width of the prediction
    ("size", "map_size", ".0f", 12),
    (f"size, {CASCADES} cascades", "cascade_size", ".0f", 18),
    ("bias (m)", "bias", ".3g", 12),
    ("depth bits", "bits", ".0f", 12),
)

Metrics = dict[str, float | None]


@dataclass(frozen=True)
class Pair:
    """A predicted and a measured value; None if there is none, or none in the range of measurements."""

    predicted: float | None
    measured: float | None

    @property
    def ratio(self) -> float | None:
        """Predicted over measured."""
        return self.predicted / self.measured if self.predicted and self.measured else None


@dataclass(frozen=True)
class SceneCheck:
    """Predictions and measurements of a scene."""

    scene: str
    map_size: Pair
    cascade_size: Pair
    bias: Pair
    bits: Pair


def main() -> None:
    """Check the given scenes, by default all, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = options.scenes or [*hard_names(), *(str(larger / name) for name in LARGER)]
    headings = "".join(f"{name:>{width}} {'measured':>9} {'ratio':>6}" for name, _, _, width in COLUMNS)
    print(f"{'scene':18}{headings}")
    rows = []
    with Worker() as worker:
        for scene in scenes:
            rows.append(check(chosen_view(scene, 512), worker))
            print(_line(rows[-1]), flush=True)
    for name, field, _, _ in COLUMNS:
        pairs = [pair for row in rows if (pair := getattr(row, field)).predicted]
        within = sum(pair.ratio is not None and 1 / WITHIN <= pair.ratio <= WITHIN for pair in pairs)
        same = sum(pair.predicted == pair.measured for pair in pairs)
        found = f"the same on {same}" if field == "bits" else f"within a factor of {WITHIN:g} on {within}"
        print(f"{name}: {found} of {len(pairs)} scenes")
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


def check(view: View, worker: Worker) -> SceneCheck:
    """Check one scene with shadow-map, or cube-map under a point light, at defaults except for the varied parameter."""
    technique = "cube-map:depth=d32f" if view.light.kind == "point" else "shadow-map:depth=d32f"
    predicted = needs(view)
    truth = cached_truth(view)
    prepared = prepare_truth(truth)

    def measure(spec: str) -> Metrics:
        rendering = worker.call(Session.draw, view, CellRequest(spec))
        metrics: Metrics = mask_record(rendering.visibility, truth, prepared)["metrics"]
        return metrics

    def edge_p95(spec: str) -> float | None:
        try:
            return measure(spec)["edge_p95"]
        except Unsupported:  # the map is too large for the driver
            return None

    def edge_size(spec: str) -> float | None:
        return first_below(SIZES, 1.0, lambda size: edge_p95(f"{spec},size={size}"))

    edges, cascades = predicted.texels.edge_size, predicted.cascades
    return SceneCheck(
        scene=view.scene.name,
        map_size=Pair(edges, edge_size(technique) if edges else None),
        cascade_size=Pair(
            cascades.edge_size.get(CASCADES) if cascades else None,
            edge_size(f"cascades:count={CASCADES}") if cascades else None,
        ),
        bias=Pair(predicted.bias.needed if predicted.bias else None, _bias(measure, technique, predicted)),
        bits=Pair(predicted.bits.bits if predicted.bits else None, _bits(measure, technique)),
    )


def first_below(values: Sequence[float], limit: float, measure: Callable[[float], float | None]) -> float | None:
    """Value at which a measurement first falls below a limit: the geometric mean of the values around that step.

    The mean, since `edge_p95` is a distance between pixels, which drops from 1 to 0 at once. None if the measurement
    never falls below the limit, or does so at the first value.
    """
    before: float | None = None
    for value in values:
        found = measure(value)
        if found is not None and found < limit:
            return None if before is None else float(np.sqrt(before * value))
        before = value
    return None


def _bits(measure: Callable[[str], Metrics], technique: str) -> int | None:
    """Fewest bits whose IoU is within TOLERATED of the best format's."""
    name = technique.partition(":")[0]
    formats = FORMATS if name == "shadow-map" else {**FORMATS, 32: "depth=d32f"}
    scores = {bits: measure(f"{name}:size={REFERENCE_SIZE},{depth}")["iou"] for bits, depth in formats.items()}
    best = max((score for score in scores.values() if score is not None), default=None)
    if best is None:
        return None
    return next(bits for bits, score in scores.items() if score is not None and score >= best - TOLERATED)


def _bias(measure: Callable[[str], Metrics], technique: str, predicted: Needs) -> float | None:
    """Smallest constant bias with acne below TOLERATED, without filtering."""
    if predicted.bias is None:
        return None
    needed = predicted.bias.needed
    return first_below(
        [needed * factor for factor in BIASES],
        TOLERATED,
        lambda bias: measure(f"{technique},size={REFERENCE_SIZE},bias=constant(world={bias:.9g}),filter=hard")["acne"],
    )


def _line(row: SceneCheck) -> str:
    def text(value: float | None, form: str, width: int) -> str:
        return f"{'-' if value is None else format(value, form):>{width}}"

    line = f"{row.scene:18}"
    for _, field, form, width in COLUMNS:
        pair = getattr(row, field)
        line += f"{text(pair.predicted, form, width)} {text(pair.measured, form, 9)} {text(pair.ratio, '.2f', 6)}"
    return line


if __name__ == "__main__":
    main()
