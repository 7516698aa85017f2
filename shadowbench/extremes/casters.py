"""Axes of the casters: thickness, gap to the receiver, overlap, number of triangles, defects of meshes."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from shadowbench.extremes.model import TEXEL, Axis, Setting, base_meshes, ground, light_at, mesh, view_of_meshes
from shadowbench.scenes.geometry import Triangles, without_zero_area
from shadowbench.scenes.model import LightKind, Mesh
from shadowbench.scenes.normals import mean_normals
from shadowbench.scenes.vectors import Floats

_PLATE = 1.2
_SECTIONS = {1024: 32, 16384: 128, 262144: 512, 1048576: 1024}  # sections of a torus by its number of triangles
_FLAT = 1e-7  # height of a sliver relative to its longest edge


@partial(
    Axis,
    name="thickness",
    about="a wall gets thinner than a shadow-map texel: light leaks through it",
    unit="texels of 5.9 mm",
    values=(30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01),
    default=10.0,
    quick=(10.0, 1.0, 0.01),
    invariant="a thin wall shadows as a thick one does",
)
def thickness(texels: float, kind: LightKind) -> Setting:
    """A wall on the ground, roughly perpendicular to the light's azimuth, and a plate above the ground."""
    thick = texels * TEXEL
    wall = mesh("box", (thick, 1.2, 1.8), (-0.9, 0.6, 0.3), turn=-30.0)
    plate = mesh("box", (1.1, thick, 1.1), (1.1, 0.6, -0.9), turn=20.0)
    return Setting((view_of_meshes([ground(), wall, plate], light_at(kind)),))


@partial(
    Axis,
    name="gap",
    about="a caster is lowered onto its receiver: peter-panning where the bias exceeds the gap",
    unit="of the caster",
    values=(1.0, 0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5),
    default=0.3,
    quick=(0.3, 1e-2, 1e-5),
    invariant="the shadow of a lowered caster ends at its foot",
)
def gap(share: float, kind: LightKind) -> Setting:
    """A plate above the ground, at a height given as a share of its side; its shadow is visible beside and below it."""
    gap, high = share * _PLATE, 0.2 * _PLATE
    plate = mesh("box", (_PLATE, high, _PLATE), (-0.3, gap + high / 2, -0.2), turn=25.0)
    eye, target = (2.2, 2.4, 2.6), (0.3, 0.3, 0.2)
    return Setting((view_of_meshes([ground(), plate], light_at(kind), eye=eye, target=target),))


@partial(
    Axis,
    name="overlap",
    about="stacked casters: the stencil count of a shadow volume overflows 8 bits at 256",
    unit="casters",
    values=(1, 3, 10, 30, 100, 127, 128, 255, 256, 257, 512, 1000),
    default=1,
    quick=(1, 256, 1000),
    lights=("directional", "point"),
    invariant="a point behind many casters is in shadow",
)
def overlap(count: float, kind: LightKind) -> Setting:
    """A stack of plates, 5 cm high in all, so that a shadow ray crosses nearly all of them."""
    step = 0.05 / int(count)
    heights = 0.5 + np.arange(int(count)) * step
    plates = [mesh("box", (0.9, 0.3 * step, 0.9), (-0.4, y, 0.1), turn=25.0) for y in heights]
    corners = np.concatenate([plate.vertices for plate in plates])
    faces = np.concatenate([plate.faces + 8 * k for k, plate in enumerate(plates)])
    return Setting((view_of_meshes([ground(), Mesh("plates", corners, faces)], light_at(kind, 75.0)),))


