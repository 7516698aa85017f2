"""Shapes for scene files, centred on the origin, with faces wound outwards.

plane 1×1 in xz, normal +y; box 1³; sphere radius ½; torus radii ½ and ⅙, around y; cylinder and cone radius ½ and
height 1 along y; capsule radius ½ with a cylinder of height 1 along y, of total height 2. Larger ones are in
`generators`.
"""

from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes import generators
from shadowbench.scenes.triangles import Triangles, welded, without_zero_area
from shadowbench.strict import Strict, explain

if TYPE_CHECKING:
    from trimesh import Trimesh  # where it is called, trimesh is imported in the function: that takes 0.4 s

_BOX = [[6, 4, 7], [3, 6, 7], [7, 4, 5], [5, 3, 7], [6, 0, 4], [2, 6, 3], [2, 0, 6], [4, 0, 5], [1, 3, 5], [5, 0, 1]]
_BOX += [[1, 2, 3], [0, 2, 1]]


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
    from trimesh import creation

    return _welded(creation.icosphere(subdivisions=parameters.subdivisions, radius=0.5))


def torus(parameters: RoundParameters) -> Triangles:
    """A horizontal ring, with half as many sections around the tube as around the axis."""
    from trimesh import creation

    around = max(3, parameters.sections // 2)
    return _upright(creation.torus(0.5, 1 / 6, major_sections=parameters.sections, minor_sections=around))


def cylinder(parameters: RoundParameters) -> Triangles:
    """A closed cylinder."""
    from trimesh import creation

    return _upright(creation.cylinder(radius=0.5, height=1.0, sections=parameters.sections))


def cone(parameters: RoundParameters) -> Triangles:
    """A closed cone with its apex up, centred at half its height."""
    from trimesh import creation

    triangles = _upright(creation.cone(radius=0.5, height=1.0, sections=parameters.sections))
    return Triangles(triangles.vertices - [0.0, 0.5, 0.0], triangles.faces)


def capsule(parameters: RoundParameters) -> Triangles:
    """A cylinder of height 1 between two hemispheres."""
    from trimesh import creation

    count = (max(4, parameters.sections // 2), parameters.sections)
    triangles = _upright(creation.capsule(height=1.0, radius=0.5, count=count))
    low, high = triangles.vertices[:, 1].min(), triangles.vertices[:, 1].max()
    return Triangles(triangles.vertices - [0.0, (low + high) / 2, 0.0], triangles.faces)


def _welded(mesh: "Trimesh") -> Triangles:
    """Welded triangles of a trimesh, without the zero-area triangles at the poles of surfaces of revolution."""
    return without_zero_area(welded(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)))[0]


def _upright(mesh: "Trimesh") -> Triangles:
    """The mesh rotated by 90° about x, as trimesh builds along z."""
    triangles = _welded(mesh)
    return Triangles(triangles.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0], triangles.faces)


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
