"""Scene files, study files and specs: valid ones with absurd values, keys and structure, and random text."""

import json
import re
import tomllib
from typing import Any

from hypothesis import strategies as st

from .cases import OBJ, OUTSIDE, ROOT, Case
from .toml import dumps
from .values import PATHS, number, replacement, text, three

TECHNIQUES = [
    "shadow-map",
    "cube-map",
    "cascades",
    "planar-projection",
    "shadow-volume",
    "ray-traced",
    "unshadowed",
    "light-samples",
    "soft-volume",
]

SCENES: list[dict[str, Any]] = [
    tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "scenes").glob("*.toml"))
] + [
    {"mesh": [{"file": "part.obj"}]},
    {
        "name": "all",
        "camera": {"position": [0, 1, 5], "target": [0, 0, 0], "fov_y": 40, "near": 0.1, "far": 9.0, "up": [0, 1, 0]},
        "light": [
            {"kind": "directional", "direction": [0.2, -1, 0], "angular_radius": 0.5},
            {"kind": "spot", "position": [0, 4, 0], "direction": [0, -1, 0], "angle": 60.0},
            {"kind": "point", "position": [0, 4, 0], "radius": 0.1},
        ],
        "mesh": [
            {"shape": "plane", "scale": 9.0, "planar": True},
            {"shape": "terrain", "cells": 8, "waves": 2.0, "seed": 4},
            {"shape": "stairs", "steps": 3, "rotate": [0, 30, 0], "casts": False},
            {"shape": "statue", "rings": 9, "sectors": 9, "folds": 3},
            {"shape": "leaves", "count": 20, "size": 0.2, "seed": 1, "color": [0.1, 0.2, 0.3]},
            {"shape": "sphere", "subdivisions": 1, "repeat": {"count": 3, "step": [1, 0, 0]}},
            {"file": "part.obj", "repeat": [{"count": 2, "step": [1, 0, 0]}, {"count": 2, "step": [0, 0, 2]}]},
        ],
    },
]
STUDIES: list[dict[str, Any]] = [
    tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "benchmarks").glob("*.toml"))
] + [
    {"scenes": ["cube-on-plane"]},
    {
        "scenes": ["scene.toml"],
        "view_size": 16,
        "rounds": 1,
        "phases": 2,
        "technique": [{"spec": "cascades", "size": 16}],
    },
    {
        "scenes": ["scene.toml"],
        "lights": [{"kind": "point", "position": [0, 3, 0]}],
        "technique": [{"spec": "cube-map"}],
    },
    {"scenes": ["scene.toml"], "map_size": 16, "technique": [{"spec": "shadow-map:bias=none"}]},
    {
        "scenes": ["cube-on-plane", "scene.toml"],
        "map_size": [16, 32],
        "view_size": 16,
        "rounds": 0,
        "phases": 2,
        "coordinates": "absolute",
        "time_limit": 5.0,
        "memory_limit": 1.5,
        "views": ["file", {"name": "near", "position": [0, 1, 3], "target": [0, 0, 0]}],
        "lights": ["file", {"kind": "directional", "direction": [0, -1, 0.5]}],
        "technique": [
            {
                "spec": "shadow-map:bias=slope(max=0.05,min=0.005)",
                "filter": ["hard", "pcf(taps=5)"],
                "bias_sweep": [1, 2],
            },
            {"spec": "cascades", "size": [16, 32]},
        ],
    },
]
SPECS = [
    "shadow-map:fit=scene,bias=slope(max=0.05,min=0.005),filter=pcf(taps=5),size=512",
    "shadow-map:preset=course",
    "cascades:size=64",
    "shadow-volume",
    "cube-map:size=256,bias=constant(0.005)",
    "ray-traced:samples=2",
    "light-samples:of=shadow-map(size=64,filter=pcf),n=2",
]

FACTORS = [0, -1, 0.5, 0.99, 1.01, 2, 3, 10, 1e-3, 1e3, 1e-9, 1e9, 1e-16, 1e16]


