"""Shapes for scene files, centred on the origin, with faces wound outwards. All are deterministic.

plane 1×1 in xz, normal +y; box 1³; sphere radius ½; torus radii ½ and ⅙, around y; cylinder and cone radius ½ and
height 1 along y; capsule radius ½ with a cylinder of height 1 along y, of total height 2. Stairs, terrain, leaves, a
draped statue, foliage that is cut out of cards and a walker are difficult for shadow techniques.
"""

from collections.abc import Callable
from functools import cache
from inspect import signature
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.cutouts import Cutout, cut_out
from shadowbench.scenes.model import Mesh
from shadowbench.scenes.triangles import Faces, Triangles, welded, without_zero_area
from shadowbench.scenes.vectors import Floats
from shadowbench.strict import Model, Strict, validated

_POLE = 1e-8  # radius below which points of a profile are on the axis
Sections = Annotated[int, Field(ge=3, le=1024, strict=True)]  # segments around the axis


def torus(sections: Sections = 64) -> Triangles:
    """A horizontal ring, with half as many sections around the tube as around the axis."""
    angles = np.linspace(0, 2 * np.pi, max(3, sections // 2) + 1)
    angles[-1] = 0
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return _revolved(circle * (1 / 6) + [0.5, 0.0], sections)


def cylinder(sections: Sections = 64) -> Triangles:
    """A closed cylinder."""
    return _revolved(np.array([[0, -0.5], [0.5, -0.5], [0.5, 0.5], [0, 0.5]]), sections)


def cone(sections: Sections = 64) -> Triangles:
    """A closed cone with its apex up, centred at half its height."""
    triangles = _revolved(np.array([[0, 0], [0.5, 0], [0, 1]]), sections)
    return Triangles(triangles.vertices - [0.0, 0.5, 0.0], triangles.faces)


def capsule(sections: Sections = 64) -> Triangles:
    """A cylinder of height 1 between two hemispheres."""
    quarter = (max(4, sections // 2) + 1) // 2 + 1  # points from the equator to a pole
    angles = np.concatenate([np.linspace(-np.pi / 2, 0, quarter), np.linspace(0, np.pi / 2, quarter)])
    profile = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.5
    profile[:quarter, 1] -= 0.5
    profile[quarter:, 1] += 0.5
    return _revolved(profile, sections + sections % 2)


def _revolved(profile: Floats, sections: int) -> Triangles:
    """The surface that a profile of (P, 2) radii and heights sweeps around the y axis, upwards on its outside."""
    radius, height = profile.T
    angles = np.linspace(0, 2 * np.pi, sections + 1)[:-1, np.newaxis]
    angles = np.where(np.abs(radius) < _POLE, 0, angles)  # (sections, P)
    points = np.stack(
        [np.cos(angles) * radius, np.sin(angles) * radius, np.broadcast_to(height, angles.shape)], axis=-1
    )
    count = len(radius)
    quad = np.array([[0, count, 1], [1, count, count + 1]])
    strips = np.arange(sections)[:, np.newaxis] * count + np.arange(count - 1)  # the first corner of each quad
    corners = (strips[..., np.newaxis, np.newaxis] + quad).reshape(-1, 3) % (sections * count)
    closed = without_zero_area(welded(points.reshape(-1, 3), corners))[0]
    return Triangles(closed.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0], closed.faces)


_HIP, _KNEE, _CHEST, _NECK, _HEAD = 0.50, 0.26, 0.78, 0.84, 0.93  # heights, of a figure of height 1
_STRIDE, _SWING, _BEND = np.radians(28.0), np.radians(24.0), np.radians(50.0)


def walker(
    phase: Annotated[float, Field(ge=0.0, le=1.0, strict=True)] = 0.1,
    sections: Annotated[int, Field(ge=4, le=256, strict=True)] = 12,
) -> Triangles:
    """A walking figure of height about 1 that faces +z, of closed limbs that overlap, its feet near y = 0.

    phase: of its stride, a whole one from 0 to 1; sections: around a limb.
    """
    angle = 2 * np.pi * phase
    limbs = [
        _limb((0, _HIP, 0), (0, _CHEST, 0), 0.085, 0.1, sections),
        _limb((0, _NECK, 0), (0, _HEAD, 0.01), 0.03, 0.065, sections),
    ]
    for side in (-1.0, 1.0):
        leg, arm = side * np.sin(angle), -side * np.sin(angle)
        bend = _BEND * max(0.0, side * np.cos(angle)) ** 2 + 0.08
        hip, shoulder = np.array([0.055 * side, _HIP, 0.0]), np.array([0.125 * side, _CHEST, 0.0])
        thigh = _STRIDE * leg
        knee = hip + (_HIP - _KNEE) * _down(thigh)
        ankle = knee + (_KNEE - 0.04) * _down(thigh - bend)
        elbow = shoulder + 0.16 * _down(_SWING * arm)
        hand = elbow + 0.17 * _down(_SWING * arm + 0.5)
        toe = ankle + 0.1 * np.array([0.0, np.sin(thigh - bend), np.cos(thigh - bend)])
        limbs += [_limb(hip, knee, 0.055, 0.043, sections), _limb(knee, ankle, 0.041, 0.03, sections)]
        limbs += [_limb(ankle, toe, 0.032, 0.026, sections), _limb(shoulder, elbow, 0.036, 0.031, sections)]
        limbs.append(_limb(elbow, hand, 0.029, 0.026, sections))
    starts = np.cumsum([0, *(len(limb.vertices) for limb in limbs[:-1])])
    faces = np.concatenate([limb.faces + start for limb, start in zip(limbs, starts, strict=True)])
    vertices = np.concatenate([limb.vertices for limb in limbs])
    return Triangles(vertices - [0.0, vertices[:, 1].min(), 0.0], faces.astype(np.int32))


def _down(angle: float) -> Floats:
    """Unit vector downwards, turned forwards by an angle."""
    return np.array([0.0, -np.cos(angle), np.sin(angle)])


def _limb(start: object, end: object, first: float, last: float, sections: int) -> Triangles:
    """A closed capsule between two points, of radius `first` at the start and `last` at the end."""
    one, other = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    along = (other - one) / np.linalg.norm(other - one)
    across = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    basis = np.stack([across, along, np.cross(across, along)])
    shape = capsule(sections)
    upper = shape.vertices[:, 1] > 0
    round_part = shape.vertices - np.where(upper, 0.5, -0.5)[:, None] * [0.0, 1.0, 0.0]
    vertices = np.where(upper[:, None], other, one) + 2 * np.where(upper, last, first)[:, None] * round_part @ basis
    return Triangles(vertices, shape.faces)


_LEAFLETS = 4  # on each side of a twig, besides the one at its end
LEAF = 0.36
"""Length of the longest leaf, as a share of a card's side."""
_EDGE = 1.5  # texels from 0 to 255 at the edge of a leaf
_FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


class Cards(NamedTuple):
    """Squares of two triangles, cut out. vertices: (4 N, 3); faces: (2 N, 3); coordinates, places: (2 N, 3, 2)."""

    vertices: Floats
    faces: Faces
    cutout: Cutout
    coordinates: NDArray[np.float32]
    places: NDArray[np.float32]


def foliage(
    count: Annotated[int, Field(ge=1, le=50_000, strict=True)] = 200,
    size: Annotated[float, Field(gt=0.0, le=1.0, strict=True)] = 0.3,
    texels: Annotated[int, Field(ge=4, le=1024, strict=True)] = 64,
    nearest: Annotated[bool, Field(strict=True)] = False,
    seed: Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)] = 1,
) -> Cards:
    """Twigs of leaves, cut out by alpha of cards with random orientations in a ball of diameter 1.

    count: cards, denser towards the ball's surface; size: side of a card; texels: along a side of the mask; nearest:
    the nearest texel in place of four mixed bilinearly; seed: of the orientations.
    """
    random = np.random.default_rng(seed)
    outward, other = random.normal(size=(2, count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    middle = outward * (0.5 - size / 2) * random.uniform(0.1, 1.0, (count, 1)) ** (1 / 3)
    across = np.cross(outward, other)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = outward + 0.7 * np.cross(outward, across)  # twigs point outwards, with random deviation
    up -= across * np.einsum("ij,ij->i", up, across)[:, None]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    half = size / 2
    corners = [middle + half * (x * across + y * up) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = (4 * np.arange(count, dtype=np.int32)[:, None, None] + _FACES).reshape(-1, 3)
    corners_of = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)  # v downwards
    coordinates = np.tile(corners_of[_FACES], (count, 1, 1))
    cutout = cut_out(twig(texels), nearest=nearest, wrap=("clamp", "clamp"))
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    return Cards(vertices, faces, cutout, coordinates, cutout.places(coordinates))


@cache
def twig(texels: int) -> NDArray[np.uint8]:
    """(texels, texels) uint8 alpha of a twig that grows upwards, opaque in its leaves; read-only, as it is cached."""
    across, along = np.meshgrid(*(2 * [(np.arange(texels) + 0.5) / texels]), indexing="xy")
    x, y = across - 0.5, 1.0 - along  # y from the foot up
    inside = 0.018 - np.hypot(x, np.minimum(np.maximum(y - 0.85, 0.0), 1.0))  # the stem, to a height of 0.85
    for number in range(_LEAFLETS):
        for side in (-1.0, 1.0):
            inside = np.maximum(inside, _leaf(x, y, (0.0, 0.08 + 0.19 * number), side * np.radians(62.0), LEAF))
    inside = np.maximum(inside, _leaf(x, y, (0.0, 0.66), 0.0, 0.32))
    alpha = np.clip(0.5 + inside * texels / _EDGE, 0.0, 1.0)
    alpha[:, [0, -1]] = alpha[[0, -1]] = 0.0  # nothing reaches a card's edge
    result = np.rint(255 * alpha).astype(np.uint8)
    result.flags.writeable = False
    return result


def _leaf(x: Floats, y: Floats, foot: tuple[float, float], turn: float, length: float) -> Floats:
    """Roughly the distance inwards from the outline of a leaf: where two circles overlap."""
    sine, cosine = np.sin(turn), np.cos(turn)
    u = (x - foot[0]) * cosine - (y - foot[1]) * sine
    v = (x - foot[0]) * sine + (y - foot[1]) * cosine - length / 2
    radius = 0.62 * length
    offset = np.sqrt(radius**2 - (length / 2) ** 2)
    inside: Floats = radius - np.maximum(np.hypot(u - offset, v), np.hypot(u + offset, v))
    return inside


_BOX = [[6, 4, 7], [3, 6, 7], [7, 4, 5], [5, 3, 7], [6, 0, 4], [2, 6, 3], [2, 0, 6], [4, 0, 5], [1, 3, 5], [5, 0, 1]]
_BOX += [[1, 2, 3], [0, 2, 1]]
_ICOSAHEDRON = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2]]
_ICOSAHEDRON += [[10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11]]
_ICOSAHEDRON += [[6, 2, 10], [8, 6, 7], [9, 8, 1]]
Sectors = Annotated[int, Field(ge=8, le=512, strict=True)]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]


