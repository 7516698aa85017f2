"""Cube maps: shadows compared with closed forms, lookups with NumPy, biases on faces and at corners."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from scipy.spatial import cKDTree

from shadowbench.scenes.model import Camera, Light, Mesh, Scene, view_of
from shadowbench.scenes.vectors import unit
from shadowbench.truths.trace import Truth, trace
from tests.samples import by_turns, pairs

FACE_ON = [unit(axis) for axis in (*np.eye(3), *-np.eye(3))]
DIRECTIONS = [*FACE_ON, *map(unit, [(1, 1, 0), (0, -1, 1), (-1, 0, -1), (1, 1, 1), (-1, 1, -1), (1, -1, -1)])]
EDGE, TIE = 2e-3, 2e-6  # texels, depth: nearer than that, float32 decides

# Rows s, t and axis of +X −X +Y −Y +Z −Z, from the table of the OpenGL specification (8.13, "Cube Map Selection").
FACES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    dtype=float,
)


def lamp(*position: float) -> Light:
    return Light("lamp", "point", position=position)


def filed(shot) -> np.ndarray:
    """Positions of a shot in the file's coordinates."""
    return shot.position[..., :3] / shot.placement.scale + shot.placement.center


@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_a_sphere_shadows_its_tangent_cone_in_every_direction(direction, shape, looking, mask, studio) -> None:
    """Towards the middles of all faces, of all edges and to all corners; on the walls of a room that casts nothing."""
    light = np.array([0.13, -0.21, 0.08])
    meshes = [shape("box", 4.0, casts=False), shape("sphere", 0.4, light + direction, subdivisions=5)]
    side = unit(np.cross(direction, (0.3, 1.0, -0.2)))  # past the sphere, at its shadow
    view = looking(
        meshes, lamp(*light), 128, eye=tuple(light + 0.9 * side), target=tuple(light + 2 * direction), fov=80
    )
    shot, dark = studio.shot(view), mask("cube-map:size=512", view) < 0.5
    away = filed(shot) - light
    cosine = away @ direction / np.linalg.norm(away, axis=-1)
    angle, wall = np.arccos(np.clip(cosine, -1, 1)), shot.triangle < 12
    outline = math.asin(0.2)
    inside, outside = (wall & (angle < 0.97 * outline)), (wall & (angle > 1.03 * outline))
    assert inside.sum() > 300 and outside.sum() > 3000
    assert dark[inside].all() and not dark[outside].any()


@pytest.mark.parametrize(("depth", "layers"), by_turns(["d16", "d24", "d32f"], ["passes", "geometry"]))
def test_a_caster_a_tenth_of_a_millimetre_from_the_lamp_casts(depth, layers, looking, mask, studio) -> None:
    """A plate of 0.1 mm, 0.1 mm below a lamp 1 m above the ground, throws a square of 1 m."""
    light = np.array([0.05, 1.0, -0.1])
    square = np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    plate = Mesh("plate", light + 1e-4 * (square / 2 - [0, 1, 0]), faces)
    view = looking([Mesh("ground", 2 * square, faces), plate], lamp(*light), 128, eye=(1.0, 2.5, 1.3))
    dark = mask(f"cube-map:size=512,depth={depth},layers={layers}", view) < 0.5
    shot = studio.shot(view)
    reach = np.abs(filed(shot) - light)[..., [0, 2]].max(axis=-1)
    ground = (shot.triangle >= 0) & (shot.triangle < 2)
    assert dark[ground & (reach < 0.49)].all() and not dark[ground & (reach > 0.51)].any()
    assert (ground & (reach < 0.49)).sum() > 1000


@pytest.mark.parametrize(
    ("name", "items"),
    by_turns(
        ["room-with-lamp", "lamp-by-wall", "lamp-over-table"],
        ["", "bias=front-cull,filter=hard", "depth=d16,size=256,filter=pcf-20"],
    ),
)
def test_geometry_shader_and_six_passes_give_the_same_bits(name, items, builtin, build, studio) -> None:
    """At powers of two. Where a viewport rounds, it does so in two ways: maps of 300² differ in a last bit."""
    shot = studio.shot(builtin(name, 128))
    drawn = [build(f"cube-map:layers={layers}" + (items and f",{items}"), shot) for layers in ("geometry", "passes")]
    masks = [one.draw(shot) for one in drawn]
    maps = [one.technique.map.texture.read() for one in drawn]
    assert np.array_equal(*masks) and np.array_equal(*maps)
    assert (masks[0] < 0.5).sum() > 100 and sum((face < 1).any() for face in maps[0]) >= 3


