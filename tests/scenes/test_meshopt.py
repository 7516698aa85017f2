"""meshopt-compressed glTF: the same triangles, and refused counts."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from shadowbench.scenes.meshes import read_meshes
from tests.scenes.conftest import refused
from tests.scenes.rigs import compressed_glb

BALL = trimesh.creation.icosphere(subdivisions=2)


def test_a_compressed_file_has_the_triangles_that_were_compressed(tmp_path: Path) -> None:
    for mode, width in (("TRIANGLES", 2), ("TRIANGLES", 4), ("INDICES", 2), ("INDICES", 4)):
        for extension in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
            path = tmp_path / "ball.glb"
            path.write_bytes(compressed_glb(BALL, extension, mode, width))
            (mesh,) = read_meshes(path).meshes
            assert cycles(mesh.vertices[mesh.faces]) == cycles(np.float32(BALL.vertices)[BALL.faces])
            assert not [note for note in read_meshes(path).notes if "meshopt" in note]


def cycles(triangles: np.ndarray) -> list[list[list[float]]]:
    """Sorted triangles, each from its smallest corner on, as the codec may begin one with another of its corners."""
    turned = []
    for corners in triangles.tolist():
        first = corners.index(min(corners))
        turned.append(corners[first:] + corners[:first])
    return sorted(turned)


def test_the_exponential_filter_is_undone(tmp_path: Path) -> None:
    path = tmp_path / "ball.glb"
    path.write_bytes(compressed_glb(BALL, positions="EXPONENTIAL"))
    (mesh,) = read_meshes(path).meshes
    assert np.linalg.norm(mesh.vertices, axis=1) == pytest.approx(1.0, abs=1e-3)
    assert len(mesh.faces) == len(BALL.faces)


def test_counts_that_do_not_fit_are_refused_before_decoding(tmp_path: Path) -> None:
    for change, words in (
        ({"byteLength": 10**6}, ["ends at byte"]),
        ({"count": 10**9}, ["1000000000 elements of 12 bytes", "1944"]),
        ({"byteStride": 10}, ["10 bytes are compressed"]),
        ({"filter": "QUATERNION"}, ["quaternion rows are 8 bytes"]),
        ({"byteOffset": 1}, ["cannot be read as .glb"]),
    ):
        path = tmp_path / "ball.glb"
        path.write_bytes(compressed_glb(BALL, change=change))
        refused(path, "ball.glb", *words)
