"""The transform from a file's coordinates to local ones, in which truth and techniques compute."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shadowbench.scenes.vectors import Floats, Vec3, vec3

if TYPE_CHECKING:
    from shadowbench.scenes.model import Camera, Light, Scene


@dataclass(frozen=True)
class Placement:
    """Transform from file coordinates to local ones, local = (file − center) · scale, in float64.

    Local coordinates keep float32 precision for scenes of any size far from the origin.
    """

    center: Vec3
    scale: float

    def points(self, points: Floats | Vec3) -> Floats:
        """(…, 3) points in local coordinates."""
        return (np.asarray(points, dtype=np.float64) - self.center) * self.scale

    def length(self, metres: float) -> float:
        """A length in metres as a local length."""
        return metres * self.scale

    def camera(self, camera: "Camera") -> "Camera":
        """The camera in local coordinates."""
        position, target = (vec3(self.points(point)) for point in (camera.position, camera.target))
        near, far = (None if plane is None else self.length(plane) for plane in (camera.near, camera.far))
        return replace(camera, position=position, target=target, near=near, far=far)

    def light(self, light: "Light") -> "Light":
        """The light in local coordinates; the angular radius of a directional light is unchanged."""
        if light.kind == "directional":
            return light
        width, height = (self.length(side) for side in light.size)
        position, radius = vec3(self.points(light.position)), self.length(light.radius)
        return replace(light, position=position, radius=radius, size=(width, height))

    def scene(self, scene: "Scene") -> "Scene":
        """The scene with all its meshes, cameras and lights in local coordinates."""
        return replace(
            scene,
            meshes=tuple(replace(mesh, vertices=self.points(mesh.vertices)) for mesh in scene.meshes),
            cameras=tuple(self.camera(camera) for camera in scene.cameras),
            lights=tuple(self.light(light) for light in scene.lights),
        )


IDENTITY_PLACEMENT = Placement((0.0, 0.0, 0.0), 1.0)
