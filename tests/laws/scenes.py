"""Small random scenes: a few casters over a ground, a slope or nothing, under a sun, a lamp or a spot.

All coordinates are multiples of 2⁻²⁰ below 2⁴. They fit a float32, and moving them by such multiples or scaling them by
powers of two rounds nothing, in float64 or after the placement.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from shadowbench.scenes.model import Camera, Light, LightKind, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import build_shape
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

GRID = 2.0**-20
FLOORS = {"ground": 0.0, "slope": 0.25}  # 8 m along a side, and how much it rises with x
CONVEX = {"box": {}, "sphere": {"subdivisions": 2}, "cone": {"sections": 12}}
SHAPES = CONVEX | {"torus": {"sections": 16}, "plane": {}}


def on_grid(values: Floats) -> Floats:
    """Rounded to a grid that float32 represents exactly, also after subdivision."""
    return np.round(np.asarray(values, dtype=np.float64) / GRID) * GRID


def around(elevation: float, azimuth: float, distance: float) -> Floats:
    """(3,) position at an elevation and azimuth in degrees."""
    up, about = math.radians(elevation), math.radians(azimuth)
    return distance * np.array([math.cos(up) * math.cos(about), math.sin(up), math.cos(up) * math.sin(about)])


@dataclass(frozen=True)
class Caster:
    """A shape, scaled, sheared by `lean` metres in height for each along x, and moved."""

    kind: str
    scale: Vec3
    lean: float
    at: Vec3

    @property
    def mesh(self) -> Mesh:
        triangles = build_shape(self.kind, dict(SHAPES[self.kind]), "law")
        vertices = triangles.vertices * self.scale
        vertices[:, 1] += self.lean * vertices[:, 0]
        return Mesh(self.kind, on_grid(vertices + self.at), triangles.faces)


@dataclass(frozen=True)
class Little:
    """A small scene and its view. Equal values make equal views, so that results can be cached."""

    casters: tuple[Caster, ...]
    floor: str  # one of FLOORS, or none
    light: LightKind
    sun: tuple[float, float]  # elevation and azimuth in degrees, of a lamp too
    eye: tuple[float, float]  # the camera's elevation, and its azimuth from the sun's

    def view(self, size: int) -> View:
        """In file coordinates; size² pixels."""
        meshes = [caster.mesh for caster in self.casters]
        if self.floor in FLOORS:
            lying = Caster("plane", (8.0, 1.0, 8.0), FLOORS[self.floor], (0.0, 0.0, 0.0)).mesh
            meshes.insert(0, replace(lying, name=self.floor))
        toward = around(*self.sun, 6.5)
        position = (0.0, 0.0, 0.0) if self.light == "directional" else vec3(on_grid(toward))
        light = Light("light", self.light, vec3(-unit(toward)), position, math.radians(60.0))
        eye = around(self.eye[0], self.sun[1] + self.eye[1], 5.5)
        camera = Camera("camera", vec3(on_grid(eye)), (0.0, 0.5, 0.0), math.radians(50.0))
        scene = Scene("little", tuple(meshes), (camera,), (light,))
        return view_of(scene, camera, light, size)


@st.composite
def littles(draw: st.DrawFn, lights: Iterable[LightKind]) -> Little:
    """Scenes under one of the kinds of light; the first caster is convex and closed.

    All numbers are drawn uniformly, since hypothesis makes most of a few examples nearly equal.
    """
    random = draw(st.randoms(use_true_random=True))

    def between(low: float, high: float) -> float:
        return float(on_grid(np.array(random.uniform(low, high))))

    def caster(kinds: Iterable[str]) -> Caster:
        """Between 0.4 and 1.5 m in size, above the floor, within 1 m of the middle."""
        return Caster(
            kind=random.choice(sorted(kinds)),
            scale=(between(0.6, 1.5), between(0.4, 1.5), between(0.6, 1.5)),
            lean=random.choice([0.0, 0.25, -0.5]),
            at=(between(-1.0, 1.0), between(0.9, 1.4), between(-1.0, 1.0)),
        )

    more = [caster(SHAPES) for _ in range(random.randrange(3))]
    return Little(
        casters=(caster(CONVEX), *more),
        floor=random.choice(["ground", "ground", "slope", "none"]),
        light=random.choice(sorted(lights)),
        sun=(between(30.0, 80.0), between(0.0, 360.0)),
        eye=(between(25.0, 60.0), between(50.0, 310.0)),  # not with the sun behind it, which sees no shadow
    )
