"""Mesh files: read completely, or refused in one line."""

import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from shadowbench.scenes.file_contents import placed
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Mesh
from tests.scenes.conftest import refused
from tests.scenes.rigs import compressed_glb

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
MeshFile = Callable[[str, str | bytes], Path]
Gltf = Callable[..., Path]


def test_a_real_mesh_keeps_every_triangle_that_has_an_area(shared_scenes: Path) -> None:
    for file, triangles, dropped, instances, closed in (
        ("armadillo.obj", 86_482, 0, 1, 1),
        ("retroufo.gltf", 16_428, 64, 77, 9),
        ("2CylinderEngine.glb", 121_496, 11_160, 115, None),
        ("bgfx_tree.obj", 6_392, 684, 1, 0),
    ):
        contents = read_meshes(shared_scenes / file)
        assert contents.dropped == dropped
        assert sum(len(mesh.faces) for mesh in contents.meshes) + dropped == triangles
        assert len(contents.meshes) == instances
        if closed is not None:
            assert sum(mesh.closed for mesh in contents.meshes) == closed
        for mesh in contents.meshes:
            assert mesh.vertices.dtype == np.float64
            assert mesh.faces.dtype == np.int32
            assert np.isfinite(mesh.vertices).all()


def test_a_torus_comes_back_closed_from_every_kind_of_file(tmp_path: Path) -> None:
    for suffix in ("obj", "ply", "stl", "off", "glb"):
        torus = trimesh.creation.torus(1.0, 0.25)
        path = tmp_path / f"torus.{suffix}"
        torus.export(path)
        (mesh,) = read_meshes(path).meshes
        assert len(mesh.faces) == len(torus.faces)
        assert mesh.closed
        assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(torus.volume, rel=1e-4)


def test_objects_of_an_obj_are_meshes_and_materials_do_not_split_them(mesh_file: MeshFile) -> None:
    text = "o one\n" + OBJ + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\no two\nf 2 3 4\n"
    contents = read_meshes(mesh_file("a.obj", text))
    assert sorted((mesh.name, len(mesh.faces)) for mesh in contents.meshes) == [("one", 2), ("two", 1)]


def test_of_a_vertex_of_an_obj_the_position_is_read_and_notes_tell_the_rest(mesh_file: MeshFile) -> None:
    for text, notes in (
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n\x1b[2Jx 1\n",
            ["left out, as they make no face: 1 \\x1b"],
        ),
        ("v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0 1\nf 1 2 3\n", []),
        ("V 0 0 0\nv 1 0 0\nv 0 1 0\nVN 0 0 1\nG a\nF 1 2 3\n", []),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nL 1 2\nf 1 2 3\n", ["left out, as they make no face: 1 L"]),
    ):
        contents = read_meshes(mesh_file("a.obj", text))
        assert sorted(contents.meshes[0].vertices.tolist()) == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]
        assert len(contents.notes) == len(notes)
        assert all(f"a.obj: {note}" in found for note, found in zip(notes, contents.notes, strict=True))


STL_FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def test_the_name_of_a_solid_may_have_keywords(mesh_file: MeshFile) -> None:
    for end in ("\n", "\r\n", "\r"):
        for name in ("vertex-block", "a vertex solid endsolid facet normal", "SOLID", ""):
            text = f"solid {name}\n{STL_FACET}endsolid {name}\nSOLID two\n{STL_FACET.upper() * 2}ENDSOLID\n".replace(
                "\n", end
            )
            meshes = read_meshes(mesh_file("a.stl", text.encode())).meshes
            assert [(mesh.name, len(mesh.faces)) for mesh in meshes] == [(name or "a", 1), ("two", 2)]


def test_a_binary_stl_with_all_its_triangles_is_complete(mesh_file: MeshFile) -> None:
    for header in (b"", b"solid binary"):
        for extra in (b"\0", b"\r\n", b"colours", bytes(50), bytes(1000)):
            triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
            data = header.ljust(80, b" ") + struct.pack("<I", 2) + 2 * triangle
            assert read_meshes(mesh_file("a.stl", data)).notes == ()
            contents = read_meshes(mesh_file("a.stl", data + extra))
            assert len(contents.meshes[0].faces) == 2
            assert contents.notes == (f"a.stl: {len(extra)} byte(s) after the last of 2 triangles left out",)


PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n"