@partial(
    Axis,
    name="layers",
    about="the upper of two casters rises: their distance over that of the lower one to the ground; maps that are"
    " filtered let light through where casters overlap (bleeding), the more, the farther they are apart",
    values=(0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    default=0.1,
    quick=(0.1, 1.0, 10.0),
    invariant="a caster behind another changes no shadow",
)
def layers(ratio: float, kind: LightKind) -> Setting:
    """A plate, and above it along the light a smaller one, whose shadow's edge lies in the first one's shadow."""
    light = light_at(kind, 75.0)
    height = 0.6
    lower = np.array([-0.2, height, 0.1])
    toward = -np.array(light.direction) if kind == "directional" else np.array(light.position) - lower
    upper = lower + toward / toward[1] * height * ratio
    plates = [mesh("box", (side, 0.02, side), at, turn=25.0) for side, at in ((1.6, lower), (0.8, upper))]
    eye, target = (1.7, 0.75, 1.9), (0.0, 0.0, 0.0)  # below the plates
    return Setting((view_of_meshes([ground(), *plates], light, eye=eye, target=target),))


@partial(
    Axis,
    name="triangles",
    about="triangles of one caster, up to two million",
    values=(1, 12, 1024, 16384, 262144, 1048576, 2097152),
    default=1024,
    quick=(1, 1024, 16384),
    lights=("directional", "point"),
    invariant="a finer mesh of the same surface casts the same shadow",
)
def triangles(count: float, kind: LightKind) -> Setting:
    """One caster with a number of triangles: a triangle, a box, tori of more and more sections, finally two tori."""
    copies = 2 if count > max(_SECTIONS) else 1
    if count == 1:
        corners = np.array([[-0.6, 0.5, 0.7], [0.9, 0.7, 0.2], [-0.3, 0.6, -0.8]])
        casters = [Mesh("one", corners, np.array([[0, 1, 2]], dtype=np.int32))]
    elif count == 12:
        casters = [base_meshes()[1]]
    else:
        sections = _SECTIONS[int(count) // copies]
        casters = [mesh("torus", 1.1, (-0.8 + 1.6 * k, 0.6, 0.5 - k), sections=sections) for k in range(copies)]
    return Setting((view_of_meshes([ground(), *casters], light_at(kind, 65.0)),))


@partial(
    Axis,
    name="smoothness",
    about="triangles of a sphere with smooth normals: dark facets along the terminator where there are few",
    unit="triangles",
    values=(20, 80, 320, 1280, 5120, 20480),
    default=1280,
    quick=(20, 80, 1280),
    invariant="a smooth surface shadows itself only where its smooth normal faces away from the light",
)
def smoothness(triangles: float, kind: LightKind) -> Setting:
    """A sphere above the ground, lit from the side."""
    level = round(math.log(triangles / 20, 4))
    ball = mesh("sphere", 1.2, (0.0, 0.8, 0.0), subdivisions=level)
    smooth = replace(ball, normals=mean_normals(Triangles(ball.vertices, ball.faces)))
    return Setting((view_of_meshes([ground(), smooth], light_at(kind, 25.0)),))


@partial(
    Axis,
    name="mesh",
    about="defects of casters: slivers, duplicated triangles, T-junctions, inconsistent winding, holes",
    values=("closed", "slivers", "zero-area", "duplicated", "t-junctions", "inconsistent-winding", "open"),
    default="closed",
    quick=("closed", "slivers", "inconsistent-winding", "open"),
    lights=("directional", "point"),
    invariant="triangles cast shadows whatever the mesh's topology",
    ordered=False,
)
def defects(name: str, kind: LightKind) -> Setting:
    """The base scene, its casters with a kind of defect."""
    floor, *casters = base_meshes()
    meshes = [Mesh(caster.name, *_with_defect(name, caster.vertices, caster.faces)) for caster in casters]
    return Setting((view_of_meshes([floor, *meshes], light_at(kind)),))


def _with_defect(name: str, vertices: Floats, faces: np.ndarray) -> Triangles:
    """A mesh as modelling tools and scanners leave it behind."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    match name:
        case "slivers":  # every triangle cut in three at a point close to the middle of an edge: one part is a sliver
            inner = (a + b) / 2 * (1 - _FLAT) + c * _FLAT
            return _loose([(a, b, inner), (b, c, inner), (c, a, inner)])
        case "zero-area":  # a triangle of zero area on every edge, dropped as loading does
            flat = _loose([(a, b, (a + b) / 2)])
            both = np.concatenate([vertices, flat.vertices]), np.concatenate([faces, flat.faces + len(vertices)])
            return without_zero_area(Triangles(*both))[0]
        case "duplicated":  # every triangle twice, every third one three times
            return Triangles(vertices, np.concatenate([faces, faces, faces[::3]]))
        case "t-junctions":  # every second triangle split at the middle of an edge that its neighbour keeps unsplit
            middle = ((a + b) / 2)[::2]
            whole = a[1::2], b[1::2], c[1::2]
            return _loose([whole, (a[::2], middle, c[::2]), (middle, b[::2], c[::2])])
        case "inconsistent-winding":  # of every third triangle
            turned = faces.copy()
            turned[::3] = turned[::3, ::-1]
            return Triangles(vertices, turned)
        case "open":  # every fifth triangle missing
            return Triangles(vertices, faces[np.arange(len(faces)) % 5 != 0])
    return Triangles(vertices, faces)


def _loose(parts: list[tuple[Floats, Floats, Floats]]) -> Triangles:
    """Triangles from their first, second and third corners, (N, 3) each, no vertex shared."""
    corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return Triangles(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))