class Mapped(NamedTuple):
    """Triangles with (F, 3, 2) float32 texture coordinates."""

    vertices: Floats
    faces: Faces
    coordinates: NDArray[np.float32]


def plane() -> Mapped:
    """A unit square of two triangles; an image on it has its upper edge at −z."""
    corners = np.array([[-0.5, 0.0, 0.5], [0.5, 0.0, 0.5], [0.5, 0.0, -0.5], [-0.5, 0.0, -0.5]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Mapped(corners, faces, (corners[:, [0, 2]] + 0.5).astype(np.float32)[faces])


def box() -> Triangles:
    """A unit cube of twelve triangles and eight vertices."""
    corners = np.array(list(product((0.5, -0.5), repeat=3)))
    return Triangles(corners, np.array(_BOX, dtype=np.int32))


def sphere(subdivisions: Annotated[int, Field(ge=0, le=7, strict=True)] = 4) -> Triangles:
    """An icosphere, whose triangles are of nearly equal size; each subdivision splits them into four."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(short, long, 0.0) for long, short in product((golden, -golden), (-1.0, 1.0))]
    points = np.array([corner[turn:] + corner[:turn] for turn in (0, 2, 1) for corner in corners])
    points, faces = points / np.sqrt(1 + golden**2), np.array(_ICOSAHEDRON)
    for level in range(max(subdivisions, 1)):
        if level < subdivisions:
            edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
            ends, inverse = np.unique(edges, axis=0, return_inverse=True)
            (a, b, c), (ab, bc, ca) = faces.T, inverse.reshape(-1, 3).T + len(points)
            points = np.vstack([points, points[ends].mean(axis=1)])
            faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        length = np.sqrt((points**2).sum(axis=1, keepdims=True))
        points = points + points / length * (0.5 - length)
    return welded(points, faces)


def stairs(steps: Annotated[int, Field(ge=1, le=1000, strict=True)] = 6) -> Triangles:
    """A closed flight of stairs in the unit cube, rising towards −z; treads face +y, risers +z."""
    n = steps
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


def terrain(
    cells: Annotated[int, Field(ge=2, le=512, strict=True)] = 128,
    waves: Annotated[float, Field(gt=0.0, le=8.0, strict=True)] = 2.0,
    seed: Seed = 1,
) -> Triangles:
    """Rolling terrain over the unit square, open, facing up; heights from −½ to ½.

    cells: quads along a side; waves: waves along a side in the coarsest of four octaves; seed: of the hills.
    """
    n = cells
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, n + 1), np.linspace(-0.5, 0.5, n + 1))
    random = np.random.default_rng(seed)
    height = np.zeros_like(x)
    for layer in range(4):
        for _ in range(3):
            angle, phase = random.uniform(0.0, 2 * np.pi, 2)
            frequency = 2 * np.pi * waves * 2**layer * random.uniform(0.7, 1.3)
            # Each octave doubles the frequency at a third of the amplitude, which keeps slopes gentle.
            height += np.sin(frequency * (x * np.cos(angle) + z * np.sin(angle)) + phase) / 3**layer
    low, high = height.min(), height.max()
    height = (height - low) / (high - low) - 0.5
    return Triangles(np.stack([x, height, z], axis=2).reshape(-1, 3), _grid_faces(n, n, n + 1))


def leaves(
    count: Annotated[int, Field(ge=1, le=50_000, strict=True)] = 800,
    size: Annotated[float, Field(gt=0.0, le=1.0, strict=True)] = 0.1,
    seed: Seed = 1,
) -> Triangles:
    """Flat open leaves, diamonds of two triangles each, with random orientations.

    count: leaves in a ball of diameter 1, denser towards its surface; size: length of the longest.
    """
    n = count
    random = np.random.default_rng(seed)
    outward = _directions(random, n)
    centers = outward * (0.5 - size / 2) * random.uniform(0.15, 1.0, (n, 1)) ** (1 / 3)
    # Most leaves face outwards, as on a tree, with random deviation.
    normals = outward + 0.8 * _directions(random, n)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    along = np.cross(normals, _directions(random, n))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along)
    length = size * random.uniform(0.7, 1.0, (n, 1)) / 2
    corners = [along * length, across * length * 0.6, -along * length, -across * length * 0.6]
    vertices = (centers[:, None] + np.stack(corners, axis=1)).reshape(-1, 3)
    quad = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Triangles(vertices, (quad + 4 * np.arange(n, dtype=np.int32)[:, None, None]).reshape(-1, 3))


def statue(
    rings: Sectors = 160, sectors: Sectors = 160, folds: Annotated[int, Field(ge=0, le=40, strict=True)] = 11
) -> Triangles:
    """A draped figure of height 1, closed and smooth, whose folds, shoulders and head shadow the figure itself.

    rings: of vertices from foot to crown; sectors: vertices around; folds: of the drapery.
    """
    t = np.linspace(0.0, 1.0, rings + 1)
    u = np.linspace(0.0, 2 * np.pi, sectors, endpoint=False)
    # Heights and radii of the outline; the first and last are poles.
    heights = [0.0, 0.004, 0.03, 0.30, 0.52, 0.60, 0.70, 0.775, 0.815, 0.845, 0.87, 0.92, 0.96, 0.985, 1.0]
    radii = [0.0, 0.20, 0.215, 0.165, 0.115, 0.125, 0.165, 0.135, 0.058, 0.055, 0.078, 0.092, 0.077, 0.048, 0.0]
    walk = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(heights), np.diff(radii)))])
    fine = np.linspace(0.0, walk[-1], 2001)
    padded = [np.pad(np.interp(fine, walk, values), 20, mode="edge") for values in (heights, radii)]
    y, r = (np.convolve(values, np.full(41, 1.0 / 41), mode="valid") for values in padded)  # a moving average
    y, r = (np.interp(t, fine / walk[-1], values) for values in (y, r))
    r[[0, -1]] = 0.0
    y = (y - y[0]) / (y[-1] - y[0])

    # Folds deepen towards the hem and are twisted around the figure; the head has none.
    depth = 0.17 * np.clip(1.0 - y / 0.78, 0.0, 1.0) ** 0.7
    fold = depth[:, None] * np.cos(folds * u[None] + 5.0 * y[:, None])
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


def _bump(y: Floats, center: float, width: float) -> Floats:
    """Gaussian with value 1 at `center`, about 0 at twice `width` from it."""
    return np.exp(-(((y - center) / width) ** 2))


_ALL = (plane, box, sphere, torus, cylinder, cone, capsule, stairs, terrain, leaves, statue, foliage, walker)
SHAPES: dict[str, Callable[..., Triangles | Mapped | Cards]] = {shape.__name__: shape for shape in _ALL}

WITH_COORDINATES = ("plane", "foliage")
"""Shapes with texture coordinates, which reach from 0 to 1."""


def shape_table(name: str, base: type[Model], where: str) -> type[Model]:
    """The model of a shape's parameters beside the fields of `base`. Raises InputError for an unknown name."""
    if name not in SHAPES:
        raise InputError(f"{where}: shape: unknown {name!r:.60}{alternatives(name, SHAPES)}")
    return _shape_table(name, base)


@cache
def _shape_table(name: str, base: type[Model]) -> type[Model]:
    parameters: dict[str, Any] = {
        key: (parameter.annotation, parameter.default) for key, parameter in signature(SHAPES[name]).parameters.items()
    }
    return create_model(name, __base__=base, **parameters)


def build_shape(name: str, parameters: dict[str, object], where: str) -> Mesh:
    """A shape's mesh, of its name. Raises InputError that begins with `where` for an unknown name or parameter."""
    table = validated(shape_table(name, Strict, where), parameters, where)
    made: Any = SHAPES[name](**dict(table))._asdict()
    return Mesh(name, made.pop("vertices"), **made)
