"""What an axis is: a value that changes a scene, a view or parameters, and what must hold along it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shadowbench.scenes.model import (
    Camera,
    Coordinates,
    Floats,
    Light,
    LightKind,
    Mesh,
    Scene,
    Vec3,
    View,
    vec3,
    view_of,
)
from shadowbench.scenes.shapes import build_shape

Value = float | str

VIEW_SIZE = 256
MAP_SIZE = 1024
EXTENT = 6.0
"""Side of the base scene's ground, in metres."""
TEXEL = EXTENT / MAP_SIZE
"""About what a texel covers of the base scene, in metres."""
NAMES: dict[LightKind, str] = {"directional": "sun", "spot": "spot", "point": "lamp"}
_AZIMUTH = math.radians(165.0)  # from the left: the camera sees a lit side of casters and their shadows
_DISTANCES: dict[LightKind, float] = {"directional": 1.0, "spot": 6.0, "point": 3.3}


@dataclass(frozen=True, eq=False)
class Setting:
    """What is asked at one value: views of one scene, several where something moves, and parameters.

    params: values for those fields that a technique's parameters have; one that has none of them has no such axis.
    """

    views: tuple[View, ...]
    coordinates: Coordinates = "relative"
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Axis:
    """One stress parameter and its values.

    about: what varies, and what that stresses; values: in order, from one end to the other, or words; home: the
    default value, from which the operating range is searched in both directions; quick: the values of a quick sweep;
    lights: the kinds that it is swept under; holds: what must hold along it; ordered: whether values have neighbours.
    """

    name: str
    about: str
    unit: str
    values: tuple[Value, ...]
    home: Value
    quick: tuple[Value, ...]
    lights: tuple[LightKind, ...]
    holds: str
    change: Callable[[Any, LightKind], Setting]
    ordered: bool = True

    def at(self, value: Value, light: LightKind) -> Setting:
        """The setting at a value, its scene named after it."""
        setting = self.change(value, light)
        scene = replace(setting.views[0].scene, name=f"{self.name}-{shown(value)}")
        views = (
            replace(view, scene=scene, camera=replace(view.camera, name=f"camera-{frame}" if frame else "camera"))
            for frame, view in enumerate(setting.views)
        )
        return replace(setting, views=tuple(views))

    def swept(self, quick: bool) -> tuple[Value, ...]:
        """The values of a sweep, in the axis' order."""
        return tuple(value for value in self.values if value in self.quick) if quick else self.values


def shown(value: Value) -> str:
    """A value as names and tables write it: `0.25`, `16384`, `1e-5`, `1e7`."""
    if isinstance(value, str):
        return value
    power = f"{value:.0e}"
    if float(power) == value and not 1e-3 <= abs(value) < 1e5 and value:
        digit, exponent = power.split("e")
        return f"{digit}e{int(exponent)}"
    return f"{value:.10g}"


def mesh(
    kind: str,
    scale: float | Sequence[float],
    at: Sequence[float] | Floats,
    turn: float = 0.0,
    **parameters: int,
) -> Mesh:
    """A named shape, scaled, turned about y by degrees, moved."""
    triangles = build_shape(kind, dict(parameters), "axis")
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    turned = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    vertices = (triangles.vertices * np.asarray(scale, dtype=np.float64)) @ turned.T + np.asarray(at, dtype=np.float64)
    return Mesh(kind, vertices, triangles.faces)


def ground(side: float = EXTENT) -> Mesh:
    """The square that all stands on, at y = 0."""
    return replace(mesh("plane", side, (0.0, 0.0, 0.0)), name="ground")


def base_meshes() -> tuple[Mesh, ...]:
    """A ground, a turned box that stands on it, a sphere above it: neither shadows the other, however low the light."""
    return (
        ground(),
        mesh("box", 0.9, (-0.7, 0.45, 0.5), turn=25.0),
        mesh("sphere", 0.8, (0.6, 0.65, -1.1), subdivisions=4),
    )


def light_at(kind: LightKind, elevation: float = 50.0, azimuth: float = _AZIMUTH) -> Light:
    """A light of a kind that stands at an elevation, in degrees, and shines on the scene's middle."""
    e = math.radians(elevation)
    toward = np.array([math.cos(e) * math.cos(azimuth), math.sin(e), math.cos(e) * math.sin(azimuth)])
    return shining(kind, toward)


def shining(kind: LightKind, toward: Sequence[float] | Floats) -> Light:
    """A light of a kind in a direction as seen from the scene's middle."""
    way = np.asarray(toward) / np.linalg.norm(toward)
    position = vec3(way * _DISTANCES[kind]) if kind != "directional" else (0.0, 0.0, 0.0)
    return Light(NAMES[kind], kind, vec3(-way), position, math.radians(60.0) if kind == "spot" else 0.0)


def looking(
    meshes: Sequence[Mesh],
    light: Light,
    size: int = VIEW_SIZE,
    eye: Vec3 = (2.6, 4.2, 4.6),
    target: Vec3 = (0.0, 0.2, 0.0),
    fov: float = 40.0,
) -> View:
    """A view of some meshes; fov in degrees."""
    camera = Camera("camera", eye, target, math.radians(fov))
    return view_of(Scene("axis", tuple(meshes), (camera,), (light,)), camera, light, size)


def base(kind: LightKind, size: int = VIEW_SIZE) -> View:
    """The base scene under a light of a kind."""
    return looking(base_meshes(), light_at(kind), size)
