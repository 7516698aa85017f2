"""Fits: the part of light space that a map covers."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.geometry.convex import SceneHull, box_planes, corners, frustum_planes, hull_points
from shadowbench.geometry.lights import Box, LightView, light_space, window
from shadowbench.gl.clock import Clock
from shadowbench.maps.fits import RECTANGLES, Fit, VisibleBounds
from shadowbench.plugin.base import Frame, Phase
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, Scene
from shadowbench.scenes.vectors import unit
from tests.parallel import parallel
from tests.samples import by_turns

SIZE = 128
SCENES = ["sphere-and-torus", "spot-lamp", "street", "cube-on-plane"]
MOVING = ["scene", "view", "visible", "view(oriented=true)", "visible(oriented=false)"]


def receivers(shot) -> np.ndarray:
    """(N, 3) positions in the G-buffer that face the light and lie in its cone."""
    light, w = shot.view.light.homogeneous
    to_light = np.asarray(light) - w * shot.position[..., :3]
    to_light /= np.linalg.norm(to_light, axis=-1, keepdims=True)
    facing = np.einsum("ijk,ijk->ij", shot.normal[..., :3], to_light) > 0
    back = -unit(shot.view.light.direction)
    inside = to_light @ back >= shot.view.light.cos_half_angle
    return shot.position[(shot.position[..., 3] > 0) & facing & inside][:, :3]


def light_view_of(build, shot, items: str, phase: int = 0) -> LightView:
    one = build(f"shadow-map:{items}", shot)
    one.draw(shot, phase)
    return one.technique.light_view


def unpadded(light_view: LightView, padding: float) -> Box:
    step = np.array([*light_view.texel, 0.0]) * padding
    return Box(light_view.box.low + step, light_view.box.high - step)


@pytest.mark.parametrize(
    ("name", "fit", "filter_"),
    [*by_turns(SCENES, MOVING, ["hard", "pcf(7)"]), *by_turns(SCENES, MOVING[::-1], ["pcf(7)", "hard"])],
)
def test_all_receivers_in_view_lie_in_the_window_and_its_padding_is_free(
    studio, build, builtin, name, fit, filter_
) -> None:
    shot, radius = studio.shot(builtin(name, f"{2 * SIZE}x{SIZE}")), 0.5 if filter_ == "hard" else 3.5
    light_view = light_view_of(build, shot, f"fit={fit},filter={filter_},size=256")
    box, points = unpadded(light_view, radius + 1), light_view.space.box(receivers(shot))
    slack = 1e-5 * (light_view.box.high - light_view.box.low)
    assert (points.low >= box.low - slack).all() and (points.high <= box.high + slack).all()
    if fit.startswith("visible"):
        assert points.low[:2] == pytest.approx(box.low[:2], abs=slack[:2].max()), "and not a texel more"
        assert points.high[:2] == pytest.approx(box.high[:2], abs=slack[:2].max())


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("spot-lamp", SIZE),
        ("deep-street", SIZE),
        ("canopy", SIZE),
        *(("terrain", size) for size in (1, 7, 9, 65, "90x11", "7x60")),
    ],
)
def test_the_reduction_is_the_least_and_greatest_over_the_g_buffer_of_any_size(
    studio, build, builtin, device, name: str, size: int | str
) -> None:
    assert_bounds_are_of_the_receivers(studio.shot(builtin(name, size)), build, device)


@pytest.mark.parametrize("name", ["canopy", "spot-lamp", "terrain"])
def test_the_reduction_is_the_least_and_greatest_of_an_orthographic_view(studio, build, device, name: str) -> None:
    assert_bounds_are_of_the_receivers(studio.shot(parallel(load_scene(name), "90x65")), build, device)


def assert_bounds_are_of_the_receivers(shot, build, device) -> None:
    one, level = build("shadow-map:size=16", shot), light_space(shot.view.light)
    frame = Frame(shot.view, Phase(), 0, shot.surface, Clock(device))
    for angles in ([], np.arange(1, RECTANGLES) * 0.2):
        spaces = [level, *map(level.rotated, angles)]
        for space, result in zip(spaces, VisibleBounds(one.stage, len(spaces) > 1)(frame, spaces), strict=True):
            expected = space.box(receivers(shot))
            assert result.low == pytest.approx(expected.low, abs=3e-6)
            assert result.high == pytest.approx(expected.high, abs=3e-6)


@pytest.mark.parametrize("aim", [0.0, 0.2])
def test_a_spot_may_light_fewer_pixels_than_the_reduction_samples(studio, build, builtin, device, aim: float) -> None:
    view = builtin("sphere-and-torus", 64)
    spot = Light("spot", "spot", (0.2 + aim, -1.0, 0.1 - aim), (0.0, 3.0, 0.0), math.radians(1.5))
    shot = studio.shot(replace(view, light=spot))
    assert 0 < len(receivers(shot)) < 64
    assert_bounds_are_of_the_receivers(shot, build, device)


def looking_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The usual look-at matrix, y up."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = [right, np.cross(back, right), back]
    matrix[:3, 3] = -matrix[:3, :3] @ eye
    return matrix


HALF = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])


@pytest.mark.parametrize("kind", ["directional", "spot"])
def test_fixed_is_the_published_matrix_in_file_units(studio, build, builtin, kind: str) -> None:
    view = builtin("sphere-and-torus", 64)
    toward = np.array([0.5, 0.8, 0.3])
    position = tuple((unit(toward) * 4.58).tolist())
    view = replace(view, light=Light(kind, kind, tuple(-toward), position, math.radians(45)))
    shot = studio.shot(view)
    light_view = light_view_of(build, shot, "preset=fixed")
    near, far = 1.0, 7.5
    if kind == "directional":
        projection = np.diag([1 / 10, 1 / 10, -2 / (far - near), 1.0])
        projection[2, 3] = -(far + near) / (far - near)
    else:
        slope = math.tan(math.radians(45) / 2)
        projection = np.diag([1 / slope, 1 / slope, -(far + near) / (far - near), 0.0])
        projection[2, 3], projection[3, 2] = -2 * far * near / (far - near), -1.0
    published = HALF @ projection @ looking_at(np.asarray(position), np.zeros(3))
    points = np.random.default_rng(1).uniform(-2, 2, (50, 3))
    expected = np.column_stack([points, np.ones(50)]) @ published.T
    local = shot.placement.points(points)
    result = np.column_stack([local, np.ones(50)]) @ light_view.to_map().T
    assert result[:, :3] / result[:, 3:] == pytest.approx(expected[:, :3] / expected[:, 3:], abs=1e-9)
    assert (light_view.near, light_view.far) == pytest.approx((near * shot.placement.scale, far * shot.placement.scale))


HALTON = [(0, 0), (1 / 2, 1 / 3), (1 / 4, 2 / 3), (3 / 4, 1 / 9), (1 / 8, 4 / 9), (5 / 8, 7 / 9)]


@pytest.mark.parametrize(("fit", "name"), by_turns(sorted(Fit.table), ["cube-on-plane", "spot-lamp"]))
def test_a_phase_moves_the_window_by_a_halton_point_in_texels(studio, build, builtin, name: str, fit: str) -> None:
    shot = studio.shot(builtin(name, 64))
    one = build(f"shadow-map:fit={fit},size=128", shot)
    one.draw(shot)
    start = one.technique.light_view
    for phase, expected in enumerate(HALTON):
        one.draw(shot, phase)
        light_view = one.technique.light_view
        for moved, fixed in ((light_view.box.low, start.box.low), (light_view.box.high, start.box.high)):
            assert (moved - fixed)[:2] / start.texel == pytest.approx(expected, abs=1e-9)
            assert moved[2] == fixed[2]
        assert Phase(phase).shift == pytest.approx(expected)


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=60, deadline=None)
@given(
    eye=st.tuples(*[st.floats(-2, 2)] * 3),
    ahead=directions,
    slope=st.floats(0.1, 1.5),
    near=st.floats(0.01, 0.5),
    depth=st.floats(0.5, 4.0),
    aspect=st.floats(0.3, 3.0),
    seed=st.integers(0, 1000),
)
def test_corners_of_a_frustum_in_a_box(eye, ahead, slope, near, depth, aspect, seed) -> None:
    bounds = np.array([[-0.6, -0.3, -0.5], [0.5, 0.4, 0.7]])
    back = -unit(ahead)
    right = unit(np.cross([0.3, 0.9, 0.2], back))
    basis = np.stack([right, np.cross(back, right), back])
    far = near + depth
    frustum = frustum_planes(np.asarray(eye), basis, slope, near, far, aspect=aspect)
    planes = np.vstack([box_planes(bounds), frustum])
    result = corners(planes, 1.0)

    # Brute force: points of the box that lie in the frustum, by its definition.
    points = np.random.default_rng(seed).uniform(*bounds, (4000, 3))
    x, y, axial = ((points - eye) @ basis.T * [1, 1, -1]).T
    inside = points[(near <= axial) & (axial <= far) & (np.maximum(np.abs(x) / aspect, np.abs(y)) <= slope * axial)]
    toward = np.random.default_rng(seed).normal(size=(30, 3))
    if len(inside):
        assert len(result) >= 4
        assert ((inside @ toward.T).max(axis=0) <= (result @ toward.T).max(axis=0) + 1e-9).all()


@given(st.integers(0, 200))
def test_hull_points_reach_as_far_as_all_points(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(40, 3)) * random.choice([1.0, 0.0], 3, p=[0.7, 0.3])  # flat ones too
    toward = random.normal(size=(20, 3))
    reach = (hull_points(points) @ toward.T).max(axis=0)
    assert (reach >= (points @ toward.T).max(axis=0) - 1e-9).all()


def test_the_hull_of_a_scene_has_its_last_mesh(shape) -> None:
    scene = Scene("test", (shape("box"), shape("box", 1.0, (0.0, 5.0, 0.0))), (), ())
    assert SceneHull(scene).points.max(axis=0) == pytest.approx([0.5, 5.5, 0.5])


# Windows rotated about the light's axis

coordinates = st.integers(-50, 50).map(lambda steps: steps / 50)


@given(st.lists(st.tuples(*[coordinates] * 3), min_size=1, max_size=12).map(np.array))
def test_no_angle_gives_a_lesser_rectangle_than_the_first_oriented_space(points: np.ndarray) -> None:
    areas = [space.box(points).area for space in SUN.oriented(points, 9)]
    assert areas == pytest.approx(sorted(areas))
    brute_force = min(SUN.rotated(angle).box(points).area for angle in np.linspace(0, np.pi / 2, 500))
    assert brute_force - 0.02 <= areas[0] <= brute_force + 1e-12  # 0.02: half a step times the largest sides


def test_an_oriented_window_is_hardly_larger_than_the_least_and_never_larger_than_a_level_one(
    studio, build, builtin
) -> None:
    for name, gain in (("street", 3.0), ("deep-street", 3.5), ("terrain", 1.1), ("sphere-and-torus", 1.0)):
        shot = studio.shot(builtin(name, SIZE))
        items = "filter=hard,size=1024,fit=visible"
        level, oriented = (light_view_of(build, shot, f"{items}{more}").box.area for more in ("(oriented=false)", ""))
        points = receivers(shot)
        least = light_space(shot.view.light).oriented(points)[0].box(points).area
        assert least < oriented < 1.05 * least and level >= gain * oriented, name


def test_shadows_in_an_oriented_map_do_not_depend_on_the_scene_s_angle_about_the_light_s_axis(
    shape, looking, studio, build
) -> None:
    """A lifted plate over a square ground, with its camera, turned below a sun overhead."""
    masks = {}
    for degrees, oriented in product((0, 20, 45), ("false", "true")):
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
        meshes = [shape("plane", 4.0), shape("plane", 1.3, (0.31, 1.0, 0.17))]
        meshes = [replace(mesh, vertices=mesh.vertices @ turn.T) for mesh in meshes]
        view = looking(meshes, Light("sun", "directional", (0.0, -1.0, 0.0)), eye=turn @ (0.4, 2.5, 5.0), fov=60.0)
        shot = studio.shot(view)
        one = build(f"shadow-map:size=48,filter=hard,fit=visible(oriented={oriented})", shot)
        masks[degrees, oriented] = one.draw(shot) > 0.5
    for degrees in (20, 45):
        level, oriented = ((masks[degrees, kind] != masks[0, kind]).mean() for kind in ("false", "true"))
        assert oriented < 5e-4 < 2e-3 < level, degrees


# Windows in light space, compared with closed forms

SUN = light_space(Light("sun", "directional", (0.0, -1.0, 0.0)))
SPOT = light_space(Light("spot", "spot", (0.0, -1.0, 0.0), (0.0, 0.0, 0.0), math.radians(90)))  # base window: ±1


def box(*sides: tuple[float, float]) -> Box:
    low, high = np.array(sides, dtype=float).T
    return Box(low, high)


@pytest.mark.parametrize(("space", "stretch"), [(SUN, 1.0), (SPOT, 5.0)])
def test_near_and_far_leave_room_for_the_padding_and_a_ten_thousandth(space, stretch: float) -> None:
    """A texel of the larger side, at the far plane where a perspective light's texels are widest."""
    shown = window(box((-0.3, 0.5), (-0.1, 0.1), (1.0, 5.0)), space, 64, 2.0, (0.0, 0.0))
    texel = 0.8 / 60
    assert (shown.high - shown.low)[0] == pytest.approx(64 * texel)
    room = 2 * texel * stretch + 4e-4
    assert (shown.low[2], shown.high[2]) == pytest.approx((1 - room, 5 + room), rel=1e-9)


