"""The nodes of a glTF in a pose: clips at a time, the node tree, and vertices under morph targets and skins.

glTF 2.0 specification, sections 3.7.2.2 (morph targets), 3.7.3.3 (skins), 3.11 and appendix C (animations).
"""

import bisect
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.file_contents import Chosen
from shadowbench.scenes.gltf_layout import NUMBERS, Animation, Channel, Layout, NodeTable, Sampler, Skin
from shadowbench.scenes.gltf_storage import Data, TrianglePrimitive, as_floats, floats_of, stored
from shadowbench.scenes.triangles import Singles, Triangles, normal_matrices, triangles_of, unit_normals
from shadowbench.scenes.vectors import Floats

Pose = Mapping[tuple[int, str], Floats]
"""Values that replace those of a node: by its index, and translation, rotation, scale or weights."""
NO_CLIP = "none"
TYPES = {"translation": ("VEC3", 3), "rotation": ("VEC4", 4), "scale": ("VEC3", 3)}


def pose_at(data: Data, chosen: Chosen) -> tuple[Pose, list[str]]:
    """The pose of a file as chosen, and notes on the clip and on what it moves besides nodes. Raises InputError.

    Without animations, or with NO_CLIP, nodes stay as they stand. Before its first and after its last key a channel
    keeps the value of that key, as the specification demands.
    """
    layout, where = data.layout, data.where
    number = _number_of(layout, chosen.clip, where)
    if number is None:
        count = len(layout.animations)
        still = [f"{where}: none of {count} clip(s) taken: nodes stand as in the file"] if count else []
        return {}, still if chosen.time is None else [*still, f"{where}: time: no clip to pose"]
    clip = layout.animations[number]
    time = chosen.time or 0.0
    pose: dict[tuple[int, str], Floats] = {}
    samples: dict[tuple[int, str, int], tuple[Floats, float, float]] = {}  # each sampler's, which many may share
    first, last, lost = math.inf, -math.inf, 0
    for channel in clip.channels:
        kind, width = _kind_of(layout, channel)
        node = channel.target.node
        if node is None or not width:
            lost += 1
            continue
        key = channel.sampler, kind, width
        if key not in samples:
            samples[key] = _sampled(data, clip.samplers[channel.sampler], kind, width, time)
        value, start, end = samples[key]
        pose[node, channel.target.path] = value
        first, last = min(first, start), max(last, end)
    notes = [_note(layout, number, time, first, last, where)]
    if lost:
        notes.append(
            f"{where}: {lost} channel(s) of the clip left out: they move no translation, rotation, scale or weights"
        )
    return pose, notes


def _number_of(layout: Layout, clip: str | None, where: str) -> int | None:
    """Index of the clip with a name or number, by default the first; None if none is asked for, or there is none."""
    names = [each.name for each in layout.animations]
    if clip is None:
        return 0 if names else None
    if clip in names:
        return names.index(clip)
    if clip == NO_CLIP:
        return None
    if clip.isdecimal() and 1 <= int(clip) <= len(names):
        return int(clip) - 1
    known = [f"{name:.60}" for name in names if name][:20]
    numbers = f"1 to {len(names)}" if names else "no others, as there are none"
    raise InputError(f"{where}: clip: found {clip!r:.60}{alternatives(clip, [*known, NO_CLIP])}, or {numbers}")


def _kind_of(layout: Layout, channel: Channel) -> tuple[str, int]:
    """Type of a channel's accessor, and the number of its values at a time: 0 for a channel that is left out."""
    if channel.target.node is None:
        return "", 0
    node = layout.nodes[channel.target.node]
    if channel.target.path == "weights" and node.mesh is not None:
        return "SCALAR", max((len(each.targets) for each in layout.meshes[node.mesh].primitives), default=0)
    # A matrix cannot be animated by the specification.
    return TYPES.get(channel.target.path, ("", 0)) if node.matrix is None else ("", 0)


