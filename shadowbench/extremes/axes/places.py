"""Axes of position and scale: distance of the scene from the origin, and its size in metres."""

from dataclasses import replace

import numpy as np

from shadowbench.extremes.axes.model import Axis, Setting, base_view
from shadowbench.scenes.model import Coordinates, LightKind, Scene, View, view_of
from shadowbench.scenes.vectors import Floats, vec3

_DIRECTION = np.array([0.8, 0.36, -0.48])  # unit length, along no axis


def _transformed(view: View, factor: float, offset: Floats) -> View:
    """The view with scene, camera and light scaled, then translated."""
    scene, camera, light = view.scene, view.camera, view.light

    def transformed(points: Floats) -> Floats:
        return np.asarray(points, dtype=np.float64) * factor + offset

    camera = replace(
        camera,
        position=vec3(transformed(np.array(camera.position))),
        target=vec3(transformed(np.array(camera.target))),
        near=None,
        far=None,
    )
    if light.kind != "directional":
        light = replace(light, position=vec3(transformed(np.array(light.position))))
    meshes = tuple(replace(mesh, vertices=transformed(mesh.vertices)) for mesh in scene.meshes)
    return view_of(Scene(scene.name, meshes, (camera,), (light,)), camera, light, view.size)


def _translated(metres: float, kind: LightKind, coordinates: Coordinates) -> Setting:
    return Setting((_transformed(base_view(kind), 1.0, _DIRECTION * metres),), coordinates)


def _relative(metres: float, kind: LightKind) -> Setting:
    return _translated(metres, kind, "relative")


def _absolute(metres: float, kind: LightKind) -> Setting:
    return _translated(metres, kind, "absolute")


def _scaled(factor: float, kind: LightKind) -> Setting:
    return Setting((_transformed(base_view(kind), factor, np.zeros(3)),))


DISTANCE = Axis(
    name="distance",
    about="the whole scene moves away from the world origin; coordinates are taken relative to its centre",
    unit="m",
    values=(0.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    default=0.0,
    quick=(0.0, 1e4, 1e7),
    lights=("directional", "spot", "point"),
    invariant="moving everything changes nothing",
    change=_relative,
)
DISTANCE_ABSOLUTE = replace(
    DISTANCE,
    name="distance-absolute",
    about="the whole scene moves away from the world origin, in absolute float32 coordinates",
    invariant="moving everything changes nothing, until float32 coordinates are too coarse for the scene",
    change=_absolute,
)
SCALE = Axis(
    name="scale",
    about="the whole scene is scaled: lengths that are hard-coded in metres show",
    unit="×",
    values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
    default=1.0,
    quick=(1e-6, 1.0, 1e6),
    lights=("directional", "spot", "point"),
    invariant="scaling everything changes nothing",
    change=_scaled,
)
