"""Scenes, studies, specs and mesh files that are changed at random: each is read, or refused in one line.

`FUZZ=10000 pytest tests/test_generated_files.py -m exhaustive` tries so many of each kind.
"""

import base64
import json
import os
import resource
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import tomli_w
import trimesh
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from trimesh.exchange.gltf import export_glb

from shadowbench.errors import InputError
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.studies.study import read_study
from tests.scenes.rigs import compressed_glb, glb_of, morphed_skin, two_skins

MEMORY = 4 << 30
"""Bytes of address space that reading a file may take."""
ROOT = Path(__file__).resolve().parents[1]
BALL, BOX = trimesh.creation.icosphere(subdivisions=1), trimesh.creation.box()
SCENE = """
camera = { position = [0, 1, 5], target = [0, 0, 0], fov_y = 40, near = 0.1, far = 9.0, up = [0, 1, 0] }
light = [
    { kind = "directional", direction = [0.2, -1, 0], angular_radius = 0.5 },
    { kind = "spot", position = [0, 4, 0], direction = [0, -1, 0], angle = 60.0 },
]
mesh = [
    { shape = "terrain", cells = 8, waves = 2.0, seed = 4 },
    { shape = "leaves", count = 20, size = 0.2, rotate = [0, 30, 0], color = [0.1, 0.2, 0.3] },
    { file = "mesh.obj", repeat = [{ count = 2, step = [1, 0, 0] }, { count = 2, step = [0, 0, 2] }] },
]
"""
STUDY = """
scenes = ["cube-on-plane", "scene.toml"]
map_size = [16, 32]
view_size = 16
views = ["file", { name = "near", position = [0, 1, 3], target = [0, 0, 0] }]
lights = ["file", { kind = "directional", direction = [0, -1, 0.5] }]
technique = [{ spec = "shadow-map:bias=slope", filter = ["hard", "pcf(taps=5)"], bias_sweep = [1, 2] }]
"""
SPECS = [
    "shadow-map:fit=scene,bias=slope(max=0.05,min=0.005),filter=pcf(taps=5),size=512",
    "light-samples:of=shadow-map(size=64,filter=pcf),n=2",
]
DOCUMENTS = {
    "scene.toml": [SCENE, *(file.read_text() for file in (ROOT / "scenes").glob("t*.toml"))],
    "study.toml": [STUDY, *(file.read_text() for file in (ROOT / "benchmarks").glob("s*.toml"))],
}
TWO = trimesh.Scene({"ball": BALL, "box": BOX.copy().apply_translation([2, 0, 0])})
OBJECTS = "o one\n" + BALL.export(file_type="obj") + "o two\nusemtl a\nf -1 -2 -3\n"
FILES: dict[str, list[bytes]] = {
    "mesh.glb": [
        export_glb(TWO),
        export_glb(trimesh.Scene(BALL), extension_draco=True),
        compressed_glb(BALL),
        compressed_glb(BOX, "KHR_meshopt_compression", "INDICES"),
        morphed_skin().glb(),
        two_skins().glb(),
    ],
    "mesh.obj": [OBJECTS.encode()],
    "mesh.ply": [BALL.export(file_type="ply", encoding=encoding) for encoding in ("ascii", "binary")],
    "mesh.stl": [BALL.export(file_type="stl"), BOX.export(file_type="stl_ascii").encode()],
    "mesh.off": [BALL.export(file_type="off").encode(), b"OFF\n4 1 0\n0 0 0\n1 0 0\n2 1 0\n1 2 0\n4 0 1 2 3\n"],
}
TEXTS = ["", " ", "nan", "é", "\0", "\x1b[31m", "💥" * 90, "a" * 5000, "../outside.obj", "/dev/zero", "box", "mesh.obj"]
numbers = (
    st.sampled_from([0, -1, 1e-320, 1e-18, 1e19, 1e154, float("inf"), float("nan"), 2**31, 2**63, 10**30])
    | st.integers()
    | st.floats()
)
values: st.SearchStrategy[Any] = st.recursive(
    numbers | st.sampled_from(TEXTS) | st.text(max_size=20) | st.booleans(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)
WORDS = [b"nan", b"-inf", b"1e999", b"-1", b"0", b"x", b"99999999", b"4294967296", b"9" * 5000, b"", b"1//1", b"\0"]


def places(node: Any) -> Iterator[tuple[Any, Any]]:
    """The parent and key of every value below a node."""
    for key, part in list(node.items() if isinstance(node, dict) else enumerate(node)):
        yield node, key
        if isinstance(part, dict | list):
            yield from places(part)


@st.composite
def changed(draw: st.DrawFn, documents: list[dict[str, Any]]) -> dict[str, Any]:
    """A document of which one to four parts are left out, repeated, scaled or replaced."""
    document: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(documents))))
    for _ in range(draw(st.sampled_from([1, 1, 2, 4]))):
        spots = [*places(document)]
        kind = draw(st.sampled_from(["scale", "scale", "replace", "leave out", "repeat"]))
        if kind == "scale":
            spots = [(parent, key) for parent, key in spots if type(parent[key]) in (int, float)]
        if not spots:
            continue
        parent, key = draw(st.sampled_from(spots))
        if kind == "scale":
            factor = draw(st.sampled_from([0, -1, 0.5, 2, 10, 1e-9, 1e9]))
            parent[key] = type(parent[key])(parent[key] * factor)
        elif kind == "leave out":
            del parent[key]
        elif kind == "repeat" and isinstance(parent, list):
            parent += [parent[key]] * draw(st.sampled_from([1, 400, 20_000]))
        else:
            parent[key] = draw(values)
    return document


