"""Shared edges of triangles, and closed parts."""

import numpy as np

from shadowbench.geometry.topology import casters_of, surrounds
from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import Mesh, Scene


def one_mesh(mesh: Mesh) -> Scene:
    return Scene("test", (mesh,), (), ())


def test_a_box_is_closed_and_a_plane_is_open(shape) -> None:
    box, plane = casters_of(one_mesh(shape("box", 2.0))), casters_of(one_mesh(shape("plane", 2.0)))
    assert box.faces.shape == (12, 3) and box.edges.shape == (18, 4) and box.closed_faces == 12
    assert box.boxes.tolist() == [[[-1.0] * 3, [1.0] * 3]]
    assert plane.faces.shape == (2, 3) and len(plane.boxes) == 1 and plane.closed_faces == 0
    alone = plane.edges[:, 3] == plane.edges[:, 1]
    assert sorted(alone) == [False, True, True, True, True], "four sides and the diagonal"
    assert (plane.edges[:, 1] < plane.edges[:, 2]).all()


def test_a_box_without_a_side_and_one_wound_inwards_are_open(shape) -> None:
    box = shape("box")
    for faces in (box.faces[2:], box.faces[:, ::-1]):
        casters = casters_of(one_mesh(Mesh("box", box.vertices, faces)))
        assert casters.closed_faces == 0 and len(casters.faces) == len(faces)


def test_points_inside_a_closed_mesh_are_surrounded(shape) -> None:
    box, torus = shape("box", 2.0), shape("torus")
    inside, outside = ((0.0, 0.0, 0.0), (0.99, 0.9, -0.99)), ((1.01, 0.0, 0.0), (0.0, 5.0, 0.0))
    assert all(surrounds(box, point) for point in inside)
    assert not any(surrounds(box, point) for point in outside)
    assert not surrounds(torus, (0.0, 0.0, 0.0)), "its hole"


def test_an_edge_of_four_triangles_has_two_rows_and_two_boxes_at_it_are_closed(shape) -> None:
    left, right = shape("box"), shape("box", at=(1.0, 1.0, 0.0))
    both = Mesh(
        "two",
        np.concatenate([left.vertices, right.vertices]),
        np.concatenate([left.faces, right.faces + len(left.vertices)]),
    )
    casters = casters_of(one_mesh(both))
    assert casters.closed_faces == 24 and casters.closed_edges == len(casters.edges) == 36
    assert len(np.unique(casters.edges[:, 1:3], axis=0)) == 35


def test_meshes_are_not_welded_to_each_other(shape) -> None:
    box = shape("box")
    halves = tuple(Mesh("half", box.vertices, faces) for faces in (box.faces[:6], box.faces[6:]))
    assert casters_of(Scene("test", halves, (), ())).closed_faces == 0


def test_a_triangle_with_a_corner_twice_is_left_out(shape) -> None:
    box = shape("box")
    faces = np.concatenate([box.faces, [[0, 1, 1]]]).astype(np.int32)
    assert casters_of(one_mesh(Mesh("box", box.vertices, faces))).closed_faces == 12


def test_meshes_are_closed_that_trimesh_finds_closed() -> None:
    for name in builtin_names():
        for mesh in load_scene(name).meshes[:20]:
            if mesh.casts:
                casters = casters_of(one_mesh(mesh))
                assert (casters.closed_faces == len(casters.faces)) == mesh.closed, mesh.name
