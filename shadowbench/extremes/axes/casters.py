"""Axes of the casters: thickness, gap to the receiver, overlap, number of triangles."""

import numpy as np

from shadowbench.extremes.axes.model import (
    TEXEL,
    Axis,
    Setting,
    base_meshes,
    ground,
    light_at,
    mesh,
    view_of_meshes,
)
from shadowbench.scenes.model import LightKind, Mesh

_PLATE = 1.2
_SECTIONS = {1024: 32, 16384: 128, 262144: 512, 1048576: 1024}  # sections of a torus by its number of triangles


def _thickness(texels: float, kind: LightKind) -> Setting:
    """A wall on the ground, roughly perpendicular to the light's azimuth, and a plate above the ground."""
    thick = texels * TEXEL
    wall = mesh("box", (thick, 1.2, 1.8), (-0.9, 0.6, 0.3), turn=-30.0)
    plate = mesh("box", (1.1, thick, 1.1), (1.1, 0.6, -0.9), turn=20.0)
    return Setting((view_of_meshes([ground(), wall, plate], light_at(kind)),))


def _gap(share: float, kind: LightKind) -> Setting:
    """A plate above the ground, at a height given as a share of its side; its shadow is visible beside and below it."""
    gap, high = share * _PLATE, 0.2 * _PLATE
    plate = mesh("box", (_PLATE, high, _PLATE), (-0.3, gap + high / 2, -0.2), turn=25.0)
    eye, target = (2.2, 2.4, 2.6), (0.3, 0.3, 0.2)
    return Setting((view_of_meshes([ground(), plate], light_at(kind), eye=eye, target=target),))


def _overlap(count: float, kind: LightKind) -> Setting:
    """A stack of plates, 5 cm high in all, so that a shadow ray crosses nearly all of them."""
    step = 0.05 / int(count)
    heights = 0.5 + np.arange(int(count)) * step
    thick = 0.3 * step
    plates = [mesh("box", (0.9, thick, 0.9), (-0.4, y, 0.1), turn=25.0) for y in heights]
    corners = np.concatenate([plate.vertices for plate in plates])
    faces = np.concatenate([plate.faces + 8 * k for k, plate in enumerate(plates)])
    return Setting((view_of_meshes([ground(), Mesh("plates", corners, faces)], light_at(kind, 75.0)),))


def _layers(ratio: float, kind: LightKind) -> Setting:
    """A plate, and above it along the light a smaller one, whose shadow's edge lies in the first one's shadow."""
    light = light_at(kind, 75.0)
    height = 0.6
    lower = np.array([-0.2, height, 0.1])
    toward = -np.array(light.direction) if kind == "directional" else np.array(light.position) - lower
    upper = lower + toward / toward[1] * height * ratio
    plates = [mesh("box", (side, 0.02, side), at, turn=25.0) for side, at in ((1.6, lower), (0.8, upper))]
    eye, target = (1.7, 0.75, 1.9), (0.0, 0.0, 0.0)  # below the plates
    return Setting((view_of_meshes([ground(), *plates], light, eye=eye, target=target),))


def _triangles(count: float, kind: LightKind) -> Setting:
    """One caster with a number of triangles: a triangle, a box, tori of more and more sections, finally two tori."""
    light = light_at(kind, 65.0)
    if count == 1:
        corners = np.array([[-0.6, 0.5, 0.7], [0.9, 0.7, 0.2], [-0.3, 0.6, -0.8]])
        return Setting(
            (view_of_meshes([ground(), Mesh("one", corners, np.array([[0, 1, 2]], dtype=np.int32))], light),)
        )
    if count == 12:
        return Setting((view_of_meshes([ground(), base_meshes()[1]], light),))
    copies = 2 if count > max(_SECTIONS) else 1
    sections = _SECTIONS[int(count) // copies]
    tori = [mesh("torus", 1.1, (-0.8 + 1.6 * k, 0.6, 0.5 - k), sections=sections) for k in range(copies)]
    return Setting((view_of_meshes([ground(), *tori], light),))


THICKNESS = Axis(
    name="thickness",
    about="a wall gets thinner than a shadow-map texel: light leaks through it",
    unit="texels of 5.9 mm",
    values=(30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01),
    default=10.0,
    quick=(10.0, 1.0, 0.01),
    lights=("directional", "spot", "point"),
    invariant="a thin wall shadows as a thick one does",
    change=_thickness,
)
GAP = Axis(
    name="gap",
    about="a caster is lowered onto its receiver: peter-panning where the bias exceeds the gap",
    unit="of the caster",
    values=(1.0, 0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5),
    default=0.3,
    quick=(0.3, 1e-2, 1e-5),
    lights=("directional", "spot", "point"),
    invariant="the shadow of a lowered caster ends at its foot",
    change=_gap,
)
OVERLAP = Axis(
    name="overlap",
    about="stacked casters: the stencil count of a shadow volume overflows 8 bits at 256",
    unit="casters",
    values=(1, 3, 10, 30, 100, 127, 128, 255, 256, 257, 512, 1000),
    default=1,
    quick=(1, 256, 1000),
    lights=("directional", "point"),
    invariant="a point behind many casters is in shadow",
    change=_overlap,
)
LAYERS = Axis(
    name="layers",
    about="the upper of two casters rises: their distance over that of the lower one to the ground; maps that are"
    " filtered let light through where casters overlap (bleeding), the more, the farther they are apart",
    unit="",
    values=(0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    default=0.1,
    quick=(0.1, 1.0, 10.0),
    lights=("directional", "spot", "point"),
    invariant="a caster behind another changes no shadow",
    change=_layers,
)
TRIANGLES = Axis(
    name="triangles",
    about="triangles of one caster, up to two million",
    unit="",
    values=(1, 12, 1024, 16384, 262144, 1048576, 2097152),
    default=1024,
    quick=(1, 1024, 16384),
    lights=("directional", "point"),
    invariant="a finer mesh of the same surface casts the same shadow",
    change=_triangles,
)
