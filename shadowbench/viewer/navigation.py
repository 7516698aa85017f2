"""Motion of a camera, and projection between space and the picture.

Points of a picture are (x, y) in [−1, 1], x to the right, y up; pictures are square.
"""

import math
from dataclasses import replace

import numpy as np

from shadowbench.scenes.model import NEAREST_TARGET, Camera
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

LEAST_TILT = math.radians(1.0)
"""Least angle between the direction of view and the camera's up vector, in radians."""

NEAREST = 1e3 * NEAREST_TARGET
"""Least distance to the target to which a camera zooms, as a share of their coordinates."""


def ray(camera: Camera, x: float, y: float) -> Floats:
    """(3,) direction from the camera through a point of the picture, of length 1 along the camera's axis."""
    right, up, back = camera.basis()
    slope = math.tan(camera.fov_y / 2)
    direction: Floats = slope * (x * right + y * up) - back
    return direction


def projected(camera: Camera, point: Vec3 | Floats) -> tuple[float, float, float]:
    """(x, y, depth) of a point in space: its place in the picture, of no meaning for depth ≤ 0, and its view depth."""
    right, up, back = camera.basis()
    offset = np.subtract(point, camera.position)
    depth = float(-back @ offset)
    scale = math.tan(camera.fov_y / 2) * (depth or 1e-300)
    return float(right @ offset) / scale, float(up @ offset) / scale, depth


def distance(camera: Camera) -> float:
    """From the camera to its target."""
    return math.dist(camera.target, camera.position)


def orbited(camera: Camera, yaw: float, pitch: float) -> Camera:
    """The camera turned about its target: by `yaw` about its up vector, then by `pitch` above the horizon, in radians.

    It stops short of the poles.
    """
    return _at(camera, np.add(camera.target, _turned(camera, yaw, pitch)), camera.target)


def looked(camera: Camera, yaw: float, pitch: float) -> Camera:
    """The camera turned about its own position, to the left by `yaw` and up by `pitch`, in radians."""
    return _at(camera, camera.position, np.subtract(camera.position, _turned(camera, yaw, -pitch)))


def panned(camera: Camera, x: float, y: float) -> Camera:
    """The camera moved parallel to the picture, so that what is at its target moves by (x, y) in the picture."""
    right, up, _ = camera.basis()
    half = math.tan(camera.fov_y / 2) * distance(camera)
    return _shifted(camera, -half * (x * right + y * up))


def zoomed(camera: Camera, factor: float) -> Camera:
    """The camera at `factor` times its distance from its target; where it is if that would be too near or too far."""
    moved = np.add(camera.target, np.subtract(camera.position, camera.target) * factor)
    reach = float(np.abs(np.concatenate([moved, camera.target])).max())
    if reach > LARGEST or np.abs(moved - camera.target).max() < NEAREST * reach:
        return camera
    return _at(camera, moved, camera.target)


def walked(camera: Camera, right: float, up: float, forward: float) -> Camera:
    """The camera and its target moved, in metres; up and forward are those of the camera's up vector, not its tilt."""
    side, _, back = camera.basis()
    vertical = unit(camera.up)
    ahead = np.cross(vertical, side) if abs(float(vertical @ back)) < 1.0 else -back
    return _shifted(camera, right * side + up * vertical + forward * ahead)


def _turned(camera: Camera, yaw: float, pitch: float) -> Floats:
    """The camera's offset from its target in spherical coordinates about its up vector, turned."""
    vertical, offset = unit(camera.up), np.subtract(camera.position, camera.target)
    level = np.cross(camera.basis()[0], vertical)  # horizontal, from the target to the camera
    most = math.pi / 2 - LEAST_TILT
    tilt = float(np.clip(math.atan2(offset @ vertical, offset @ level) + pitch, -most, most))
    horizontal = math.cos(yaw) * level + math.sin(yaw) * np.cross(vertical, level)
    turned: Floats = distance(camera) * (math.cos(tilt) * horizontal + math.sin(tilt) * vertical)
    return turned


def _shifted(camera: Camera, step: Floats) -> Camera:
    return _at(camera, np.add(camera.position, step), np.add(camera.target, step))


def _at(camera: Camera, position: Vec3 | Floats, target: Vec3 | Floats) -> Camera:
    """The camera at another place, with near and far planes around the scene: a file's were for its own place."""
    return replace(camera, position=vec3(position), target=vec3(target), near=None, far=None)
