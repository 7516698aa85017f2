"""What of a scene's geometry maps must hold: what casts or receives, and its hull."""

import numpy as np

from shadowbench.geometry.convex import hull_points
from shadowbench.scenes.geometry import Geometry, bounds_of, used_by
from shadowbench.scenes.model import Floats, Light, Scene


def caster_and_receiver_vertices(geometry: Geometry) -> Floats:
    """(N, 3) corners of what casts or receives, or of everything if nothing does."""
    concerned = geometry.casts | geometry.receives  # a sky that does neither must not widen the map
    return used_by(geometry.faces[concerned] if concerned.any() else geometry.faces, geometry.vertices)


class SceneHull:
    """What a fit knows of the geometry, computed once: points that bound it in every direction, and its boxes."""

    def __init__(self, scene: Scene) -> None:
        vertices = caster_and_receiver_vertices(scene.geometry)
        self.bounds = bounds_of(vertices)
        self.extent = float(np.abs(self.bounds).max())
        self.points = hull_points(vertices)

    def position_step(self, light: Light) -> float:
        """The local length by which float32 rounds places in the scene, as seen from a light."""
        farthest = self.extent if light.kind == "directional" else max(self.extent, *map(abs, light.position))
        return 2.0**-24 * farthest
