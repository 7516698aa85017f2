"""Scene files, study files and specs: valid ones with absurd values, keys and structure, and random text."""

import json
import re
import tomllib
from typing import Any

import tomli_w
from hypothesis import strategies as st

from .cases import OBJ, OUTSIDE, ROOT, Case
from .values import PATHS, number, replacement, text, three

SPECS = [
    "shadow-map:fit=scene,bias=slope(max=0.05,min=0.005),filter=pcf(taps=5),size=512",
    "shadow-map:preset=course",
    "cube-map:size=256,bias=constant(0.005)",
    "ray-traced:samples=2",
    "light-samples:of=shadow-map(size=64,filter=pcf),n=2",
    *(f"{name}:size=1" for name in ("cascades", "planar-projection", "shadow-volume", "unshadowed", "soft-volume")),
]
EVERY_SCENE = """
name = "all"
camera = { position = [0, 1, 5], target = [0, 0, 0], fov_y = 40, near = 0.1, far = 9.0, up = [0, 1, 0] }
light = [
    { kind = "directional", direction = [0.2, -1, 0], angular_radius = 0.5 },
    { kind = "spot", position = [0, 4, 0], direction = [0, -1, 0], angle = 60.0 },
    { kind = "point", position = [0, 4, 0], radius = 0.1 },
]
mesh = [
    { shape = "plane", scale = 9.0, planar = true },
    { shape = "terrain", cells = 8, waves = 2.0, seed = 4 },
    { shape = "stairs", steps = 3, rotate = [0, 30, 0], casts = false },
    { shape = "statue", rings = 9, sectors = 9, folds = 3 },
    { shape = "leaves", count = 20, size = 0.2, seed = 1, color = [0.1, 0.2, 0.3] },
    { shape = "sphere", subdivisions = 1, repeat = { count = 3, step = [1, 0, 0] } },
    { file = "part.obj", repeat = [{ count = 2, step = [1, 0, 0] }, { count = 2, step = [0, 0, 2] }] },
]
"""
EVERY_STUDY = """
scenes = ["cube-on-plane", "scene.toml"]
map_size = [16, 32]
view_size = 16
rounds = 0
phases = 2
coordinates = "absolute"
time_limit = 5.0
memory_limit = 1.5
views = ["file", { name = "near", position = [0, 1, 3], target = [0, 0, 0] }]
lights = ["file", { kind = "directional", direction = [0, -1, 0.5] }]
[[technique]]
spec = "shadow-map:bias=slope(max=0.05,min=0.005)"
filter = ["hard", "pcf(taps=5)"]
bias_sweep = [1, 2]
[[technique]]
spec = "cascades"
size = [16, 32]
"""
SCENES: list[dict[str, Any]] = [
    *(tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "scenes").glob("*.toml"))),
    {"mesh": [{"file": "part.obj"}]},
    tomllib.loads(EVERY_SCENE),
]
LAMP = {"kind": "point", "position": [0, 3, 0]}
STUDIES: list[dict[str, Any]] = [
    *(tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "benchmarks").glob("*.toml"))),
    {"scenes": ["cube-on-plane"]},
    {"scenes": ["scene.toml"], "view_size": 16, "rounds": 1, "technique": [{"spec": "cascades", "size": 16}]},
    {"scenes": ["scene.toml"], "lights": [LAMP], "technique": [{"spec": "cube-map"}]},
    {"scenes": ["scene.toml"], "map_size": 16, "technique": [{"spec": "shadow-map:bias=none"}]},
    tomllib.loads(EVERY_STUDY),
]
FACTORS = [0, -1, 0.5, 0.99, 1.01, 2, 3, 10, 1e-3, 1e3, 1e-9, 1e9, 1e-16, 1e16]
CHANGES = [
    "scale",
    "scale",
    "scale",
    "scale",
    "value",
    "value",
    "path",
    "three",
    "drop",
    "rename",
    "repeat",
    "number",
    "number",
    "wrap",
]
KEYS = st.sampled_from(["file", "shape", "repeat", "count", "spec", "size"]) | st.text(max_size=8)


def places(node: Any) -> list[tuple[Any, Any]]:
    """The parent and key of every value below a node."""
    found = []
    for key, part in node.items() if isinstance(node, dict) else enumerate(node):
        found += [(node, key), *(places(part) if isinstance(part, dict | list) else [])]
    return found


