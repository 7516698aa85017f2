"""Vertices of glTF primitives under morph targets and skins, in float64.

glTF 2.0 specification, sections 3.7.2.2 (morph targets) and 3.7.3.3 (skins).
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import MOST_TRIANGLES, Triangles, triangles_of
from shadowbench.scenes.gltf_accessors import Data, as_floats, floats_of, stored
from shadowbench.scenes.gltf_animation import Pose
from shadowbench.scenes.gltf_bytes import TrianglePrimitive
from shadowbench.scenes.gltf_motion import Skin
from shadowbench.scenes.gltf_nodes import Node, joint_worlds
from shadowbench.scenes.normals import Singles, normal_matrices, unit_normals
from shadowbench.scenes.vectors import Floats

UNEVEN = 0.01
"""Deviation of the sum of a vertex's weights from 1 above which a note says so: more than 8-bit weights round."""
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


class Posed(NamedTuple):
    """A primitive's triangles, their (4, 4) matrix to the world, and their (F, 3, 3) normals, None if it is flat."""

    triangles: Triangles
    matrix: Floats
    normals: Singles | None


class Poser:
    """The deformed primitives of a file in a pose, each made when it is asked for. Raises InputError."""

    def __init__(self, data: Data, pose: Pose, nodes: list[Node]) -> None:
        self._data, self._pose = data, pose
        self._users: dict[int, list[Node]] = {}
        for node in nodes:
            if node.data.mesh is not None:
                self._users.setdefault(node.data.mesh, []).append(node)
        self._worlds = joint_worlds(data.layout, pose, nodes)
        self._joints: dict[int, Floats] = {}
        self._uneven = 0

    @property
    def notes(self) -> list[str]:
        """A note on weights that were not normalised, if there were any."""
        line = f"{self._data.where}: weights of joints of {self._uneven} vertices divided by their sum, which is not 1"
        return [line] if self._uneven else []

    def posed(self, primitive: TrianglePrimitive) -> dict[int, Posed]:
        """A primitive as each visible node deforms it that does, by the node's number."""
        users = [node for node in self._users.get(primitive.mesh, ()) if node.visible]
        found = {node.number: self._deformed(primitive, node) for node in users}
        return {index: each for index, each in found.items() if each is not None}

    def stands(self, primitive: TrianglePrimitive, posed: Mapping[int, object]) -> bool:
        """Whether a primitive is also needed as it is stored. posed: what the method of this name returned."""
        return not posed or len(posed) < len(self._users[primitive.mesh])

    def _deformed(self, primitive: TrianglePrimitive, node: Node) -> Posed | None:
        weights, skin = self._weights(node, primitive.mesh), node.data.skin
        moved = any(weights[: len(primitive.primitive.targets)])
        blend = None if skin is None else blended(primitive, self._joint_matrices(skin))
        if blend is None and not moved:
            return None
        positions, matrix = morphed(primitive, "POSITION", weights), node.matrix
        assert positions is not None  # as `read_primitives` checks
        normals = morphed(primitive, "NORMAL", weights)
        if blend is not None:
            positions, matrix = skinned(positions, blend.matrices)
            if normals is not None:
                normals = np.einsum("vij,vj->vi", normal_matrices(blend.matrices[:, :, :3]), normals) @ matrix[:3, :3]
            self._uneven += blend.uneven
        triangles = triangles_of(positions, primitive.faces, self._data.where)
        return Posed(triangles, matrix, corner_normals(primitive, normals))

    def _weights(self, node: Node, mesh: int) -> list[float]:
        """Weights of the morph targets: animated, or the node's, or the mesh's."""
        given = self._pose.get((node.number, "weights"))
        if given is not None:
            return [float(weight) for weight in given]
        return self._data.layout.meshes[mesh].weights if node.data.weights is None else node.data.weights

    def _joint_matrices(self, skin: int) -> Floats:
        if skin not in self._joints:
            self._joints[skin] = joint_matrices(self._data, self._data.layout.skins[skin], self._worlds)
        return self._joints[skin]


class Blend(NamedTuple):
    """(V, 3, 4) matrices by which a skin moves each vertex, and the number of vertices whose weights were uneven."""

    matrices: Floats
    uneven: int


def corner_normals(primitive: TrianglePrimitive, normals: Floats | None) -> Singles | None:
    """(F, 3, 3) unit normals of (V, 3) ones; None for None."""
    return None if normals is None else primitive.by_corner(unit_normals(normals))


