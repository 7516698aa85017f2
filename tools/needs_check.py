"""Compares predictions of `needs` with measurements on built-in and larger scenes: map size, cascades, bias.

python tools/needs_check.py [SCENE…]: a line of a Markdown table per scene; ratios are predicted over measured values.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

import shadowbench as sb
from shadowbench.scenes.library import hard_names
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.maps import REFERENCE_SIZE, TOLERATED
from shadowbench.survey.survey import needs

LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
SIZES = tuple(round(256 * 2 ** (k / 2)) for k in range(13))  # to 16384
BIASES = tuple(2 ** (k / 2) for k in range(-8, 7))  # factors of the predicted bias
CASCADES = 5  # the technique's default
COLUMNS = {"size": ".0f", f"size, {CASCADES} cascades": ".0f", "bias (m)": ".3g"}
WITHIN = 2.0


def main() -> None:
    """Check the given scenes, by default all, and print the table."""
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    print(f"| scene | {' | '.join(f'{name} | ratio' for name in COLUMNS)} |")
    print(f"|---|{'---:|' * 2 * len(COLUMNS)}")
    ratios: list[list[float | None]] = []  # None without a prediction, NaN without a measurement
    for scene in sys.argv[1:] or [*hard_names(), *(str(larger / name) for name in LARGER)]:
        pairs = list(check(scene))
        ratios.append([predicted and predicted / measured for predicted, measured in pairs])
        texts = [
            "–" if one is None else f"{one:{form}}" for (one, _), form in zip(pairs, COLUMNS.values(), strict=True)
        ]
        cells = [f"{text} | {ratio or np.nan:.2f}" for text, ratio in zip(texts, ratios[-1], strict=True)]
        print(f"| {Path(scene).stem} | {' | '.join(cells).replace('nan', '–')} |", flush=True)
    for name, column in zip(COLUMNS, zip(*ratios, strict=True), strict=True):
        able = [ratio for ratio in column if ratio is not None]
        within = sum(1 / WITHIN <= ratio <= WITHIN for ratio in able)
        print(f"{name}: within a factor of {WITHIN:g} in {within} of {len(able)} scenes")


def check(scene: str) -> Iterator[tuple[float | None, float]]:
    """What is predicted, None if nothing is, and measured, NaN if nothing in the range of measurements.

    Of shadow-map, or cube-map under a point light, at defaults but for what is varied.
    """
    view = chosen_view(scene, 512)
    names = {"view": view.camera.name, "light": view.light.name}
    predicted = needs(view, penumbrae=False)
    technique = "cube-map" if predicted.light == "point" else "shadow-map"

    def measure(spec: str, metric: str) -> float:
        """A metric of a spec, NaN if its map is too large for the driver."""
        return float(sb.run(scene, spec, view_size=512, rounds=0, **names).at[0, metric])

    one, several = predicted.texels.edge_size, predicted.cascades and predicted.cascades.edge_size[CASCADES]
    for size, spec in ((one, f"{technique}:depth=d32f"), (several, f"cascades:count={CASCADES}")):
        yield size, first_below(SIZES if size else (), 1.0, "edge_p95", spec + ",size={:.0f}", measure)
    bias = predicted.bias and predicted.bias.needed
    constant = f"{technique}:depth=d32f,size={REFERENCE_SIZE},filter=hard,bias=constant(world={{:.9g}})"
    yield bias, first_below([bias * factor for factor in BIASES] if bias else (), TOLERATED, "acne", constant, measure)


def first_below(
    values: Sequence[float], limit: float, metric: str, spec: str, measure: Callable[[str, str], float]
) -> float:
    """Value of a spec's parameter at which a metric first falls below a limit, NaN if not between two of the values.

    The geometric mean of those two, since `edge_p95` is a distance between pixels, which drops from 1 to 0 at once.
    """
    step = next((at for at, value in enumerate(values) if measure(spec.format(value), metric) < limit), 0)
    return float(np.sqrt(values[step - 1] * values[step])) if step else np.nan


if __name__ == "__main__":
    main()
