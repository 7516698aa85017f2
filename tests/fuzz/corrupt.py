"""Small valid mesh files of each format, and deterministic ways to corrupt them."""

import base64
import json
import random
import struct
from functools import cache
from typing import Any

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb

from .cases import OUTSIDE, Case
from .values import PATHS

FORMATS = ("glb", "gltf", "obj", "ply", "stl", "off")
ABSURD = [
    0,
    1,
    -1,
    2,
    3,
    255,
    256,
    65535,
    65536,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**32,
    2**40,
    2**63,
    10**30,
    0.5,
    1e300,
    float("nan"),
    float("inf"),
    None,
    True,
    "x",
    "",
    [],
    {},
    [[]],
    [1] * 50,
    "../../etc/passwd",
    "\ud800",
]
TOKENS = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"1e19",
    b"-1",
    b"0",
    b"99999999",
    b"4294967296",
    b"9" * 400,
    b"9" * 5000,
    b"x",
    b"",
    b"\0",
    b"\xff\xfe",
    b"1.5.2",
    b"0x10",
    b"1_000",
    b"\xe2\x88\x9e",
    b"-0",
    b"1e-320",
    b"//",
    b"1//1",
    b"/",
]


@cache
def valid(kind: str) -> list[bytes]:
    """Valid files of a format: text and binary, one mesh and several, plain and compressed."""
    ball, box = trimesh.creation.icosphere(subdivisions=1), trimesh.creation.box()
    two = trimesh.Scene({"ball": ball, "box": box.copy().apply_translation([2, 0, 0])})
    two.add_geometry(box, node_name="again", transform=np.diag([-2.0, 1.0, 1.0, 1.0]))
    if kind == "glb":
        draco = export_glb(trimesh.Scene(ball), extension_draco=True)
        assert b"KHR_draco_mesh_compression" in draco
        return [export_glb(trimesh.Scene(box)), export_glb(two), draco, export_glb(two, extension_draco=True)]
    if kind == "gltf":
        return [_embedded(data) for data in valid("glb")]
    if kind == "ply":
        return [ball.export(file_type="ply", encoding=encoding) for encoding in ("ascii", "binary")]
    if kind == "stl":
        texts = [ball.export(file_type="stl_ascii"), box.export(file_type="stl_ascii")]
        return [ball.export(file_type="stl"), *(text.encode() for text in texts), "".join(texts).encode()]
    if kind == "obj":
        objects = "o one\n" + _body(ball, 0) + "o two\nusemtl a\n" + _body(box, len(ball.vertices))
        return [
            ball.export(file_type="obj").encode(),
            ("mtllib part.mtl\n" + objects).encode(),
            box.export(file_type="obj").encode(),
        ]
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