def morphed(primitive: TrianglePrimitive, name: str, weights: Sequence[float] | Floats) -> Floats | None:
    """(V, 3) float64 attribute, POSITION or NORMAL, plus the weighted displacements of the morph targets.

    None if the primitive lacks it; targets without a weight have the weight 0. Raises InputError.
    """
    values = primitive.floats(name, "VEC3")
    for weight, target in zip(weights, primitive.primitive.targets, strict=False):
        if values is None or weight == 0.0 or name not in target:
            continue
        primitive.check_count(f"a morph target's {name}", target[name])
        values = values + weight * floats_of(primitive.data, target[name], "VEC3")
    return values


def blended(primitive: TrianglePrimitive, joints: Floats) -> Blend | None:
    """The matrices of a skin at each vertex; None if the primitive has no joints.

    joints: (J, 4, 4) as of `joint_matrices`. Weights are divided by their sum; a vertex without any follows the
    first of its joints, both as in three.js. Raises InputError.
    """
    found = _influences(primitive, len(joints))
    if found is None:
        return None
    numbers, weights = found
    sums = weights.sum(axis=1)
    uneven = int((np.abs(sums - 1.0) > UNEVEN).sum())
    weights[sums == 0.0, 0] = 1.0
    weights /= np.where(sums == 0.0, 1.0, sums)[:, None]
    matrices = np.zeros((len(weights), 3, 4))
    for number, weight in zip(numbers.T, weights.T, strict=True):
        matrices += weight[:, None, None] * joints[number, :3]
    return Blend(matrices, uneven)


def skinned(positions: Floats, blend: Floats) -> tuple[Floats, Floats]:
    """(V, 3) positions moved by (V, 3, 4) matrices, and the matrix that places them in the world.

    It is a reflection, of positions that are reflected before, where most vertices are mirrored: it turns triangles as
    that of a mirroring node does.
    """
    linear = blend[:, :, :3]
    moved = np.einsum("vij,vj->vi", linear, positions) + blend[:, :, 3]
    mirrored = (np.sign(np.linalg.det(linear)).sum() < 0.0) if len(linear) else False
    return (moved * MIRROR.diagonal()[:3], MIRROR) if mirrored else (moved, np.eye(4))


def joint_matrices(data: Data, skin: Skin, worlds: Mapping[int, Floats]) -> Floats:
    """(J, 4, 4) matrices from a skinned mesh to the world. worlds: of nodes, by index. Raises InputError."""
    matrices = np.array([worlds[joint] for joint in skin.joints])
    if skin.inverseBindMatrices is None:
        return matrices
    index, accessor = skin.inverseBindMatrices, data.layout.accessors[skin.inverseBindMatrices]
    inverse = as_floats(stored(data, index, "MAT4", rows=slice(len(skin.joints))), accessor)
    if len(inverse) < len(skin.joints):
        raise InputError(
            f"{data.where}: a skin has {len(skin.joints)} joints, and {len(inverse)} inverse bind matrices"
        )
    product: Floats = matrices @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
    return product


def _influences(primitive: TrianglePrimitive, joints: int) -> tuple[NDArray[np.int32], Floats] | None:
    """(V, 4 n) indices of joints and their weights; None if the primitive has none. Raises InputError."""
    sets = sorted(name[7:] for name in primitive.primitive.attributes if re.fullmatch(r"JOINTS_\d+", name))
    where = primitive.data.where
    if not sets:
        return None
    if (count := len(sets) * len(primitive.positions)) > MOST_TRIANGLES:
        raise InputError(f"{where}: {count} sets of joints of a primitive's vertices; allowed are {MOST_TRIANGLES}")
    numbers, weights = [], []
    for each in sets:
        number, weight = primitive.integers(f"JOINTS_{each}", "VEC4"), primitive.floats(f"WEIGHTS_{each}", "VEC4")
        if number is None or weight is None:
            raise InputError(f"{where}: a primitive has JOINTS_{each} without WEIGHTS_{each}")
        numbers.append(number.astype(np.int32))
        weights.append(weight)
    number, weight = np.hstack(numbers), np.hstack(weights)
    if not (np.isfinite(weight).all() and (weight >= 0.0).all()):
        raise InputError(f"{where}: a weight of a joint is {weight.min():g}; allowed: finite ones, not below 0")
    number[(weight == 0.0) & (number >= joints)] = 0  # exporters leave anything there
    if number.max(initial=0) >= joints:
        raise InputError(f"{where}: a vertex has joint {number.max()}; its skin has {joints}, counted from 0")
    return number, weight