def _sampled(data: Data, sampler: Sampler, kind: str, width: int, time: float) -> tuple[Floats, float, float]:
    """(width,) values of a sampler at a time, and the times of its first and last key. Raises InputError.

    Reads the values at the two keys around the time alone, as many samplers may share long accessors.
    """
    where = f"{data.where}: accessors {sampler.input + 1}"
    keys = stored(data, sampler.input, "SCALAR")[:, 0]
    accessor = data.layout.accessors[sampler.output]
    cubic = sampler.interpolation == "CUBICSPLINE"
    rows = width // NUMBERS[kind]
    each = rows * (3 if cubic else 1)
    if not len(keys) or accessor.count < len(keys) * each:
        raise InputError(
            f"{data.where}: accessors {sampler.output + 1}: {accessor.count} elements; needed are {each} for each of "
            f"{len(keys)} keys, and at least one key"
        )

    def value(key: int, part: int = 1 if cubic else 0) -> Floats:
        start = key * each + part * rows
        return as_floats(stored(data, sampler.output, kind, rows=slice(start, start + rows)), accessor).ravel()

    first, last = float(keys[0]), float(keys[-1])
    before = bisect.bisect_right(keys, time, key=float) - 1
    if before < 0 or before == len(keys) - 1 or sampler.interpolation == "STEP":
        return value(max(before, 0)), first, last
    start, end = float(keys[before]), float(keys[before + 1])
    if not start <= time < end:
        raise InputError(f"{where}: found a key at {start:g} s and the next at {end:g} s; allowed: times that increase")
    share = (time - start) / (end - start)
    if cubic:
        spline = _hermite(value(before), value(before, 2), value(before + 1), value(before + 1, 0), share, end - start)
        return spline, first, last
    between = slerp if kind == "VEC4" else _lerp
    return between(value(before), value(before + 1), share), first, last


def _lerp(a: Floats, b: Floats, share: float) -> Floats:
    return (1.0 - share) * a + share * b


