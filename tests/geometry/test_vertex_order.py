"""The order of triangles in which few vertices are shaded more than once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.geometry.vertex_order import CACHE, by_first_use, in_reuse_order
from shadowbench.scenes.shapes import build_shape


def random_faces(seed: int, count: int, vertices: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, vertices, (count, 3)).astype(np.int32)


def misses(faces: np.ndarray) -> int:
    """Vertices shaded with a cache that drops the vertex that entered first."""
    cache: list[int] = []
    count = 0
    for vertex in faces.ravel().tolist():
        if vertex not in cache:
            cache = [*cache, vertex][-CACHE:]
            count += 1
    return count


@given(st.integers(0, 99), st.integers(0, 60), st.integers(1, 80))
def test_it_has_each_triangle_once_and_vertices_numbered_by_first_use_are_the_same_corners(
    seed, count, vertices
) -> None:
    faces = random_faces(seed, count, vertices)
    assert sorted(in_reuse_order(faces).tolist()) == list(range(count))
    renumbered, former = by_first_use(faces)
    assert (former[renumbered] == faces).all()
    _, first = np.unique(renumbered, return_index=True)
    assert (np.diff(first) > 0).all() and len(former) == len(np.unique(faces))


def test_meshes_stay_in_their_order() -> None:
    meshes = [random_faces(seed, 40, 30) + 30 * seed for seed in range(5)]
    order = in_reuse_order(np.concatenate(meshes))
    assert (np.diff(order // 40) >= 0).all()


def test_a_sphere_shades_at_most_three_vertices_for_four_triangles() -> None:
    for shuffled in (False, True):
        faces = build_shape("sphere", {"subdivisions": 4}, "sphere").faces.astype(np.int32)
        faces = np.random.default_rng(0).permutation(faces) if shuffled else faces
        assert misses(faces[in_reuse_order(faces)]) < 0.75 * len(faces) < misses(faces)