def _glb(document: dict[str, Any], blob: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def corrupted(kind: str, seed: int) -> Case:
    """The mesh file number `seed` of a format."""
    chance = random.Random(f"{kind} {seed}")
    data = chance.choice(valid(kind))
    if kind in ("glb", "gltf") and chance.random() < 0.7:
        document, blob = _chunks(data) if kind == "glb" else (json.loads(data), b"")
        for _ in range(chance.choice([1, 1, 2, 4])):
            chance.choice([_lie, _lie, _lie, _lie, _drop, _cycle, _deep, _many, _elsewhere])(document, chance)
        data = _glb(document, blob) if kind == "glb" else json.dumps(document).encode()
        if chance.random() < 0.8:
            return Case(kind, f"mesh.{kind}", {f"mesh.{kind}": data}, {"out.bin": f"../{OUTSIDE}/part.bin"})
    if chance.random() < 0.4:
        return Case(kind, f"mesh.{kind}", {f"mesh.{kind}": _numbers(data, chance)})
    for _ in range(chance.choice([1, 1, 2, 5, 20])):
        data = chance.choice(
            [_truncate, _flip, _flip, _header, _header, _splice, _double, _token, _token, _token, _count, _count]
        )(data, chance)
    return Case(kind, f"mesh.{kind}", {f"mesh.{kind}": data})


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


def _truncate(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.choice([0, chance.randint(0, 100), chance.randint(0, len(data))])]


def _flip(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    return (
        data[:at]
        + bytes(chance.choices([0, 255, 127, 128, chance.randrange(256)], k=chance.choice([1, 2, 4, 8])))
        + data[at + 1 :]
    )


def _header(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(min(len(data), 200) + 1)
    return (
        data[:at]
        + chance.choice([b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0"])
        + data[at + 4 :]
    )


def _splice(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randint(0, len(data))] + data[chance.randint(0, len(data)) :]


def _double(data: bytes, chance: random.Random) -> bytes:
    at, to = sorted(chance.choices(range(len(data) + 1), k=2))
    return data[:to] + data[at:to] * chance.choice([1, 3, 100 if to - at < 2000 else 1]) + data[to:]


def _token(data: bytes, chance: random.Random) -> bytes:
    """A word of a text file, or of bytes that resemble one, replaced."""
    words = data.split(b" ")
    words[chance.randrange(len(words))] = chance.choice(TOKENS)
    return b" ".join(words)


def _count(data: bytes, chance: random.Random) -> bytes:
    """A count in a file's header made huge."""
    head, rest = data[:300], data[300:]
    digits = [k for k in range(len(head)) if head[k : k + 1].isdigit()]
    at = chance.choice(digits) if digits else 0
    return head[:at] + chance.choice([b"99999999", b"4294967295", b"-1", b"0", b"9" * 30]) + head[at + 1 :] + rest


def _spots(node: Any) -> list[tuple[Any, Any]]:
    found = []
    for key, part in list(node.items() if isinstance(node, dict) else enumerate(node)):
        found.append((node, key))
        if isinstance(part, dict | list):
            found += _spots(part)
    return found


def _lie(document: dict[str, Any], chance: random.Random) -> None:
    """A value of the JSON replaced: a count, offset, index or type."""
    parts = [part for part in document.values() if isinstance(part, dict | list) and part]
    parent, key = chance.choice(_spots(chance.choice(parts)) if parts else [(document, "asset")])
    parent[key] = chance.choice(ABSURD)


def _drop(document: dict[str, Any], chance: random.Random) -> None:
    parent, key = chance.choice(_spots(document) or [({"a": 1}, "a")])
    if key in parent if isinstance(parent, dict) else key < len(parent):
        del parent[key]


def _cycle(document: dict[str, Any], chance: random.Random) -> None:
    nodes = document.get("nodes")
    if isinstance(nodes, list) and nodes and isinstance(nodes[-1], dict):
        nodes[-1]["children"] = [chance.randrange(len(nodes)) for _ in range(chance.choice([1, 2, 1000]))]


def _deep(document: dict[str, Any], chance: random.Random) -> None:
    depth = chance.choice([10, 1200, 20_000])
    kind = chance.choice(["rotate", "scale", "plain"])
    own: dict[str, Any] = {"rotate": {"rotation": [0, 0.5, 0, 0.9]}, "scale": {"scale": [10, 10, 10]}}.get(kind, {})
    document["nodes"] = [{**own, "children": [k + 1]} for k in range(depth)] + [{"mesh": 0}]
    document["scenes"] = [{"nodes": [0]}]
    document["scene"] = 0


def _many(document: dict[str, Any], chance: random.Random) -> None:
    """A part of the document repeated many times: nodes of one mesh, primitives of one accessor."""
    lists = [part for part in document.values() if isinstance(part, list) and part]
    if lists:
        part = chance.choice(lists)
        part += [part[0]] * chance.choice([10, 1000, 20_000])
        if part is document.get("nodes"):
            document["scenes"] = [{"nodes": list(range(len(part)))}]


def _elsewhere(document: dict[str, Any], chance: random.Random) -> None:
    """A buffer or image with a path that must not be read."""
    uri = chance.choice(
        [
            *PATHS,
            f"../{OUTSIDE}/part.bin",
            "out.bin",
            "..%2Foutside%2Fpart.bin",
            "data:;base64,*",
            "data:;base64,AA==",
            "data:",
        ]
    )
    document["buffers"] = [{"byteLength": 4096, "uri": uri}]
    document["images"] = [{"uri": uri}]
