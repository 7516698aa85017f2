"""Cards with cut-out leaves, and the same leaves made of triangles."""

import math

import numpy as np

from shadowbench.scenes.cutouts import Cutout
from shadowbench.scenes.model import Camera, Mesh

TEXELS = 16
PADDING = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge"}
BARYCENTRIC = np.array([[0, 0], [1, 0], [0, 1.0]])
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


def made_of_triangles(mesh: Mesh, least: int = 128) -> Mesh:
    """The opaque texels of a nearest-sampled mesh, as triangles: of each texel its part in each of the mesh's.

    least: the lowest opaque α₈. Outside 0 to 1, up to 99 texels away, the texture is padded.
    """
    cutout, found = mesh.cutout, []
    assert cutout is not None and cutout.nearest and mesh.coordinates is not None
    sizes = cutout.alpha.shape[::-1]
    for corners, places in zip(mesh.vertices[mesh.faces], mesh.coordinates * np.array(sizes, float), strict=True):
        low, high = np.floor(places.min(axis=0)).astype(int), np.ceil(places.max(axis=0)).astype(int)
        columns, rows = (
            np.pad(np.arange(size), 99, PADDING[wrap])[first + 99 : last + 99]
            for size, wrap, first, last in zip(sizes, cutout.wrap, low, high, strict=True)
        )
        row, column = np.nonzero(cutout.alpha[rows][:, columns] >= least)
        squares = (np.stack([column, row], axis=1) + low)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
        sides = np.stack([places[1] - places[0], places[2] - places[0]])
        weights = (squares - places[0]) @ np.linalg.inv(sides)  # of the second and the third corner
        for j in range(3):
            weights = left_of(weights, *BARYCENTRIC[[j, (j + 1) % 3]])
        points = corners[0] + weights @ (corners[1:] - corners[0])
        fans = np.stack([np.repeat(points[:, :1], points.shape[1] - 2, 1), points[:, 1:-1], points[:, 2:]], axis=2)
        found.append(fans.reshape(-1, 3, 3))
    corners = np.concatenate(found)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    corners = corners[area > 1e-12]  # of corners that are there twice
    return Mesh("texels", corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


def left_of(polygons: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(M, k + 1, 2) parts of (N, k, 2) convex polygons left of the line from a to b; the last corner may repeat."""
    x, y = np.moveaxis(polygons - a, 2, 0)
    side, after = (b - a)[0] * y - (b - a)[1] * x, np.roll(polygons, -1, axis=1)
    other = np.roll(side, -1, axis=1)
    crossed = (side >= 0) != (other >= 0)
    share = np.divide(side, side - other, out=np.zeros_like(side), where=crossed)
    places = np.stack([polygons, polygons + share[..., None] * (after - polygons)], axis=2).reshape(len(x), -1, 2)
    there = np.stack([side >= 0, crossed], axis=2).reshape(len(x), -1)
    count = there.sum(axis=1)
    order = np.argsort(~there, axis=1, kind="stable")
    chosen = np.minimum(np.arange(polygons.shape[1] + 1), count[:, None] - 1)
    corners = np.take_along_axis(order, np.maximum(chosen, 0), axis=1)
    return np.take_along_axis(places, corners[..., None], axis=1)[count > 2]
