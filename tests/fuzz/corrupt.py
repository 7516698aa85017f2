"""Small valid mesh files of each format, and deterministic ways to corrupt them."""

import base64
import json
import random
import struct
from functools import cache
from typing import Any

import meshopt
import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb

from .cases import OUTSIDE, Case
from .values import NUMBERS, PATHS

FORMATS = ("glb", "gltf", "obj", "ply", "stl", "off")
ABSURD = [*NUMBERS, None, True, "x", "", [], {}, [[]], [1] * 50, "../../etc/passwd", "\ud800"]
TOKENS = [
    *b"nan inf -inf 1e999 1e19 -1 0 99999999 4294967296 x \0 \xff\xfe 1.5.2 0x10 1_000 -0 1e-320 // 1//1 /".split(b" "),
    *(b"9" * 400, b"9" * 5000, b"", "∞".encode()),
]
DAMAGES = ["cut", "flip", "flip", "header", "header", "splice", "double", "token", "token", "token", "count", "count"]
LIES = ["value", "value", "value", "value", "drop", "cycle", "deep", "many", "elsewhere"]


@cache
def valid(kind: str) -> list[bytes]:
    """Valid files of a format: text and binary, one mesh and several, plain and compressed."""
    ball, box = trimesh.creation.icosphere(subdivisions=1), trimesh.creation.box()
    two = trimesh.Scene({"ball": ball, "box": box.copy().apply_translation([2, 0, 0])})
    two.add_geometry(box, node_name="again", transform=np.diag([-2.0, 1.0, 1.0, 1.0]))
    if kind == "glb":
        draco = export_glb(trimesh.Scene(ball), extension_draco=True)
        assert b"KHR_draco_mesh_compression" in draco
        from tests.scenes.rigs import morphed_skin, two_skins  # they use this module

        packed = [compressed_glb(ball), compressed_glb(box, "KHR_meshopt_compression", "INDICES")]
        rigs = [morphed_skin().glb(), two_skins().glb()]
        plain = [export_glb(trimesh.Scene(box)), export_glb(two)]
        return [*plain, draco, export_glb(two, extension_draco=True), *packed, *rigs]
    if kind == "gltf":
        return [_embedded(data) for data in valid("glb")]
    if kind == "ply":
        return [ball.export(file_type="ply", encoding=encoding) for encoding in ("ascii", "binary")]
    if kind == "stl":
        texts = [ball.export(file_type="stl_ascii"), box.export(file_type="stl_ascii")]
        return [ball.export(file_type="stl"), *(text.encode() for text in texts), "".join(texts).encode()]
    if kind == "obj":
        objects = "mtllib part.mtl\no one\n" + _body(ball, 0) + "o two\nusemtl a\n" + _body(box, len(ball.vertices))
        return [ball.export(file_type="obj").encode(), objects.encode(), box.export(file_type="obj").encode()]
    return [ball.export(file_type="off").encode(), b"OFF\n5 1 0\n0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n5 0 1 2 3 4\n"]


def _body(mesh: trimesh.Trimesh, first: int) -> str:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices)
    return vertices + "".join(f"f {a} {b} {c}\n" for a, b, c in mesh.faces + 1 + first)


