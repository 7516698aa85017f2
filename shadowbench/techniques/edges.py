"""Which triangles share which edges: casters as closed parts and the rest, found once for a scene."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from shadowbench.scenes.model import Floats, Scene, Vec3

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles and edges as indices into the scene's vertices, those at one place being one; part after part.

    faces: (F, 3), as wound. edges: (E, 4): third corner, a, b, third corner of up to two triangles at the edge from a
    to b, a < b; the last is a where there is but one. An edge of more than two triangles has several rows. face_ends,
    edge_ends: (P,) the row that a part ends before; boxes: (P, 2, 3) its lowest and highest corners.
    """

    faces: Indices
    edges: Indices
    face_ends: Indices
    edge_ends: Indices
    boxes: Floats


@dataclass(frozen=True, eq=False)
class Casters:
    """A scene's casters. A part is what hangs together by edges.

    closed: parts where each edge has as many triangles one way as the other, wound outwards; open: all others.
    """

    closed: Surface
    open: Surface

    def around(self, point: Vec3) -> bool:
        """Whether a point may be inside a closed part."""
        low, high = self.closed.boxes.transpose(1, 0, 2)
        return bool(((low <= point) & (point <= high)).all(axis=1).any())


def casters_of(scene: Scene) -> Casters:
    """The casters of a scene, welded as the device has them: by float32 position, each mesh by itself."""
    geometry = scene.geometry
    vertices = geometry.vertices.astype(np.float32) + np.float32(0)  # −0 is 0
    mesh = np.repeat(np.arange(len(scene.meshes)), [len(mesh.vertices) for mesh in scene.meshes])
    faces = _welded(vertices, mesh)[geometry.caster_faces]
    # A triangle with a corner twice runs along its one edge both ways: it has no wall.
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    first, second = _pairs(faces)

    two = second >= 0
    a, b = first[two] // 3, second[two] // 3
    links = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(faces), len(faces)))
    parts, labels = connected_components(links, directed=False)
    part: Indices = labels.astype(np.int64)
    opposed = np.zeros(len(first), dtype=bool)
    opposed[two] = _rising(faces)[first[two]] != _rising(faces)[second[two]]
    loose = np.bincount(part[first[~opposed] // 3], minlength=parts)
    # Only if wound outwards: inside one wound inwards, nothing between a receiver and the light need face the light.
    corners = vertices[faces].astype(np.float64)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    closed = (loose == 0) & (np.bincount(part, volume, minlength=parts) > 0)

    low, high = np.full((parts, 3), np.inf), np.full((parts, 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    boxes = np.stack([low, high], axis=1)
    return Casters(*(_surface(faces, first, second, part, boxes, chosen) for chosen in (closed, ~closed)))


def _welded(vertices: NDArray[np.float32], mesh: Indices) -> Indices:
    """(V,) for each vertex the first of its mesh at the same place."""
    order = np.lexsort((*vertices.T, mesh))
    same = (vertices[order[1:]] == vertices[order[:-1]]).all(axis=1) & (mesh[order[1:]] == mesh[order[:-1]])
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    first = np.empty(len(vertices), dtype=np.int64)
    first[order] = np.repeat(order[starts], np.diff(np.append(starts, len(order))))  # lexsort is stable
    return first


def _rising(faces: Indices) -> NDArray[np.bool_]:
    """(3F,) whether side k of a triangle, from corner k to the next, runs from the lower index to the higher."""
    return (faces < np.roll(faces, -1, axis=1)).ravel()


def _pairs(faces: Indices) -> tuple[Indices, Indices]:
    """Sides (3 · triangle + k) two by two at each edge, one of each direction first; −1 for a side left alone."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high, rising = np.minimum(start, end), np.maximum(start, end), _rising(faces)
    order = np.lexsort((rising, high, low))
    directed = _place_in_run(low[order], high[order], rising[order])
    order = order[np.lexsort((rising[order], directed, high[order], low[order]))]
    place = _place_in_run(low[order], high[order])
    leads = place % 2 == 0
    follows = np.append(~leads[1:], False)  # a side at an odd place follows its own edge's
    first = order[leads]
    second = np.where(follows, np.append(order[1:], -1), -1)[leads]
    return first, second


def _place_in_run(*sorted_keys: NDArray[np.generic]) -> Indices:
    """For each row, how many rows before it have the same keys."""
    count = len(sorted_keys[0])
    new = np.ones(count, dtype=bool)
    new[1:] = np.any([key[1:] != key[:-1] for key in sorted_keys], axis=0)
    starts = np.flatnonzero(new)
    return np.arange(count) - np.repeat(starts, np.diff(np.append(starts, count)))


def _surface(
    faces: Indices, first: Indices, second: Indices, part: Indices, boxes: Floats, chosen: NDArray[np.bool_]
) -> Surface:
    """What the chosen parts have of the faces and of the pairs of their sides."""

    def by_part(of: Indices) -> tuple[Indices, Indices]:
        """The rows of the chosen parts, part after part, and where each part ends; `of` says a row's part."""
        order = np.argsort(of, kind="stable")
        return order[chosen[of[order]]], np.cumsum(np.bincount(of, minlength=len(chosen))[chosen])

    own, face_ends = by_part(part)
    mine, edge_ends = by_part(part[first // 3])
    first, second = first[mine], second[mine]
    third = np.roll(faces, 1, axis=1).ravel()  # the corner that side k does not touch
    start, end = faces.ravel()[first], np.roll(faces, -1, axis=1).ravel()[first]
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges = np.column_stack([third[first], low, high, np.where(second >= 0, third[second], low)])
    return Surface(faces[own], edges, face_ends, edge_ends, boxes[chosen])
