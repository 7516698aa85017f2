"""Culling of casters that cannot shadow any visible receiver, by bounding boxes against half-spaces."""

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.convex import box_planes, corners, view_planes
from shadowbench.geometry.lights import LightView, light_space
from shadowbench.gl.program import Ranges
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.vectors import Floats

_CHUNK = 256  # triangles that are drawn or culled together
_GAP = 1024  # a gap of fewer indices is drawn, as another draw call costs more
_FEW = 4096  # triangles: any order is as fast
_ROUNDING = 1e-6  # of the scene's extent: exceeds the float32 rounding of a corner's distance to a plane


class CasterChunks:
    """A scene's caster triangles in chunks, in the order in which they are drawn; no chunk spans two meshes.

    cull: False draws all; reorder: an order that reuses vertices, else that of the device's index buffer; cut_last:
    whether the cut-out triangles follow the opaque ones, else all are opaque. vertices: (V, 3) float32; faces: (F, 3)
    int32 opaque ones; reordered: whether these are other than the scene's; count: of triangles; boxes: (C, 2, 3)
    bounding box of each chunk; ends: (C,) index of the triangle after its last.
    """

    def __init__(self, scene: Scene, cull: bool, reorder: bool = True, cut_last: bool = False) -> None:
        geometry, self.cull = scene.geometry, cull
        cut = geometry.is_cut_out[geometry.casts] & cut_last
        self.faces, self.vertices = geometry.caster_faces[~cut], geometry.vertices.astype(np.float32)
        self.count, cut_corners = len(cut), self.vertices[geometry.caster_faces[cut]]
        self.reordered = reorder and len(self.faces) > _FEW
        if self.reordered:
            from shadowbench.geometry.vertex_order import by_first_use, in_reuse_order  # Numba takes 0.3 s to import

            self.faces, used = by_first_use(self.faces[in_reuse_order(self.faces)])
            self.vertices = self.vertices[used]
        meshes = sorted(scene.meshes, key=lambda mesh: cut_last and mesh.cutout is not None)
        counts = [len(mesh.faces) if mesh.casts else 0 for mesh in meshes]
        starts = [np.arange(end - count, end, _CHUNK) for count, end in zip(counts, np.cumsum(counts), strict=True)]
        first = np.concatenate([np.zeros(0, dtype=np.int64), *starts])
        self.ends = np.append(first[1:], self.count)[: len(first)]
        self.boxes = np.zeros((0, 2, 3))
        if len(first):
            corners = np.concatenate([self.vertices[self.faces], cut_corners]).reshape(-1, 3)
            low, high = (each.reduceat(corners, 3 * first) for each in (np.minimum, np.maximum))
            self.boxes = np.stack([low, high], axis=1).astype(np.float64)

    def index_ranges(self, light: tuple[float, ...], *regions: Floats) -> Ranges | None:
        """(first, count) index ranges of the chunks that may shadow any region; None to draw all.

        regions: (P, 4) planes each. The ranges include small gaps between chunks.
        """
        if not self.cull:
            return None
        kept = np.any([may_shadow(self.boxes, light, planes) for planes in regions], axis=0)
        return kept_ranges(kept, 3 * self.ends)

    def count_culled(self, ranges: Ranges | None) -> int:
        """Number of caster triangles outside the ranges."""
        return 0 if ranges is None else self.count - sum(count for _, count in ranges) // 3


def may_shadow(boxes: Floats, light: tuple[float, ...], planes: Floats) -> NDArray[np.bool_]:
    """(C,) bool, conservative: whether each caster may shadow points of a convex region.

    boxes: (C, 2, 3) bounding boxes of the casters; light: unit vector towards it and w = 0, or its position and w = 1;
    planes: (P, 4), the region is where n·x + d ≥ 0. A caster is culled if its box is behind one plane and no light ray
    through the box approaches that plane. A lamp in or on the box has rays through it in more directions than its
    corners tell.
    """
    points, position = box_corners(boxes), np.array(light[:3])
    away = light[3] * points - position
    slack = _ROUNDING * float(np.abs(boxes).max(initial=1.0))
    behind = (points @ planes[:, :3].T + planes[:, 3] < -slack).all(axis=1)
    receding = (away @ planes[:, :3].T <= slack).all(axis=1)
    around = ((boxes[:, 0] - slack <= position) & (position <= boxes[:, 1] + slack)).all(axis=1) & (light[3] > 0)
    kept: NDArray[np.bool_] = around | ~(behind & receding).any(axis=1)
    return kept


def box_corners(boxes: Floats) -> Floats:
    """(C, 8, 3) corners of (C, 2, 3) boxes."""
    return np.stack([boxes[:, pick, (0, 1, 2)] for pick in np.ndindex(2, 2, 2)], axis=1)


def visible_region(view: View) -> Floats:
    """(P, 4) planes of the scene's bounds inside the view frustum, and of their bounds in a sun's light space."""
    bounds = view.scene.geometry.bounds
    planes = np.vstack([box_planes(bounds), view_planes(view)])
    if view.light.kind != "directional":
        return planes
    space, visible = light_space(view.light), corners(planes, float(np.abs(bounds).max()))
    return np.vstack([planes, LightView(space, space.box(visible), 1).planes]) if len(visible) else planes


def kept_ranges(kept: NDArray[np.bool_], ends: NDArray[np.int64], others: NDArray[np.bool_] | None = None) -> Ranges:
    """(first, count) ranges of the kept chunks, with small gaps included.

    kept: (C,) bool; ends: (C,) index after the last of each chunk; others: (C,) bool, chunks that no gap may have.
    """
    if not kept.any():
        return ()
    starts, stops = np.concatenate([[0], ends])[:-1][kept], ends[kept]
    wide = starts[1:] - stops[:-1] > _GAP
    if others is not None:
        wide |= np.diff(np.cumsum(others)[kept]) > 0
    first, last = starts[np.append(True, wide)], stops[np.append(wide, True)]
    return tuple((int(start), int(stop - start)) for start, stop in zip(first, last, strict=True))
