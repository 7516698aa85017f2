"""What one draw of a cell gives: images, and what its row says of memory, work and facts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.files import png_of
from shadowbench.scenes.tables import LONGEST_NAME
from shadowbench.techniques.base import Technique
from shadowbench.techniques.filters import Filter


@dataclass(frozen=True, eq=False)
class Rendering:
    """One draw of a cell, images with row 0 at the top.

    visibility: (N, N) float32 quantised to 16 bits; picture: (N, N, 3) uint8 sRGB, shaded with it; map: (H, W) float32
    linear depth, where it was asked for and the technique has one.
    """

    visibility: NDArray[np.float32]
    picture: NDArray[np.uint8]
    map: NDArray[np.float32] | None
    gpu_bytes: int
    work: dict[str, int]
    facts: dict[str, float]

    def _repr_png_(self) -> bytes:
        """The picture, as a notebook shows it."""
        return png_of(self.picture)


def own_work(technique: Technique, pixels: int, facts: dict[str, float]) -> dict[str, int]:
    """What OpenGL does not count: texture reads of maps, and rays. Taken out of `facts` where they state them.

    A technique with one of our filters reads what its row declares for each pixel of the view.
    """
    work: dict[str, int] = {name: int(facts.pop(name)) for name in ("reads", "rays") if name in facts}
    chosen = getattr(technique.params, "filter", None)
    if "reads" not in work and isinstance(chosen, Filter):
        work["reads"] = pixels * chosen.reads
    return work


def numbers(spec: str, facts: Mapping[str, float]) -> dict[str, float]:
    """Facts as a row can hold them; raises ValueError for one that is not finite, or has a name beyond LONGEST_NAME."""
    for name, value in facts.items():
        if len(name) > LONGEST_NAME:
            raise ValueError(
                f"{spec}: fact {name!r:.60}… has a name of {len(name)} characters; allowed: {LONGEST_NAME}"
            )
        if not math.isfinite(value):
            raise ValueError(f"{spec}: fact {name!r} is {value}; allowed: finite numbers")
    return {name: float(value) for name, value in facts.items()}
