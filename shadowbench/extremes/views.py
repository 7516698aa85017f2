"""Axes of the view: movement of eye and light, distance from the origin and scale, depth format, map and view size."""

from dataclasses import replace
from functools import partial

import numpy as np

from shadowbench.extremes.model import (
    MAP_SIZE,
    TEXEL,
    VIEW_SIZE,
    Axis,
    Setting,
    base_view,
    ground,
    light_at,
    mesh,
    turn_about_y,
    view_of_meshes,
)
from shadowbench.scenes.model import Camera, Coordinates, LightKind, Scene, View, view_of
from shadowbench.scenes.vectors import Floats, unit, vec3

FRAMES = 5  # frames of an animation, the first at rest
_DIRECTION = np.array([0.8, 0.36, -0.48])  # unit length, along no axis
_REVERSED = "d32f-reversed"


@partial(
    Axis,
    name="volume-wall",
    about="the eye crosses the side of a shadow volume: z-pass counts go wrong at the near plane",
    unit="m",
    values=(0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0, -1e-6, -1e-5, -1e-4, -1e-3, -1e-2, -0.1, -0.5),
    default=0.5,
    quick=(0.5, 1e-4, 0.0, -0.1),
    invariant="the position of the eye moves no shadow",
)
def volume_wall(metres: float, kind: LightKind) -> Setting:
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


@partial(
    Axis,
    name="camera-step",
    about="the camera moves by fractions of a texel: shimmering edges",
    unit="texels of 5.9 mm",
    values=(0.05, 0.1, 0.25, 0.5, 0.75),
    default=0.05,
    quick=(0.05, 0.5),
    invariant="a pixel changes only if it does in the truth",
)
def camera_step(texels: float, kind: LightKind) -> Setting:
    """The camera moves by that many texels per frame."""
    first = base_view(kind)
    step = np.array([0.8, 0.0, -0.6]) * texels * TEXEL
    cameras = [_moved(first.camera, 1.0, step * frame) for frame in range(FRAMES)]
    return Setting(tuple(view_of(first.scene, camera, first.light, first.size) for camera in cameras))


def _light_steps(texels: float, kind: LightKind) -> Setting:
    """The light rotates about the y axis so that the shadow of a point 1 m high moves by that many texels per frame."""
    first = base_view(kind)
    light = first.light
    turns = [turn_about_y(texels * TEXEL * frame) for frame in range(FRAMES)]
    poses = [(vec3(turn @ light.direction), vec3(turn @ light.position)) for turn in turns]
    lights = [replace(light, direction=direction, position=position) for direction, position in poses]
    return Setting(tuple(replace(first, light=light) for light in lights))


light_step = replace(
    camera_step,
    name="light-step",
    about="the light moves so that shadow edges shift by fractions of a texel: shimmering edges",
    change=_light_steps,
)


def _translated(metres: float, kind: LightKind, coordinates: Coordinates) -> Setting:
    return Setting((_transformed(base_view(kind), 1.0, _DIRECTION * metres),), coordinates)


distance = Axis(
    partial(_translated, coordinates="relative"),
    name="distance",
    about="the whole scene moves away from the world origin; coordinates are taken relative to its centre",
    unit="m",
    values=(0.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    default=0.0,
    quick=(0.0, 1e4, 1e7),
    invariant="moving everything changes nothing",
)
distance_absolute = replace(
    distance,
    name="distance-absolute",
    about="the whole scene moves away from the world origin, in absolute float32 coordinates",
    invariant="moving everything changes nothing, until float32 coordinates are too coarse for the scene",
    change=partial(_translated, coordinates="absolute"),
)


@partial(
    Axis,
    name="scale",
    about="the whole scene is scaled: lengths that are hard-coded in metres show",
    unit="×",
    values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
    default=1.0,
    quick=(1e-6, 1.0, 1e6),
    invariant="scaling everything changes nothing",
)
def scale(factor: float, kind: LightKind) -> Setting:
    """The base scene, scaled about the origin."""
    return Setting((_transformed(base_view(kind), factor, np.zeros(3)),))


def _transformed(view: View, factor: float, offset: Floats) -> View:
    """The view with scene, camera and light scaled, then translated."""
    scene, camera, light = view.scene, _moved(view.camera, factor, offset), view.light
    if light.kind != "directional":
        light = replace(light, position=vec3(np.array(light.position) * factor + offset))
    meshes = tuple(mesh.with_vertices(mesh.vertices * factor + offset) for mesh in scene.meshes)
    return view_of(Scene(scene.name, meshes, (camera,), (light,)), camera, light, view.size)


def _moved(camera: Camera, factor: float, offset: Floats) -> Camera:
    position, target = (vec3(np.array(point) * factor + offset) for point in (camera.position, camera.target))
    return replace(camera, position=position, target=target, near=None, far=None)


@partial(
    Axis,
    name="depth-format",
    about="depth formats from reversed 32-bit float to 16 bits: precision of the depth comparison",
    values=(_REVERSED, "d32f", "d24", "d16"),
    default="d32f",
    quick=(_REVERSED, "d32f", "d16"),
    invariant="the bias suits the precision of each depth format",
    ordered=False,
)
def depth_format(name: str, kind: LightKind) -> Setting:
    """The base scene, with a depth format."""
    params = {"reversed": True, "depth": "d32f"} if name == _REVERSED else {"depth": name}
    return Setting((base_view(kind),), params=params)


@partial(
    Axis,
    name="map-size",
    about="texels along a side of the shadow map: aliasing of a small map, memory of a large one",
    unit="texels",
    values=(16, 32, 64, 128, 256, 512, MAP_SIZE, 2048, 4096, 8192, 16384),
    default=MAP_SIZE,
    quick=(16, 256, MAP_SIZE, 2048),
    invariant="a coarse map blurs edges, a fine one is right, and none leaks light",
)
def map_size(texels: float, kind: LightKind) -> Setting:
    """The base scene, with a map size."""
    return Setting((base_view(kind),), params={"size": int(texels)})


@partial(
    Axis,
    name="view-size",
    about="pixels along a side of the picture, over a shadow map of fixed size",
    unit="px",
    values=(16, 32, 64, 128, VIEW_SIZE, 512, 1024, 2048, 4096),
    default=VIEW_SIZE,
    quick=(16, VIEW_SIZE, 512),
    lights=("directional", "point"),
    invariant="the same shadows, sampled finer",
)
def view_size(pixels: float, kind: LightKind) -> Setting:
    """The base scene, at a view size."""
    return Setting((base_view(kind, int(pixels)),))