def places(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value below a node."""
    if not isinstance(node, dict | list):
        return [path]
    parts = node.items() if isinstance(node, dict) else enumerate(node)
    return ([path] if path else []) + [found for key, part in parts for found in places(part, (*path, key))]


def changed(node: Any, path: tuple[Any, ...], change: Any) -> Any:
    """A copy of the node with `change(parent, key)` applied to the parent of a path."""
    copy = dict(node) if isinstance(node, dict) else list(node)
    if len(path) == 1:
        change(copy, path[0])
    else:
        copy[path[0]] = changed(copy[path[0]], path[1:], change)
    return copy


@st.composite
def mutated(draw: st.DrawFn, seeds: list[dict[str, Any]]) -> dict[str, Any]:
    """A valid document after one to four changes."""
    document: dict[str, Any] = draw(st.sampled_from(seeds))
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 4]))):
        if not document:
            break
        numbers = [path for path in places(document) if type(value_at(document, path)) in (int, float)]
        if numbers and draw(st.booleans()):
            document = changed(document, draw(st.sampled_from(numbers)), _scaled(draw(st.sampled_from(FACTORS))))
        else:
            document = changed(document, draw(st.sampled_from(places(document))), _change(draw, draw(CHANGES)))
    return document


CHANGES = st.sampled_from(["value", "value", "path", "three", "drop", "rename", "repeat", "number", "number", "wrap"])


def value_at(node: Any, path: tuple[Any, ...]) -> Any:
    """The value at a path."""
    for key in path:
        node = node[key]
    return node


def _scaled(factor: float) -> Any:
    def change(parent: Any, key: Any) -> None:
        new = parent[key] * factor
        parent[key] = int(new) if isinstance(parent[key], int) and abs(new) < 1e15 else new

    return change


def _change(draw: st.DrawFn, kind: str) -> Any:
    def change(parent: Any, key: Any) -> None:
        if kind == "value":
            parent[key] = draw(replacement)
        elif kind == "number":
            parent[key] = draw(number)
        elif kind == "three":
            parent[key] = draw(three)
        elif kind == "path":
            parent[key] = draw(st.sampled_from(PATHS))
        elif kind == "drop":
            del parent[key]
        elif kind == "wrap":
            parent[key] = draw(st.sampled_from([[parent[key]], {"a": parent[key]}, str(parent[key])]))
        elif kind == "rename" and isinstance(parent, dict):
            parent[
                draw(st.sampled_from(["file", "shape", "repeat", "count", "spec", "size"]) | st.text(max_size=8))
            ] = parent.pop(key)
        elif kind == "repeat" and isinstance(parent, list):
            parent += [parent[key]] * draw(st.sampled_from([1, 20, 400]))

    return change


@st.composite
def broken(draw: st.DrawFn, seeds: list[dict[str, Any]]) -> bytes:
    """The text of a document with bytes removed, doubled, flipped or inserted; or text that is not TOML."""
    data = dumps(draw(mutated(seeds) | st.sampled_from(seeds))).encode("utf-8", "surrogatepass")
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.integers(0, len(data)))
        kind = draw(st.sampled_from(["cut", "splice", "junk", "double", "nest", "keys", "digits"]))
        if kind == "cut":
            data = data[:at]
        elif kind == "splice":
            data = data[:at] + data[draw(st.integers(0, len(data))) :]
        elif kind == "double":
            data += data[at : at + 2000]
        else:
            count = draw(st.sampled_from([1, 30, 500, 20_000]))
            junk = {"junk": draw(st.binary(max_size=12)), "nest": b"a=" + b"[" * count, "digits": b"=" + b"9" * count}
            data = data[:at] + junk.get(kind, b"\n" + b"a." * count + b"a = 1\n") + data[at:]
    return data


def written(documents: st.SearchStrategy[dict[str, Any]]) -> st.SearchStrategy[bytes]:
    """Documents as the bytes of a file."""
    return documents.map(lambda document: dumps(document).encode("utf-8", "surrogatepass"))


def companions(draw: st.DrawFn) -> tuple[dict[str, bytes], dict[str, str]]:
    """The files and links that PATHS name, beside a scene."""
    uri = draw(st.sampled_from([*PATHS, f"../{OUTSIDE}/part.bin", "data:,x", "data:;base64,AAAA", "data:;base64,*"]))
    files = {
        "data.bin": b"\0" * 64,
        "données.obj": OBJ,
        "mtl.obj": b"mtllib ../outside/part.obj\n" + OBJ,
        "mesh.gltf": json.dumps(
            {
                "asset": {"version": "2.0"},
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
                "buffers": [{"byteLength": 36, "uri": uri}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            }
        ).encode(),
    }
    random = draw(st.binary(max_size=200))
    for name in ("random.glb", "random.ply", "random.stl", "random.off"):
        files[name] = random
    return files, {
        "out.obj": f"../{OUTSIDE}/part.obj",
        "link": f"../{OUTSIDE}",
        "loop.obj": "loop.obj",
        "ghost.obj": "no",
    }


@st.composite
def scene_case(draw: st.DrawFn) -> Case:
    files, links = companions(draw)
    data = draw(written(mutated(SCENES)) | written(mutated(SCENES)) | broken(SCENES))
    name = "scène 1.toml" if draw(st.booleans()) else "scene.toml"
    return Case("scene", name, {**files, name: data}, links)


@st.composite
def study_case(draw: st.DrawFn) -> Case:
    files, links = companions(draw)
    data = draw(written(mutated(STUDIES)) | written(mutated(STUDIES)) | broken(STUDIES))
    files["scene.toml"] = b'[[mesh]]\nshape = "box"\n'
    return Case("study", "study.toml", {**files, "study.toml": data}, links)


text_part = (
    st.sampled_from(["size=", "bias=", "filter=", "fit=", "preset=", "slope", "pcf", "true", "nan", "inf"]) | text
)
MARKS = [
    "(",
    ")",
    ",",
    "=",
    ":",
    "a(",
    "-",
    ".",
    "e9",
    "9" * 5000,
    "((",
    "a=" * 300,
    "a(" * 400,
    "a(b(" * 3000,
    "\0",
    "",
]


@st.composite
def spec_case(draw: st.DrawFn) -> Case:
    text = draw(st.sampled_from(SPECS) | st.sampled_from(TECHNIQUES).map(lambda name: name + ":size=1"))
    if draw(st.booleans()):
        text = re.sub(r"\d+\.?\d*", lambda _: str(draw(number)), text, count=draw(st.integers(1, 3)))
        return Case("spec", "", text=text)
    head = text.find(":") + 1 if draw(st.booleans()) else 0
    for _ in range(draw(st.sampled_from([1, 1, 2, 4]))):
        spots = st.integers(min(head, len(text)), len(text))
        first, last = sorted(draw(st.tuples(spots, spots)))
        new = draw(st.sampled_from(MARKS) | number.map(str) | text_part) * draw(st.sampled_from([1, 1, 2, 50]))
        text = text[:first] + new + (text[last:] if draw(st.booleans()) else text[first:])
    return Case("spec", "", text=text)
