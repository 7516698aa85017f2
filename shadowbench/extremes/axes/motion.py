"""Axes of motion: a camera entering a shadow volume, and subtexel steps of camera and light."""

import math
from dataclasses import replace

import numpy as np

from shadowbench.extremes.axes.model import TEXEL, Axis, Setting, base_view, ground, light_at, mesh, view_of_meshes
from shadowbench.scenes.model import Light, LightKind, View, view_of
from shadowbench.scenes.vectors import Floats, unit, vec3

FRAMES = 5
"""Frames of an animation, the first at rest."""


def _volume_wall(metres: float, kind: LightKind) -> Setting:
    """The eye at a distance from the side of a plate's shadow volume, inside it if `metres` is negative."""
    light = light_at(kind, 70.0)
    plate = mesh("box", (1.0, 0.1, 1.6), (0.3, 1.6, 0.0))
    edge = np.array([0.8, 1.55, 0.4])  # on the plate's lower edge at +x, the side away from the light
    position, w = light.homogeneous
    away = unit(edge * w - np.asarray(position)) if w else -np.asarray(position)
    out = unit(np.cross(away, [0.0, 0.0, 1.0]))
    out = out if out[0] > 0 else -out
    eye = edge + away * 0.9 + out * metres
    post = mesh("box", (0.3, 0.8, 0.3), (-0.4, 0.4, -1.5), turn=25.0)
    target = vec3(eye + np.array([-0.55, -0.35, -1.2]))
    return Setting((view_of_meshes([ground(), plate, post], light, eye=vec3(eye), target=target, fov=70.0),))


def _camera_steps(texels: float, kind: LightKind) -> Setting:
    first = base_view(kind)
    step = np.array([0.8, 0.0, -0.6]) * texels * TEXEL
    return Setting(tuple(_translated_camera(first, step * frame) for frame in range(FRAMES)))


def _translated_camera(view: View, offset: Floats) -> View:
    camera = view.camera
    moved = replace(
        camera,
        position=vec3(np.add(camera.position, offset)),
        target=vec3(np.add(camera.target, offset)),
        near=None,
        far=None,
    )
    return view_of(view.scene, moved, view.light, view.size)


def _light_steps(texels: float, kind: LightKind) -> Setting:
    """The light rotates about the y axis so that the shadow of a point 1 m high moves by that many texels per frame."""
    first = base_view(kind)
    angle = texels * TEXEL
    return Setting(tuple(replace(first, light=_rotated(first.light, angle * frame)) for frame in range(FRAMES)))


def _rotated(light: Light, angle: float) -> Light:
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return replace(light, direction=vec3(turn @ light.direction), position=vec3(turn @ light.position))


_STILL = "a pixel changes only if it does in the truth"

VOLUME_WALL = Axis(
    name="volume-wall",
    about="the eye crosses the side of a shadow volume: z-pass counts go wrong at the near plane",
    unit="m",
    values=(0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0, -1e-6, -1e-5, -1e-4, -1e-3, -1e-2, -0.1, -0.5),
    default=0.5,
    quick=(0.5, 1e-4, 0.0, -0.1),
    lights=("directional", "spot", "point"),
    invariant="the position of the eye moves no shadow",
    change=_volume_wall,
)
CAMERA_STEP = Axis(
    name="camera-step",
    about="the camera moves by fractions of a texel: shimmering edges",
    unit="texels of 5.9 mm",
    values=(0.05, 0.1, 0.25, 0.5, 0.75),
    default=0.05,
    quick=(0.05, 0.5),
    lights=("directional", "spot", "point"),
    invariant=_STILL,
    change=_camera_steps,
)
LIGHT_STEP = replace(
    CAMERA_STEP,
    name="light-step",
    about="the light moves so that shadow edges shift by fractions of a texel: shimmering edges",
    change=_light_steps,
)
