"""Handles of lights in the picture, their motion, and lights of one kind as another.

A sun's handle lies on a dome: a sphere around the camera's target that fits into the picture. Other lights have theirs
where they are, and those that have a direction a second one on their axis, to aim.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shadowbench.scenes.model import Camera, Light, LightShape, Scene
from shadowbench.scenes.vectors import Floats, Vec3, perpendicular_basis, unit, vec3
from shadowbench.viewer.navigation import distance, projected, ray

Handle = Literal["light", "aim"]
Path = Literal["rest", "day", "circle"]
DAY_TILT = math.radians(35.0)
"""Angle between the plane of a day's arc and the vertical."""
_CONE = math.radians(60.0)
_SHARE = 0.8  # of the picture that the dome takes


@dataclass(frozen=True)
class Dome:
    """The sphere on which a sun's handle lies."""

    center: Vec3
    radius: float

    @staticmethod
    def of(camera: Camera) -> "Dome":
        """The dome around a camera's target."""
        return Dome(camera.target, _SHARE * distance(camera) * math.sin(camera.fov_y / 2))

    def hit(self, camera: Camera, x: float, y: float, far: bool) -> Floats:
        """(3,) unit vector from the centre to where a pixel's ray meets the sphere, or comes closest to it.

        far: of two such places the one behind the centre.
        """
        along = unit(ray(camera, x, y))
        away = np.subtract(camera.position, self.center)
        middle = -float(along @ away)
        closest = away + middle * along
        half = math.sqrt(max(self.radius**2 - float(closest @ closest), 0.0))
        return unit(closest + (half if far else -half) * along)


def handles(light: Light, camera: Camera) -> dict[Handle, Vec3]:
    """The places of a light's handles in space."""
    if light.kind == "directional":
        dome = Dome.of(camera)
        return {"light": vec3(np.subtract(dome.center, unit(light.direction) * dome.radius))}
    found: dict[Handle, Vec3] = {"light": light.position}
    if light.kind != "point":
        found["aim"] = vec3(np.add(light.position, unit(light.direction) * _reach(light, camera)))
    return found


def dragged(light: Light, camera: Camera, handle: Handle, to: tuple[float, float], far: bool) -> Light:
    """The light after its handle was dragged to a place in the picture.

    A sun moves on its dome, above the horizon; far: on the half of it that is behind its centre. Other handles move
    parallel to the picture, and come to the depth of the camera's target if they were behind the camera.
    """
    if light.kind == "directional":
        toward = Dome.of(camera).hit(camera, *to, far)
        return replace(light, direction=vec3(-_above_horizon(toward)))
    point = np.asarray(handles(light, camera)[handle])
    depth = projected(camera, vec3(point))[2]
    if depth < 1e-3 * distance(camera):
        depth = distance(camera)
    moved = np.add(camera.position, ray(camera, *to) * depth)
    if handle == "light":
        return replace(light, position=vec3(moved))
    axis = moved - light.position
    return replace(light, direction=vec3(unit(axis))) if np.linalg.norm(axis) > 0 else light


def is_far(light: Light, camera: Camera) -> bool:
    """Whether a sun's handle is on the half of its dome that is behind the centre."""
    return projected(camera, handles(light, camera)["light"])[2] > distance(camera)


def sun_at(azimuth: float, elevation: float) -> Vec3:
    """Direction in which the light of a sun travels; azimuth: about y from +x towards −z; both in radians."""
    level = math.cos(elevation)
    return vec3((-level * math.cos(azimuth), -math.sin(elevation), level * math.sin(azimuth)))


def azimuth_elevation(light: Light) -> tuple[float, float]:
    """Azimuth and elevation in radians of the direction that a light comes from, as for `sun_at`."""
    x, y, z = -unit(light.direction)
    return math.atan2(-z, x), math.asin(float(np.clip(y, -1.0, 1.0)))


def travelled(light: Light, path: Path, center: Vec3, turns: float) -> Light:
    """The light after `turns` of its path around the scene's centre.

    circle: about the vertical axis, `turns` from where it is; day: on an arc from the east (+x) over the south to the
    west in one turn, then anew, a lamp at the distance that it has.
    """
    if path == "rest":
        return light
    if path == "day":
        hour = math.pi * (turns % 1.0)
        high = math.sin(hour)
        toward = np.array([math.cos(hour), high * math.cos(DAY_TILT), high * math.sin(DAY_TILT)])
        return _seen_from(light, center, _above_horizon(toward))
    cosine, sine = math.cos(2 * math.pi * turns), math.sin(2 * math.pi * turns)
    about_y = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return replace(
        light,
        direction=vec3(about_y @ light.direction),
        position=vec3(np.add(center, about_y @ np.subtract(light.position, center))),
    )


@dataclass
class Travel:
    """The motion of a light: its path and speed, and how far it is on it."""

    path: Path = "rest"
    per_minute: float = 2.0
    turns: float = 0.0

    def moved(self, light: Light, scene: Scene, seconds: float) -> Light:
        """The light after so many more seconds."""
        turn = seconds * self.per_minute / 60
        self.turns += turn
        center = vec3(scene.geometry.bounds.mean(axis=0))
        return travelled(light, self.path, center, turn if self.path == "circle" else self.turns)


def with_kind(light: Light, kind: LightShape, scene: Scene) -> Light:
    """The light as one of another kind that shines on the scene from the same side.

    A sun becomes a lamp at a distance of the scene's diagonal, so that a shadow map of it is a perspective one; a lamp
    becomes a sun in its direction.
    """
    if kind == light.kind:
        return light
    low, high = scene.geometry.bounds
    center, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    changed = replace(light, kind=kind, angle=light.angle or _CONE, radius=0.0, size=(0.0, 0.0))
    if light.kind == "directional":
        return replace(changed, position=vec3(center - unit(light.direction) * diagonal))
    if light.kind == "point":
        away = center - light.position
        return replace(changed, direction=vec3(unit(away) if away.any() else (0.0, -1.0, 0.0)))
    return changed


def _seen_from(light: Light, center: Vec3, toward: Floats) -> Light:
    """The light in a direction from the centre, at its distance, shining to the centre."""
    radius = float(np.linalg.norm(np.subtract(light.position, center)))
    return replace(light, direction=vec3(-toward), position=vec3(np.add(center, toward * radius)))


def _above_horizon(toward: Floats) -> Floats:
    """A direction to a sun, at least one degree above the horizon."""
    least = math.sin(math.radians(1.0))
    if toward[1] >= least:
        return toward
    level = np.array([toward[0], 0.0, toward[2]])
    back = unit(level) if level.any() else perpendicular_basis(np.array([0.0, 1.0, 0.0]), (0, 0, 1))[0]
    return unit(back * math.cos(math.radians(1.0)) + np.array([0.0, least, 0.0]))


def _reach(light: Light, camera: Camera) -> float:
    """Distance of the handle that aims from its light: as far as the camera's target, or half the camera's distance."""
    return max(math.dist(light.position, camera.target), 0.5 * distance(camera))
