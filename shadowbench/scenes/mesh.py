"""A mesh of a scene, which may share its triangles with others that are moved elsewhere."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.cutouts import Cutout
from shadowbench.scenes.geometry import bounds_of, mirrors, moved, used_by
from shadowbench.scenes.normals import turned
from shadowbench.scenes.placement import Placement
from shadowbench.scenes.textures import Texture
from shadowbench.scenes.vectors import Floats, Vec3

GREY: Vec3 = (0.8, 0.8, 0.8)
WHITE: Vec3 = (1.0, 1.0, 1.0)
CORNERS = ("coordinates", "places", "normals")
"""What a mesh has by corner of a triangle, as vertices at one place are one."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one surface, in world space.

    points: (V, 3) float64, the vertices before they are moved; faces: (F, 3) int32 indices into them,
    counter-clockwise seen from outside; both are read-only, as results computed from them are cached. color: linear
    RGB in [0, 1]; casts, receives: whether it casts and receives shadows; planar: flagged as a planar receiver.
    cutout: where it is opaque, None for everywhere; places: (F, 3, 2) float32 of the triangles' corners in it, in
    sub-texels, None for 0. coordinates: (F, 3, 2) float32 texture coordinates of the corners, None for 0. normals:
    (F, 3, 3) float32 of a smooth surface, which it is shaded by, before they are moved; None if it is flat, and
    zero at corners without one. texture, and tints, (F, 3) float32 linear RGB that color is multiplied by, are of
    pictures only. moves: affine (4, 4) matrices of an instance, which move its points in turn, and then placement,
    to local coordinates; all others have none and are where they are.
    """

    name: str
    points: Floats = field(repr=False)
    faces: NDArray[np.int32] = field(repr=False)
    color: Vec3 = GREY
    casts: bool = True
    receives: bool = True
    planar: bool = False
    cutout: Cutout | None = None
    coordinates: NDArray[np.float32] | None = field(default=None, repr=False)
    places: NDArray[np.float32] | None = field(default=None, repr=False)
    normals: NDArray[np.float32] | None = field(default=None, repr=False)
    texture: Texture | None = None
    tints: NDArray[np.float32] | None = field(default=None, repr=False)
    moves: tuple[Floats, ...] = field(default=(), repr=False)
    placement: Placement | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in ("points", "faces", *CORNERS):
            values = getattr(self, name)
            if values is not None and values.flags.writeable:  # else it stays the array that instances share
                view = values.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    @property
    def vertices(self) -> Floats:
        """(V, 3) float64; of an instance computed anew each time, as it may be large."""
        vertices = self.points
        for matrix in self.moves:
            vertices = moved(vertices, matrix)
        return vertices if self.placement is None else self.placement.points(vertices)

    @cached_property
    def moved_bounds(self) -> Floats:
        """(2, 3) lowest and highest vertex in use, before placement."""
        return bounds_of(used_by(self.faces, replace(self, placement=None).vertices))

    @property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest vertex in use; as rounding keeps order, these are placed to the same bits."""
        return self.moved_bounds if self.placement is None else self.placement.points(self.moved_bounds)

    def with_bounds(self, bounds: Floats) -> "Mesh":
        """The same mesh, which knows its `moved_bounds`: of many instances, these take seconds."""
        self.__dict__["moved_bounds"] = bounds
        return self

    def with_vertices(self, vertices: Floats) -> "Mesh":
        """The mesh with other vertices, in place of an instance's too."""
        normals = self.normals
        for matrix in self.moves:
            normals = None if normals is None else turned(normals, matrix)
        return replace(self, points=vertices, normals=normals, moves=(), placement=None)

    def placed(self, placement: Placement) -> "Mesh":
        """The mesh in local coordinates."""
        if self.moves:
            return replace(self, placement=placement).with_bounds(self.moved_bounds)
        return replace(self, points=placement.points(self.points))

    def reshaped(
        self, vertices: Floats, faces: NDArray[np.int32], matrix: Floats, kept: NDArray[np.bool_] | None = None
    ) -> "Mesh":
        """The mesh with vertices moved by an affine (4, 4) matrix; one that mirrors has reversed the faces' corners.

        kept: (F,) bool, which of its faces these are, by default all.
        """
        mesh = self.picked(vertices, faces, mirrors(matrix), kept)
        return mesh if mesh.normals is None else replace(mesh, normals=turned(mesh.normals, matrix))

    def picked(
        self, points: Floats, faces: NDArray[np.int32], mirrored: bool, kept: NDArray[np.bool_] | None = None
    ) -> "Mesh":
        """The mesh with other points and faces, those that are kept of its own, with corners reversed if `mirrored`."""
        corners, tints = {name: values for name in CORNERS if (values := getattr(self, name)) is not None}, self.tints
        if kept is not None:
            corners = {name: values[kept] for name, values in corners.items()}
            tints = None if tints is None else tints[kept]
        if mirrored:
            corners = {name: values[:, ::-1] for name, values in corners.items()}
        return replace(self, points=points, faces=faces, tints=tints, **corners)

    @cached_property
    def closed(self) -> bool:
        """Whether every edge, after welding by position, is shared by exactly two triangles."""
        import trimesh  # the import takes 0.3 s, and most commands do not need it

        welded = trimesh.Trimesh(self.vertices, self.faces, process=False)
        welded.merge_vertices()
        return bool(welded.is_watertight)


def distinct(meshes: Iterable[Mesh]) -> list[Mesh]:
    """The first mesh of each list of triangles, which several may share."""
    found: dict[tuple[int, ...], Mesh] = {}
    for mesh in meshes:
        found.setdefault(shared_key(mesh), mesh)
    return list(found.values())


def shared_key(mesh: Mesh) -> tuple[int, ...]:
    """What meshes have in common that share their triangles, while they live."""
    return mesh.points.ctypes.data, mesh.faces.ctypes.data, len(mesh.faces)