class CubeLookup:
    """Texels of a cube map that directions from the light fall on, computed independently of the shaders."""

    def __init__(self, technique, shot, bias: float) -> None:
        self.away = shot.position[..., :3] - np.asarray(shot.view.light.position)
        distance = np.linalg.norm(self.away, axis=-1)
        cosine = -np.einsum("ijk,ijk->ij", shot.normal[..., :3], self.away) / np.maximum(distance, 1e-9)
        self.usable = (shot.position[..., 3] > 0) & (cosine > 1e-4)
        self.compared = (distance - bias) / technique.far
        self.faces, self.size = technique.map.texture.read().astype(float), technique.params.size
        self.sure = self.usable.copy()

    def texels(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(face, (column, row) with fractions) of each direction."""
        face = np.argmax(directions @ FACES[:, 2].T, axis=-1)
        s, t, axis = np.moveaxis(np.einsum("...ij,...j->...i", FACES[face], directions), -1, 0)
        return face, (np.stack([s, t], axis=-1) / axis[..., None] + 1) / 2 * self.size

    def lit(self, directions: np.ndarray) -> np.ndarray:
        face, place = self.texels(np.where(self.usable[..., None], directions, 1.0))
        self.sure &= (np.abs(place - np.round(place)) > EDGE).all(axis=-1)
        column, row = np.moveaxis(np.clip(np.floor(place).astype(int), 0, self.size - 1), -1, 0)
        stored = self.faces[face, row, column]
        self.sure &= np.abs(self.compared - stored) > TIE
        return (self.compared <= stored).astype(float)


@pytest.mark.parametrize(
    ("filter_", "name"),
    by_turns(["hard", "pcf(3)", "pcf-20", "pcf-20(spread=0.1)"], ["room-with-lamp", "lamp-by-wall"]),
)
def test_filters_compare_the_texels_that_they_say(name, filter_, builtin, build, studio) -> None:
    shot = studio.shot(builtin(name, 192))
    one = build(f"cube-map:size=128,bias=constant(world=0.05),filter={filter_}", shot)
    found = one.draw(shot)
    scale = shot.placement.scale
    lookup = CubeLookup(one.technique, shot, 0.05 * scale)
    if filter_.startswith("pcf-20"):
        spread = (0.1 if "spread" in filter_ else 1 / 25) * scale
        to_eye = np.linalg.norm(shot.position[..., :3] - np.asarray(shot.view.camera.position), axis=-1)
        side = spread * (1 + to_eye / shot.view.near_far[1])
        steps = [side[..., None] * np.array(c) for c in product((-1, 0, 1), repeat=3) if np.abs(c).sum() >= 2]
        assert len(steps) == 20
    else:
        face, _ = lookup.texels(lookup.away)
        reach = 1 if filter_ == "pcf(3)" else 0
        texel = 2 * np.abs(lookup.away).max(axis=-1)[..., None] / one.technique.params.size
        across = range(-reach, reach + 1)
        steps = [texel * (x * FACES[face, 0] + y * FACES[face, 1]) for x in across for y in across]
    expected = np.mean([lookup.lit(lookup.away + step) for step in steps], axis=0)
    sure = lookup.sure
    assert sure.sum() > 0.7 * lookup.usable.sum() and 0.02 < (expected[sure] < 0.5).mean() < 0.98
    assert np.abs(found - expected)[sure].max() < 1e-6


def facing(tilt: float, toward: np.ndarray, looking, size: int = 128):
    """A plane that a lamp at the origin sees in a direction, leaning away along a texel's diagonal on the +Z face."""
    toward = unit(toward)
    across = unit(np.cross(toward, (1, 1, 0) if toward[2] > 0.9 else (0, 0, 1)))
    normal = -math.cos(math.radians(tilt)) * toward + math.sin(math.radians(tilt)) * across
    one, other = across + math.tan(math.radians(tilt)) * toward, np.cross(toward, across)
    one = 0.6 * unit(one)
    corners = 2 * toward + np.array([-one - 0.6 * other, one - 0.6 * other, one + 0.6 * other, -one + 0.6 * other])
    mesh = Mesh("plane", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    return looking([mesh], lamp(0.0, 0.0, 0.0), size, tuple(2 * toward + 0.9 * normal), tuple(2 * toward), 50)


CORNER, FACE, BORDER = (1.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("tilt", "toward", "filter_"),
    pairs([5.0, 60.0, 85.0], [FACE, BORDER, CORNER, (-0.8, -1.0, 0.9)], ["hard", "hardware", "pcf(7)", "pcf-20"]),
)
def test_an_inclined_plane_has_no_acne_anywhere_on_the_cube(tilt, toward, filter_, looking, mask) -> None:
    for size in (61, 256):
        visibility = mask(f"cube-map:bias=texel(limit=64),filter={filter_},size={size}", facing(tilt, toward, looking))
        # Where three faces meet, three texels are averaged: a third is no float.
        assert (visibility > 1 - 1e-6).all(), f"{(visibility < 1).sum()} pixels at {size}"


def test_the_map_image_is_a_cross_of_distances(shape, looking, build, studio) -> None:
    """A lamp in an empty room of 4 m, at another distance from each wall."""
    light = np.array([0.3, -0.7, 1.1])
    shot = studio.shot(looking([shape("box", 4.0)], lamp(*light), 32, eye=(1.5, 1.5, 1.5)))
    one = build("cube-map:size=65", shot)
    one.draw(shot)
    cross = one.technique.map_image() * one.technique.facts()["depth_range_m"]
    assert cross.shape == (3 * 65, 4 * 65)
    middle = cross[32::65, 32::65]
    far = one.technique.facts()["depth_range_m"]
    assert far == pytest.approx(np.linalg.norm(np.abs(light) + 2), rel=2e-3)
    xs, ys, zs = ((2 - value, 2 + value) for value in light)  # to the walls at + and −
    expected = [[far, far, ys[0], far], [zs[1], xs[0], zs[0], xs[1]], [far, far, ys[1], far]]
    assert middle == pytest.approx(np.array(expected), rel=1e-5)
    # Neighbours in the picture are neighbours in the room, and up is up.
    assert cross[65:130, 129] == pytest.approx(cross[65:130, 130], rel=0.02)
    assert cross[64, 130:195] == pytest.approx(cross[65, 130:195], rel=0.02)
    assert cross[129, 130:195] == pytest.approx(cross[130, 130:195], rel=0.02)


# Seams, where the map has them: in texels of the face that a pixel's receiver lies on

SEAMS = 256  # texels along a side of a face


@dataclass(frozen=True)
class EdgePixels:
    """The decided pixels of a view within two texels of a true shadow edge, and which of them lie at a seam."""

    decided: np.ndarray  # (H, W)
    dark: np.ndarray  # of the decided, by the truth
    edge: np.ndarray
    seam: np.ndarray

    def count(self, mask: np.ndarray) -> np.ndarray:
        """[[pixels, wrong pixels] at seams, the same elsewhere]."""
        wrong = (mask[self.decided] < 0.5) != self.dark
        parts = [self.edge & self.seam, self.edge & ~self.seam]
        return np.array([[part.sum(), (part & wrong).sum()] for part in parts])


def edge_pixels(shot, truth: Truth) -> EdgePixels:
    """A true edge passes between two neighbouring decided pixels of one triangle that differ.

    A seam lies where the two largest components of the direction from the light are equal. Near is within two texels.
    """
    away = shot.position[..., :3] - np.asarray(shot.view.light.position)
    decided, dark = truth.receivers & ~truth.undecided, truth.visibility < 0.5
    found = []
    for a, b in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        crossed = decided[a] & decided[b] & (shot.triangle[a] == shot.triangle[b]) & (dark[a] != dark[b])
        found.append(((away[a] + away[b]) / 2)[crossed])
    edges, pixels = (u / np.linalg.norm(u, axis=1, keepdims=True) for u in (np.concatenate(found), away[decided]))
    edges = edges[cKDTree(edges).query(pixels)[1]]
    axis = np.eye(3)[np.argmax(np.abs(pixels), axis=1)] * np.sign(pixels)
    on_face, edge_on_face = (u / np.maximum((u * axis).sum(axis=1, keepdims=True), 1e-9) for u in (pixels, edges))
    texels = SEAMS / 2
    to_edge = np.abs(on_face - edge_on_face).max(axis=1) * texels
    to_seam = (1 - np.sort(np.abs(on_face), axis=1)[:, 1]) * texels
    return EdgePixels(decided, dark[decided], to_edge <= 2, to_seam <= 2)


def test_the_hardware_s_filter_reads_across_seams(builtin, studio, build, device) -> None:
    """Switched off, the mask changes within half a texel of a seam, and nowhere else."""
    shot = studio.shot(builtin("lamp-by-wall", 384))
    one = build("cube-map:size=32", shot)
    across = one.draw(shot)
    device.context.disable_direct(0x884F)
    try:
        clamped = one.draw(shot)
    finally:
        device.context.enable_direct(0x884F)
    away = np.sort(np.abs(shot.position[..., :3] - np.asarray(shot.view.light.position)), axis=-1)
    to_seam = (1 - away[..., 1] / away[..., 2]) * 16
    changed = np.abs(across - clamped) > 1e-3
    assert changed.sum() > 100 and to_seam[changed].max() < 0.51


@pytest.mark.slow
def test_shadow_edges_are_no_worse_at_seams(shape, studio, mask) -> None:
    """Over lamps amid 160 boxes and spheres in a room."""
    random = np.random.default_rng(5)
    meshes = [shape("box", 4.0, casts=False)]
    for number in range(160):
        scale = random.uniform(0.06, 0.2, 3 if number % 2 else 1)
        place = random.uniform(0.6, 1.6) * unit(random.normal(size=3))
        meshes.append(shape("box" if number % 2 else "sphere", scale, place))
    scene, counts = Scene("seams", tuple(meshes), (), ()), np.zeros((2, 2))
    for _ in range(16):
        eye = random.choice([-1.0, 1.0], 3) * [1.8, 1.6, 1.4]
        camera = Camera("corner", tuple(eye), tuple(-0.3 * eye), 1.5)
        light = Light("lamp", "point", position=tuple(random.uniform(-0.25, 0.25, 3)))
        view = view_of(scene, camera, light, 320)
        pixels = edge_pixels(studio.shot(view), trace(view, pixel_samples=1))
        counts += pixels.count(mask(f"cube-map:size={SEAMS}", view))
    (seam, wrong_at_seam), (other, wrong_elsewhere) = counts
    assert min(seam, other) >= 2000
    assert wrong_at_seam / seam <= min(1.5 * wrong_elsewhere / other, 0.05)  # found: 0.0424, elsewhere 0.0441
