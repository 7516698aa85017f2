"""Handles of lights in the picture, their motion, and lights of one kind as another.

A sun's handle lies on a dome: a sphere around the camera's target that fits into the picture. Other lights have theirs
where they are, and those that have a direction a second one on their axis, to aim.
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.model import Camera, Light, LightShape, Scene
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3
from shadowbench.viewer.navigation import distance, projected, ray

Handle = Literal["light", "aim"]
LightPath = Literal["rest", "day", "circle"]
LOWEST = math.radians(1.0)
"""Least elevation to which a sun is dragged, in radians."""
_CONE = math.radians(60.0)
_TILT = math.radians(35.0)  # of the sun at noon from overhead, towards the south
_SUNRISE = math.asin(math.sin(LOWEST) / math.cos(_TILT))  # from the east along its arc
_SHARE = 0.8  # of the picture that the dome takes


def dome_radius(camera: Camera) -> float:
    """Radius of the dome around a camera's target."""
    return _SHARE * distance(camera) * math.sin(camera.fov_y / 2)


def handles(light: Light, camera: Camera) -> dict[Handle, Vec3]:
    """The places of a light's handles in space."""
    if light.kind == "directional":
        return {"light": vec3(np.subtract(camera.target, unit(light.direction) * dome_radius(camera)))}
    found: dict[Handle, Vec3] = {"light": light.position}
    if light.kind != "point":
        reach = max(math.dist(light.position, camera.target), 0.5 * distance(camera))
        found["aim"] = vec3(np.add(light.position, unit(light.direction) * reach))
    return found


def dragged(light: Light, camera: Camera, handle: Handle, to: tuple[float, float], far: bool) -> Light:
    """The light after its handle was dragged to a place in the picture.

    A sun moves on its dome, above the horizon; far: on the half of it that is behind its centre. Other handles move
    parallel to the picture, and come to the depth of the camera's target if they were behind the camera.
    """
    if light.kind == "directional":
        sun = replace(light, direction=vec3(-_on_dome(camera, *to, far)))
        azimuth, elevation = azimuth_elevation(sun)
        return sun if elevation >= LOWEST else replace(sun, direction=sun_direction(azimuth, LOWEST))
    depth = projected(camera, handles(light, camera)[handle])[2]
    if depth < 1e-3 * distance(camera):
        depth = distance(camera)
    moved = np.add(camera.position, ray(camera, *to) * depth)
    if handle == "light":
        return replace(light, position=vec3(moved))
    axis = moved - light.position
    return replace(light, direction=vec3(unit(axis))) if np.linalg.norm(axis) > 0 else light


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


def azimuth_elevation(light: Light) -> tuple[float, float]:
    """Azimuth and elevation in radians of the direction that a light comes from, as for `sun_direction`."""
    x, y, z = -unit(light.direction)
    return math.atan2(x, -z), math.asin(float(np.clip(y, -1.0, 1.0)))


def travelled(light: Light, scene: Scene, path: LightPath, turns: float) -> Light:
    """The light after so many turns of its path around the scene's centre.

    circle: about the vertical axis; day: from the hour at which a sun is as far in the east (+x), along an arc over the
    south to the west, then anew, a lamp at the distance that it has and shining to the centre.
    """
    if path == "rest":
        return light
    center, is_sun = scene.geometry.bounds.mean(axis=0), light.kind == "directional"
    if path == "day":
        xyz, w = light.homogeneous
        away = np.subtract(xyz, w * center)
        hour, daylight = math.atan2(math.hypot(away[1], away[2]), away[0]), math.pi - 2 * _SUNRISE
        hour = _SUNRISE + (hour - _SUNRISE + turns * daylight) % daylight
        toward = np.array([math.cos(hour), *(math.sin(hour) * np.array([math.cos(_TILT), math.sin(_TILT)]))])
        turned = replace(light, direction=vec3(-toward))
        return turned if is_sun else replace(turned, position=vec3(center + toward * np.linalg.norm(away)))
    cosine, sine = math.cos(2 * math.pi * turns), math.sin(2 * math.pi * turns)
    about_y = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    turned = replace(light, direction=vec3(about_y @ light.direction))
    return turned if is_sun else replace(turned, position=vec3(center + about_y @ (light.position - center)))


def with_kind(light: Light, kind: LightShape, scene: Scene) -> Light:
    """The light as one of another kind that shines on the scene from the same side.

    A lamp becomes a sun in its direction. A sun becomes a lamp, so that a shadow map of it is a perspective one: where
    it was a lamp before, if it shone on the scene's centre from there as it does now, else as far from that centre, or
    at a distance of the scene's diagonal if it was none.
    """
    if kind == light.kind:
        return light
    low, high = scene.geometry.bounds
    center = (low + high) / 2
    away = center - light.position
    aimed = _is_within(away, light.direction, (light.angle or _CONE) / 2)
    changed = replace(light, kind=kind, angle=light.angle or _CONE, radius=0.0, size=(0.0, 0.0))
    if light.kind == "directional":
        was_lamp = any(light.position)
        if was_lamp and aimed:
            return changed
        reach = float(np.linalg.norm(away if was_lamp else high - low))
        return replace(changed, position=vec3(center - unit(light.direction) * reach))
    if light.kind == "point" and (kind == "directional" or not aimed):
        return replace(changed, direction=vec3(unit(away) if away.any() else (0.0, -1.0, 0.0)))
    return changed


def _is_within(toward: Floats, axis: Vec3, half_angle: float) -> bool:
    """Whether a vector is within a cone about an axis."""
    return float(np.dot(toward, unit(axis))) > math.cos(half_angle) * float(np.linalg.norm(toward))
