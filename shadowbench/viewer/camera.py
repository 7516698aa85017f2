"""Camera and light moved by hand, and lights of other kinds. Lengths are in halves of the picture's height, y up."""

import math
from dataclasses import replace

import numpy as np

from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.model import NEAREST_TARGET, Camera, Light, LightShape, Scene
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

LEAST_TILT = math.radians(1.0)
"""Least angle between the direction of view and the camera's up vector, in radians."""
LOWEST = math.radians(1.0)
"""Least elevation to which a sun is dragged, in radians."""
NEAREST = 1e3 * NEAREST_TARGET
"""Least distance to the target to which a camera zooms, as a share of their coordinates."""
_CONE = math.radians(60.0)


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
    half = camera.half_height(distance(camera))
    step = -half * (x * right + y * up)
    return _at(camera, np.add(camera.position, step), np.add(camera.target, step))


def zoomed(camera: Camera, factor: float) -> Camera:
    """The camera at `factor` times its distance from its target; where it is if that would be too near or too far.

    An orthographic one stays where it is and shows `factor` times the height.
    """
    if not camera.converging:
        height = camera.height * factor
        return replace(camera, height=height) if NEAREST * distance(camera) < height < LARGEST else camera
    moved = np.add(camera.target, np.subtract(camera.position, camera.target) * factor)
    reach = float(np.abs(np.concatenate([moved, camera.target])).max())
    if reach > LARGEST or np.abs(moved - camera.target).max() < NEAREST * reach:
        return camera
    return _at(camera, moved, camera.target)


def _turned(camera: Camera, yaw: float, pitch: float) -> Floats:
    """The camera's offset from its target in spherical coordinates about its up vector, turned."""
    vertical, offset = unit(camera.up), np.subtract(camera.position, camera.target)
    level = np.cross(camera.basis()[0], vertical)  # horizontal, from the target to the camera
    most = math.pi / 2 - LEAST_TILT
    tilt = float(np.clip(math.atan2(offset @ vertical, offset @ level) + pitch, -most, most))
    horizontal = math.cos(yaw) * level + math.sin(yaw) * np.cross(vertical, level)
    turned: Floats = distance(camera) * (math.cos(tilt) * horizontal + math.sin(tilt) * vertical)
    return turned


def _at(camera: Camera, position: Vec3 | Floats, target: Vec3 | Floats) -> Camera:
    """The camera at another place, with near and far planes around the scene: a file's were for its own place."""
    return replace(camera, position=vec3(position), target=vec3(target), near=None, far=None)


def dragged(light: Light, camera: Camera, x: float, y: float) -> Light:
    """The light after a drag by (x, y) in the picture: a sun turns and rises, a lamp moves parallel to the picture.

    A lamp behind the camera moves as one at the camera's target.
    """
    if light.kind == "directional":
        azimuth, elevation = sun_angles(light)
        risen = min(max(elevation + y * math.pi / 4, LOWEST), math.pi / 2)
        return replace(light, direction=sun_direction(azimuth + x * math.pi / 2, risen))
    right, up, back = camera.basis()
    depth = float(back @ np.subtract(camera.position, light.position))
    half = camera.half_height(depth if depth > 0 else distance(camera))
    return replace(light, position=vec3(light.position + half * (x * right + y * up)))


def sun_angles(light: Light) -> tuple[float, float]:
    """Azimuth and elevation in radians of the direction that a light comes from, as for `sun_direction`."""
    x, y, z = -unit(light.direction)
    return math.atan2(x, -z), math.asin(float(np.clip(y, -1.0, 1.0)))


def with_kind(light: Light, kind: LightShape, scene: Scene) -> Light:
    """The light as one of another kind that shines on the scene from the same side.

    A lamp shines to the scene's centre when it becomes a sun, or a spot from a point light; a sun becomes a lamp at a
    distance of the scene's diagonal from the centre.
    """
    if kind == light.kind:
        return light
    low, high = scene.geometry.bounds
    center = (low + high) / 2
    changed = replace(light, kind=kind, angle=light.angle or _CONE, radius=0.0, size=(0.0, 0.0))
    if light.kind == "directional":
        return replace(changed, position=vec3(center - unit(light.direction) * math.dist(low, high)))
    toward = center - light.position
    if kind == "directional" or light.kind == "point":
        return replace(changed, direction=vec3(unit(toward)) if toward.any() else light.direction)
    return changed
