"""Camera matrices, in doubles until a uniform makes floats of them."""

import numpy as np
from pyglm import glm

from shadowbench.scenes.model import Floats, View


def view_projection(view: View) -> Floats:
    """(4, 4) float64, world to clip space of a view's camera, as written (multiply from the left)."""
    camera = view.camera
    _, up, back = camera.basis()
    eye = glm.dvec3(*camera.position)  # a tuple would be rounded to float32
    looking = np.array(glm.lookAt(eye, eye - glm.dvec3(*back), glm.dvec3(*up)))
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
    result: Floats = projection @ looking
    return result
