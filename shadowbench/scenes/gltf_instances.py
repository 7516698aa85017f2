"""Instances of EXT_mesh_gpu_instancing: a node's mesh drawn many times, each with a transform of its own."""

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_accessors import Data, floats_of
from shadowbench.scenes.gltf_layout import NodeTable
from shadowbench.scenes.vectors import Floats

TYPES = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


def instance_matrices(data: Data, node: NodeTable) -> Floats:
    """(N, 4, 4) float64 matrices from each instance of a node's mesh to the node; the identity for one without.

    Raises InputError for attributes that are not finite or no rotation.
    """
    from scipy.spatial.transform import Rotation  # the import takes 0.3 s

    if not node.instances:
        return np.eye(4)[None]
    where = f"{data.where}: node {node.name or ''!r:.60}: EXT_mesh_gpu_instancing"
    found = {
        name: floats_of(data, node.instances[name], kind) for name, kind in TYPES.items() if name in node.instances
    }
    if not all(np.isfinite(rows).all() for rows in found.values()):
        raise InputError(f"{where}: found infinite or undefined numbers; allowed are finite ones")
    matrices = np.tile(np.eye(4), (data.layout.instance_count(node), 1, 1))
    if "ROTATION" in found:
        if not found["ROTATION"].any(axis=1).all():
            raise InputError(f"{where}: found a rotation of four zeros; allowed: unit quaternions")
        matrices[:, :3, :3] = Rotation.from_quat(found["ROTATION"]).as_matrix()
    matrices[:, :3, :3] *= found.get("SCALE", np.ones((1, 3)))[:, None, :]
    matrices[:, :3, 3] = found.get("TRANSLATION", 0.0)
    return matrices
