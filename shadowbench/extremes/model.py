"""Stress axes: one parameter of a scene, view or technique each, and its values."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shadowbench.scenes.model import Camera, Coordinates, Light, LightKind, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import build_shape
from shadowbench.scenes.vectors import Floats, Vec3, vec3

Value = float | str

VIEW_SIZE = 256
MAP_SIZE = 1024
EXTENT = 6.0  # side of the base scene's ground, in metres
TEXEL = EXTENT / MAP_SIZE  # approximate size of a texel in the base scene, in metres
NAMES: dict[LightKind, str] = {"directional": "sun", "spot": "spot", "point": "lamp"}
_AZIMUTH = math.radians(165.0)  # from the left: the camera sees a lit side of casters and their shadows
_DISTANCES: dict[LightKind, float] = {"directional": 1.0, "spot": 6.0, "point": 3.3}


@dataclass(frozen=True, eq=False)
class Setting:
    """Views and parameters to measure at one value of an axis.

    views: of one scene, several for an animation; params: values by parameter name; a technique without these
    parameters is left out of the axis.
    """

    views: tuple[View, ...]
    coordinates: Coordinates = "relative"
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Axis:
    """One stress parameter and its values.

    about: what varies, and what that stresses; values: in order from one end to the other, or words; default: the
    unproblematic value, from which the operating range extends both ways; quick: values of a quick sweep; lights: kinds
    of light to sweep under; ordered: whether the order of values is meaningful.
    """

    change: Callable[[Any, LightKind], Setting]
    name: str
    about: str
    values: tuple[Value, ...]
    default: Value
    quick: tuple[Value, ...]
    unit: str = ""
    lights: tuple[LightKind, ...] = tuple(NAMES)
    ordered: bool = True

    def at(self, value: Value, light: LightKind) -> Setting:
        """Setting at a value, with its scene named after the axis and value."""
        setting = self.change(value, light)
        scene = replace(setting.views[0].scene, name=f"{self.name}-{value_label(value)}")
        views = (
            replace(view, scene=scene, camera=replace(view.camera, name=f"camera-{frame}" if frame else "camera"))
            for frame, view in enumerate(setting.views)
        )
        return replace(setting, views=tuple(views))

    def swept(self, quick: bool) -> tuple[Value, ...]:
        """Values of a full or quick sweep, in the order of the axis."""
        return tuple(value for value in self.values if value in self.quick) if quick else self.values


def value_label(value: Value) -> str:
    """Text of a value in names and tables: `0.25`, `16384`, `1e-5`, `1e7`."""
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
    **parameters: float,
) -> Mesh:
    """A named shape, scaled, then rotated about y by `turn` degrees, then translated to `at`."""
    shape = build_shape(kind, dict(parameters), "axis")
    turned = shape.vertices * np.asarray(scale, dtype=np.float64) @ turn_about_y(math.radians(turn)).T
    return replace(shape, vertices=turned + np.asarray(at, dtype=np.float64))


def turn_about_y(angle: float) -> Floats:
    """(3, 3) rotation about the y axis by an angle in radians."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def ground(side: float = EXTENT) -> Mesh:
    """A square ground at y = 0."""
    return replace(mesh("plane", side, (0.0, 0.0, 0.0)), name="ground")


def base_meshes() -> tuple[Mesh, ...]:
    """A ground, a rotated box on it and a sphere above it, neither of which shadows the other at any elevation."""
    return (
        ground(),
        mesh("box", 0.9, (-0.7, 0.45, 0.5), turn=25.0),
        mesh("sphere", 0.8, (0.6, 0.65, -1.1), subdivisions=4),
    )


def light_at(kind: LightKind, elevation: float = 50.0, azimuth: float = _AZIMUTH) -> Light:
    """A light at an elevation in degrees and an azimuth in radians, aimed at the scene's centre."""
    e = math.radians(elevation)
    toward = np.array([math.cos(e) * math.cos(azimuth), math.sin(e), math.cos(e) * math.sin(azimuth)])
    return light_from(kind, toward)


def light_from(kind: LightKind, toward: Sequence[float] | Floats) -> Light:
    """A light in a direction as seen from the scene's centre, aimed at the centre."""
    unit_vector = np.asarray(toward) / np.linalg.norm(toward)
    position = vec3(unit_vector * _DISTANCES[kind]) if kind != "directional" else (0.0, 0.0, 0.0)
    return Light(NAMES[kind], kind, vec3(-unit_vector), position, math.radians(60.0) if kind == "spot" else 0.0)


def view_of_meshes(
    meshes: Sequence[Mesh],
    light: Light,
    size: int = VIEW_SIZE,
    eye: Vec3 = (2.6, 4.2, 4.6),
    target: Vec3 = (0.0, 0.2, 0.0),
    fov: float = 40.0,
) -> View:
    """A view of meshes under a light; fov: vertical, in degrees."""
    camera = Camera("camera", eye, target, math.radians(fov))
    return view_of(Scene("axis", tuple(meshes), (camera,), (light,)), camera, light, size)


def base_view(kind: LightKind, size: int = VIEW_SIZE) -> View:
    """View of the base scene under a light of a kind."""
    return view_of_meshes(base_meshes(), light_at(kind), size)
