"""Scenes of more triangles than one list may have, whose instances share theirs."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.errors import TooLarge
from shadowbench.scenes.instanced import InstancedGeometry
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.mesh import Mesh
from shadowbench.scenes.model import Scene
from shadowbench.scenes.placed import placed
from tests.crowds import CROWD, expanded_and_instanced
from tests.scenes.conftest import refused

LEAVES = """
[[mesh]]
shape = "plane"
mask = "leaf.png"
repeat = [{ count = 4, step = [3, 0, 0] }]
"""


@pytest.fixture
def crowd_file(scene_file: Callable[..., Path]) -> Path:
    return scene_file(CROWD)


@pytest.fixture(params=["file", "local"])
def crowd(request: pytest.FixtureRequest, crowd_file: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Scene, Scene]:
    scenes = expanded_and_instanced(crowd_file, monkeypatch)
    return scenes if request.param == "file" else tuple(scene.placement.scene(scene) for scene in scenes)


def test_instances_are_to_the_bit_what_they_are_expanded(crowd: tuple[Scene, Scene]) -> None:
    flat, shared = (scene.geometry for scene in crowd)
    assert not isinstance(flat, InstancedGeometry) and isinstance(shared, InstancedGeometry)
    every = np.arange(flat.count)
    chosen = shared.select(every)
    assert shared.count == flat.count and shared.caster_count == flat.caster_count
    for name in ("bounds", "caster_bounds"):
        assert np.array_equal(getattr(shared, name), getattr(flat, name)), name
    for name in ("normals", "shading_normals", "colors", "casts", "receives", "planar"):
        assert np.array_equal(getattr(chosen, name), getattr(flat, name)), name
    assert np.array_equal(shared.corners(every), flat.vertices[flat.faces])
    assert np.array_equal(shared.receives_at(np.append(every, -1)), np.append(flat.receives, False))
    for mine, other in zip(*(scene.meshes for scene in crowd), strict=True):
        assert np.array_equal(mine.vertices, other.vertices)
        assert np.array_equal(mine.vertices[mine.faces], other.vertices[other.faces])
        own = other.with_vertices(other.vertices)
        assert own.moves == () and np.array_equal(own.vertices, mine.vertices)
        assert mine.normals is None or np.array_equal(own.normals, mine.normals)


def test_instances_share_their_triangles_here_and_in_another_process(crowd: tuple[Scene, Scene]) -> None:
    flat, shared = crowd
    assert len(shared.geometry.sources) == 4  # three shapes and the ground
    assert len(pickle.loads(pickle.dumps(shared)).geometry.sources) == 4
    assert len(pickle.dumps(shared)) < len(pickle.dumps(flat)) / 3


def test_a_list_of_all_triangles_is_refused(crowd: tuple[Scene, Scene]) -> None:
    for name in ("vertices", "faces", "normals", "caster_faces", "is_cut_out"):
        with pytest.raises(TooLarge, match="as instances of"):
            getattr(crowd[1].geometry, name)


def test_the_digest_tells_instances_apart(crowd: tuple[Scene, Scene]) -> None:
    scene = crowd[1]
    first, *others = scene.meshes
    moved = replace(first, moves=(np.diag([1.0, 1.0, 1.001, 1.0]), *first.moves))
    others = [replace(scene, meshes=(one, *others)) for one in (moved, replace(first, casts=not first.casts))]
    assert len({one.geometry.digest() for one in (scene, *others)}) == 3
    assert replace(scene).geometry.digest() == scene.geometry.digest()


def test_triangles_of_no_area_are_left_out_of_instances_too(
    gltf_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    fan = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]]
    scales = [1, 1, 1], [1, 1, 0], [-1, 1, 1], [0, 1, 0], [1, 2, 3]
    nodes = [{"mesh": 0, "scale": list(scale)} for scale in scales]
    path = gltf_file(positions=np.array(fan, np.float32), nodes=nodes, scenes=[{"nodes": [0, 1, 2, 3, 4]}])
    flat, shared = expanded_and_instanced(path, monkeypatch)
    assert (shared.dropped, len(shared.meshes)) == (flat.dropped, len(flat.meshes))
    every = np.arange(flat.geometry.count)
    assert np.array_equal(shared.geometry.corners(every), flat.geometry.corners(every))
    assert [bool(mesh.moves) for mesh in shared.meshes[:4]] == [True, False, True, True]


def test_limits_are_one_line(crowd_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shadowbench.scenes.placed.MOST_TRIANGLES", 100)
    refused(crowd_file, "triangles; a scene may have 100, those of instances counted once")
    monkeypatch.setattr("shadowbench.scenes.placed.MOST_TRIANGLES", 10_000)
    monkeypatch.setattr("shadowbench.scenes.placed.MOST_DRAWN", 10_000)
    refused(crowd_file, "triangles of all instances; a scene may have 10000")


def test_cut_out_instances_are_one_line(scene_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene_file(LEAVES, complete=True)
    Image.fromarray(np.eye(8, dtype=np.uint8) * 255).save(path.with_name("leaf.png"))
    most = load_scene(path).geometry.count - 1
    monkeypatch.setattr("shadowbench.scenes.placed.MOST_TRIANGLES", most)
    refused(path, "[[mesh]] 1", "is cut out", f"more than {most} triangles", "opaque instances")


def test_tiny_meshes_in_batches_are_what_they_are_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    quad = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
    faces = np.array([[0, 2, 1], [0, 1, 4], [0, 3, 2]], dtype=np.int32)  # the second has no area
    matrices = [np.diag([scale, 1.0, 0.3, 1.0]) for scale in (1.0, -0.7, 0.0, 3.0, 0.1)]  # a mirror, and all flat
    instances = [(Mesh("quad", quad, faces), matrix) for matrix in matrices]
    found = []
    for size in (1, 4, 1 << 12):
        monkeypatch.setattr("shadowbench.scenes.placed._BATCH", size)
        meshes, dropped = placed(instances, "quads")
        assert (len(meshes), dropped) == (4, 4 + 3)
        found.append([(mesh.vertices.tobytes(), mesh.faces.tobytes()) for mesh in meshes])
    assert found[0] == found[1] == found[2]
