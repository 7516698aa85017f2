"""Camera matrices in float64; uniforms convert them to float32."""

import numpy as np
from pyglm import glm

from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats


def view_projection(view: View) -> Floats:
    """(4, 4) float64 world-to-clip matrix of a view's camera, for column vectors."""
    camera = view.camera
    _, up, back = camera.basis()
    eye = glm.dvec3(*camera.position)  # glm rounds a tuple to float32
    world_to_camera = np.array(glm.lookAt(eye, eye - glm.dvec3(*back), glm.dvec3(*up)))
    near, far = view.near_far
    slope = float(np.tan(camera.fov_y / 2))
    projection = np.array(
        [
            [1 / slope, 0, 0, 0],
            [0, 1 / slope, 0, 0],
            [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
            [0, 0, -1, 0],
        ]
    )
    result: Floats = projection @ world_to_camera
    return result