def _chunks(glb: bytes) -> tuple[dict[str, Any], bytes]:
    length = struct.unpack("<I", glb[12:16])[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def _embedded(glb: bytes) -> bytes:
    document, blob = _chunks(glb)
    document["buffers"] = [{"byteLength": len(blob), "uri": "data:;base64," + base64.b64encode(blob).decode()}]
    return json.dumps(document).encode()


def glb_of(document: dict[str, Any], blob: bytes) -> bytes:
    """The bytes of a .glb."""
    text = json.dumps(document).encode()
    text, blob = text + b" " * (-len(text) % 4), blob + b"\0" * (-len(blob) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def corrupted(kind: str, seed: int) -> Case:
    """The mesh file number `seed` of a format."""
    chance = random.Random(f"{kind} {seed}")
    data = chance.choice(valid(kind))
    intact = False
    if kind in ("glb", "gltf") and chance.random() < 0.7:
        document, blob = _chunks(data) if kind == "glb" else (json.loads(data), b"")
        for _ in range(chance.choice([1, 1, 2, 4])):
            _lie(document, chance)
        data = glb_of(document, blob) if kind == "glb" else json.dumps(document).encode()
        intact = chance.random() < 0.8
    if not intact and chance.random() < 0.4:
        data = _numbers(data, chance)
    elif not intact:
        for _ in range(chance.choice([1, 1, 2, 5, 20])):
            data = _damaged(data, chance)
    return Case(kind, f"mesh.{kind}", {f"mesh.{kind}": data}, {"out.bin": f"../{OUTSIDE}/part.bin"})


def _numbers(data: bytes, chance: random.Random) -> bytes:
    """Digits of a text, or bytes of a body, changed, so that the file may well be read."""
    changed = bytearray(data)
    digits = [k for k, byte in enumerate(data) if chr(byte).isdecimal()]
    start = data.find(b"end_header") + 12 if b"end_header" in data[:600] else 84
    for _ in range(chance.choice([1, 3, 10])):
        if b"\0" in data:
            changed[chance.randrange(start, len(data))] = chance.choice([0, 1, 63, 64, 127, 128, 191, 255])
        elif digits:
            changed[chance.choice(digits)] = ord(chance.choice("0123456789.-e"))
    return bytes(changed)


def _damaged(data: bytes, chance: random.Random) -> bytes:
    """Bytes cut, changed or doubled, a word replaced, or a count in the header made huge."""
    at, to = sorted(chance.choices(range(len(data) + 1), k=2))
    near = chance.randrange(min(len(data), 200) + 1)
    match chance.choice(DAMAGES):
        case "cut":
            return data[: chance.choice([0, near, at])]
        case "flip":
            junk = chance.choices([0, 255, 127, 128, chance.randrange(256)], k=chance.choice([1, 2, 4, 8]))
            return data[:at] + bytes(junk) + data[at + 1 :]
        case "header":
            junk = [b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0"]
            return data[:near] + chance.choice(junk) + data[near + 4 :]
        case "splice":
            return data[:at] + data[to:]
        case "double":
            return data[:to] + data[at:to] * chance.choice([1, 3, 100 if to - at < 2000 else 1]) + data[to:]
        case "token":
            words = data.split(b" ")
            words[chance.randrange(len(words))] = chance.choice(TOKENS)
            return b" ".join(words)
    digits = [k for k in range(min(len(data), 300)) if data[k : k + 1].isdigit()]
    near = chance.choice(digits) if digits else 0
    return data[:near] + chance.choice([b"99999999", b"4294967295", b"-1", b"0", b"9" * 30]) + data[near + 1 :]


def _spots(node: Any) -> list[tuple[Any, Any]]:
    found = []
    for key, part in list(node.items() if isinstance(node, dict) else enumerate(node)):
        found.append((node, key))
        if isinstance(part, dict | list):
            found += _spots(part)
    return found


def _lie(document: dict[str, Any], chance: random.Random) -> None:
    """Change the JSON: another value, a part left out or repeated, a cycle or chain of nodes, a forbidden file."""
    nodes = document.get("nodes")
    parent, key = chance.choice(_spots(document) or [({"a": 1}, "a")])
    match chance.choice(LIES):
        case "value":
            parts = [part for part in document.values() if isinstance(part, dict | list) and part]
            parent, key = chance.choice(_spots(chance.choice(parts)) if parts else [(document, "asset")])
            parent[key] = chance.choice(ABSURD)
        case "drop":
            del parent[key]
        case "cycle" if isinstance(nodes, list) and nodes and isinstance(nodes[-1], dict):
            nodes[-1]["children"] = [chance.randrange(len(nodes)) for _ in range(chance.choice([1, 2, 1000]))]
        case "deep":
            own = chance.choice([{"rotation": [0, 0.5, 0, 0.9]}, {"scale": [10, 10, 10]}, {}])
            chain = [{**own, "children": [k + 1]} for k in range(chance.choice([10, 1200, 20_000]))]
            document |= {"nodes": [*chain, {"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
        case "many":
            lists = [part for part in document.values() if isinstance(part, list) and part]
            for part in lists[:1] and [chance.choice(lists)]:
                part += [part[0]] * chance.choice([10, 1000, 20_000])
                if part is nodes:
                    document["scenes"] = [{"nodes": list(range(len(part)))}]
        case "elsewhere":
            more = [f"../{OUTSIDE}/part.bin", "out.bin", "..%2Foutside%2Fpart.bin", "data:;base64,*", "data:"]
            uri = chance.choice([*PATHS, *more])
            document |= {"buffers": [{"byteLength": 4096, "uri": uri}], "images": [{"uri": uri}]}


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
