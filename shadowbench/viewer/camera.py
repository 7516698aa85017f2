"""Camera and light moved by hand: motions of the camera, handles of the light in the picture, lights of other kinds.

Points of a picture are (x, y) in [−1, 1], x to the right, y up; pictures are square. A sun's handle lies on a dome: a
sphere around the camera's target that fits into the picture. Other lights have theirs where they are, and those that
have a direction a second one on their axis, to aim.
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.model import NEAREST_TARGET, Camera, Light, LightShape, Scene
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

Handle = Literal["light", "aim"]
LEAST_TILT = math.radians(1.0)
"""Least angle between the direction of view and the camera's up vector, in radians."""
LOWEST = math.radians(1.0)
"""Least elevation to which a sun is dragged, in radians."""
NEAREST = 1e3 * NEAREST_TARGET
"""Least distance to the target to which a camera zooms, as a share of their coordinates."""
_CONE = math.radians(60.0)
_DOME = 0.8  # share of the picture that the dome takes


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


def dome_radius(camera: Camera) -> float:
    """Radius of the dome around a camera's target."""
    return _DOME * distance(camera) * math.sin(camera.fov_y / 2)


def handles(light: Light, camera: Camera) -> dict[Handle, Vec3]:
    """The places of a light's handles in space."""
    if light.kind == "directional":
        return {"light": vec3(np.subtract(camera.target, unit(light.direction) * dome_radius(camera)))}
    if light.kind == "point":
        return {"light": light.position}
    reach = max(math.dist(light.position, camera.target), 0.5 * distance(camera))
    return {"light": light.position, "aim": vec3(np.add(light.position, unit(light.direction) * reach))}


def dragged(light: Light, camera: Camera, handle: Handle, to: tuple[float, float], far: bool) -> Light:
    """The light after its handle was dragged to a place in the picture.

    A sun moves on its dome, above the horizon; far: on the half of it that is behind its centre. Other handles move
    parallel to the picture, and come to the depth of the camera's target if they were behind the camera.
    """
    if light.kind == "directional":
        sun = replace(light, direction=vec3(-_on_dome(camera, *to, far)))
        azimuth, elevation = sun_angles(sun)
        return sun if elevation >= LOWEST else replace(sun, direction=sun_direction(azimuth, LOWEST))
    depth = projected(camera, handles(light, camera)[handle])[2]
    if depth < 1e-3 * distance(camera):
        depth = distance(camera)
    moved = np.add(camera.position, ray(camera, *to) * depth)
    if handle == "light":
        return replace(light, position=vec3(moved))
    axis = moved - light.position
    return replace(light, direction=vec3(unit(axis))) if axis.any() else light


def _on_dome(camera: Camera, x: float, y: float, far: bool) -> Floats:
    """(3,) unit vector from the dome's centre to where a pixel's ray meets it, or comes closest to it.

    far: of two such places the one behind the centre.
    """
    along = unit(ray(camera, x, y))
    away = np.subtract(camera.position, camera.target)
    closest = away - float(along @ away) * along
    half = math.sqrt(max(dome_radius(camera) ** 2 - float(closest @ closest), 0.0))
    return unit(closest + (half if far else -half) * along)


def is_far(light: Light, camera: Camera) -> bool:
    """Whether a sun's handle is on the half of its dome that is behind the centre."""
    return projected(camera, handles(light, camera)["light"])[2] > distance(camera)


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