def test_a_bad_mesh_file_is_one_line(mesh_file: MeshFile) -> None:
    for name, data, words in (
        ("a.obj", "", ["empty"]),
        ("a.obj", OBJ, ["no triangles"]),
        ("a.obj", OBJ + "f 1 1 2\nf 2 2 2\n", ["all 2 triangles have zero area"]),
        ("a.obj", "v 0 0\n" + OBJ + "f 1 2 3\n", ["line 1", "2 numbers", "3"]),
        ("a.obj", "v nan 0 0\n" + OBJ + "f 1 2 3\n", ["NaN"]),
        ("a.obj", "v 1e300 0 0\n" + OBJ + "f 1 2 3\n", ["1e+300"]),
        ("a.obj", OBJ + "f 0 1 2\n", ["vertex 0"]),
        ("a.obj", OBJ + "f 1 2 9\n", ["line 5", "vertex 9", "4"]),
        ("a.obj", OBJ + "f 1 2 -5\n", ["line 5", "vertex -5", "4"]),
        ("a.obj", OBJ + "f 1 2 x\n", ["line 5", "'x'", "integers"]),
        ("a.obj", OBJ + "f 1 2 \\\n 3\nf 1 \\\n2 \\\n 3\nf 1 2 x\n", ["line 10", "'x'"]),
        ("a.obj", OBJ.replace("v 0 1", "\0v 0 1") + "f 1 2 3\n", ["line 3", "NUL"]),
        ("a.off", "OFF BINARY\n3 1 0\n", ["BINARY", "numbers of vertices"]),
        ("a.off", "OFF\n99999999999999 1 0\n0 0 0\n", ["cut short", "99999999999999"]),
        ("a.off", OFF + "4 0 1 2\n", ["line 6", "4 numbers", "5"]),
        ("a.off", OFF + "3 0 1 2.5\n", ["vertex 2.5"]),
        ("a.obj", OBJ + "l 1 2\n", ["holds 4 points", "no triangles"]),
        ("a.ply", "ply\nnonsense", ["not a PLY"]),
        ("a.ply", PLY + PLY_FACES.format(2) + "3 0 1 2\n", ["cut short"]),
        ("a.ply", PLY + PLY_FACES.format(1) + "3 0 1 7\n", ["vertex 7"]),
        ("a.ply", PLY + PLY_FACES.format(1) + "3 0 0\n", ["after the header: line 4"]),
        ("a.ply", (PLY + PLY_FACES.format(10**30)).replace("ascii", "binary_little_endian"), ["cut short"]),
        ("a.ply", (PLY + PLY_FACES.format(1)).replace("list uchar", "") + "7\n", ["vertex_indices"]),
        ("a.ply", (PLY + PLY_FACES.format(0)).replace("float y", "float w"), ["x, y and z"]),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 5) + b"\0" * 50, ["cut short", "5"]),
        ("a.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", ["endsolid"]),
        ("a.stl", f"solid x\n{STL_FACET}vertex 0 0 1\nendsolid", ["line 2", "facet of 4 vertices", "3"]),
        ("a.stl", f"solid x\n{STL_FACET.replace('vertex 1 0 0', 'vertex 1 0 x')}endsolid", ["line 5", "'x'"]),
        ("a.stl", f"solid x\nnormal\n{STL_FACET}endsolid", ["line 2", "'normal'", "facet"]),
        ("a.stl", b"\0" * 84 + b"\0" * 50, ["announces 0 triangles", "50 bytes follow"]),
        ("a.gltf", "{", ["a.gltf"]),
        ("a.gltf", '{"asset": {"version": "2.0"}, "meshes": [{}]}', ["meshes 1.primitives"]),
        ("a.glb", b"glTF\x02\0\0\0", ["not a GLB"]),
    ):
        refused(mesh_file(name, data), name, *words)


def test_a_missing_file_a_folder_and_an_unknown_kind_are_one_line(tmp_path: Path) -> None:
    refused(tmp_path / "nothing.obj", "nothing.obj", "no such file")
    (tmp_path / "folder.obj").mkdir()
    refused(tmp_path / "folder.obj", "not a file")
    refused(tmp_path / "a.fbx", "unknown kind", ".glb .gltf .obj .ply .stl .off")
    refused(tmp_path / "a.usdz", "a.usdz: USD is not read; convert it to .glb, with Blender", "usdcat")


def test_a_file_cut_short_is_one_line(tmp_path: Path) -> None:
    for suffix in ("glb", "stl", "ply", "off"):
        for kept in (0.1, 0.5, 0.9, 0.99):
            path = tmp_path / f"ball.{suffix}"
            trimesh.creation.icosphere(subdivisions=2).export(path)
            data = path.read_bytes()
            path.write_bytes(data[: int(len(data) * kept)])
            refused(path, f"ball.{suffix}")


@pytest.fixture
def draco(tmp_path: Path) -> Path:
    """A compressed sphere of 320 triangles."""
    path, ball = tmp_path / "ball.glb", trimesh.creation.icosphere(subdivisions=2)
    path.write_bytes(trimesh.exchange.gltf.export_glb(trimesh.Scene(ball), extension_draco=True))
    return path


def test_a_draco_file_is_decoded_and_a_broken_one_refused(draco: Path) -> None:
    (mesh,) = read_meshes(draco).meshes
    assert len(mesh.faces) == 320
    assert np.linalg.norm(mesh.vertices, axis=1) == pytest.approx(1.0, abs=1e-3)
    draco.write_bytes(draco.read_bytes().replace(b"DRACO", b"OCARD"))
    refused(draco, "ball.glb", "KHR_draco_mesh_compression")


