"""Views by orthographic cameras."""

import math
from dataclasses import replace

from shadowbench.options import ViewSizeLike
from shadowbench.scenes.model import Scene, View, view_of


def parallel(scene: Scene, size: ViewSizeLike) -> View:
    """The first view of a scene by parallel rays, as high as it is at the camera's target."""
    camera = scene.cameras[0]
    height = 2 * camera.half_height(math.dist(camera.position, camera.target))
    return view_of(scene, replace(camera, fov_y=0.0, height=height), scene.lights[0], size)
