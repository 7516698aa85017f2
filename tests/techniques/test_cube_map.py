"""Cube maps: shadows compared with closed forms, lookups with NumPy, biases on faces and at corners."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.vectors import unit

DIRECTIONS = [unit(signs) for signs in product((-1, 0, 1), repeat=3) if any(signs)]
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


def test_a_box_between_lamp_and_wall_shadows_the_hull_of_its_projected_corners(shape, looking, mask, studio) -> None:
    light = np.array([0.2, 1.1, 0.3])
    box = shape("box", [0.5, 0.3, 0.4], (-0.1, 1.0, -0.8))
    wall = Mesh(
        "wall", np.array([[-3.0, -2, -2], [3, -2, -2], [3, 4, -2], [-3, 4, -2]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    view = looking([wall, box], lamp(*light), 256, eye=(2.5, 2.0, 1.5), target=(-0.4, 0.8, -2.0), fov=60)
    rays = box.vertices - light
    corners = (light + rays * ((-2 - light[2]) / rays[:, 2:]))[:, :2]
    hull = ConvexHull(corners)
    shot, dark = studio.shot(view), mask("cube-map:size=1024", view) < 0.5
    depth = (filed(shot)[..., :2] @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=-1)  # metres outside
    on_wall, texel = (shot.triangle >= 0) & (shot.triangle < 2), 2 * 2.3 / 1024
    assert dark[on_wall & (depth < -2 * texel)].all() and not dark[on_wall & (depth > 2 * texel)].any()
    assert (on_wall & (depth < -2 * texel)).sum() > 1000


@pytest.mark.parametrize("layers", ["passes", "geometry"])
@pytest.mark.parametrize("depth", ["d16", "d24", "d32f"])
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


@pytest.mark.parametrize("items", ["", "bias=front-cull,filter=hard", "depth=d16,size=256,filter=pcf-20"])
@pytest.mark.parametrize("name", ["room-with-lamp", "lamp-by-wall", "lamp-over-table", "spot-lamp"])
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


@pytest.mark.parametrize("filter_", ["hard", "pcf(3)", "pcf-20", "pcf-20(spread=0.1)"])
@pytest.mark.parametrize("name", ["room-with-lamp", "lamp-by-wall"])
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


@pytest.mark.parametrize("filter_", ["hard", "hardware", "pcf(3)", "pcf(7)", "pcf-20"])
@pytest.mark.parametrize("toward", [FACE, BORDER, CORNER, (-0.8, -1.0, 0.9)])
@pytest.mark.parametrize("tilt", [5.0, 30.0, 60.0, 75.0, 85.0])
def test_an_inclined_plane_has_no_acne_anywhere_on_the_cube(tilt, toward, filter_, looking, mask) -> None:
    for size in (61, 256):
        visibility = mask(f"cube-map:bias=texel(limit=64),filter={filter_},size={size}", facing(tilt, toward, looking))
        # Where three faces meet, three texels are averaged: a third is no float.
        assert (visibility > 1 - 1e-6).all(), f"{(visibility < 1).sum()} pixels at {size}"


@pytest.mark.parametrize(
    ("items", "scene", "reason"),
    [
        ("", "cube-on-plane", "a directional light has no position to look around from"),
        ("bias=polygon-offset", "room-with-lamp", "polygon-offset has no meaning for a cube map"),
        ("bias=receiver-plane", "room-with-lamp", "receiver-plane has no meaning for a cube map"),
        ("filter=dither-4", "room-with-lamp", "dither-4 has no meaning for a cube map"),
        ("filter=pcf-20", "spot-lamp", None),
    ],
)
def test_parameters_without_meaning_for_a_cube_map_are_named(items, scene, reason, builtin, studio, device) -> None:
    spec = parse_spec(f"cube-map:{items}" if items else "cube-map", techniques())
    assert spec.technique.unsupported(spec.params, studio.shot(builtin(scene, 32)).view, device) == reason


@pytest.mark.parametrize("toward", [FACE, CORNER])
def test_the_bound_is_met_at_a_corner_as_at_a_face_s_centre(toward, looking, mask) -> None:
    """A texel is seen at 55° at the corner, and shrinks to a third; across that slant it is as wide as ever."""
    view = facing(60.0, toward, looking, 256)
    share = {
        scale: (mask(f"cube-map:bias=texel(limit=64,scale={scale}),filter=hard,size=256", view) < 0.5).mean()
        for scale in (0.5, 0.9, 1.0)
    }
    assert share[1.0] == 0 < share[0.9] < 0.05 < share[0.5]


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


@pytest.mark.parametrize("depth", ["d16", "d24", "d32f"])
def test_the_farthest_point_is_stored_nearer_than_an_empty_texel(depth, looking, build, studio) -> None:
    """The tip of a tent, in the middle of the upper face, is farther from the lamp than all else."""
    rim = [[0.02, 1.9, -0.2], [-0.2, 1.9, 0.02], [-0.02, 1.9, 0.2], [0.2, 1.9, -0.02]]
    tent = Mesh("tent", np.array([[0.0, 2.0, 0.0], *rim]), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]))
    one = build(f"cube-map:size=65,depth={depth}", shot := studio.shot(looking([tent], lamp(0.0, 0.0, 0.0), 32)))
    one.draw(shot)
    above = one.technique.map.texture.read()[2]
    assert above[32, 32] < above[0, 0] == 1
    assert above[32, 32] * one.technique.facts()["depth_range_m"] == pytest.approx(2, rel=2**-15)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["room-with-lamp", "lamp-by-wall", "lamp-over-table"])
def test_the_error_falls_as_the_faces_grow(name, builtin, mask, truth_of, scored) -> None:
    view, truth = builtin(name, 1024), truth_of(name, 1024)
    errors = [1 - scored(mask(f"cube-map:size={size}", view), truth)["iou"] for size in (512, 1024, 2048, 4096)]
    assert errors == sorted(errors, reverse=True)
    assert errors[3] < 0.25 * errors[0]
    assert errors[1] < 0.01 and errors[3] < 0.0025  # found, at most: 0.0073, 0.0019