@st.composite
def damaged(draw: st.DrawFn, files: list[bytes]) -> bytes:
    """A file that is cut short, doubled in part, or in which some bytes or words are others."""
    data = draw(st.sampled_from(files))
    for _ in range(draw(st.sampled_from([1, 1, 2, 5]))):
        at, to = sorted(draw(st.tuples(*[st.integers(0, len(data))] * 2)))
        words = data.split(b" ")
        words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(WORDS))
        header = draw(st.integers(0, min(len(data), 200)))
        other = data[:header] + draw(st.binary(min_size=1, max_size=8)) + data[header + 4 :]
        cut, doubled = data[:at] + data[to:], data[:to] + data[at:]
        data = draw(st.sampled_from([data[:at], cut, doubled, other, b" ".join(words)]))
    return data


@st.composite
def changed_gltf(draw: st.DrawFn, embedded: bool) -> bytes:
    """A .glb whose JSON is changed, or if `embedded` a .gltf that has its buffer in itself."""
    data = draw(st.sampled_from(FILES["mesh.glb"]))
    length = int.from_bytes(data[12:16], "little")
    document, blob = json.loads(data[20 : 20 + length]), data[28 + length :]
    if embedded:
        uri = "data:;base64," + base64.b64encode(blob).decode()
        document["buffers"] = [{"byteLength": len(blob), "uri": uri}, *document["buffers"][1:]]
    document = draw(changed([document]))
    return json.dumps(document).encode() if embedded else glb_of(document, blob)


KINDS: dict[str, st.SearchStrategy[bytes]] = {
    "spec": damaged([spec.encode() for spec in SPECS]),
    "mesh.gltf": changed_gltf(embedded=True),
    **{name: damaged(files) for name, files in FILES.items()},
}
KINDS["mesh.glb"] |= changed_gltf(embedded=False)
for name, texts in DOCUMENTS.items():
    made = changed([tomllib.loads(text) for text in texts]).map(lambda document: tomli_w.dumps(document).encode())
    KINDS[name] = made | damaged([text.encode() for text in texts])


@contextmanager
def limited_memory() -> Iterator[None]:
    """Lets this process take MEMORY more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + MEMORY, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def read(kind: str, file: Path, data: bytes) -> None:
    """Read a file or a spec. Raises InputError."""
    if kind == "spec":
        spec = parse_spec(data.decode(errors="replace"), techniques())
        assert parse_spec(spec.full_text, techniques()) == spec
    elif kind == "study.toml":
        assert next(read_study(file, techniques()).blocks())
    else:
        scene = load_scene(file)
        assert scene.meshes and np.isfinite(scene.geometry.vertices).all()
        assert scene.geometry.faces.min() >= 0 and scene.geometry.faces.max() < len(scene.geometry.vertices)
        view, _ = view_of(scene, scene.cameras[0], scene.lights[0], 8).placed()
        assert np.isfinite([*view.near_far, *view.camera.position]).all()


@pytest.mark.parametrize(
    "count", [12, pytest.param(int(os.environ.get("FUZZ", "500")), marks=[pytest.mark.slow, pytest.mark.exhaustive])]
)
@pytest.mark.parametrize("kind", KINDS)
def test_every_file_is_read_or_refused_in_one_line(kind: str, count: int, tmp_path: Path) -> None:
    (tmp_path / "mesh.obj").write_bytes(FILES["mesh.obj"][0])
    (tmp_path / "scene.toml").write_text('[[mesh]]\nshape = "box"')

    def judge(data: bytes) -> None:
        file = tmp_path / kind
        if kind != "spec":
            file.write_bytes(data)
        try:
            with limited_memory():
                read(kind, file, data)
        except InputError as error:
            line, cause = str(error), error.__cause__
        else:
            return
        assert line.isprintable()
        assert len(line) < 3000
        assert not isinstance(cause, MemoryError)

    options = {"phases": [Phase.generate], "database": None, "suppress_health_check": list(HealthCheck)}
    seed(0)(settings(max_examples=count, deadline=30_000, **options)(given(KINDS[kind])(judge)))()
