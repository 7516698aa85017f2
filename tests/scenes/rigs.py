"""glTF files made by code: rigged, morphed and animated ones, and compressed ones."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshopt
import numpy as np
import trimesh
from numpy.typing import NDArray

CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
HALF = np.sqrt(0.5)


def glb_of(document: dict[str, Any], blob: bytes) -> bytes:
    """The bytes of a .glb."""
    text = json.dumps(document).encode()
    text, blob = text + b" " * (-len(text) % 4), blob + b"\0" * (-len(blob) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


class Rig:
    """A glTF in the making. Nodes are dictionaries with the names of the specification."""

    def __init__(self) -> None:
        self.blob = b""
        self.rows: list[NDArray[np.float64]] = []  # of accessors, with fractions for normalised integers
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.json |= {name: [] for name in ("nodes", "meshes", "skins", "animations", "accessors", "bufferViews")}

    def accessor(self, values: Any, dtype: str = "float32", normalized: bool = False) -> int:
        """Index of a new accessor with the rows of values, each a number or several."""
        array: NDArray[Any] = np.asarray(values, dtype)
        width = 1 if array.ndim == 1 else int(np.prod(array.shape[1:]))
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": array.nbytes}
        row = {"componentType": CODES[dtype], "count": len(array), "type": TYPES[width], "normalized": normalized}
        self.json["accessors"].append({"bufferView": len(self.json["bufferViews"]), **row})
        self.json["bufferViews"].append(view)
        scale = np.iinfo(array.dtype).max if normalized else 1.0
        self.rows.append(np.maximum(array / scale, -1.0) if normalized else array.astype(np.float64).reshape(-1, width))
        self.blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(self.json["accessors"]) - 1

    def mesh(self, points: Any, faces: Any, targets: Any = (), weights: Any = None, **attributes: int) -> int:
        """Index of a new mesh of one primitive; targets: displacements, attributes: accessors of further ones."""
        primitive = {
            "attributes": {"POSITION": self.accessor(points), **attributes},
            "indices": self.accessor(np.ravel(faces), "uint16"),
            "targets": [{"POSITION": self.accessor(target)} for target in targets],
        }
        self.json["meshes"].append({"primitives": [primitive], **({"weights": weights} if weights else {})})
        return len(self.json["meshes"]) - 1

    def influences(self, joints: Any, weights: Any, number: int = 0, **kinds: Any) -> dict[str, int]:
        """Attributes of a set of four joints a vertex; kinds: as of `accessor`, of the weights."""
        return {
            f"JOINTS_{number}": self.accessor(joints, "uint8"),
            f"WEIGHTS_{number}": self.accessor(weights, **kinds),
        }

    def skin(self, joints: list[int], inverse: Any = None) -> int:
        """Index of a new skin. inverse: (J, 4, 4) inverse bind matrices."""
        matrices = {} if inverse is None else {"inverseBindMatrices": self.accessor(np.transpose(inverse, (0, 2, 1)))}
        self.json["skins"].append({"joints": joints, **matrices})
        return len(self.json["skins"]) - 1

    def clip(
        self, *channels: tuple[int, str, Any, Any], kind: str = "LINEAR", name: str | None = None, **of: Any
    ) -> None:
        """A new animation of channels: node, path, times and values; of: as of `accessor`, of the values."""
        samplers = [
            {"input": self.accessor(times), "output": self.accessor(values, **of), "interpolation": kind}
            for _, _, times, values in channels
        ]
        targets = [{"sampler": k, "target": {"node": n, "path": path}} for k, (n, path, _, _) in enumerate(channels)]
        self.json["animations"].append({"channels": targets, "samplers": samplers, **({"name": name} if name else {})})

    def glb(self) -> bytes:
        """The bytes of a .glb."""
        document = {key: part for key, part in self.json.items() if part != []}
        return glb_of(document | {"buffers": [{"byteLength": len(self.blob)}]}, self.blob)

    def write(self, path: Path) -> Path:
        """Write a .glb."""
        path.write_bytes(self.glb())
        return path


def tube(rings: int = 9, sides: int = 6) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points and faces of an open prism of height 2 about the y axis."""
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([0.3 * np.cos(angle), np.zeros(sides), 0.3 * np.sin(angle)], axis=1)
    points = np.concatenate([ring + np.array([0, height, 0]) for height in np.linspace(0, 2, rings)])
    k = np.arange((rings - 1) * sides)
    beside = k // sides * sides + (k + 1) % sides
    faces = np.stack([k, k + sides, beside, beside, k + sides, beside + sides], axis=1).reshape(-1, 3)
    return points, faces


