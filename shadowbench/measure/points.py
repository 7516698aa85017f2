"""Points of surfaces, followed from frame to frame by their triangle and barycentric coordinates."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.scoring import prepare_truth, surface_points
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.masks import Mask, Single
from shadowbench.scores.motion import Motion, Seen
from shadowbench.truths.trace import Truth

CENTRE = 1 / 256  # px from a row or column of centres up to which a point is on it; a decided truth is the same so far
ALIGNED = 0.9  # least cosine between the normals of neighbouring triangles of one surface
STEP = 1.0  # pixels, as large as at the point, by which a surface may be off the point's plane

Indices = NDArray[np.int32]


class Points:
    """The points that are followed through the truths of a sequence, at first those at the pixels' centres.

    Where none is left, a new one begins at the centre of a decided receiver; of two at one pixel the older one stays.
    What it returns depends on the truths alone, so that one serves the masks of any number of techniques.
    """

    def __init__(self) -> None:
        self._before: View | None = None
        self._triangle = np.zeros(0, np.int32)
        self._weights = np.zeros((0, 3))  # of the triangles' corners
        self._place = np.zeros((0, 3))  # in the frame before

    def see(self, truth: Truth) -> Seen:
        """The points in the next frame. Raises ValueError for a truth without a view, or of other triangles."""
        view, before = truth.view, self._before
        if view is None:
            raise ValueError("a truth without a view; allowed: one of `trace`, whose surfaces are known")
        geometry, still = view.scene.geometry, before is not None and before.light == view.light
        if before is not None and before.scene is not view.scene:
            if not np.array_equal(before.scene.geometry.faces, geometry.faces):
                raise ValueError(f"{view.name}: other triangles than in the frame before; allowed: the same, moved")
            if not np.array_equal(before.scene.geometry.vertices, geometry.vertices):
                self._place = np.einsum("nk,nki->ni", self._weights, geometry.corners(self._triangle))
                still = False
        decided = (truth.receivers & ~truth.undecided).ravel()
        kept, around, read = _followed(view, self._triangle, self._place, truth.triangle.ravel(), decided)
        free = decided.copy()
        free[around[0]] = False
        new = np.flatnonzero(free).astype(np.int32)
        triangle = truth.triangle.ravel()[new]
        place = surface_points(view, new, triangle) + np.array(view.camera.position)
        weights = geometry.weights(triangle, place)
        self._before = view
        self._triangle = np.concatenate([self._triangle[kept], triangle])
        self._weights = np.concatenate([self._weights.take(kept, axis=0), weights])
        self._place = np.concatenate([self._place.take(kept, axis=0), place])
        pixel, right, below = np.concatenate([around, np.stack([new, 0 * new, 0 * new])], axis=1)
        return Seen(kept, pixel, right, below, np.concatenate([read, free[new]]), still)


def motion_scores(frames: Iterable[tuple[Single, Truth]]) -> dict[str, float | None]:
    """`Motion.scores` of masks (H, W) and their truths, in order."""
    motion, points = Motion(), Points()
    for mask, truth in frames:
        motion.add(Comparison(mask, prepare_truth(truth)), points.see(truth))
    return motion.scores()


def _followed(
    view: View, triangle: Indices, place: Floats, seen: Indices, decided: Mask
) -> tuple[Indices, Indices, Mask]:
    """`kept`, (3, K) `pixel`, `right` and `below`, and `read` of `Seen`, of the points that are still in sight.

    triangle, place: (N,), (N, 3) of the points so far; seen, decided: (H · W,) the triangle at each pixel, and whether
    it is a decided receiver.
    """
    geometry, camera, (width, height) = view.scene.geometry, view.camera, view.size
    at = place - np.array(camera.position)
    right, up, back = np.einsum("ai,ni->an", camera.basis(), at)
    pixel_size = (camera.height - 2 * camera.slope * back) / height
    pixel_size[pixel_size <= 0] = np.nan  # behind the camera
    column, row = (width - 1) / 2 + right / pixel_size, (height - 1) / 2 - up / pixel_size
    kept = np.flatnonzero((abs(column + 0.5 - width / 2) < width / 2) & (abs(row + 0.5 - height / 2) < height / 2))
    own, at, pixel_size = triangle[kept], at.take(kept, axis=0), pixel_size[kept]
    nearest = np.rint([row[kept], column[kept]]).astype(np.int32)
    aside = [row[kept], column[kept]] - nearest
    steps = np.where(abs(aside) <= CENTRE, 0, np.sign(aside)).astype(np.int32)

    def shows(rows: Indices, columns: Indices) -> tuple[Mask, Mask]:
        """Whether pixels show the points' surfaces, and whether they are decided too."""
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        place = np.where(inside, rows * width + columns, 0)
        same = inside & (seen[place] == own)
        rest = np.flatnonzero(inside & ~same & (seen[place] >= 0))
        cosines = np.einsum("ni,ni->n", geometry.normals[own[rest]], geometry.normals[seen[place[rest]]])
        rest = rest[np.abs(cosines) >= ALIGNED]
        apart = surface_points(view, place[rest], seen[place[rest]]) - at[rest]
        off = np.einsum("ni,ni->n", geometry.normals[own[rest]], apart)
        same[rest] = np.abs(off) <= STEP * pixel_size[rest]
        return same, same & decided[place]

    (y, x), (down, across) = nearest, steps
    in_sight, read = shows(y, x)
    for rows, columns in ((y, x + across), (y + down, x), (y + down, x + across)):
        read &= shows(rows, columns)[1]
    pixel = y * width + x
    oldest = np.full(width * height, -1)
    candidates = np.flatnonzero(in_sight)[::-1]
    oldest[pixel[candidates]] = candidates  # of several, the one assigned last stays
    stay = np.flatnonzero(oldest[pixel] == np.arange(len(pixel)))
    return kept[stay].astype(np.int32), np.stack([pixel, across, down * width]).take(stay, axis=1), read[stay]
