"""Compares predictions of `needs` with measurements on built-in and larger scenes: map size, cascades, bits, bias.

python tools/needs_check.py [SCENE…]: a line of a Markdown table per scene; ratios are predicted over measured values.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from shadowbench.errors import Unsupported
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.maps import REFERENCE_SIZE, TOLERATED
from shadowbench.survey.survey import needs
from shadowbench.truths.cache import cached_truth

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
SIZES = tuple(round(256 * 2 ** (k / 2)) for k in range(13))  # to 16384
BIASES = tuple(2 ** (k / 2) for k in range(-8, 7))  # factors of the predicted bias
CASCADES = 5  # the technique's default
FORMATS = {16: "depth=d16", 24: "depth=d24", 32: "depth=d32f"}
COLUMNS = {"size": ".0f", f"size, {CASCADES} cascades": ".0f", "bias (m)": ".3g", "depth bits": ".0f"}
WITHIN = 2.0

Pair = tuple[float | None, float | None]
"""A predicted and a measured value; None if there is none, or none in the range of measurements."""


def main() -> None:
    """Check the given scenes, by default all, and print the table."""
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = sys.argv[1:] or [*hard_names(), *(str(larger / name) for name in LARGER)]
    print(f"| scene | {' | '.join(f'{name} | ratio' for name in COLUMNS)} |")
    print(f"|---|{'---:|' * 2 * len(COLUMNS)}")
    rows: list[list[Pair]] = []
    with Worker() as worker:
        for scene in scenes:
            rows.append(list(check(chosen_view(scene, 512), worker)))
            cells = [cell for pair, form in zip(rows[-1], COLUMNS.values(), strict=True) for cell in text(pair, form)]
            print(f"| {Path(scene).stem} | {' | '.join(cells)} |", flush=True)
    for name, column in zip(COLUMNS, zip(*rows, strict=True), strict=True):
        pairs = [(predicted, measured) for predicted, measured in column if predicted]
        within = sum(bool(measured) and 1 / WITHIN <= predicted / measured <= WITHIN for predicted, measured in pairs)
        print(f"{name}: within a factor of {WITHIN:g} in {within} of {len(pairs)} scenes")


def text(pair: Pair, form: str) -> list[str]:
    """The cells of a prediction and of its ratio to what was measured."""
    predicted, measured = pair
    ratio = f"{predicted / measured:.2f}" if predicted and measured else "–"
    return ["–" if predicted is None else format(predicted, form), ratio]


def check(view: View, worker: Worker) -> Iterator[Pair]:
    """The pairs of one scene with shadow-map, or cube-map under a point light, at defaults but for what is varied."""
    technique = "cube-map" if view.light.kind == "point" else "shadow-map"
    predicted, truth = needs(view, penumbrae=False), cached_truth(view)
    prepared = prepare_truth(truth)

    def measure(spec: str, metric: str) -> float | None:
        try:
            rendering = worker.call(Session.draw, view, CellRequest(spec))
        except Unsupported:  # the map is too large for the driver
            return None
        value: float | None = mask_record(rendering.visibility, truth, prepared)["metrics"][metric]
        return value

    edges, cascades, bias = predicted.texels.edge_size, predicted.cascades, predicted.bias
    for size, spec in (
        (edges, f"{technique}:depth=d32f"),
        (cascades and cascades.edge_size[CASCADES], f"cascades:count={CASCADES}"),
    ):
        yield (
            size,
            size and first_below(SIZES, 1.0, lambda size, spec=spec: measure(f"{spec},size={size}", "edge_p95")),
        )
    constant = f"{technique}:depth=d32f,size={REFERENCE_SIZE},filter=hard,bias=constant"
    biases = [bias.needed * factor for factor in BIASES] if bias else []
    yield (
        bias and bias.needed,
        first_below(biases, TOLERATED, lambda world: measure(f"{constant}(world={world:.9g})", "acne")),
    )
    reverse = {32: "depth=d32f,reversed=true"} if technique == "shadow-map" else {}
    formats = {**FORMATS, **reverse}.items()
    ious = {bits: measure(f"{technique}:size={REFERENCE_SIZE},{depth}", "iou") for bits, depth in formats}
    best = max((iou for iou in ious.values() if iou is not None), default=0.0)
    enough = [bits for bits, iou in ious.items() if iou is not None and iou >= best - TOLERATED]
    yield predicted.bits and predicted.bits.bits, enough[0] if enough else None


def first_below(values: Sequence[float], limit: float, measure: Callable[[float], float | None]) -> float | None:
    """Value at which a measurement first falls below a limit: the geometric mean of the values around that step.

    The mean, since `edge_p95` is a distance between pixels, which drops from 1 to 0 at once. None if the measurement
    never falls below the limit, or does so at the first value.
    """
    before: float | None = None
    for value in values:
        measured = measure(value)
        if measured is not None and measured < limit:
            return None if before is None else float(np.sqrt(before * value))
        before = value
    return None


if __name__ == "__main__":
    main()
