"""Strips for the pages of biases, filters, fits and splits: the same part of a picture with each member of a family."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pages import grid, labelled
from PIL import Image

from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.scenes.opening import chosen_view

SIZE, TILE, COLUMNS = 512, 180, 5  # pixels along a side of the picture and of a tile; tiles in a row


class Strip(NamedTuple):
    """What a strip shows: a scene, the spec that a member completes, a part, and what is to be seen.

    part: left, top and side in eighths of the picture.
    """

    scene: str
    spec: str
    part: tuple[int, int, int]
    seen: str


STRIPS = {
    "splits": Strip("deep-street", "cascades:split={}", (0, 0, 8), "a colour for each cascade"),
    "biases": Strip(
        "docs/gallery/light-leaks.toml",
        "shadow-map:fit=scene,size=512,bias={}",
        (3, 4, 4),
        "acne, the stripes on the ground, and light that leaks where floor and wall meet",
    ),
    "filters": Strip("post", "shadow-map:size=256,filter={}", (1, 3, 5), "edges, and the contact of the blue box"),
    "fits": Strip(
        "street", "shadow-map:size=512,filter=hard,fit={}", (2, 4, 3), "the size of texels, and what is missing"
    ),
}
COUNTED = {name: f"{name},count=4" for name in ("shares", "ends")}  # their defaults are of four cascades


def strip(worker: Worker, members: Iterable[str], shown: Strip) -> list[NDArray[np.uint8]]:
    """One (H, W, 3) picture with a labelled tile for each member that the spec's technique supports; tinted."""
    view = chosen_view(shown.scene, SIZE)
    asked = {one: CellRequest(shown.spec.format(COUNTED.get(one, one))) for one in members}
    left, top, side = (part * SIZE // 8 for part in shown.part)
    tiles = []
    for name, request in asked.items():
        if worker.call(Session.unsupported, view, request) is None:
            picture = Image.fromarray(worker.call(Session.draw, view, request, tinted=True).picture)
            part = picture.crop((left, top, left + side, top + side)).resize((TILE, TILE), Image.Resampling.NEAREST)
            tiles.append(labelled(np.asarray(part), name))
    return [grid(tiles, COLUMNS)]
