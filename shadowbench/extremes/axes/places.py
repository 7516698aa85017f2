"""Axes of place and size: how far from the origin, how large in metres."""

from dataclasses import replace

import numpy as np

from shadowbench.extremes.axes.model import Axis, Setting, base
from shadowbench.scenes.model import Coordinates, Floats, LightKind, Scene, View, vec3, view_of

_WAY = np.array([0.8, 0.36, -0.48])  # of length 1, along no axis


def _carried(view: View, factor: float, offset: Floats) -> View:
    """The view with everything in it scaled, then moved."""
    scene, camera, light = view.scene, view.camera, view.light

    def carried(points: Floats) -> Floats:
        return np.asarray(points, dtype=np.float64) * factor + offset

    camera = replace(
        camera,
        position=vec3(carried(np.array(camera.position))),
        target=vec3(carried(np.array(camera.target))),
        near=None,
        far=None,
    )
    if light.kind != "directional":
        light = replace(light, position=vec3(carried(np.array(light.position))))
    meshes = tuple(replace(mesh, vertices=carried(mesh.vertices)) for mesh in scene.meshes)
    return view_of(Scene(scene.name, meshes, (camera,), (light,)), camera, light, view.size)


def _moved(metres: float, kind: LightKind, coordinates: Coordinates) -> Setting:
    return Setting((_carried(base(kind), 1.0, _WAY * metres),), coordinates)


def _relative(metres: float, kind: LightKind) -> Setting:
    return _moved(metres, kind, "relative")


def _absolute(metres: float, kind: LightKind) -> Setting:
    return _moved(metres, kind, "absolute")


def _scaled(factor: float, kind: LightKind) -> Setting:
    return Setting((_carried(base(kind), factor, np.zeros(3)),))


DISTANCE = Axis(
    name="distance",
    about="the whole scene moves away from the world origin; coordinates are taken relative to its centre",
    unit="m",
    values=(0.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    home=0.0,
    quick=(0.0, 1e4, 1e7),
    lights=("directional", "spot", "point"),
    holds="moving everything changes nothing",
    change=_relative,
)
DISTANCE_ABSOLUTE = replace(
    DISTANCE,
    name="distance-absolute",
    about="the whole scene moves away from the world origin, in absolute float32 coordinates",
    holds="moving everything changes nothing, until float32 coordinates are too coarse for the scene",
    change=_absolute,
)
SCALE = Axis(
    name="scale",
    about="the whole scene is scaled: lengths that are hard-coded in metres show",
    unit="×",
    values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
    home=1.0,
    quick=(1e-6, 1.0, 1e6),
    lights=("directional", "spot", "point"),
    holds="scaling everything changes nothing",
    change=_scaled,
)