def slerp(a: Floats, b: Floats, share: float) -> Floats:
    """Quaternion at a share of the shorter arc from one to another.

    scipy's Slerp may take the other way round for half a turn, which is common between keys.
    """
    a, b = (each / (np.linalg.norm(each) or 1.0) for each in (a, b))
    cosine = float(a @ b)
    b = -b if cosine < 0.0 else b
    angle = math.acos(min(abs(cosine), 1.0))
    if angle < 1e-6:  # where sin(angle) rounds; off by less than angle³
        return _lerp(a, b, share)
    return (math.sin((1.0 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle)


def _hermite(a: Floats, out: Floats, b: Floats, into: Floats, share: float, duration: float) -> Floats:
    """Cubic spline from a, with the tangent `out`, to b, with the tangent `into`."""
    t, t2, t3 = share, share * share, share**3
    rise = duration * ((t3 - 2 * t2 + t) * out + (t3 - t2) * into)
    return (2 * t3 - 3 * t2 + 1) * a + (3 * t2 - 2 * t3) * b + rise


def _note(layout: Layout, number: int, time: float, first: float, last: float, where: str) -> str:
    clip: Animation = layout.animations[number]
    name = f" {clip.name!r:.60}" if clip.name else ""
    title = f"{where}: clip{name}, {number + 1} of {len(layout.animations)}"
    if first > last:
        return f"{title}, moves nothing"
    held = " (held at its end)" if time > last else " (held at its beginning)" if time < first else ""
    return f"{title}, from {first:.4g} to {last:.4g} s: posed at {time:.6g} s{held}; clip and time choose another"


class Node(NamedTuple):
    """A node: its number from 0, its table, its (4, 4) float64 node-to-world matrix, and whether it is visible."""

    number: int
    data: NodeTable
    matrix: Floats
    visible: bool


def scene_nodes(layout: Layout, pose: Pose) -> list[Node]:
    """The nodes of the default scene, parents before children, in the order of the file."""
    if layout.scenes:
        return list(_tree(layout, pose, layout.scenes[layout.scene or 0].nodes, set()))
    return list(_tree(layout, pose, _roots(layout), set()))


def joint_worlds(layout: Layout, pose: Pose, nodes: list[Node]) -> dict[int, Floats]:
    """(4, 4) node-to-world matrices by index: of the scene's nodes, and of all others if skins use those."""
    worlds = {node.number: node.matrix for node in nodes}
    if any(node.data.skin is not None for node in nodes):
        roots = [root for root in _roots(layout) if root not in worlds]
        worlds |= {node.number: node.matrix for node in _tree(layout, pose, roots, set(worlds))}
    return worlds


def _roots(layout: Layout) -> list[int]:
    children = {child for node in layout.nodes for child in node.children}
    return [index for index in range(len(layout.nodes)) if index not in children]


def _tree(layout: Layout, pose: Pose, roots: list[int], seen: set[int]) -> Iterator[Node]:
    """The nodes below roots, and those. seen: indices of nodes that must not be among them; they are added."""
    waiting = [(index, np.eye(4), True) for index in reversed(roots)]
    while waiting:
        index, parent, visible = waiting.pop()
        if index in seen:
            raise ValueError(f"node {index} has two parents or is its own ancestor")
        seen.add(index)
        node = layout.nodes[index]
        matrix = parent @ _local_matrix(index, node, pose)
        # KHR_node_visibility hides the meshes and lights of a node and its descendants, but not cameras.
        visible = visible and node.visible
        waiting.extend((child, matrix, visible) for child in reversed(node.children))
        yield Node(index, node, matrix, visible)


def _local_matrix(index: int, node: NodeTable, pose: Pose) -> Floats:
    from scipy.spatial.transform import Rotation  # the import takes 0.3 s

    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    matrix = np.eye(4)
    rotation = Rotation.from_quat(pose.get((index, "rotation"), np.array(node.rotation)))
    matrix[:3, :3] = rotation.as_matrix() * pose.get((index, "scale"), np.array(node.scale))
    matrix[:3, 3] = pose.get((index, "translation"), np.array(node.translation))
    return matrix


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
        """A primitive as each visible node draws it, by the node's number."""
        users = [node for node in self._users.get(primitive.mesh, ()) if node.visible]
        posed = {node.number: self._deformed(primitive, node) for node in users}
        if None in posed.values():
            still = triangles_of(primitive.positions, primitive.faces, self._data.where)
            normals = corner_normals(primitive, primitive.floats("NORMAL", "VEC3"))
        return {node.number: posed[node.number] or Posed(still, node.matrix, normals) for node in users}

    def _deformed(self, primitive: TrianglePrimitive, node: Node) -> Posed | None:
        weights, skin = self._weights(node, primitive.mesh), node.data.skin
        moved = any(weights[: len(primitive.primitive.targets)])
        influences = None if skin is None else _influences(primitive, len(self._data.layout.skins[skin].joints))
        if influences is None and not moved:
            return None
        positions, matrix = morphed(primitive, "POSITION", weights), node.matrix
        assert positions is not None  # as `read_primitives` checks
        normals = morphed(primitive, "NORMAL", weights)
        if influences is not None and skin is not None:
            blend = self._blend(skin, *influences)
            linear = blend[:, :, :3]
            positions = np.einsum("vij,vj->vi", linear, positions) + blend[:, :, 3]
            if normals is not None:
                normals = np.einsum("vij,vj->vi", normal_matrices(linear), normals)
            matrix = np.eye(4)
            if np.sign(np.linalg.det(linear)).sum() < 0.0:
                # Most vertices are mirrored: as by a mirroring node, of positions that are mirrored before.
                matrix = MIRROR
                positions = positions * MIRROR.diagonal()[:3]
                normals = None if normals is None else normals * MIRROR.diagonal()[:3]
        triangles = triangles_of(positions, primitive.faces, self._data.where)
        return Posed(triangles, matrix, corner_normals(primitive, normals))

    def _weights(self, node: Node, mesh: int) -> list[float]:
        """Weights of the morph targets: animated, or the node's, or the mesh's."""
        given = self._pose.get((node.number, "weights"))
        if given is not None:
            return [float(weight) for weight in given]
        return self._data.layout.meshes[mesh].weights if node.data.weights is None else node.data.weights

    def _blend(self, skin: int, numbers: NDArray[np.int32], weights: Floats) -> Floats:
        """(V, 3, 4) matrices by which a skin moves vertices with (V, 4 n) joints and weights.

        Weights are divided by their sum; a vertex without any follows the first of its joints, both as in three.js.
        """
        if skin not in self._joints:
            self._joints[skin] = joint_matrices(self._data, self._data.layout.skins[skin], self._worlds)
        sums = weights.sum(axis=1)
        self._uneven += int((np.abs(sums - 1.0) > UNEVEN).sum())
        weights[sums == 0.0, 0] = 1.0
        weights /= np.where(sums == 0.0, 1.0, sums)[:, None]
        matrices = np.zeros((len(weights), 3, 4))
        for number, weight in zip(numbers.T, weights.T, strict=True):
            matrices += weight[:, None, None] * self._joints[skin][number, :3]
        return matrices


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
    numbers, weights = [], []
    for each in sets:
        number, weight = primitive.integers(f"JOINTS_{each}", "VEC4"), primitive.floats(f"WEIGHTS_{each}", "VEC4")
        if number is None or weight is None:
            raise InputError(f"{where}: a primitive has JOINTS_{each} without WEIGHTS_{each}")
        numbers.append(number.astype(np.int32))
        weights.append(weight)
    number, weight = np.hstack(numbers), np.hstack(weights)
    number[(weight == 0.0) & (number >= joints)] = 0  # exporters leave anything there
    if number.max(initial=0) >= joints:
        raise InputError(f"{where}: a vertex has joint {number.max()}; its skin has {joints}, counted from 0")
    return number, weight
