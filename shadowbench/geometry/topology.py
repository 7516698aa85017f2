"""Edge topology of the casters: connected parts, closed or open, with the edges for shadow volumes."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.vectors import Floats, Vec3

Indices = NDArray[np.int64]
Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Casters:
    """Triangles and edges of the casters, as indices into the scene's welded vertices, ordered by part.

    faces: (F, 3), winding kept. edges: (E, 4) of an edge a < b: opposite corner, a, b, opposite corner, which is a if
    there is only one triangle; of more than two, several rows. face_ends, edge_ends: (P,) index after each part's last
    row; boxes: (P, 2, 3) bounding box of each part. The first `closed` parts are wound outwards and their edges all
    have as many half-edges in either direction, of `closed_faces` and `closed_edges`; the others are open.
    """

    faces: Indices
    edges: Indices
    face_ends: Indices
    edge_ends: Indices
    boxes: Floats
    closed: int

    @property
    def closed_faces(self) -> int:
        """Number of triangles of closed parts."""
        return int(np.append(0, self.face_ends)[self.closed])

    @property
    def closed_edges(self) -> int:
        """Number of edges of closed parts."""
        return int(np.append(0, self.edge_ends)[self.closed])

    def may_contain(self, point: Vec3) -> bool:
        """Whether a point may be inside a closed part, or on its surface."""
        low, high = boxes = self.boxes[: self.closed].transpose(1, 0, 2)
        rounding = 1e-6 * max(np.abs(boxes).max(initial=0.0), *map(abs, point))  # the boxes are of float32
        return bool(((low - rounding <= point) & (point <= high + rounding)).all(axis=1).any())


@dataclass(frozen=True, eq=False)
class Topology:
    """The caster triangles, their edges and their parts, which are sets of triangles connected by shared edges.

    faces, edges, boxes: as in `Casters`; edges are sorted by their corners a and b. half_edges: (E, 2) of each edge,
    3 · triangle + k for the one from corner k to the next, one of each direction if possible, −1 for none. part: (F,)
    of each triangle. closed: (P,) bool, as in `Casters`; open: (P,) bool, parts with a half-edge that has no opposite.
    """

    faces: Indices
    edges: Indices
    half_edges: Indices
    part: Indices
    closed: NDArray[np.bool_]
    open: NDArray[np.bool_]
    boxes: Floats


def topology_of(scene: Scene) -> Topology:
    """The topology of the casters, each mesh welded by float32 position, as the device stores it."""
    from scipy.sparse import coo_matrix, csgraph  # 0.3 s, for which only shadow volumes wait

    geometry = scene.geometry
    vertices = geometry.vertices.astype(np.float32) + np.float32(0)  # −0 is 0
    mesh = np.repeat(np.arange(len(scene.meshes)), [len(mesh.vertices) for mesh in scene.meshes])
    faces = _welded(vertices, mesh)[geometry.caster_faces]
    # A triangle with two equal corners has both half-edges of its only edge, and therefore no wall.
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    rising = (faces < np.roll(faces, -1, axis=1)).ravel()
    first, second = sides = _paired_half_edges(faces, rising)

    two = second >= 0
    pairs = first[two] // 3, second[two] // 3
    links = coo_matrix((np.ones(len(pairs[0])), pairs), shape=(len(faces), len(faces)))
    parts, labels = csgraph.connected_components(links, directed=False)
    part: Indices = labels.astype(np.int64)
    opposed = two & (rising[first] != rising[second])
    loose = np.bincount(part[first[~opposed] // 3], minlength=parts)
    # Only if wound outwards: inside a part wound inwards, no triangle between a receiver and the light need face the
    # light.
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


def is_closed(mesh: Mesh) -> bool:
    """Whether all parts of a mesh are closed and wound outwards, so that only its front faces are seen from outside."""
    center = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2  # for float32
    alone = replace(mesh, vertices=mesh.vertices - center, casts=True)
    return bool(topology_of(Scene(mesh.name, (alone,), (), ())).closed.all())


def surrounds(mesh: Mesh, point: Vec3) -> bool:
    """Whether a point is inside a closed mesh, whose triangles then fill all directions.

    By solid angles (Van Oosterom, Strackee 1983).
    """
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces] - np.asarray(point), 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a)))
    halves = np.arctan2(np.einsum("ij,ij->i", a, np.cross(b, c)), la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(halves.sum() > np.pi)  # of 2π


def casters_of(scene: Scene) -> Casters:
    """The casters of a scene, ordered by part, closed ones first."""
    topology = topology_of(scene)
    parts = np.argsort(~topology.closed, kind="stable")
    rank = np.argsort(parts)

    def by_part(part_of_row: Indices) -> tuple[Indices, Indices]:
        """Indices of the rows, ordered by part, and the end of each part."""
        ranks = rank[part_of_row]
        return np.argsort(ranks, kind="stable"), np.cumsum(np.bincount(ranks, minlength=len(parts)))

    own, face_ends = by_part(topology.part)
    mine, edge_ends = by_part(topology.part[topology.half_edges[:, 0] // 3])
    faces, edges, boxes = topology.faces[own], topology.edges[mine], topology.boxes[parts]
    return Casters(faces, edges, face_ends, edge_ends, boxes, int(topology.closed.sum()))


def _welded(vertices: NDArray[np.float32], mesh: Indices) -> Indices:
    """(V,) for each vertex, the index of the first vertex of its mesh at the same position."""
    order = np.lexsort((*vertices.T, mesh))
    same = (vertices[order[1:]] == vertices[order[:-1]]).all(axis=1) & (mesh[order[1:]] == mesh[order[:-1]])
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    first = np.empty(len(vertices), dtype=np.int64)
    first[order] = np.repeat(order[starts], np.diff(np.append(starts, len(order))))  # lexsort is stable
    return first


def _paired_half_edges(faces: Indices, rising: NDArray[np.bool_]) -> tuple[Indices, Indices]:
    """Half-edges in pairs by edge, of opposite directions if possible; −1 for an unpaired one.

    rising: (3F,) whether a half-edge goes from the lower vertex index to the higher.
    """
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    # Edge and direction as one integer, which sorts faster than a tuple.
    key = (np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)) << 1 | rising
    order = np.argsort(key, kind="stable")
    directed = _index_in_run(key[order])
    if directed.any():  # an edge with several half-edges of one direction
        order = order[np.lexsort((rising[order], directed, key[order] >> 1))]
    leads = _index_in_run(key[order] >> 1) % 2 == 0
    follows = np.append(~leads[1:], False)  # at an odd index in its run, paired with the one before
    return order[leads], np.where(follows, np.append(order[1:], -1), -1)[leads]


def _index_in_run(keys: Indices) -> Indices:
    """(N,) for each of sorted keys, the number of equal keys before it."""
    starts = np.flatnonzero(np.append(True, keys[1:] != keys[:-1])[: len(keys)])
    return np.arange(len(keys)) - np.repeat(starts, np.diff(np.append(starts, len(keys))))


def _edges(faces: Indices, first: Indices, second: Indices) -> Indices:
    """(E, 4) edges with adjacency, as in `Casters`, of paired half-edges."""
    opposite = np.roll(faces, 1, axis=1).ravel()  # the corner opposite half-edge k
    start, end = faces.ravel()[first], np.roll(faces, -1, axis=1).ravel()[first]
    low, high = np.minimum(start, end), np.maximum(start, end)
    return np.column_stack([opposite[first], low, high, np.where(second >= 0, opposite[second], low)])
