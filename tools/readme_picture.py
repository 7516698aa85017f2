"""Draws docs/shadows.png: a published setting, the default and the ray-traced truth, with errors in colour."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pages import labelled
from PIL import Image

from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.session import Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.scores.metrics import score
from shadowbench.truths.cache import cached_truth

SCENES = ("sphere-and-torus", "stairs")
SPECS = ("shadow-map:preset=course", "shadow-map", "ray-traced")
SIZE = 420
FALSE_SHADOW, FALSE_LIGHT = (213, 94, 0), (0, 114, 178)  # distinguishable with colour vision deficiency


def main() -> None:
    """Draw every spec in every scene, mark wrong pixels, and combine all into one image."""
    rows = [_row(worker, name) for name in SCENES for worker in [Worker()]]
    sheet = Image.fromarray(np.vstack(rows))
    file = Path(__file__).resolve().parent.parent / "docs" / "shadows.png"
    file.parent.mkdir(exist_ok=True)
    sheet.save(file, optimize=True)
    print(file)


def _row(worker: Worker, name: str) -> NDArray[np.uint8]:
    scene = load_scene(name)
    view = view_of(scene, scene.cameras[0], scene.lights[0], SIZE)
    truth = cached_truth(view)
    prepared = prepare_truth(truth)
    tiles = []
    with worker:
        for spec in SPECS:
            rendering = worker.call(Session.draw, PlacedView(view), CellRequest(spec))
            tile = rendering.picture.copy()
            shadow, decided = rendering.visibility < 0.5, truth.receivers & ~truth.undecided
            tile[decided & shadow & (truth.visibility > 0.5)] = FALSE_SHADOW
            tile[decided & ~shadow & (truth.visibility < 0.5)] = FALSE_LIGHT
            tiles.append(labelled(tile, f"{spec}   IoU {score(rendering.visibility, prepared)['iou']:.3f}"))
    return np.hstack(tiles)


if __name__ == "__main__":
    main()
