"""The tree of casters: which triangles a walk without a stack reaches."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.geometry.tree import LEAF, Tree, build_tree
from shadowbench.scenes.shapes import build_shape

COUNTS = [0, 1, 2, 7, 8, 9, 300]


def boxes_of(tree: Tree) -> np.ndarray:
    """(N, 2, 3) lowest and highest corners."""
    fractions = np.stack([tree.words[:, :3] & 0xFFFF, tree.words[:, :3] >> 16], axis=1)
    return tree.low + fractions * tree.step


def leaf_of(word: int) -> range:
    """Positions in `order` of a leaf's triangles."""
    first = (word - LEAF) >> 3
    return range(first, first + (word & 7))


def walk(tree: Tree, hits: np.ndarray) -> list[int]:
    """Faces reached by a walk that enters the nodes in `hits`, (N,) bool."""
    node, faces = 0, []
    while node < len(tree.words):
        word = int(tree.words[node, 3])
        if hits[node] and word >= LEAF:
            faces += [int(tree.order[k]) for k in leaf_of(word)]
        node = node + 1 if hits[node] or word >= LEAF else word
    return faces


def random_triangles(seed: int, count: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    corners = random.normal(size=(count, 1, 3)) + spread * random.normal(size=(count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@settings(max_examples=30)
@given(st.integers(0, 99), st.sampled_from(COUNTS), st.sampled_from([0.0, 1e-3, 1.0, 1e3]))
def test_a_walk_meets_each_triangle_once_and_through_the_boxes_around_a_point_every_one_there(
    seed, count, spread
) -> None:
    vertices, faces = random_triangles(seed, count, spread)
    tree = build_tree(vertices, faces)
    assert sorted(walk(tree, np.ones(len(tree.words), bool))) == list(range(count))
    boxes = boxes_of(tree)
    for face in range(0, count, 37):
        inside = vertices[faces[face]].mean(axis=0)
        hits = ((boxes[:, 0] <= inside) & (inside <= boxes[:, 1])).all(axis=1)
        assert face in walk(tree, hits)


def test_triangles_in_one_place_are_divided_by_number() -> None:
    for count in (7, 8, 100):
        tree = build_tree(np.zeros((3, 3)), np.tile(np.arange(3, dtype=np.int32), (count, 1)))
        sizes = [len(leaf_of(int(word))) for word in tree.words[:, 3] if word >= LEAF]
        assert sum(sizes) == count and max(sizes) <= 7


def test_centres_that_double_are_divided_in_bounded_depth() -> None:
    """Each split by the heuristic would take off one triangle: 120 levels; the builder's stack holds 64."""
    across = 2.0 ** np.arange(120)[:, np.newaxis, np.newaxis] * np.eye(3)[:1]
    vertices = (across + 1e-3 * np.eye(3)[np.newaxis]).reshape(-1, 3)
    tree = build_tree(vertices, np.arange(360, dtype=np.int32).reshape(-1, 3))
    assert sorted(walk(tree, np.ones(len(tree.words), bool))) == list(range(120))


def test_a_ray_through_a_sphere_enters_few_boxes() -> None:
    sphere = build_shape("sphere", {"subdivisions": 5}, "test")
    tree = build_tree(sphere.vertices, sphere.faces)
    boxes = boxes_of(tree)[:, :, :2]
    crossed = ((boxes[:, 0] <= 0.01) & (boxes[:, 1] >= 0.01)).all(axis=1)  # by the ray along z at x = y = 0.01
    assert crossed.sum() < 0.01 * len(tree.words)
