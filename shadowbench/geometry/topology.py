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

    def may_contain(self, point: Vec3) -> bool:
        """Whether a point may be inside a closed part."""
        low, high = self.closed.boxes.transpose(1, 0, 2)
        return bool(((low <= point) & (point <= high)).all(axis=1).any())


@dataclass(frozen=True, eq=False)
class Topology:
    """The triangles that cast and the edges that they share; a part is what hangs together by edges.

    faces, edges: all of them, as in a Surface, by the edges' corners a and b; sides: (E, 2) what meets at each edge,
    3 · triangle + k for the side from corner k to the next, one of each direction where there are, −1 for none; part:
    (F,) that of each triangle; closed, open: (P,) bool, as Casters says, and those with a loose edge; boxes: (P, 2, 3).
    """

    faces: Indices
    edges: Indices
    half_edges: Indices
    part: Indices
    closed: NDArray[np.bool_]
    open: NDArray[np.bool_]
    boxes: Floats


def topology_of(scene: Scene) -> Topology:
    """The topology of what casts, welded as the device has it: by float32 position, each mesh by itself."""
    geometry = scene.geometry
    vertices = geometry.vertices.astype(np.float32) + np.float32(0)  # −0 is 0
    mesh = np.repeat(np.arange(len(scene.meshes)), [len(mesh.vertices) for mesh in scene.meshes])
    faces = _welded(vertices, mesh)[geometry.caster_faces]
    # A triangle with a corner twice runs along its one edge both ways: it has no wall.
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    rising = (faces < np.roll(faces, -1, axis=1)).ravel()
    first, second = sides = _pairs(faces, rising)

    two = second >= 0
    a, b = first[two] // 3, second[two] // 3
    links = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(faces), len(faces)))
    parts, labels = connected_components(links, directed=False)
    part: Indices = labels.astype(np.int64)
    opposed = np.zeros(len(first), dtype=bool)
    opposed[two] = rising[first[two]] != rising[second[two]]
    loose = np.bincount(part[first[~opposed] // 3], minlength=parts)
    # Only if wound outwards: inside one wound inwards, nothing between a receiver and the light need face the light.
    corners = vertices[faces].astype(np.float64)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    closed = (loose == 0) & (np.bincount(part, volume, minlength=parts) > 0)

    low, high = np.full((parts, 3), np.inf), np.full((parts, 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    return Topology(
        faces=faces,
        edges=_edges(faces, first, second),
        half_edges=np.column_stack(sides),
        part=part,
        closed=closed,
        open=loose > 0,
        boxes=np.stack([low, high], axis=1),
    )


def casters_of(scene: Scene) -> Casters:
    """The casters of a scene, part after part."""
    topology = topology_of(scene)
    return Casters(_surface(topology, topology.closed), _surface(topology, ~topology.closed))


def _welded(vertices: NDArray[np.float32], mesh: Indices) -> Indices:
    """(V,) for each vertex the first of its mesh at the same place."""
    order = np.lexsort((*vertices.T, mesh))
    same = (vertices[order[1:]] == vertices[order[:-1]]).all(axis=1) & (mesh[order[1:]] == mesh[order[:-1]])
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    first = np.empty(len(vertices), dtype=np.int64)
    first[order] = np.repeat(order[starts], np.diff(np.append(starts, len(order))))  # lexsort is stable
    return first


def _pairs(faces: Indices, rising: NDArray[np.bool_]) -> tuple[Indices, Indices]:
    """Sides (3 · triangle + k) two by two at each edge, one of each direction first; −1 for a side left alone.

    rising: (3F,) whether a side runs from the lower index to the higher.
    """
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    # One number for the edge and the direction along it: numbers sort faster than their parts do.
    side = (np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)) << 1 | rising
    order = np.argsort(side, kind="stable")
    directed = _place_in_run(side[order])
    if directed.any():  # an edge of several triangles one way
        order = order[np.lexsort((rising[order], directed, side[order] >> 1))]
    leads = _place_in_run(side[order] >> 1) % 2 == 0
    follows = np.append(~leads[1:], False)  # a side at an odd place follows its own edge's
    return order[leads], np.where(follows, np.append(order[1:], -1), -1)[leads]


def _place_in_run(keys: Indices) -> Indices:
    """(N,) for each of sorted keys, how many before it are the same."""
    starts = np.flatnonzero(np.append(True, keys[1:] != keys[:-1])[: len(keys)])
    return np.arange(len(keys)) - np.repeat(starts, np.diff(np.append(starts, len(keys))))


def _edges(faces: Indices, first: Indices, second: Indices) -> Indices:
    """(E, 4) third corner, a, b, third corner, as a Surface has them."""
    third = np.roll(faces, 1, axis=1).ravel()  # the corner that side k does not touch
    start, end = faces.ravel()[first], np.roll(faces, -1, axis=1).ravel()[first]
    low, high = np.minimum(start, end), np.maximum(start, end)
    return np.column_stack([third[first], low, high, np.where(second >= 0, third[second], low)])


def _surface(topology: Topology, chosen: NDArray[np.bool_]) -> Surface:
    """The triangles and edges of the chosen parts."""

    def by_part(of: Indices) -> tuple[Indices, Indices]:
        """The rows of the chosen parts, part after part, and where each part ends; `of` says a row's part."""
        order = np.argsort(of, kind="stable")
        return order[chosen[of[order]]], np.cumsum(np.bincount(of, minlength=len(chosen))[chosen])

    own, face_ends = by_part(topology.part)
    mine, edge_ends = by_part(topology.part[topology.half_edges[:, 0] // 3])
    faces, edges, boxes = topology.faces[own], topology.edges[mine], topology.boxes[chosen]
    return Surface(faces, edges, face_ends, edge_ends, boxes)
