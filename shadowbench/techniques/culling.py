"""Casters that can reach no receiver that is looked at: told by boxes and half-spaces, and left out of a draw."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.convex import box_planes, corners, view_planes
from shadowbench.geometry.lights import LightView, light_space
from shadowbench.gl.program import Ranges
from shadowbench.scenes.model import Floats, Scene, View

_CHUNK = 512  # triangles that are drawn or left out together
_GAP = 1024  # indices that are rather drawn than skipped: a call costs more
_ROUNDING = 1e-6  # of the scene's extent: more than float32 moves a corner across a plane


class CasterChunks:
    """A scene's casters in runs of triangles of one mesh, in the order that the device has them; `cull` may be off.

    boxes: (C, 2, 3) lowest and highest corners of each run; ends: (C,) the triangle that it ends before; triangles: how
    many there are.
    """

    def __init__(self, scene: Scene, cull: bool) -> None:
        geometry, self.cull = scene.geometry, cull
        counts = [len(mesh.faces) if mesh.casts else 0 for mesh in scene.meshes]
        starts = [np.arange(end - count, end, _CHUNK) for count, end in zip(counts, np.cumsum(counts), strict=True)]
        first = np.concatenate([np.zeros(0, dtype=np.int64), *starts])
        self.triangles = sum(counts)
        self.ends = np.append(first[1:], self.triangles)[: len(first)]
        self.boxes = np.zeros((0, 2, 3))
        if len(first):
            places = geometry.vertices[geometry.caster_faces].reshape(-1, 3)
            low, high = np.minimum.reduceat(places, 3 * first), np.maximum.reduceat(places, 3 * first)
            self.boxes = np.stack([low, high], axis=1)

    def index_ranges(self, light: tuple[float, ...], *regions: Floats) -> Ranges | None:
        """(first, count) index ranges of the chunks that may shadow any region; None to draw all.

        regions: (P, 4) planes each. The ranges include small gaps between chunks.
        """
        if not self.cull:
            return None
        kept = np.any([may_shadow(self.boxes, light, planes) for planes in regions], axis=0)
        return kept_ranges(kept, 3 * self.ends)

    def count_culled(self, ranges: Ranges | None) -> int:
        """How many triangles a draw of these ranges leaves out."""
        return 0 if ranges is None else self.triangles - sum(count for _, count in ranges) // 3


def may_shadow(boxes: Floats, light: tuple[float, ...], planes: Floats) -> NDArray[np.bool_]:
    """(C,) which casters may cast a shadow into a convex region; none that does is left out.

    boxes: (C, 2, 3) lowest and highest corners; light: unit vector towards it and w = 0, or its position and w = 1;
    planes: (P, 4), the region lies where n·x + d ≥ 0. A caster is out where its box lies behind a plane and every way
    on from there, away from the light, leads no nearer to it.
    """
    places = np.stack([boxes[:, pick, (0, 1, 2)] for pick in np.ndindex(2, 2, 2)], axis=1)
    away = light[3] * places - np.array(light[:3])
    slack = _ROUNDING * float(np.abs(boxes).max(initial=1.0))
    behind = (places @ planes[:, :3].T + planes[:, 3] < -slack).all(axis=1)
    stays = (away @ planes[:, :3].T <= slack).all(axis=1)
    kept: NDArray[np.bool_] = ~(behind & stays).any(axis=1)
    return kept


def visible_region(view: View) -> Floats:
    """(P, 4) planes of what a view shows of its scene; for a sun also those that its light moves along."""
    bounds = view.scene.geometry.bounds
    planes = np.vstack([box_planes(bounds), view_planes(view)])
    if view.light.kind != "directional":
        return planes
    space, seen = light_space(view.light), corners(planes, float(np.abs(bounds).max()))
    return np.vstack([planes, LightView(space, space.box(seen), 1).planes]) if len(seen) else planes


def kept_ranges(kept: NDArray[np.bool_], ends: NDArray[np.int64]) -> Ranges:
    """(first, count) of what is kept of runs that end before (C,) `ends`; small gaps are filled."""
    starts, stops = np.concatenate([[0], ends])[:-1][kept], ends[kept]
    if not len(starts):
        return ()
    wide = starts[1:] - stops[:-1] > _GAP
    first, last = starts[np.append(True, wide)], stops[np.append(wide, True)]
    return tuple((int(start), int(stop - start)) for start, stop in zip(first, last, strict=True))
