"""Convex hull and bounds of a scene's casters and receivers."""

import numpy as np

from shadowbench.geometry.convex import hull_points
from shadowbench.scenes.geometry import Geometry, bounds_of, used_by
from shadowbench.scenes.model import Floats, Light, Scene


def caster_and_receiver_vertices(geometry: Geometry) -> Floats:
    """(N, 3) vertices of all casters and receivers, or of the whole scene if it has neither."""
    shadowing = geometry.casts | geometry.receives  # a sky, which is neither, must not enlarge the map
    return used_by(geometry.faces[shadowing] if shadowing.any() else geometry.faces, geometry.vertices)


class SceneHull:
    """Bounds of a scene's casters and receivers for fits, computed once.

    bounds: (2, 3) bounding box; extent: largest absolute coordinate; points: (N, 3) vertices of the convex hull.
    """

    def __init__(self, scene: Scene) -> None:
        self._geometry = scene.geometry
        self._nearest: tuple[Light, float] | None = None
        vertices = caster_and_receiver_vertices(scene.geometry)
        self.bounds = bounds_of(vertices)
        self.extent = float(np.abs(self.bounds).max())
        self.points = hull_points(vertices)

    def highest_caster(self, sun: Light) -> float:
        """Largest coordinate of a caster or receiver along the direction towards a directional light."""
        return float((self.points @ sun.homogeneous[0]).max())

    def nearest_caster(self, light: Light) -> float:
        """Distance from a lamp or spot to the nearest caster, at least the light's radius and 1e-6 of the extent."""
        if self._nearest is None or self._nearest[0] != light:
            import trimesh  # the import takes 0.3 s

            triangles = self._geometry.vertices[self._geometry.caster_faces]
            position = np.array(light.position)
            origins = np.broadcast_to(position, (len(triangles), 3))
            closest = trimesh.triangles.closest_point(triangles, origins)  # type: ignore[no-untyped-call]
            nearest = np.linalg.norm(closest - position, axis=1).min(initial=np.inf)
            self._nearest = light, max(float(nearest), light.radius, 1e-6 * self.extent)
        return self._nearest[1]

    def position_step(self, light: Light) -> float:
        """Float32 rounding error of positions in the scene and of the light's position, a local length."""
        farthest = self.extent if light.kind == "directional" else max(self.extent, *map(abs, light.position))
        return 2.0**-24 * farthest