@st.composite
def mutated(draw: st.DrawFn, seeds: list[dict[str, Any]]) -> dict[str, Any]:
    """A valid document after one to four changes."""
    document: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(seeds))))
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 4]))):
        numbers = [(parent, key) for parent, key in places(document) if type(parent[key]) in (int, float)]
        kind = draw(st.sampled_from(CHANGES))
        spots = numbers if kind == "scale" else places(document)
        if not spots:
            continue
        parent, key = draw(st.sampled_from(spots))
        if kind == "scale":
            scaled = parent[key] * draw(st.sampled_from(FACTORS))
            parent[key] = int(scaled) if isinstance(parent[key], int) and abs(scaled) < 1e15 else scaled
        elif kind == "drop":
            del parent[key]
        elif kind == "rename":
            if isinstance(parent, dict):
                parent[draw(KEYS)] = parent.pop(key)
        elif kind == "repeat":
            if isinstance(parent, list):
                parent += [parent[key]] * draw(st.sampled_from([1, 20, 400]))
        elif kind == "wrap":
            parent[key] = draw(st.sampled_from([[parent[key]], {"a": parent[key]}, str(parent[key])]))
        else:
            values = {"value": replacement, "number": number, "three": three, "path": st.sampled_from(PATHS)}
            parent[key] = draw(values[kind])
    return document


def written(document: dict[str, Any]) -> bytes:
    return tomli_w.dumps(document).encode("utf-8", "surrogatepass")


@st.composite
def broken(draw: st.DrawFn, seeds: list[dict[str, Any]]) -> bytes:
    """The text of a document with bytes removed, doubled, flipped or inserted; or text that is not TOML."""
    data = written(draw(mutated(seeds) | st.sampled_from(seeds)))
    for _ in range(draw(st.integers(1, 5))):
        at, to = draw(st.integers(0, len(data))), draw(st.integers(0, len(data)))
        count = draw(st.sampled_from([1, 30, 500, 20_000]))
        data = draw(
            st.sampled_from([
                data[:at],
                data[:at] + data[to:],
                data + data[at : at + 2000],
                data[:at] + draw(st.binary(max_size=12)) + data[at:],
                data[:at] + b"a=" + b"[" * count + data[at:],
                data[:at] + b"=" + b"9" * count + data[at:],
                data[:at] + b"\n" + b"a." * count + b"a = 1\n" + data[at:],
            ])
        )  # fmt: skip
    return data


def companions(draw: st.DrawFn) -> tuple[dict[str, bytes], dict[str, str]]:
    """The files and links that PATHS name, beside a scene."""
    uri = draw(st.sampled_from([*PATHS, f"../{OUTSIDE}/part.bin", "data:,x", "data:;base64,AAAA", "data:;base64,*"]))
    gltf = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": 36, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    }
    junk = draw(st.binary(max_size=200))
    files = {"données.obj": OBJ, "mesh.gltf": json.dumps(gltf).encode()}
    files |= {f"random.{suffix}": junk for suffix in ("glb", "ply", "stl", "off")}
    links = {"out.obj": f"../{OUTSIDE}/part.obj", "link": f"../{OUTSIDE}", "loop.obj": "loop.obj", "ghost.obj": "no"}
    return files, links


def document(seeds: list[dict[str, Any]]) -> st.SearchStrategy[bytes]:
    """The bytes of a file, more often of a valid TOML than not."""
    return mutated(seeds).map(written) | mutated(seeds).map(written) | broken(seeds)


@st.composite
def scene_case(draw: st.DrawFn) -> Case:
    files, links = companions(draw)
    name = draw(st.sampled_from(["scène 1.toml", "scene.toml"]))
    return Case("scene", name, {**files, name: draw(document(SCENES))}, links)


@st.composite
def study_case(draw: st.DrawFn) -> Case:
    files, links = companions(draw)
    files["scene.toml"] = b'[[mesh]]\nshape = "box"\n'
    return Case("study", "study.toml", {**files, "study.toml": draw(document(STUDIES))}, links)


PARTS = st.sampled_from(["size=", "bias=", "filter=", "fit=", "preset=", "slope", "pcf", "true", "nan", "inf"]) | text
MARKS = [*"(),=:-.", "a(", "e9", "9" * 5000, "((", "a=" * 300, "a(" * 400, "a(b(" * 3000, "\0", ""]


@st.composite
def spec_case(draw: st.DrawFn) -> Case:
    text = draw(st.sampled_from(SPECS))
    if draw(st.booleans()):
        text = re.sub(r"\d+\.?\d*", lambda _: str(draw(number)), text, count=draw(st.integers(1, 3)))
        return Case("spec", "", text=text)
    head = text.find(":") + 1 if draw(st.booleans()) else 0
    for _ in range(draw(st.sampled_from([1, 1, 2, 4]))):
        spots = st.integers(min(head, len(text)), len(text))
        first, last = sorted(draw(st.tuples(spots, spots)))
        new = draw(st.sampled_from(MARKS) | number.map(str) | PARTS) * draw(st.sampled_from([1, 1, 2, 50]))
        text = text[:first] + new + (text[last:] if draw(st.booleans()) else text[first:])
    return Case("spec", "", text=text)