def test_a_decoder_that_fails_or_is_missing_is_one_line(
    draco: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    for decoder, word in (  # of different lengths: Python takes a source of the same second and size for compiled
        ("import os; os.abort()", "died with code -6"),
        ("b'x' * (3 << 30)", "MemoryError"),
        ("while True: continue", "more than 2 s"),
    ):
        (tmp_path / "DracoPy.py").write_text(f"def decode(blob):\n    {decoder}\n")
        monkeypatch.setattr("shadowbench.scenes.compression.LONGEST", 2.0 if "while" in decoder else 20.0)
        refused(draco, "ball.glb", "KHR_draco_mesh_compression", word)
    packed = tmp_path / "packed.glb"
    packed.write_bytes(compressed_glb(trimesh.creation.box()))
    for module, file in (("DracoPy", draco), ("meshopt", packed)):
        monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
        refused(file, file.name, module, "pip install '.[compressed]'")


def test_a_comment_or_name_in_another_code_than_utf8_does_no_harm(mesh_file: MeshFile) -> None:
    for name in ("a.obj", "a.off", "a.stl", "a.ply"):
        text = {
            "a.obj": "# é\no Säule\n" + OBJ + "f 1 2 3\n",
            "a.off": OFF.replace("OFF", "OFF # é") + "3 0 1 2\n",
            "a.stl": f"solid Säule\n{STL_FACET}endsolid Säule\n",
            "a.ply": PLY.replace("element vertex", "comment é\nelement vertex") + PLY_FACES.format(1) + "3 0 1 2\n",
        }[name]
        assert [len(mesh.faces) for mesh in read_meshes(mesh_file(name, text.encode("latin-1"))).meshes] == [1]


def test_what_common_files_leave_out_or_add_costs_no_triangle(mesh_file: MeshFile) -> None:
    """A name that ends like a continued line, and a keyword without a blank, as in ModelNet40."""
    for name, data in (
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl lib\\set\\\nf 1 2 3\nG a\\\nf 2 4 3\n"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\no a\\\r\nf 1 2 3\r\nf 2 4 \\\r\n 3\r\n"),
        ("a.off", "COFF4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n"),
    ):
        (mesh,) = read_meshes(mesh_file(name, data)).meshes
        assert np.sort(mesh.vertices[mesh.faces].sum(axis=1), axis=0).tolist() == [[1, 1, 0], [2, 2, 0]]


def test_strips_of_a_ply_are_triangles_beside_its_faces(mesh_file: MeshFile) -> None:
    for kind in ("ascii", "binary_little_endian"):
        rows, head = (
            [[7, 0, 1, 2, -1, 1, 3, 2], [4, 2, 1, 3, 0]],
            PLY.replace("ascii", kind).replace("vertex 3", "vertex 4"),
        )
        head += "element face 1\nproperty list int int vertex_indices\n"
        head += "element tristrips 2\nproperty list int int vertex_indices\nend_header\n"
        corners, face = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [3, 0, 1, 2]
        if kind == "ascii":
            data = (head + "".join(" ".join(map(str, row)) + "\n" for row in [*corners, face, *rows])).encode()
        else:
            data = head.encode() + np.array(corners, "<f4").tobytes()
            data += b"".join(np.array(row, "<i4").tobytes() for row in [face, *rows])
        (mesh,) = read_meshes(mesh_file("a.ply", data)).meshes
        found = mesh.vertices[mesh.faces]
        normals = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
        # Of the face, then of strips, of which every other triangle turns the other way.
        assert sorted(normals[:, 2].tolist()) == [-1, 1, 1, 1, 1]


def test_meshes_are_placed_without_triangles_of_zero_area() -> None:
    quad = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
    faces = np.array([[0, 2, 1], [0, 1, 4], [0, 3, 2]], dtype=np.int32)  # the second has no area
    matrices = [np.diag([scale, 1.0, 0.3, 1.0]) for scale in (1.0, -0.7, 0.0, 3.0)]  # a mirror, and all flat
    meshes, dropped = placed([(Mesh("quad", quad, faces), matrix) for matrix in matrices], "quads")
    assert (len(meshes), dropped) == (3, 3 + 3)
    assert [mesh.bounds[:, 0].tolist() for mesh in meshes] == [[0, 1], [-0.7, 0], [0, 3]]
    assert all(
        np.cross(*(mesh.vertices[mesh.faces[0, 1:]] - mesh.vertices[mesh.faces[0, 0]]))[1] > 0 for mesh in meshes
    )


def test_each_copy_counts_as_triangles_of_a_scene(scene_file, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene_file('[[mesh]]\nshape = "box"\nrepeat = [{ count = 9, step = [2, 0, 0] }]')
    monkeypatch.setattr("shadowbench.scenes.file_contents.MOST_TRIANGLES", 100)
    refused(path, "scene.toml: 108 triangles, each copy of a mesh counted; a scene may have 100")
