"""Axes of the light: elevation, passage through the up axis, far/near ratio, distance of a lamp to a wall, size."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from shadowbench.extremes.model import (
    NAMES,
    Axis,
    Setting,
    base_meshes,
    ground,
    light_at,
    light_from,
    mesh,
    view_of_meshes,
)
from shadowbench.scenes.model import Light, LightKind, Mesh


@partial(
    Axis,
    name="elevation",
    about="the light sinks from the zenith to the horizon: long shadows, light at grazing incidence",
    unit="°",
    values=(
        *(89.9, 85.0, 75.0, 60.0, 50.0, 40.0, 30.0, 20.0, 15.0, 10.0, 7.0),
        *(5.0, 3.0, 2.0, 1.0, 0.8, 0.7, 0.6, 0.5, 0.2, 0.1),
    ),
    default=50.0,
    quick=(89.9, 50.0, 5.0, 0.1),
    invariant="a low light lengthens shadows and leaks through no surface",
)
def elevation(degrees: float, kind: LightKind) -> Setting:
    """The base scene under a light at an elevation."""
    return Setting((view_of_meshes(base_meshes(), light_at(kind, degrees)),))


@partial(
    Axis,
    name="through-up",
    about="the light passes through the up axis, where a look-at matrix built from that axis degenerates",
    unit="°",
    values=(5.0, 1.0, 0.1, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-5, -1e-3, -0.1, -1.0, -5.0),
    default=5.0,
    quick=(5.0, 1e-5, 0.0),
    lights=("directional", "spot"),
    invariant="a light along the up axis is a light like any other",
)
def through_up(degrees: float, kind: LightKind) -> Setting:
    """A floor, perpendicular to the light at 0°, under a box that is out of view."""
    tilt = math.radians(degrees)
    light = light_from(kind, (math.sin(tilt), math.cos(tilt), 0.0))
    box = mesh("box", 0.9, (0.0, 3.0, 0.0), turn=25.0)
    return Setting((view_of_meshes([ground(4.0), box], light, eye=(1.5, 2.0, 1.6), target=(0.1, 0.0, 0.1)),))


@partial(
    Axis,
    name="far-near",
    about="the caster approaches the lamp: the ratio of the far to the near plane, and with it depth precision",
    values=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    default=1e1,
    quick=(1e1, 1e4, 1e7),
    lights=("spot", "point"),
    invariant="a caster near the light shadows as its larger, farther likeness does",
)
def far_near(ratio: float, kind: LightKind) -> Setting:
    """A box near the light, the ground's farthest corner being `ratio` times as far; its shadow is always the same."""
    light = Light(NAMES[kind], kind, (0.0, -1.0, 0.0), (0.2, 2.0, -0.1), math.radians(100.0) if kind == "spot" else 0.0)
    far = float(np.linalg.norm(np.subtract(light.position, (-2.0, 0.0, 2.0))))
    near = far / ratio
    center = np.add(light.position, np.array([0.15, -1.3, 0.1]) * near)
    return Setting((view_of_meshes([ground(4.0), mesh("box", 0.6 * near, center, turn=25.0)], light),))


@partial(
    Axis,
    name="lamp-distance",
    about="a point light approaches a wall: light at grazing incidence, and a wide range of depths",
    unit="m",
    values=(2.0, 1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4),
    default=1.0,
    quick=(1.0, 1e-2, 1e-4),
    lights=("point",),
    invariant="a lamp close to a wall lights the wall, and the rest as before",
)
def lamp_distance(metres: float, kind: LightKind) -> Setting:
    """A lamp beside a wall on the ground, at half the wall's height."""
    corners = np.array([[-2.0, 0.0, 2.0], [-2.0, 0.0, -2.0], [-2.0, 3.0, -2.0], [-2.0, 3.0, 2.0]])
    wall = Mesh("wall", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    light = Light(NAMES[kind], kind, position=(-2.0 + metres, 1.5, 0.1))
    return Setting((view_of_meshes([*base_meshes(), wall], light, eye=(4.6, 3.4, 3.6), target=(-0.6, 0.7, 0.0)),))


@partial(
    Axis,
    name="light-size",
    about="the light grows, from a point to a broad light: penumbrae from less than a pixel to wider than the casters",
    unit="°",
    values=(0.01, 0.03, 0.1, 0.2665, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0),
    default=0.01,
    quick=(0.01, 1.0, 20.0),
    invariant="a shadow's penumbra is as wide as the light seen from its caster's edge",
)
def light_size(degrees: float, kind: LightKind) -> Setting:
    """A light of an angular radius as seen from the scene's centre."""
    light, angle = light_at(kind), math.radians(degrees)
    distance = float(np.linalg.norm(light.position))
    sized = replace(light, radius=angle if kind == "directional" else distance * math.sin(angle))
    return Setting((view_of_meshes(base_meshes(), sized),))
