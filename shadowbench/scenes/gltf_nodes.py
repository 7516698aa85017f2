"""The node tree of a glTF in a pose."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_animation import Pose
from shadowbench.scenes.gltf_layout import Layout, NodeTable
from shadowbench.scenes.vectors import Floats


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
    joints = {joint for node in nodes if node.data.skin is not None for joint in layout.skins[node.data.skin].joints}
    if not joints <= worlds.keys():
        roots = [root for root in _roots(layout) if root not in worlds]
        worlds |= {node.number: node.matrix for node in _tree(layout, pose, roots, set(worlds))}
    if lost := joints - worlds.keys():
        raise InputError(f"nodes {min(lost) + 1}: is a joint and its own ancestor")
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
