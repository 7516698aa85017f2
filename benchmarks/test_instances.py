"""A hundred instances of a mesh of 1.3 million triangles: loaded, traced and drawn within 4 GiB.

    pytest -s benchmarks/test_instances.py

prints the most memory that the command and its worker had resident at one time, and the seconds of each of its steps.
"""

import json
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil

SIDES = (1000, 650)
"""Quadrilaterals along and around a ring: 1.3 million triangles."""
MOST = 4 << 30  # bytes
STEPS = """
import sys, time
import shadowbench as sb
start = time.perf_counter()
def done(name, result):
    global start
    print(f"{name} {time.perf_counter() - start:.1f} s: {result!r}", flush=True)
    start = time.perf_counter()
    return result
if __name__ == "__main__":
    scene = done("load", sb.load(sys.argv[1]))
    truth = done("truth", sb.truth(scene))
    drawn = done("render", sb.render(scene, "shadow-map:size=2048"))
    done("score", sb.score(drawn.visibility, truth)["iou"])
    open(sys.argv[2], "wb").write(drawn._repr_png_())
"""


def ring() -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) float32 vertices and (F, 3) uint32 faces of a closed, bumpy ring."""
    long, short = SIDES
    along, around = np.meshgrid(*(np.arange(n) * (2 * np.pi / n) for n in SIDES), indexing="ij")
    thick = 0.3 + 0.03 * np.sin(17 * along) * np.sin(11 * around) + 0.01 * np.sin(90 * along + 40 * around)
    out = 1.0 + thick * np.cos(around)
    vertices = np.stack([out * np.cos(along), thick * np.sin(around), out * np.sin(along)], axis=-1)
    i, j = np.meshgrid(np.arange(long), np.arange(short), indexing="ij")
    a, b, c, d = ((i + di) % long * short + (j + dj) % short for di, dj in ((0, 0), (0, 1), (1, 1), (1, 0)))
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=-2)
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.uint32)


def crowd(path: Path, instances: int = 100) -> Path:
    """A .glb of a ring drawn many times by EXT_mesh_gpu_instancing, in a square, each turned another way."""
    vertices, faces = ring()
    random, side = np.random.default_rng(0), round(instances**0.5)
    places = np.stack([*np.divmod(np.arange(instances), side), random.random(instances)], axis=1)
    turns = random.normal(size=(instances, 4))
    arrays = [
        (vertices, "VEC3", 5126),
        (faces.ravel(), "SCALAR", 5125),
        ((places[:, [0, 2, 1]] * [2.0, 1.0, 2.0]).astype(np.float32), "VEC3", 5126),
        ((turns / np.linalg.norm(turns, axis=1, keepdims=True)).astype(np.float32), "VEC4", 5126),
    ]
    starts = np.cumsum([0, *(values.nbytes for values, _, _ in arrays)]).tolist()
    instances = {"TRANSLATION": 2, "ROTATION": 3}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "nodes": [
            {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "ROTATION": 3}}}}
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": k, "componentType": code, "count": len(values), "type": kind}
            for k, (values, kind, code) in enumerate(arrays)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": values.nbytes}
            for start, (values, _, _) in zip(starts, arrays, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1]}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + starts[-1], len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", starts[-1], 0x004E4942))
        for values, _, _ in arrays:
            file.write(values.tobytes())
    return path


def resident(process: psutil.Process) -> int:
    """Bytes that a process and those that it started have resident."""
    total = 0
    with suppress(psutil.NoSuchProcess):
        for each in (process, *process.children(recursive=True)):
            with suppress(psutil.NoSuchProcess):
                total += each.memory_info().rss
    return total


def test_a_hundred_instances_of_a_large_mesh_take_at_most_4_gib(tmp_path: Path) -> None:
    program = tmp_path / "steps.py"
    program.write_text(STEPS)
    command = [sys.executable, str(program), str(crowd(tmp_path / "crowd.glb")), str(tmp_path / "crowd.png")]
    most = 0
    with subprocess.Popen(command) as running:
        watched = psutil.Process(running.pid)
        while running.poll() is None:
            most = max(most, resident(watched))
            time.sleep(0.05)
    print(f"most resident: {most / 2**30:.2f} GiB; picture: {tmp_path / 'crowd.png'}")
    assert running.returncode == 0
    assert most <= MOST
