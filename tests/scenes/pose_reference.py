"""Poses of glTF files evaluated vertex by vertex from the specification, apart from the package: slow, in plain Python.

It reads triangle lists that are not compressed, of files whose weights need not be divided by their sum.
"""

import base64
import bisect
import json
import math
import struct
from pathlib import Path
from typing import Any

Matrix = list[list[float]]
Point = tuple[float, float, float]
CODES = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
LARGEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}
COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Reference:
    """A file at a time of one of its animations, None for the nodes' own transforms."""

    def __init__(self, path: Path, animation: int | None = 0, time: float = 0.0) -> None:
        data, self.chunk = path.read_bytes(), b""
        if data[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", data, 12)
            data, self.chunk = data[20 : 20 + length], data[28 + length :]
        self.json, self.folder = json.loads(data), path.parent
        self.nodes: list[dict[str, Any]] = [dict(node) for node in self.json["nodes"]]
        if animation is not None:
            clip = self.json["animations"][animation]
            for channel in clip["channels"]:
                target = channel["target"]
                value = self._sampled(clip["samplers"][channel["sampler"]], target["path"], time)
                self.nodes[target["node"]][target["path"]] = value
        self.parents = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", ())}

    def corners(self) -> list[list[tuple[Point, Point, Point]]]:
        """The triangles of each primitive of each node of the scene, depth first; mirrored ones are not turned."""
        found = []
        waiting = list(reversed(self.json["scenes"][self.json.get("scene", 0)]["nodes"]))
        while waiting:
            number = waiting.pop()
            node = self.nodes[number]
            waiting += reversed(node.get("children", []))
            if "mesh" in node:
                for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                    if primitive.get("mode", 4) == 4:
                        found.append(self._primitive(number, node, primitive))
        return found

    def times(self, animation: int) -> list[float]:
        """Times of the keys of an animation's first channel."""
        clip = self.json["animations"][animation]
        return [time for (time,) in self._read(clip["samplers"][clip["channels"][0]["sampler"]]["input"])]

    def world(self, number: int) -> Matrix:
        """From a node to the world."""
        node = self.nodes[number]
        if "matrix" in node:
            own = [[node["matrix"][4 * column + row] for column in range(4)] for row in range(4)]
        else:
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            length = math.sqrt(x * x + y * y + z * z + w * w)
            x, y, z, w = x / length, y / length, z / length, w / length
            turn = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            scale, move = node.get("scale", (1, 1, 1)), node.get("translation", (0, 0, 0))
            own = [[turn[row][k] * scale[k] for k in range(3)] + [move[row]] for row in range(3)] + [[0, 0, 0, 1]]
        return _product(self.world(self.parents[number]), own) if number in self.parents else own

    def _primitive(self, number: int, node: dict[str, Any], primitive: dict[str, Any]) -> list[Any]:
        attributes = primitive["attributes"]
        points = [list(row) for row in self._read(attributes["POSITION"])]
        weights = node.get("weights", self.json["meshes"][node["mesh"]].get("weights", []))
        for weight, target in zip(weights, primitive.get("targets", []), strict=False):
            if "POSITION" in target:
                for point, move in zip(points, self._read(target["POSITION"]), strict=True):
                    for axis in range(3):
                        point[axis] += weight * move[axis]
        if "skin" not in node or "JOINTS_0" not in attributes:
            world = self.world(number)
            moved = [_apply(world, point) for point in points]
        else:
            moved = self._skinned(self.json["skins"][node["skin"]], attributes, points)
        indices = range(len(points)) if "indices" not in primitive else [i for (i,) in self._read(primitive["indices"])]
        order = [int(index) for index in indices]
        return [(moved[order[k]], moved[order[k + 1]], moved[order[k + 2]]) for k in range(0, len(order), 3)]

    def _skinned(self, skin: dict[str, Any], attributes: dict[str, int], points: list[list[float]]) -> list[Point]:
        matrices = [self.world(joint) for joint in skin["joints"]]
        if "inverseBindMatrices" in skin:
            inverse = self._read(skin["inverseBindMatrices"])
            matrices = [
                _product(world, [[row[4 * j + i] for j in range(4)] for i in range(4)])
                for world, row in zip(matrices, inverse, strict=False)
            ]
        moved = []
        for vertex, point in enumerate(points):
            total, share, number = [0.0, 0.0, 0.0], 0.0, 0
            while f"JOINTS_{number}" in attributes:
                joints = self._read(attributes[f"JOINTS_{number}"])[vertex]
                for joint, weight in zip(joints, self._read(attributes[f"WEIGHTS_{number}"])[vertex], strict=True):
                    if weight:
                        part = _apply(matrices[int(joint)], point)
                        total = [total[axis] + weight * part[axis] for axis in range(3)]
                        share += weight
                number += 1
            moved.append((total[0] / share, total[1] / share, total[2] / share))
        return moved

    def _sampled(self, sampler: dict[str, Any], path: str, time: float) -> list[float]:
        times, rows = [t for (t,) in self._read(sampler["input"])], self._read(sampler["output"])
        kind = sampler.get("interpolation", "LINEAR")
        if path == "weights":
            size = len(rows) // len(times) // (3 if kind == "CUBICSPLINE" else 1)
            flat = [value for (value,) in rows]
            rows = [tuple(flat[k : k + size]) for k in range(0, len(flat), size)]
        before = bisect.bisect_right(times, time) - 1
        at, step = (1, 3) if kind == "CUBICSPLINE" else (0, 1)
        if before < 0 or before == len(times) - 1 or kind == "STEP":
            return list(rows[max(before, 0) * step + at])
        a, b = rows[before * step + at], rows[(before + 1) * step + at]
        length = times[before + 1] - times[before]
        t = (time - times[before]) / length
        if kind == "CUBICSPLINE":
            out, into = rows[before * 3 + 2], rows[(before + 1) * 3]
            return [
                (2 * t**3 - 3 * t**2 + 1) * a[k]
                + length * (t**3 - 2 * t**2 + t) * out[k]
                + (-2 * t**3 + 3 * t**2) * b[k]
                + length * (t**3 - t**2) * into[k]
                for k in range(len(a))
            ]
        if path != "rotation":
            return [(1 - t) * a[k] + t * b[k] for k in range(len(a))]
        a, b = ([value / math.hypot(*key) for value in key] for key in (a, b))
        dot = sum(p * q for p, q in zip(a, b, strict=True))
        angle = math.acos(min(abs(dot), 1.0))
        if angle == 0.0:
            return list(a)
        sign = -1.0 if dot < 0 else 1.0
        return [
            math.sin(angle * (1 - t)) / math.sin(angle) * a[k] + sign * math.sin(angle * t) / math.sin(angle) * b[k]
            for k in range(4)
        ]

    def _read(self, number: int) -> list[tuple[float, ...]]:
        cache = self.__dict__.setdefault("_cache", {})
        if number not in cache:
            accessor = self.json["accessors"][number]
            code, count = CODES[accessor["componentType"]], COUNTS[accessor["type"]]
            rows = [(0,) * count] * accessor["count"]
            if "bufferView" in accessor:
                rows = self._rows(accessor, code, count, accessor["count"])
            if "sparse" in accessor:
                sparse = accessor["sparse"]
                indices = self._rows(sparse["indices"], CODES[sparse["indices"]["componentType"]], 1, sparse["count"])
                for (index,), row in zip(
                    indices, self._rows(sparse["values"], code, count, sparse["count"]), strict=True
                ):
                    rows[int(index)] = row
            if accessor.get("normalized"):
                largest = LARGEST[accessor["componentType"]]
                rows = [tuple(max(value / largest, -1.0) for value in row) for row in rows]
            cache[number] = rows
        found: list[tuple[float, ...]] = cache[number]
        return found

    def _rows(self, part: dict[str, Any], code: str, count: int, rows: int) -> list[tuple[float, ...]]:
        view = self.json["bufferViews"][part["bufferView"]]
        data, start = self._buffer(view["buffer"]), view.get("byteOffset", 0) + part.get("byteOffset", 0)
        stride = view.get("byteStride", struct.calcsize(code) * count)
        return [struct.unpack_from(f"<{count}{code}", data, start + k * stride) for k in range(rows)]

    def _buffer(self, number: int) -> bytes:
        uri = self.json["buffers"][number].get("uri")
        if uri is None:
            return self.chunk
        return base64.b64decode(uri.partition(",")[2]) if uri[:5] == "data:" else (self.folder / uri).read_bytes()


def _product(a: Matrix, b: Matrix) -> Matrix:
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def _apply(matrix: Matrix, point: list[float]) -> Point:
    x, y, z = (sum(matrix[row][k] * point[k] for k in range(3)) + matrix[row][3] for row in range(3))
    return x, y, z
