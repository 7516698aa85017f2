"""Cube maps: shadows compared with closed forms, lookups with NumPy, biases on faces and at corners."""

import math
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


def test_geometry_shader_and_six_passes_give_the_same_bits(builtin, build, studio) -> None:
    """At powers of two. Where a viewport rounds, it does so in two ways: maps of 300² differ in a last bit."""
    shot = studio.shot(builtin("lamp-by-wall", 128))
    drawn = [build(f"cube-map:layers={layers},bias=front-cull", shot) for layers in ("geometry", "passes")]
    masks = [one.draw(shot) for one in drawn]
    maps = [one.technique.map.texture.read() for one in drawn]
    assert np.array_equal(*masks) and np.array_equal(*maps)
    assert (masks[0] < 0.5).sum() > 100 and sum((face < 1).any() for face in maps[0]) >= 3


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
    own = ["two-planes"] if filter_ != "pcf-20" else []
    for size, bias in product((61, 256), ["texel(limit=64)", *own]):
        visibility = mask(f"cube-map:bias={bias},filter={filter_},size={size}", facing(tilt, toward, looking))
        # Where three faces meet, three texels are averaged: a third is no float.
        assert (visibility > 1 - 1e-6).all(), f"{(visibility < 1).sum()} pixels at {size}"


def test_the_map_image_has_the_six_faces_side_by_side(shape, looking, build, studio) -> None:
    """A lamp in an empty room of 4 m, at another distance from each wall."""
    light = np.array([0.3, -0.7, 1.1])
    shot = studio.shot(looking([shape("box", 4.0)], lamp(*light), 32, eye=(1.5, 1.5, 1.5)))
    one = build("cube-map:size=65", shot)
    one.draw(shot)
    far = one.technique.facts()["depth_range_m"]
    assert far == pytest.approx(np.linalg.norm(np.abs(light) + 2), rel=2e-3)
    faces = one.technique.map_image() * far
    assert faces.shape == (65, 6 * 65)
    assert faces[32, 32::65] == pytest.approx([wall for at in light for wall in (2 - at, 2 + at)], rel=1e-5)


# Seams, where the map has them: in texels of the face that a pixel's receiver lies on

SEAMS = 256  # texels along a side of a face


def edge_pixels(shot, truth: Truth, mask: np.ndarray) -> np.ndarray:
    """[[pixels, wrong pixels] at seams, the same elsewhere], of the decided pixels within two texels of a true edge.

    A true edge passes between two neighbouring decided pixels of one triangle that differ. A seam lies where the two
    largest components of the direction from the light are equal. Near is within two texels.
    """
    away = shot.position[..., :3] - np.asarray(shot.view.light.position)
    decided, dark = truth.receivers & ~truth.undecided, truth.visibility < 0.5
    crossings = []
    for a, b in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        crossed = decided[a] & decided[b] & (shot.triangle[a] == shot.triangle[b]) & (dark[a] != dark[b])
        crossings.append(((away[a] + away[b]) / 2)[crossed])
    edges, pixels = (u / np.linalg.norm(u, axis=1, keepdims=True) for u in (np.concatenate(crossings), away[decided]))
    edges = edges[cKDTree(edges).query(pixels)[1]]
    axis = np.eye(3)[np.argmax(np.abs(pixels), axis=1)] * np.sign(pixels)
    on_face, edge_on_face = (u / np.maximum((u * axis).sum(axis=1, keepdims=True), 1e-9) for u in (pixels, edges))
    edge = np.abs(on_face - edge_on_face).max(axis=1) * SEAMS / 2 <= 2
    seam = (1 - np.sort(np.abs(on_face), axis=1)[:, 1]) * SEAMS / 2 <= 2
    wrong = (mask < 0.5)[decided] != dark[decided]
    return np.array([[part.sum(), (part & wrong).sum()] for part in (edge & seam, edge & ~seam)])


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
        meshes.append(shape("box", scale, place) if number % 2 else shape("sphere", scale, place, subdivisions=2))
    scene, counts = Scene("seams", tuple(meshes), (), ()), np.zeros((2, 2))
    for _ in range(16):
        eye = random.choice([-1.0, 1.0], 3) * [1.8, 1.6, 1.4]
        camera = Camera("corner", tuple(eye), tuple(-0.3 * eye), 1.5)
        light = Light("lamp", "point", position=tuple(random.uniform(-0.25, 0.25, 3)))
        view = view_of(scene, camera, light, 320)
        counts += edge_pixels(studio.shot(view), trace(view, pixel_samples=1), mask(f"cube-map:size={SEAMS}", view))
    (seam, wrong_at_seam), (other, wrong_elsewhere) = counts
    assert min(seam, other) >= 2000
    assert wrong_at_seam / seam <= min(1.5 * wrong_elsewhere / other, 0.05)  # found: 0.0399, elsewhere 0.0435
