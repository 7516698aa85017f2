"""Cards with cut-out leaves, and the same leaves made of triangles."""

import math

import numpy as np

from shadowbench.scenes.cutouts import Cutout
from shadowbench.scenes.model import Camera, Mesh

TEXELS = 16
CAMERA = Camera("camera", (2.5, 3.0, 4.0), (0.0, 0.7, 0.0), math.radians(40))
GROUND = Mesh(
    "ground",
    np.array([[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4.0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)


def alpha_of(kind: str) -> np.ndarray:
    """(TEXELS, TEXELS) uint8: a leaf with holes, or noise."""
    random = np.random.default_rng(5)
    if kind == "noise":
        return random.integers(0, 256, (TEXELS, TEXELS), dtype=np.uint8)
    y, x = (np.mgrid[:TEXELS, :TEXELS] + 0.5) / TEXELS - 0.5
    leaf = (x**2 + y**2 < 0.2) & (np.sin(30 * x) > -0.7)
    return np.where(leaf, 255, 0).astype(np.uint8)


def cards(count: int, cutout: Cutout, seed: int = 1) -> Mesh:
    """Squares of random places and directions above the ground; texture coordinates from −0.25 to 1.25."""
    random = np.random.default_rng(seed)
    middle = random.uniform([-1.5, 0.2, -1.5], [1.5, 1.8, 1.5], (count, 3))[:, None]
    along, other = random.normal(size=(2, count, 1, 3))
    across = np.cross(along, other)
    along, across = (0.3 * each / np.linalg.norm(each, axis=2, keepdims=True) for each in (along, across))
    corners = middle + np.array([-1, 1, 1, -1.0])[:, None] * along + np.array([-1, -1, 1, 1.0])[:, None] * across
    faces = 4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    places = np.array([[-0.25, -0.25], [1.25, -0.25], [1.25, 1.25], [-0.25, 1.25]], dtype=np.float32)
    coordinates = np.tile(places[[[0, 1, 2], [0, 2, 3]]], (count, 1, 1))
    alpha = random.uniform(0.6, 1.0, (2 * count, 3)).astype(np.float32) if cutout.factor < 1 else None
    corners, faces = corners.reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32)
    return Mesh("leaves", corners, faces, cutout=cutout, coordinates=coordinates, alpha=alpha)


def made_of_triangles(mesh: Mesh) -> Mesh:
    """The opaque texels of a nearest-sampled mesh of `cards`, each as two triangles."""
    cutout = mesh.cutout
    assert cutout is not None
    edges = np.arange(math.floor(-0.25 * TEXELS), math.ceil(1.25 * TEXELS))
    row, column = (each.ravel() for each in np.meshgrid(edges, edges, indexing="ij"))
    opaque = cutout.opaque(np.stack([column + 0.5, row + 0.5], axis=1) / TEXELS)
    low = np.stack([column, row], axis=1)[opaque]
    squares = (low[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) / TEXELS
    squares = (np.clip(squares, -0.25, 1.25) + 0.25) / 1.5  # from texture coordinates to shares of the card's sides
    corners = mesh.vertices.reshape(-1, 4, 3)
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    points = first[:, None, None] + squares[..., :1] * along[:, None, None] + squares[..., 1:] * across[:, None, None]
    faces = 4 * np.arange(points.size // 12)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh("texels", points.reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32))
