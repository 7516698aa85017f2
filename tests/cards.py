"""Cards with cut-out leaves, scenes of them, and the same leaves made of triangles."""

import math
from typing import Any

import numpy as np

from shadowbench.scenes.cutouts import WRAPS, Cutout, Wrap, cut_out
from shadowbench.scenes.model import Camera, Light, Mesh

TEXELS = 16
PADDING = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge"}
BARYCENTRIC = np.array([[0, 0], [1, 0], [0, 1.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
CAMERA = Camera("camera", (2.5, 3.0, 4.0), (0.0, 0.7, 0.0), math.radians(40))
GROUND = Mesh("ground", np.array([[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4.0]]), TWO)
NOISE = np.random.default_rng(8).integers(0, 256, (7, 13), dtype=np.uint8)


def alpha_of(kind: str) -> np.ndarray:
    """(TEXELS, TEXELS) uint8: a leaf with holes, or noise."""
    random = np.random.default_rng(5)
    if kind == "noise":
        return random.integers(0, 256, (TEXELS, TEXELS), dtype=np.uint8)
    y, x = (np.mgrid[:TEXELS, :TEXELS] + 0.5) / TEXELS - 0.5
    leaf = (x**2 + y**2 < 0.2) & (np.sin(30 * x) > -0.7)
    return np.where(leaf, 255, 0).astype(np.uint8)


def alpha_at(alpha: np.ndarray, nearest: bool, wrap: tuple[Wrap, Wrap], coordinates: np.ndarray) -> np.ndarray:
    """(N,) α₈ at (N, 2) texture coordinates from −3 to 4, texel by texel."""
    height, width = alpha.shape
    columns, rows = (
        np.pad(np.arange(width), 3 * width, PADDING[wrap[0]]),
        np.pad(np.arange(height), 3 * height, PADDING[wrap[1]]),
    )
    alpha = alpha[rows][:, columns].astype(float)
    x, y = (coordinates * [width, height] + 3 * np.array([width, height])).T
    if nearest:
        return alpha[np.floor(y).astype(int), np.floor(x).astype(int)]
    i, j = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    right, down = x - 0.5 - i, y - 0.5 - j
    above = alpha[j, i] * (1 - right) + alpha[j, i + 1] * right
    return above * (1 - down) + (alpha[j + 1, i] * (1 - right) + alpha[j + 1, i + 1] * right) * down


def cards(count: int, cutout: Cutout, seed: int = 1) -> Mesh:
    """Squares of random places and directions above the ground; texture coordinates from −0.25 to 1.25."""
    random = np.random.default_rng(seed)
    middle = random.uniform([-1.5, 0.2, -1.5], [1.5, 1.8, 1.5], (count, 3))[:, None]
    along, other = random.normal(size=(2, count, 1, 3))
    across = np.cross(along, other)
    along, across = (0.3 * each / np.linalg.norm(each, axis=2, keepdims=True) for each in (along, across))
    corners = middle + np.array([-1, 1, 1, -1.0])[:, None] * along + np.array([-1, -1, 1, 1.0])[:, None] * across
    faces = (4 * np.arange(count)[:, None, None] + TWO).reshape(-1, 3).astype(np.int32)
    coordinates = np.tile(np.array(box(-0.25, -0.25, 1.25, 1.25), np.float32)[TWO], (count, 1, 1))
    places = cutout.places(coordinates)
    return Mesh("leaves", corners.reshape(-1, 3), faces, cutout=cutout, coordinates=coordinates, places=places)


def card(cutout: Cutout, middle: Any, along: Any, up: Any, places: Any) -> Mesh:
    """A parallelogram; along, up: half its sides; places: (4, 2) of its corners, from the lower left one on."""
    middle, along, up = (np.asarray(each, float) for each in (middle, along, up))
    corners = middle + np.array([-1, 1, 1, -1.0])[:, None] * along + np.array([-1, -1, 1, 1.0])[:, None] * up
    return Mesh("card", corners, TWO, cutout=cutout, places=cutout.places(np.asarray(places, np.float32)[TWO]))


def box(left: float, top: float, right: float, bottom: float) -> list[list[float]]:
    """Texture coordinates of a card's corners, v downwards."""
    return [[left, bottom], [right, bottom], [right, top], [left, top]]


def crossing(light: Light) -> list[Mesh]:
    """Plants, each of three cards through one axis and a level one through all."""
    leaf, plants = cut_out(alpha_of("leaf"), nearest=True, wrap=("clamp", "clamp")), []
    for x, z in ((-0.8, -0.5), (0.1, 0.3), (0.9, -0.3), (-0.6, 0.9)):
        for turn in (0.2, 0.2 + math.pi / 3, 0.2 - math.pi / 3):
            across = 0.45 * np.array([math.cos(turn), 0, math.sin(turn)])
            plants.append(card(leaf, (x, 0.6, z), across, (0, 0.6, 0), box(-0.1, 0, 1.1, 1)))
        plants.append(card(leaf, (x, 0.7, z), (0.5, 0.1, 0), (0, 0.1, 0.5), box(0, 0, 1, 1)))
    return plants


def wraps(light: Light) -> list[Mesh]:
    """Each wrap in u with each in v, coordinates from −2.3 to 3.6, of a mask that is not square."""
    return [
        card(cut_out(NOISE, nearest=True, wrap=(u, v)), (0.9 * i - 0.9, 0.5 + 0.2 * j, 0.9 * j - 0.9),
             (0.4, 0.1 * i, 0), (0, 0.3, -0.3), box(-2.3, -1.7, 3.6, 2.2))
        for i, u in enumerate(WRAPS) for j, v in enumerate(WRAPS)
    ]  # fmt: skip


def edge_on(light: Light) -> list[Mesh]:
    """Cards along the camera's ray to their middle and along the light's, and turned from it by little."""
    leaf, thin = cut_out(alpha_of("noise"), nearest=True), []
    lamp = -1e3 * np.array(light.direction) if light.kind == "directional" else np.array(light.position)
    for i, tilt in enumerate((0.0, 1e-4, 1e-2, 0.1)):
        for j, toward in enumerate((np.array(CAMERA.position), lamp)):
            middle = np.array([0.55 * i - 0.9, 0.7, 0.9 * j - 0.4])
            ahead = (toward - middle) / np.linalg.norm(toward - middle)
            across = np.cross(ahead, (0.3, 0.1, 1.0))
            normal = np.cross(ahead, across / np.linalg.norm(across))
            ahead = ahead * math.cos(tilt) + normal * math.sin(tilt)
            thin.append(card(leaf, middle, 0.3 * ahead, 0.3 * np.cross(normal, ahead), box(-0.2, 0.1, 1.3, 0.9)))
    return thin


def made_of_triangles(mesh: Mesh) -> Mesh:
    """The opaque sub-texels of a mesh, as triangles: of each its part in each of the mesh's.

    Outside the bitmap, up to 99 sub-texels away, it is padded.
    """
    cutout, pieces = mesh.cutout, []
    assert cutout is not None and mesh.places is not None
    for corners, places in zip(mesh.vertices[mesh.faces], mesh.places.astype(float), strict=True):
        low, high = np.floor(places.min(axis=0)).astype(int), np.ceil(places.max(axis=0)).astype(int)
        columns, rows = (
            np.pad(np.arange(size), 99, PADDING[wrap])[first + 99 : last + 99]
            for size, wrap, first, last in zip(cutout.size, cutout.wrap, low, high, strict=True)
        )
        row, column = np.nonzero(cutout.bits[rows][:, columns])
        squares = (np.stack([column, row], axis=1) + low)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
        sides = np.stack([places[1] - places[0], places[2] - places[0]])
        weights = (squares - places[0]) @ np.linalg.inv(sides)  # of the second and the third corner
        for j in range(3):
            weights = left_of(weights, *BARYCENTRIC[[j, (j + 1) % 3]])
        points = corners[0] + weights @ (corners[1:] - corners[0])
        fans = np.stack([np.repeat(points[:, :1], points.shape[1] - 2, 1), points[:, 1:-1], points[:, 2:]], axis=2)
        pieces.append(fans.reshape(-1, 3, 3))
    corners = np.concatenate(pieces)
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
