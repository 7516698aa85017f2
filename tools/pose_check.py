"""Compare poses of glTF files with an evaluation by hand in plain Python, and with Blender's.

python tools/pose_check.py FILE... [--blender PYTHON]

Of the first clip the first and the last key and one at a third are posed, where Blender's interpolation does not count.
Printed is the largest distance of corners from those evaluated by hand, and of vertices from the nearest ones of
Blender's and the other way round, as a share of the diagonal. PYTHON: an interpreter that can import bpy. Exit code 1
for more than 1e-5.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from shadowbench.scenes.gltf import read_gltf
from shadowbench.scenes.gltf_pose import Moment
from shadowbench.scenes.triangles import Triangles, transformed

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.scenes.pose_reference import Reference

LARGEST = 1e-5
# Blender's z is up: its (x, y, z) is (x, z, −y) in glTF.
BLENDER = """
import json, sys
import bpy, numpy as np
file, out, times = sys.argv[-3:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=file, disable_bone_shape=True)
scene, found = bpy.context.scene, {}
for time in json.loads(times):
    frame = time * scene.render.fps / scene.render.fps_base
    scene.frame_set(int(frame), subframe=frame - int(frame))
    graph, points = bpy.context.evaluated_depsgraph_get(), []
    for one in scene.objects:
        if one.type == "MESH":
            mesh = one.evaluated_get(graph).to_mesh()
            local = np.empty(3 * len(mesh.vertices))
            mesh.vertices.foreach_get("co", local)
            matrix = np.array(one.evaluated_get(graph).matrix_world)
            points.append(local.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
    x, y, z = np.concatenate(points).T
    found[str(time)] = np.stack([x, z, -y], axis=1)
np.savez(out, **found)
"""


def main() -> int:
    """Print a line for each file and time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--blender", metavar="PYTHON")
    asked = parser.parse_args()
    largest = 0.0
    print("| file | vertices | time, s | by hand | Blender |\n|---|---|---|---|---|")
    for file in asked.files:
        times = _key_times(file)
        theirs = _blender(asked.blender, file, times) if asked.blender else {}
        for time in times:
            corners = [part for part in _corners(file, time) if len(part)]
            points = np.concatenate([part.reshape(-1, 3) for part in corners])
            diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
            by_hand = [np.array(part) for part in Reference(file, 0 if times != [0.0] else None, time).corners()]
            differences = [
                min(_farthest(mine - hand), _farthest(mine - hand[:, ::-1]))  # a mirrored one is turned
                for mine, hand in zip(corners, by_hand, strict=True)
            ]
            shares, unique = [max(differences) / diagonal], np.unique(points, axis=0)
            if theirs:
                blender = theirs[str(time)]
                ways = (KDTree(blender).query(unique)[0].max(), KDTree(unique).query(blender)[0].max())
                shares.append(float(max(ways)) / diagonal)
            largest = max(largest, *shares)
            columns = [file.name, len(unique), f"{time:.4g}", *(f"{share:.1e}" for share in shares)]
            print("|", " | ".join(map(str, columns)), "|", flush=True)
    return int(largest > LARGEST)


def _farthest(difference: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(difference, axis=-1).max())


def _corners(file: Path, time: float) -> list[NDArray[np.float64]]:
    """(F, 3, 3) corners of each mesh in the world."""
    found = []
    for mesh, matrix in read_gltf(file, file.name, Moment(time)).instances:
        moved = transformed(Triangles(mesh.vertices, mesh.faces), matrix)
        found.append(moved.vertices[moved.faces])
    return found


def _key_times(file: Path) -> list[float]:
    """First key, one at a third, and last key of the first channel of the first clip; 0 without clips."""
    reference = Reference(file, None)
    if not reference.json.get("animations"):
        return [0.0]
    keys = reference.times(0)
    return sorted({keys[0], keys[len(keys) // 3], keys[-1]})


def _blender(python: str, file: Path, times: list[float]) -> dict[str, NDArray[np.float64]]:
    """(V, 3) vertices in the world by time."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.npz"
        command = [python, "-c", BLENDER, str(file.resolve()), str(out), json.dumps(times)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with np.load(out) as found:
            return dict(found)


if __name__ == "__main__":
    sys.exit(main())