def turn(axis: Any, degrees: float) -> NDArray[np.float64]:
    """A unit quaternion."""
    half = np.radians(degrees) / 2
    return np.array([*(np.asarray(axis) / np.linalg.norm(axis) * np.sin(half)), np.cos(half)])


def _chance(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def _weights(points: NDArray[np.float64], sets: int = 1) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Joints and weights, which add up to 1, of four joints a set."""
    chance = _chance(3)
    joints = np.stack([chance.permutation(4 * sets) for _ in points])
    weights = chance.random(joints.shape) ** 3
    return joints, weights / weights.sum(axis=1, keepdims=True)


def _chain(rig: Rig, first: int, count: int = 4, **extra: Any) -> list[int]:
    """Joints below each other, half a metre apart; extra: of each."""
    for k in range(count):
        below = {"children": [first + k + 1]} if k < count - 1 else {}
        rig.json["nodes"].append({"translation": [0, 0.5 if k else 0, 0], **extra, **below})
    return list(range(first, first + count))


def _inverse() -> NDArray[np.float64]:
    """Inverse bind matrices of a straight chain."""
    matrices = np.tile(np.eye(4), (4, 1, 1))
    matrices[:, 1, 3] = [0, -0.5, -1, -1.5]
    return matrices


TIMES = [0.0, 0.5, 1.25, 2.0]


def _swing(seed: int, count: int = 4) -> NDArray[np.float64]:
    """Unit quaternions, one for each time."""
    values = _chance(seed).normal(size=(count, 4))
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def morphing() -> Rig:
    """Three targets, whose weights are animated; beside it the same mesh with weights of its own, and of the node."""
    rig, (points, faces), chance = Rig(), tube(), _chance(6)
    mesh = rig.mesh(points, faces, [chance.normal(size=points.shape) for _ in range(3)], [0.5, 0, -0.25])
    rig.json["nodes"] = [{"children": [1, 2], "mesh": mesh}, {"mesh": mesh, "translation": [3, 0, 0]}]
    rig.json["nodes"].append({"mesh": mesh, "weights": [0, 1.5, 0.25], "rotation": turn([0, 1, 0], 90).tolist()})
    rig.clip((0, "weights", TIMES, chance.normal(size=12)))
    return rig


def morphed_skin() -> Rig:
    """Targets and a skin together; weights in 8 bits; weights of targets along a cubic spline."""
    rig, (points, faces), chance = Rig(), tube(), _chance(7)
    joints, weights = _weights(points)
    bytes_ = np.floor(weights * 255)
    bytes_[:, 0] += 255 - bytes_.sum(axis=1)
    kind = {"dtype": "uint8", "normalized": True}
    moves = [chance.normal(size=points.shape) * 0.1 for _ in range(2)]
    mesh = rig.mesh(points, faces, moves, **rig.influences(joints, bytes_, **kind))
    rig.json["nodes"] = [{"children": [1], "mesh": mesh, "skin": 0}]
    chain = _chain(rig, 1, rotation=turn([1, 0, 1], 25).tolist())
    rig.skin(chain, _inverse())
    rig.clip((0, "weights", TIMES, chance.normal(size=24)), kind="CUBICSPLINE")
    return rig


def eight_joints() -> Rig:
    """Two sets of joints, no inverse bind matrices, keys that are steps."""
    rig, (points, faces) = Rig(), tube()
    joints, weights = _weights(points, 2)
    sets = {
        name: index
        for k in range(2)
        for name, index in rig.influences(joints[:, 4 * k : 4 * k + 4], weights[:, 4 * k : 4 * k + 4], k).items()
    }
    rig.json["nodes"] = [{"children": [1], "mesh": rig.mesh(points, faces, **sets), "skin": 0}]
    chain = _chain(rig, 1, 8)
    rig.skin(chain)
    rig.clip(*((joint, "translation", TIMES, _chance(joint).normal(size=(4, 3))) for joint in chain), kind="STEP")
    return rig


def quantised() -> Rig:
    """Rotations in 16 bits, joints in 16 bits, and keys that begin late."""
    rig, (points, faces) = Rig(), tube()
    joints, weights = _weights(points)
    sets = {
        "JOINTS_0": rig.accessor(joints, "uint16"),
        "WEIGHTS_0": rig.accessor(np.round(weights * 65535), "uint16", True),
    }
    rig.json["nodes"] = [{"children": [1], "mesh": rig.mesh(points, faces, **sets), "skin": 0}]
    chain = _chain(rig, 1)
    rig.skin(chain, _inverse())
    turns = [(joint, "rotation", np.array(TIMES) + 0.25, np.round(_swing(joint) * 32767)) for joint in chain]
    rig.clip(*turns, dtype="int16", normalized=True)
    return rig


def two_skins() -> Rig:
    """One mesh that stands, and hangs in two skins, one of which is mirrored."""
    rig, (points, faces) = Rig(), tube()
    mesh = rig.mesh(points, faces, **rig.influences(*_weights(points)))
    rig.json["nodes"] = [{"children": [1, 2, 3, 4, 8]}, {"mesh": mesh, "rotation": turn([1, 0, 0], 90).tolist()}]
    rig.json["nodes"] += [{"mesh": mesh, "skin": 0}, {"mesh": mesh, "skin": 1}]
    first = _chain(rig, 4)
    second = _chain(rig, 8)
    rig.json["nodes"][8]["scale"] = [-1, 1, 1]
    rig.skin(first, _inverse())
    rig.skin(second, _inverse())
    rig.clip(*((joint, "rotation", TIMES, _swing(joint)) for joint in first[1:]), (9, "scale", TIMES, [[1, 1, 1]] * 4))
    return rig


def sheared() -> Rig:
    """Joints of another tree than the mesh, with matrices and uneven scales, in two clips."""
    rig, (points, faces) = Rig(), tube()
    mesh = rig.mesh(points, faces, **rig.influences(*_weights(points)))
    rig.json["scenes"] = [{"nodes": [0, 1]}]
    matrix = [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0.25, 2, 0, 0.1, 0.2, 0.3, 1]
    rig.json["nodes"] = [{"mesh": mesh, "skin": 0, "matrix": matrix}, {"children": [2], "matrix": matrix}]
    chain = _chain(rig, 2, scale=[1, 0.5, 1.5])
    rig.skin(chain, _inverse())
    rig.clip((3, "rotation", TIMES, _swing(1)), name="other")
    rig.clip(
        *((joint, "rotation", TIMES, _swing(joint)) for joint in chain),
        (4, "scale", [0.0, 2.0], [[1, 1, 1], [3, 1, 1]]),
        name="walk",
    )
    return rig


RIGS: dict[str, Callable[[], Rig]] = {
    make.__name__: make for make in (morphing, morphed_skin, eight_joints, quantised, two_skins, sheared)
}


def compressed_glb(
    mesh: trimesh.Trimesh,
    extension: str = "EXT_meshopt_compression",
    mode: str = "TRIANGLES",
    width: int = 2,
    positions: str = "NONE",
    change: dict[str, Any] | None = None,
) -> bytes:
    """A .glb of meshopt-compressed positions and indices of `width` bytes. change: of the table of the positions."""
    vertices, corners = np.float32(mesh.vertices), mesh.faces.ravel().astype(f"<u{width}")
    rows = meshopt.encode_filter_exp(vertices, 15) if positions == "EXPONENTIAL" else vertices
    first = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES", version=int(extension[0] == "K"))
    second = meshopt.encode_gltf_buffer(corners, mode)
    sizes = [{"count": len(vertices), "byteStride": 12}, {"count": len(corners), "byteStride": width}]
    packed = [
        {"byteLength": len(first), "mode": "ATTRIBUTES", "filter": positions, **sizes[0], **(change or {})},
        {"byteLength": len(second), "mode": mode, **sizes[1], "byteOffset": len(first)},
    ]
    lengths = [vertices.nbytes, corners.nbytes]
    document = {
        "asset": {"version": "2.0"},
        "extensionsRequired": [extension],
        "extensionsUsed": [extension],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": len(vertices)},
            {"bufferView": 1, "componentType": {2: 5123, 4: 5125}[width], "type": "SCALAR", "count": len(corners)},
        ],
        "bufferViews": [
            {
                "buffer": 1,
                "byteOffset": sum(lengths[:k]),
                "byteLength": lengths[k],
                "extensions": {extension: {"buffer": 0, **packed[k]}},
            }
            for k in (0, 1)
        ],
        "buffers": [{"byteLength": len(first + second)}, {"byteLength": sum(lengths)}],
    }
    return glb_of(document, first + second)
