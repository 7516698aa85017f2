"""Temporal stability: pixels that flip between lit and shadowed from frame to frame while the truth does not."""

import itertools
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import perpendicular_basis, unit, vec3
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.masks import greatest
from shadowbench.scores.metrics import METRICS, Metric
from shadowbench.truths.trace import Truth

Step = Literal["camera", "light"]
"""What moves in a small step."""

EDGE = 2  # pixels around a true edge in which flips are counted
FINER = 3
"""Pixels along a side, after a step of the camera, for one before it."""
SIZE_AFTER: Mapping[Step | None, int] = {"camera": FINER, "light": 1, None: 0}
"""Pixels along a side of the image after a step, for one before it; 0 without a step."""
RIGHT, UP = 0.5, 0.3  # pixels by which a step moves the image

Mask = NDArray[np.float32]
Count = Callable[[Sequence[Mask], Sequence[Truth]], float | None]


def _of_one_mask(comparison: Comparison) -> None:
    """One mask has no flips: they are counted between the frames before and after a step."""


FLIPS = Metric(
    "flips",
    _of_one_mask,
    "lower",
    "hard",
    "Of the pixels within 2 px of a true edge, the share that switches between lit and shadowed after a small step of "
    "camera or light (--step) although the truth does not: shimmering. On an axis of stress, the largest share "
    "from one frame to the next. Empty under a light with a size, where the truth changes throughout the penumbra.",
)
ROW_METRICS: Mapping[str, Metric] = ChainMap({FLIPS.name: FLIPS}, METRICS)
"""All metrics that a row may have: those of its mask, plug-ins' among them, and its flips."""


def row_metrics(row: Mapping[str, Any]) -> dict[str, float | None]:
    """Metrics of a score row by name, with its flips if they were measured; empty for a cell without scores."""
    return dict(row.get("metrics", {})) | ({FLIPS.name: row[FLIPS.name]} if FLIPS.name in row else {})


def flips(masks: Sequence[Mask], truths: Sequence[Truth]) -> float | None:
    """Largest share, over pairs of frames, of edge pixels that flip between lit and shadowed while the truth does not.

    masks: (H, W) visibility of each frame. Edge pixels are decided receivers within EDGE pixels of a true edge in both
    frames; None if there are none. A share of all receivers would depend on the length of the edges. None also under
    a light with a size: each step changes the truth throughout the penumbra, so that hardly a pixel is left to compare.
    """
    if any(truth.sampled for truth in truths):
        return None
    shares = []
    for (before, was), (after, now) in itertools.pairwise(zip(masks, truths, strict=True)):
        steady = was.receivers & now.receivers & ~was.undecided & ~now.undecided & (was.visibility == now.visibility)
        steady &= _near_edge(was) & _near_edge(now)
        if steady.any():
            shares.append(float(((before < 0.5) != (after < 0.5))[steady].mean()))
    return max(shares, default=None)


@dataclass(frozen=True, eq=False)
class Stepped:
    """A view after a small step; `count` compares it with the view before the step.

    A step of the camera turns it by a fraction of a pixel, so that all surfaces stay visible; an orthographic one moves
    aside by that. The image after it is
    FINER times as fine: pixels show other points of a surface than before, and would flip along every edge, even of a
    shadow map that does not move, if the nearest one were compared. A step of the light moves it by the same
    angle, seen from a view's height away if the camera is orthographic.
    """

    before: View
    step: Step

    @cached_property
    def view(self) -> View:
        """The view after the step."""
        before = self.before
        camera, light = before.camera, before.light
        pixel = (2 * camera.slope or 1.0) / before.size.height  # as an angle
        distance = camera.height or float(np.linalg.norm(np.subtract(camera.position, camera.target)))
        if self.step == "camera":
            offset = distance * pixel * (np.array([RIGHT, UP, 0.0]) @ camera.basis())
            position = np.add(camera.position, (1 - camera.converging) * offset)
            moved = replace(camera, position=vec3(position), target=vec3(np.add(camera.target, offset)))
            return replace(before, camera=moved, size=before.size.times(SIZE_AFTER[self.step]))
        across = pixel * (np.array([RIGHT, UP, 0.0]) @ perpendicular_basis(-unit(light.direction), camera.up))
        if light.kind == "directional":
            return replace(before, light=replace(light, direction=vec3(unit(light.direction) + across)))
        reach = float(np.linalg.norm(np.subtract(light.position, camera.target)))
        return replace(before, light=replace(light, position=vec3(np.add(light.position, reach * across))))

    def count(self, masks: Sequence[Mask], truths: Sequence[Truth]) -> float | None:
        """`flips` between the masks before and after the step.

        After a step of the camera, a pixel flips if it differs from all four pixels around its surface point, and its
        truth from none of them.
        """
        if self.step == "light":
            return flips(masks, truths)
        if any(truth.sampled for truth in truths):
            return None
        (before, after), (was, now) = masks, truths
        rows, columns, inside = self._surroundings
        steady = inside & was.receivers & ~was.undecided & _near_edge(was)
        flipped = np.ones_like(steady)
        for row, column in itertools.product((rows, rows + 1), (columns, columns + 1)):
            steady &= now.receivers[row, column] & ~now.undecided[row, column]
            steady &= now.visibility[row, column] == was.visibility
            flipped &= (after[row, column] < 0.5) != (before < 0.5)
        return float(flipped[steady].mean()) if steady.any() else None

    @cached_property
    def _surroundings(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
        """Row and column of the pixel after a step of the camera that lies above and left of each surface point.

        (H, W) each; also whether all four pixels around the point are inside the image.
        """
        camera, turned = self.before.camera, self.view.camera
        extents = [side * self.before.pixel / 2 for side in self.before.size]
        x, y = np.meshgrid(
            *(
                sign * extent * (1 - (2 * np.arange(side) + 1) / side)
                for sign, extent, side in zip((-1, 1), extents, self.before.size, strict=True)
            )
        )
        to_turned = camera.basis() @ turned.basis().T
        moved = np.subtract(turned.position, camera.position) @ turned.basis().T
        right, up, back = np.moveaxis(np.stack([x, y, -np.ones_like(x)], axis=-1) @ to_turned - moved, -1, 0)
        column, row = (
            np.floor((1 + side / extent) / 2 * count - 0.5).astype(np.intp)
            for side, extent, count in zip((-right / back, up / back), extents, self.view.size, strict=True)
        )
        width, height = self.view.size
        inside = (row >= 0) & (column >= 0) & (row < height - 1) & (column < width - 1)
        return row.clip(0, height - 2), column.clip(0, width - 2), inside


def _near_edge(truth: Truth) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = greatest(truth.visibility, EDGE) != -greatest(-truth.visibility, EDGE)
    return near
