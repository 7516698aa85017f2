"""Shapes that are difficult for shadow techniques: stairs, terrain, leaves, a draped statue.

All are deterministic: the same parameters give the same triangles.
"""

import numpy as np
from pydantic import Field

from shadowbench.scenes.triangles import Faces, Triangles
from shadowbench.scenes.vectors import Floats
from shadowbench.strict import Strict


class StairsParameters(Strict):
    """steps: number of steps."""

    steps: int = Field(6, ge=1, le=1000, strict=True)


class TerrainParameters(Strict):
    """cells: quads along a side; waves: waves along a side in the coarsest of four octaves; seed: of the hills."""

    cells: int = Field(128, ge=2, le=512, strict=True)
    waves: float = Field(2.0, gt=0.0, le=8.0, strict=True)
    seed: int = Field(1, ge=0, le=2**32 - 1, strict=True)


class LeavesParameters(Strict):
    """count: leaves in a ball of diameter 1, denser towards its surface; size: length of the longest; seed: of all."""

    count: int = Field(800, ge=1, le=50_000, strict=True)
    size: float = Field(0.1, gt=0.0, le=1.0, strict=True)
    seed: int = Field(1, ge=0, le=2**32 - 1, strict=True)


class StatueParameters(Strict):
    """rings: vertex rings from foot to crown; sectors: vertices around; folds: of the drapery."""

    rings: int = Field(160, ge=8, le=512, strict=True)
    sectors: int = Field(160, ge=8, le=512, strict=True)
    folds: int = Field(11, ge=0, le=40, strict=True)


def stairs(parameters: StairsParameters) -> Triangles:
    """A closed flight of stairs in the unit cube, rising towards −z; treads face +y, risers +z."""
    n = parameters.steps
    k = np.arange(n)
    # The profile in (z, y), from the front edge at the foot up to the back: riser, tread, riser, tread …
    top = np.repeat((k + 1) / n, 2)
    front = np.stack([1 - k / n, 1 - (k + 1) / n], axis=1).ravel()
    profile = np.concatenate([np.stack([front, top], axis=1), np.stack([1 - np.arange(n + 1) / n, np.zeros(n + 1)], 1)])
    profile -= 0.5
    m = len(profile)
    vertices = np.concatenate([np.insert(profile[:, ::-1], 0, x, axis=1) for x in (-0.5, 0.5)])

    tread, foot = np.stack([2 * k, 2 * k + 1], axis=1), 2 * n + np.stack([k, k + 1], axis=1)
    # Each side has a column below each tread. A column is cut at the height of its lower neighbour, so that they share
    # the corner below the riser and there is no T-junction.
    corner = 2 * k[1:] - 1
    columns = np.concatenate(
        [
            np.stack([tread[:, 0], tread[:, 1], foot[:, 1]], axis=1),
            np.stack([tread[:1, 0], foot[:1, 1], foot[:1, 0]], axis=1),
            np.stack([tread[1:, 0], foot[1:, 1], corner], axis=1),
            np.stack([corner, foot[1:, 1], foot[1:, 0]], axis=1),
        ]
    )
    # Around the profile: risers and treads upwards, then the back, then along the bottom to the front.
    outline = np.concatenate([[2 * n], np.arange(2 * n), np.arange(3 * n, 2 * n, -1)])
    here, there = outline, np.roll(outline, -1)
    walls = np.concatenate(
        [np.stack([here, here + m, there + m], axis=1), np.stack([here, there + m, there], axis=1)],
    )
    faces = np.concatenate([columns, columns[:, ::-1] + m, walls])
    return Triangles(vertices, faces.astype(np.int32))


def terrain(parameters: TerrainParameters) -> Triangles:
    """Rolling terrain over the unit square, open, facing up; heights from −½ to ½."""
    n = parameters.cells
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, n + 1), np.linspace(-0.5, 0.5, n + 1))
    random = np.random.default_rng(parameters.seed)
    height = np.zeros_like(x)
    for layer in range(4):
        for _ in range(3):
            angle, phase = random.uniform(0.0, 2 * np.pi, 2)
            frequency = 2 * np.pi * parameters.waves * 2**layer * random.uniform(0.7, 1.3)
            # Each octave doubles the frequency at a third of the amplitude, which keeps slopes gentle.
            height += np.sin(frequency * (x * np.cos(angle) + z * np.sin(angle)) + phase) / 3**layer
    low, high = height.min(), height.max()
    height = (height - low) / (high - low) - 0.5
    return Triangles(np.stack([x, height, z], axis=2).reshape(-1, 3), _grid_faces(n, n, n + 1))


