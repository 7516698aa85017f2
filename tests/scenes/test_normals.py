"""Smooth normals: read from files, and moved with the surfaces that have them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from shadowbench.scenes.file_contents import Chosen
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.meshes import placed, read_meshes
from shadowbench.scenes.model import Mesh
from shadowbench.scenes.triangles import unit_normals
from tests.scenes.conftest import refused
from tests.scenes.rigs import Rig

MeshFile = Callable[[str, str | bytes], Path]
CORNERS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
NORMALS = "vn 1 0 1\nvn 0 0 2\nvn 0 -3 0\nvn 0 0 1\n"
HALF = np.sqrt(0.5)
GIVEN = np.array([[HALF, 0, HALF], [0, 0, 1], [0, -1, 0], [0, 0, 1]])


def corners_of(path: Path) -> dict[tuple[float, ...], NDArray[np.float32]]:
    """The normal at each vertex of a file of one mesh whose corners agree, by position."""
    (mesh,) = read_meshes(path).meshes
    assert mesh.normals is not None
    assert mesh.normals.dtype == np.float32
    places, normals = mesh.vertices[mesh.faces].reshape(-1, 3), mesh.normals.reshape(-1, 3)
    return {tuple(place): normal for place, normal in zip(places.tolist(), normals, strict=True)}


def test_an_obj_has_a_normal_at_each_corner(mesh_file: MeshFile) -> None:
    for faces in ("f 1//1 2//2 3//3 4//4", "f 1/9/1 2/9/2 3/9/3 4/9/4", "f -4//-4 -3//-3 -2//-2 -1//-1"):
        found = corners_of(mesh_file("a.obj", CORNERS + NORMALS + faces))
        assert np.allclose([found[0, 0, 0], found[1, 0, 0], found[1, 1, 0], found[0, 1, 0]], GIVEN, atol=1e-7)


def test_normals_of_an_obj_follow_concave_polygons(mesh_file: MeshFile) -> None:
    ring = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)]  # earcut's order of corners is its own
    text = "".join(f"v {x} {y} 0\nvn {x + 1} {y + 1} 1\n" for x, y in ring)
    found = corners_of(mesh_file("a.obj", text + "f " + " ".join(f"{k}//{k}" for k in range(1, 6))))
    for (x, y, _), normal in found.items():
        assert np.allclose(normal, unit_normals(np.array([x + 1, y + 1, 1])))


def test_faces_of_an_obj_without_normals_are_flat_beside_others(mesh_file: MeshFile) -> None:
    (mesh,) = read_meshes(mesh_file("a.obj", CORNERS + NORMALS + "f 1 2 3\nf 1//1 3//3 4//4\n")).meshes
    assert mesh.normals is not None
    assert not mesh.normals[0].any()
    assert mesh.normals[1].any(axis=1).all()


def test_a_sphere_of_a_file_is_smooth(tmp_path: Path) -> None:
    for kind in ("ply", "obj", "glb"):
        for encoding in ("ascii", "binary"):
            sphere = trimesh.creation.icosphere(subdivisions=2)
            options = {"encoding": encoding, "vertex_normal": True} if kind == "ply" else {"include_normals": True}
            sphere.export(tmp_path / f"sphere.{kind}", **options)
            for place, normal in corners_of(tmp_path / f"sphere.{kind}").items():
                assert np.dot(unit_normals(np.array(place)), normal) > 0.999


def test_normals_stay_perpendicular_to_their_surface() -> None:
    """Of a plane along the diagonals, under scaling, mirroring and flattening."""
    for matrix in (np.diag([1, 2, 3.0]), np.diag([-1, 1, 1.0]), np.diag([1, 0, 1.0])):
        plane = np.array([[0, 0, 0], [1, 0, -1], [0, 1, -1.0]])
        mesh = Mesh("plane", plane, np.array([[0, 1, 2]], np.int32), normals=unit_normals(np.ones((1, 3, 3))))
        affine = np.eye(4)
        affine[:3, :3] = matrix
        ((moved,), _) = placed([(mesh, affine)], "file")
        a, b, c = moved.vertices[moved.faces[0]]
        assert moved.normals is not None
        assert np.allclose(moved.normals @ np.cross(b - a, c - a), np.linalg.norm(np.cross(b - a, c - a)), rtol=1e-6)


def test_normals_bend_with_joints_and_morph_targets(tmp_path: Path) -> None:
    """One joint turns a square by 90° about x; a morph target then adds to a normal."""
    rig = Rig()
    square, faces = [[0, 0, 0], [1, 0, 0], [1, 1, 0.0]], [[0, 1, 2]]
    influences = rig.influences([[0, 0, 0, 0]] * 3, [[1, 0, 0, 0.0]] * 3)
    mesh = rig.mesh(square, faces, NORMAL=rig.accessor([[0, 0, 1.0]] * 3), **influences)
    skin = rig.skin([1])
    rig.json["nodes"] += [{"mesh": mesh, "skin": skin, "children": [1]}, {"rotation": [HALF, 0, 0, HALF]}]
    (posed,) = read_meshes(rig.write(tmp_path / "a.glb"), chosen=Chosen(0.0)).meshes
    assert posed.normals is not None
    assert np.allclose(posed.normals, [0, -1, 0], atol=1e-6)


def test_a_shape_is_smooth_where_its_table_says_so(scene_file: Callable[..., Path]) -> None:
    text = '[[mesh]]\nshape = "sphere"\nsmooth = true\n[[mesh]]\nshape = "sphere"\n'
    smooth, flat = load_scene(str(scene_file(text))).meshes[:2]
    assert smooth.normals is not None
    assert flat.normals is None
    refused(scene_file('[[mesh]]\nfile = "a.obj"\nsmooth = true\n'), "smooth is for a shape")
