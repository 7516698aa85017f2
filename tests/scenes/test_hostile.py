"""Hostile files, made to hang, to exhaust memory, to read other files or to control a terminal: each is one line."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from tests.scenes.conftest import refused

BOX = '[[mesh]]\nshape = "box"\n'
FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
Write = Callable[..., Path]


def test_a_scene_file_beyond_its_limits_is_refused_before_the_work(scene_file: Write) -> None:
    for text, words in (
        ("a = " + "[" * 30 + "]" * 30 + "\n" + BOX, ["nested deeper than 20"]),
        ("a = " + "[" * 20_000 + "\n", ["not TOML"]),
        ("[[camera]]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\n" * 1001 + BOX, ["1000"]),
        (BOX * 50_001, ["mesh: found", "50000"]),
        (f'"{"k" * 5000}" = 1\n' + BOX, ["unknown field"]),
    ):
        refused(scene_file(text), *words)


def test_a_pipe_is_not_waited_for(tmp_path: Path, scene_file: Write, gltf_file: Write) -> None:
    for name in ("pipe.obj", "pipe.toml", "pipe.bin"):
        os.mkfifo(tmp_path / name)
    refused(tmp_path / "pipe.toml", "is not a file")
    refused(tmp_path / "pipe.obj", "is not a file")
    refused(scene_file('[[mesh]]\nfile = "pipe.obj"\n'), "is not a file")
    refused(gltf_file(buffers=[{"byteLength": 48, "uri": "pipe.bin"}]), "is not a file")


# What is not the file's to read.


@pytest.fixture
def outside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder beside the scene's, with valid buffer data."""
    folder = tmp_path_factory.mktemp("outside")
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
    (folder / "part.bin").write_bytes(positions.tobytes() + np.arange(3, dtype=np.uint32).tobytes())
    (folder / "part.obj").write_text(OBJ)
    return folder


def test_the_buffer_of_a_gltf_lies_in_its_folder(gltf_file: Write, tmp_path: Path, outside: Path) -> None:
    (tmp_path / "link.bin").symlink_to(outside / "part.bin")
    (tmp_path / "folder").symlink_to(outside)
    relative = os.path.relpath(outside / "part.bin", tmp_path)
    for uri in (str(outside / "part.bin"), relative, relative.replace("/", "%2F"), "link.bin", "folder/part.bin"):
        refused(gltf_file(buffers=[{"byteLength": 48, "uri": uri}]), "buffers 1", "outside")
    (tmp_path / "my part.bin").write_bytes((outside / "part.bin").read_bytes())
    for uri in ("my%20part.bin", "my part.bin", "./my%20part.bin"):
        assert len(load_scene(gltf_file(buffers=[{"byteLength": 48, "uri": uri}])).meshes) == 2


def test_an_invalid_buffer_is_one_line(gltf_file: Write) -> None:
    for uri in ("data:,x", "data:;base64,*", "data:;base64,AAAA", "data:", "file:///etc/passwd", ""):
        refused(gltf_file(buffers=[{"byteLength": 48, "uri": uri}]), "model.gltf")


def test_few_bytes_do_not_stand_for_more_triangles_than_a_scene_has(gltf_file: Write) -> None:
    many = np.zeros((30_000, 3), dtype=np.float32)
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    refused(gltf_file(positions=many, meshes=[{"primitives": [primitive] * 2000}]), "60000000 vertices", "30000000")
    refused(gltf_file(positions=many, nodes=[{"mesh": 0}] * 20_010), "600300000 vertices", "30000000")


def test_a_mesh_file_that_would_take_too_long_to_read_is_refused(mesh_file: Write) -> None:
    for name, data, words in (
        ("a.stl", f"solid a\n{FACET}endsolid a\n" * 50_001, ["50001 objects", "50000"]),
        ("a.obj", OBJ + (" " * 90_000 + "v 0 0 0\n") * 100 + "f 1 1 1 x\n", ["line 105", "'x'"]),
    ):
        refused(mesh_file(name, data), name, *words)


def test_few_bytes_do_not_stand_for_more_numbers_than_are_used(gltf_file: Write) -> None:
    zeros = {"componentType": 5126, "count": 10_000_000, "type": "VEC3"}
    still = json.loads(gltf_file().read_text())["accessors"]
    instanced = {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}
    for parts, words in (
        ({"primitive": {"attributes": {"POSITION": 0, "COLOR_0": 2}}}, ["COLOR_0 has 10000000 elements; allowed: 3"]),
        (
            {"primitive": {"targets": [{"POSITION": 2}]}, "nodes": [{"mesh": 0, "weights": [1]}]},
            ["a morph target's POSITION has 10000000", "allowed: 3"],
        ),
        ({"nodes": [{"mesh": 0, **instanced}]}, ["draw 10000000 primitives", "50000"]),
        ({"accessors": [*still, *[zeros] * 3]}, ["90000000 numbers", "67108864"]),
    ):
        refused(gltf_file(**{"accessors": [*still, zeros], **parts}), *words)
