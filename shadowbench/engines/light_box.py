"""The box that an engine's shadow map is to cover: all casters and receivers, seen from the light."""

from typing import Any

import numpy as np
import trimesh

from shadowbench.geometry.convex import caster_and_receiver_faces, caster_and_receiver_vertices
from shadowbench.geometry.lights import light_space, window
from shadowbench.scenes.model import View

PADDING = 2.0  # texels beside the casters and receivers, for an engine's filter
MARGIN = 1e-3  # share of the distances, against rounding


def light_box(view: View, size: int | None = None, phase: tuple[float, float] = (0, 0)) -> dict[str, Any]:
    """The box of all casters and receivers, in metres, as `view.json` and `draw` of an engine have it.

    Of a directional light an orthographic camera: its position, in the middle of the near plane, at depth 0; its
    target, in the middle of the far plane; up; width, height and depth. For a map of size² texels it is padded, and
    shifted by a phase in texels. Of other lights the distances near and far, for a spot along its axis, within its
    cone.
    """
    if view.light.kind != "directional":
        near, far = _distances(view)
        return {"near": near, "far": far}
    space = light_space(view.light)
    tight = space.box(caster_and_receiver_vertices(view.scene.geometry))
    # As a map of one texel the box has no padding across, and a margin in depth.
    box = window(tight, space, size or 1, PADDING if size else MARGIN, phase)
    middle, (width, height, depth) = (box.low + box.high) / 2, (box.high - box.low).tolist()
    right, up, back = space.basis
    across = middle[0] * right + middle[1] * up
    return {
        "position": (across - box.low[2] * back).tolist(),
        "target": (across - box.high[2] * back).tolist(),
        "up": up.tolist(),
        "width": width,
        "height": height,
        "depth": depth,
    }


def _distances(view: View) -> tuple[float, float]:
    """Least and largest distance of casters and receivers from a light; for a spot along its axis, within its cone."""
    light, geometry = view.light, view.scene.geometry
    points = caster_and_receiver_vertices(geometry) - light.position
    triangles = geometry.vertices[caster_and_receiver_faces(geometry)]
    origins = np.broadcast_to(light.position, (len(triangles), 3))
    closest = trimesh.triangles.closest_point(triangles, origins)  # type: ignore[no-untyped-call]
    near = float(np.linalg.norm(closest - origins, axis=1).min())
    far = float(np.linalg.norm(points, axis=1).max())
    if light.frustum_angle is not None:
        depths = points @ -light_space(light).basis[2]
        if depths.max() > 0.0:  # else all is behind the spot
            near, far = max(near * np.cos(light.frustum_angle / 2), depths.min()), float(depths.max())
    near, far = min(near, far) * (1 - MARGIN), far * (1 + MARGIN)
    return float(max(near, far / 1e4)), far
