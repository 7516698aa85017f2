"""Poses of rigs by the specification, apart from the package: of triangle lists whose weights add up to 1."""

import bisect
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.scenes.rigs import Rig

Floats = NDArray[np.float64]


class Reference:
    """A rig at a time of one of its animations."""

    def __init__(self, rig: Rig, animation: int, time: float) -> None:
        self.json, self.rows = rig.json, rig.rows
        self.nodes: list[dict[str, Any]] = [dict(node) for node in self.json["nodes"]]
        clip = self.json["animations"][animation]
        for channel in clip["channels"]:
            target = channel["target"]
            value = self._sampled(clip["samplers"][channel["sampler"]], target["path"], time)
            self.nodes[target["node"]][target["path"]] = value
        self.parents = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", ())}

    def corners(self) -> list[Floats]:
        """(F, 3, 3) triangles of each node of the scene that has a mesh, depth first; mirrored ones are not turned."""
        triangles = []
        waiting = list(reversed(self.json["scenes"][0]["nodes"]))
        while waiting:
            number = waiting.pop()
            node = self.nodes[number]
            waiting += reversed(node.get("children", []))
            if "mesh" in node:
                (primitive,) = self.json["meshes"][node["mesh"]]["primitives"]
                order = self.rows[primitive["indices"]].astype(int).reshape(-1, 3)
                triangles.append(self._vertices(number, node, primitive)[order])
        return triangles

    def _vertices(self, number: int, node: dict[str, Any], primitive: dict[str, Any]) -> Floats:
        attributes = primitive["attributes"]
        points = self.rows[attributes["POSITION"]].copy()
        weights = node.get("weights", self.json["meshes"][node["mesh"]].get("weights", []))
        for weight, target in zip(weights, primitive.get("targets", []), strict=False):
            points += weight * self.rows[target["POSITION"]]
        points = np.column_stack([points, np.ones(len(points))])
        if "skin" not in node:
            return (points @ self._world(number).T)[:, :3]
        skin = self.json["skins"][node["skin"]]
        matrices = [self._world(joint) for joint in skin["joints"]]
        if "inverseBindMatrices" in skin:
            inverse = self.rows[skin["inverseBindMatrices"]].reshape(-1, 4, 4)
            matrices = [world @ columns.T for world, columns in zip(matrices, inverse, strict=True)]
        moved = np.zeros((len(points), 4))
        for name in [name for name in attributes if name.startswith("JOINTS")]:
            shares = self.rows[attributes[name.replace("JOINTS", "WEIGHTS")]]
            for vertex, joints in enumerate(self.rows[attributes[name]].astype(int)):
                for joint, share in zip(joints, shares[vertex], strict=True):
                    moved[vertex] += share * (matrices[joint] @ points[vertex])
        return moved[:, :3] / moved[:, 3:]

    def _world(self, number: int) -> Floats:
        """From a node to the world."""
        node = self.nodes[number]
        own = np.eye(4)
        if "matrix" in node:
            own = np.reshape(node["matrix"], (4, 4)).T
        else:
            x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1))) / np.linalg.norm(node.get("rotation", 1.0))
            turn = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            own[:3, :3] = np.array(turn) * node.get("scale", (1, 1, 1))
            own[:3, 3] = node.get("translation", (0, 0, 0))
        return self._world(self.parents[number]) @ own if number in self.parents else own

    def _sampled(self, sampler: dict[str, Any], path: str, time: float) -> Floats:
        times, values = self.rows[sampler["input"]].ravel().tolist(), self.rows[sampler["output"]]
        kind = sampler["interpolation"]
        parts = values.reshape(len(times), 3 if kind == "CUBICSPLINE" else 1, -1)
        middle = parts.shape[1] // 2
        before = bisect.bisect_right(times, time) - 1
        if before < 0 or before == len(times) - 1 or kind == "STEP":
            return np.array(parts[max(before, 0), middle])
        a, b, length = parts[before, middle], parts[before + 1, middle], times[before + 1] - times[before]
        t = (time - times[before]) / length
        if kind == "CUBICSPLINE":
            rise = length * ((t**3 - 2 * t**2 + t) * parts[before, 2] + (t**3 - t**2) * parts[before + 1, 0])
            return (2 * t**3 - 3 * t**2 + 1) * a + (-2 * t**3 + 3 * t**2) * b + rise
        if path != "rotation":
            return (1 - t) * a + t * b
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        angle = math.acos(min(abs(a @ b), 1.0))
        if angle == 0.0:
            return np.array(a)
        return (math.sin(angle * (1 - t)) * a + math.copysign(1.0, a @ b) * math.sin(angle * t) * b) / math.sin(angle)