def leaves(parameters: LeavesParameters) -> Triangles:
    """Flat open leaves, diamonds of two triangles each, with random orientations."""
    n = parameters.count
    random = np.random.default_rng(parameters.seed)
    outward = _directions(random, n)
    centers = outward * (0.5 - parameters.size / 2) * random.uniform(0.15, 1.0, (n, 1)) ** (1 / 3)
    # Most leaves face outwards, as on a tree, with random deviation.
    normals = outward + 0.8 * _directions(random, n)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    along = np.cross(normals, _directions(random, n))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along)
    length = parameters.size * random.uniform(0.7, 1.0, (n, 1)) / 2
    corners = [along * length, across * length * 0.6, -along * length, -across * length * 0.6]
    vertices = (centers[:, None] + np.stack(corners, axis=1)).reshape(-1, 3)
    quad = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Triangles(vertices, (quad + 4 * np.arange(n, dtype=np.int32)[:, None, None]).reshape(-1, 3))


def statue(parameters: StatueParameters) -> Triangles:
    """A draped figure of height 1, closed and smooth, whose folds, shoulders and head shadow the figure itself."""
    rings, sectors = parameters.rings, parameters.sectors
    t = np.linspace(0.0, 1.0, rings + 1)
    u = np.linspace(0.0, 2 * np.pi, sectors, endpoint=False)
    # Heights and radii of the outline; the first and last are poles.
    heights = [0.0, 0.004, 0.03, 0.30, 0.52, 0.60, 0.70, 0.775, 0.815, 0.845, 0.87, 0.92, 0.96, 0.985, 1.0]
    radii = [0.0, 0.20, 0.215, 0.165, 0.115, 0.125, 0.165, 0.135, 0.058, 0.055, 0.078, 0.092, 0.077, 0.048, 0.0]
    walk = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(heights), np.diff(radii)))])
    fine = np.linspace(0.0, walk[-1], 2001)
    y, r = (_smoothed(np.interp(fine, walk, values), 41) for values in (heights, radii))
    y, r = (np.interp(t, fine / walk[-1], values) for values in (y, r))
    r[[0, -1]] = 0.0
    y = (y - y[0]) / (y[-1] - y[0])

    # Folds deepen towards the hem and are twisted around the figure; the head has none.
    depth = 0.17 * np.clip(1.0 - y / 0.78, 0.0, 1.0) ** 0.7
    fold = depth[:, None] * np.cos(parameters.folds * u[None] + 5.0 * y[:, None])
    radius = r[:, None] * (1.0 + fold)
    sway = 0.035 * np.sin(2.6 * np.pi * y)[:, None]
    x = radius * np.cos(u) * (1.0 + 0.35 * _bump(y, 0.7, 0.09))[:, None] + sway  # shoulders are wider than deep
    z = radius * np.sin(u) + 0.5 * sway
    rows = np.stack([x, np.broadcast_to(y[:, None] - 0.5, x.shape), z], axis=2)

    body = rows[1:-1].reshape(-1, 3)
    foot, crown = rows[0].mean(axis=0), rows[-1].mean(axis=0)
    k = np.arange(sectors, dtype=np.int32)
    after, last = np.roll(k, -1), len(body) - sectors
    below = np.full(sectors, len(body), dtype=np.int32)
    faces = [
        np.stack([k, after, below], axis=1),
        _ring_faces(rings - 2, sectors),
        np.stack([last + after, last + k, below + 1], axis=1),
    ]
    return Triangles(np.concatenate([body, foot[None], crown[None]]), np.concatenate(faces).astype(np.int32))


def _grid_faces(rows: int, columns: int, stride: int) -> Faces:
    """(2·rows·columns, 3) triangles of a grid with `stride` vertices per row; they face +y if rows advance along +z."""
    row, column = np.mgrid[0:rows, 0:columns]
    a = (row * stride + column).ravel()
    b, c, d = a + 1, a + stride + 1, a + stride
    return np.stack([a, d, c, a, c, b], axis=1).reshape(-1, 3).astype(np.int32)


def _ring_faces(bands: int, sectors: int) -> Faces:
    """(2·bands·sectors, 3) triangles between rings of `sectors` vertices, from bottom to top, facing outwards."""
    band, k = np.mgrid[0:bands, 0:sectors]
    a = (band * sectors + k).ravel()
    b = (band * sectors + (k + 1) % sectors).ravel()
    c, d = b + sectors, a + sectors
    return np.stack([a, d, c, a, c, b], axis=1).reshape(-1, 3).astype(np.int32)


def _directions(random: np.random.Generator, count: int) -> Floats:
    """(count, 3) unit vectors, uniformly distributed over the sphere."""
    vectors = random.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _smoothed(values: Floats, width: int) -> Floats:
    """Moving average over `width` samples, with the end values repeated."""
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _bump(y: Floats, center: float, width: float) -> Floats:
    """Gaussian with value 1 at `center`, about 0 at twice `width` from it."""
    return np.exp(-(((y - center) / width) ** 2))