def test_a_perspective_map_begins_at_a_ten_thousandth_of_its_far_plane() -> None:
    for near in (1e-6, 4.9e-4):
        shown = window(box((-0.5, 0.5), (-0.5, 0.5), (near, 5.0)), SPOT, 64, 0.0, (0.0, 0.0))
        assert shown.low[2] == pytest.approx(shown.high[2] / 1e4)
    assert window(box((-0.5, 0.5), (-0.5, 0.5), (-3.0, 5.0)), SUN, 64, 0.0, (0.0, 0.0)).low[2] < -3


def test_a_spot_s_window_ends_with_its_cone() -> None:
    shown = window(box((-3.0, 0.25), (-0.75, 3.0), (1.0, 2.0)), SPOT, 64, 0.0, (0.0, 0.0))
    assert shown.low[:2] == pytest.approx((-1.0, -0.75)) and shown.high[:2] == pytest.approx((0.25, 1.0))


def test_a_box_without_a_width_has_texels_of_a_millionth_of_its_depth() -> None:
    """And at least of a millionth of the scene, as for a point, so that nothing is divided by zero."""
    for depth, narrowest in ((4.0, 4e-6), (0.0, 1e-12)):
        shown = window(box((0.5, 0.5), (0.5, 0.5), (1.0, 1.0 + depth)), SUN, 10, 1.0, (0.0, 0.0))
        assert (shown.high - shown.low)[:2] == pytest.approx(narrowest * 10 / 8, rel=1e-3, abs=0)
