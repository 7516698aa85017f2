"""Shapes for scene files, centred on the origin, with faces wound outwards.

plane 1×1 in xz, normal +y; box 1³; sphere radius ½; torus radii ½ and ⅙, around y; cylinder and cone radius ½ and
height 1 along y; capsule radius ½ with a cylinder of height 1 along y, of total height 2. Larger ones are in
`generators`.
"""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes import generators
from shadowbench.scenes.triangles import Triangles, welded, without_zero_area
from shadowbench.scenes.vectors import Floats
from shadowbench.strict import Strict, explain

_BOX = [[6, 4, 7], [3, 6, 7], [7, 4, 5], [5, 3, 7], [6, 0, 4], [2, 6, 3], [2, 0, 6], [4, 0, 5], [1, 3, 5], [5, 0, 1]]
_BOX += [[1, 2, 3], [0, 2, 1]]
_ICOSAHEDRON = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2]]
_ICOSAHEDRON += [[10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11]]
_ICOSAHEDRON += [[6, 2, 10], [8, 6, 7], [9, 8, 1]]
_POLE = 1e-8  # radius below which points of a profile are on the axis


class NoParameters(Strict):
    """Parameters of a shape that has none."""


class SphereParameters(Strict):
    """subdivisions: of an icosahedron, each splits triangles into four."""

    subdivisions: int = Field(4, ge=0, le=7, strict=True)


class RoundParameters(Strict):
    """sections: segments around the axis."""

    sections: int = Field(64, ge=3, le=1024, strict=True)


class Shape(NamedTuple):
    """A shape: the model of its parameters, and the function that builds it."""

    parameters: type[Strict]
    build: Callable[[Any], Triangles]


def plane(_: NoParameters) -> Triangles:
    """A unit square of two triangles."""
    corners = np.array([[-0.5, 0.0, 0.5], [0.5, 0.0, 0.5], [0.5, 0.0, -0.5], [-0.5, 0.0, -0.5]])
    return Triangles(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))


def box(_: NoParameters) -> Triangles:
    """A unit cube of twelve triangles and eight vertices."""
    corners = np.array(list(product((0.5, -0.5), repeat=3)))
    return Triangles(corners, np.array(_BOX, dtype=np.int32))


def sphere(parameters: SphereParameters) -> Triangles:
    """An icosphere, whose triangles are of nearly equal size."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(short, long, 0.0) for long, short in product((golden, -golden), (-1.0, 1.0))]
    points = np.array([corner[turn:] + corner[:turn] for turn in (0, 2, 1) for corner in corners])
    points, faces = points / np.sqrt(1 + golden**2), np.array(_ICOSAHEDRON)
    for level in range(max(parameters.subdivisions, 1)):
        if level < parameters.subdivisions:
            edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
            ends, inverse = np.unique(edges, axis=0, return_inverse=True)
            (a, b, c), (ab, bc, ca) = faces.T, inverse.reshape(-1, 3).T + len(points)
            points = np.vstack([points, points[ends].mean(axis=1)])
            faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        length = np.sqrt((points**2).sum(axis=1, keepdims=True))
        points = points + points / length * (0.5 - length)
    return welded(points, faces)


def torus(parameters: RoundParameters) -> Triangles:
    """A horizontal ring, with half as many sections around the tube as around the axis."""
    angles = np.linspace(0, 2 * np.pi, max(3, parameters.sections // 2) + 1)
    angles[-1] = 0
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return _revolved(circle * (1 / 6) + [0.5, 0.0], parameters.sections)


def cylinder(parameters: RoundParameters) -> Triangles:
    """A closed cylinder."""
    return _revolved(np.array([[0, -0.5], [0.5, -0.5], [0.5, 0.5], [0, 0.5]]), parameters.sections)


def cone(parameters: RoundParameters) -> Triangles:
    """A closed cone with its apex up, centred at half its height."""
    triangles = _revolved(np.array([[0, 0], [0.5, 0], [0, 1]]), parameters.sections)
    return Triangles(triangles.vertices - [0.0, 0.5, 0.0], triangles.faces)


def capsule(parameters: RoundParameters) -> Triangles:
    """A cylinder of height 1 between two hemispheres."""
    quarter = (max(4, parameters.sections // 2) + 1) // 2 + 1  # points from the equator to a pole
    angles = np.concatenate([np.linspace(-np.pi / 2, 0, quarter), np.linspace(0, np.pi / 2, quarter)])
    profile = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.5
    profile[:quarter, 1] -= 0.5
    profile[quarter:, 1] += 0.5
    return _revolved(profile, parameters.sections + parameters.sections % 2)


def _revolved(profile: Floats, sections: int) -> Triangles:
    """The surface that a profile of (P, 2) radii and heights sweeps around the y axis, upwards on its outside."""
    radius, height = profile.T
    angles = np.linspace(0, 2 * np.pi, sections + 1)[:-1, np.newaxis]
    angles = np.where(np.abs(radius) < _POLE, 0, angles)  # (sections, P)
    points = np.stack(
        [np.cos(angles) * radius, np.sin(angles) * radius, np.broadcast_to(height, angles.shape)], axis=-1
    )
    count = len(radius)
    quad = np.array([[0, count, 1], [1, count, count + 1]])
    strips = np.arange(sections)[:, np.newaxis] * count + np.arange(count - 1)  # the first corner of each quad
    corners = (strips[..., np.newaxis, np.newaxis] + quad).reshape(-1, 3) % (sections * count)
    closed = without_zero_area(welded(points.reshape(-1, 3), corners))[0]
    return Triangles(closed.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0], closed.faces)


SHAPES: dict[str, Shape] = {
    "plane": Shape(NoParameters, plane),
    "box": Shape(NoParameters, box),
    "sphere": Shape(SphereParameters, sphere),
    "torus": Shape(RoundParameters, torus),
    "cylinder": Shape(RoundParameters, cylinder),
    "cone": Shape(RoundParameters, cone),
    "capsule": Shape(RoundParameters, capsule),
    "stairs": Shape(generators.StairsParameters, generators.stairs),
    "terrain": Shape(generators.TerrainParameters, generators.terrain),
    "leaves": Shape(generators.LeavesParameters, generators.leaves),
    "statue": Shape(generators.StatueParameters, generators.statue),
}


def build_shape(name: str, parameters: dict[str, object], where: str) -> Triangles:
    """The triangles of a shape. Raises InputError that begins with `where` for an unknown name or parameter."""
    if name not in SHAPES:
        raise InputError(f"{where}: shape: unknown {name!r:.60}{alternatives(name, SHAPES)}")
    shape = SHAPES[name]
    try:
        validated = shape.parameters.model_validate(parameters)
    except ValidationError as error:
        raise explain(f"{where} ({name})", error) from error
    return shape.build(validated)
