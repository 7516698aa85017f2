"""Fits: the part of light space that a map covers."""

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.geometry.convex import box_planes, corners, frustum_planes, hull_points
from shadowbench.geometry.lights import Box, LightView, light_space
from shadowbench.gl.clock import Clock
from shadowbench.maps import reduction
from shadowbench.maps.fits import Fit
from shadowbench.maps.reduction import VisibleBounds
from shadowbench.plugin.base import Frame, Phase
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, view_of
from shadowbench.scenes.vectors import unit

SIZE = 128
SCENES = ["sphere-and-torus", "spot-lamp", "street", "cube-on-plane"]
MOVING = ["scene", "view", "visible"]


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


@pytest.mark.parametrize("fit", MOVING)
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("filter_", "radius"), [("hard", 0.5), ("pcf(7)", 3.5)])
def test_all_receivers_in_view_lie_in_the_window_and_its_padding_is_free(
    studio, build, builtin, name, fit, filter_, radius
) -> None:
    shot = studio.shot(builtin(name, SIZE))
    light_view = light_view_of(build, shot, f"fit={fit},filter={filter_},size=256")
    box, points = unpadded(light_view, radius + 1), light_view.space.box(receivers(shot))
    slack = 1e-5 * (light_view.box.high - light_view.box.low)
    assert (points.low >= box.low - slack).all() and (points.high <= box.high + slack).all()
    if fit == "visible":
        assert points.low[:2] == pytest.approx(box.low[:2], abs=slack[:2].max()), "and not a texel more"
        assert points.high[:2] == pytest.approx(box.high[:2], abs=slack[:2].max())


@pytest.mark.parametrize("name", SCENES)
def test_scene_shows_every_vertex(studio, build, builtin, name: str) -> None:
    shot = studio.shot(builtin(name, SIZE))
    light_view = light_view_of(build, shot, "fit=scene,filter=hard")
    points = shot.view.scene.geometry.vertices
    if light_view.space.perspective:  # those in the lamp's own pyramid
        x, y, axial = ((points - light_view.space.origin) @ light_view.space.basis.T * [1, 1, -1]).T
        points = points[(axial > 0) & (np.maximum(np.abs(x), np.abs(y)) <= axial * light_view.space.half)]
    held, box = light_view.space.box(points), unpadded(light_view, 1.5)
    assert (held.low >= box.low - 1e-9).all() and (held.high <= box.high + 1e-9).all()
    if not light_view.space.perspective:
        assert held.low[:2] == pytest.approx(box.low[:2]) and held.high[:2] == pytest.approx(box.high[:2])


@pytest.mark.parametrize("name", SCENES)
def test_visible_lies_in_view_and_view_in_scene(studio, build, builtin, name: str) -> None:
    shot = studio.shot(builtin(name, SIZE))
    boxes = [unpadded(light_view_of(build, shot, f"fit={fit},filter=hard"), 1.5) for fit in MOVING[::-1]]
    # `scene` bounds the vertices, `view` the box around them within the frustum, so `view` may be the larger where the
    # whole scene is seen.
    space = light_space(shot.view.light)
    around = corners(box_planes(shot.view.scene.geometry.bounds), 1.0)
    if not space.perspective:
        boxes[2] = space.box(around)
    for inner, outer in pairwise(boxes):
        slack = 1e-5 * np.abs(outer.high - outer.low)
        assert (inner.low >= outer.low - slack)[:2].all() and (inner.high <= outer.high + slack)[:2].all()


@pytest.mark.parametrize(
    ("name", "size"),
    [*((name, SIZE) for name in SCENES), *(("terrain", size) for size in (1, 2, 7, 8, 9, 63, 65, 100))],
)
def test_the_reduction_is_the_least_and_greatest_over_the_g_buffer_of_any_size(
    studio, build, builtin, device, name: str, size: int
) -> None:
    shot = studio.shot(builtin(name, size))
    one, space = build("shadow-map:size=16", shot), light_space(shot.view.light)
    found = VisibleBounds(one.stage)(Frame(shot.view, Phase(), 0, shot.surface, Clock(device)), space)
    expected = space.box(receivers(shot))
    assert found.low == pytest.approx(expected.low, abs=2e-6) and found.high == pytest.approx(expected.high, abs=2e-6)


def bounds_with_and_without_skipping(shot, build, device, monkeypatch: pytest.MonkeyPatch) -> list[Box | None]:
    """The second reads all pixels, as no rounding error is small enough."""
    one, frame = build("shadow-map:size=16", shot), Frame(shot.view, Phase(), 0, shot.surface, Clock(device))
    found = [VisibleBounds(one.stage)(frame, light_space(shot.view.light))]
    with monkeypatch.context() as patch:
        patch.setattr(reduction, "_ROUNDING", 1e12)
        return [*found, VisibleBounds(one.stage)(frame, light_space(shot.view.light))]


@pytest.mark.parametrize("name", ["spot-lamp", "deep-street", "window", "canopy"])
def test_pixels_that_are_not_read_do_not_change_the_bounds(
    studio, build, device, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    scene = load_scene(name)
    for camera, light in product(scene.cameras, scene.lights):
        if light.kind != "point":
            shot = studio.shot(view_of(scene, camera, light, SIZE))
            found, expected = bounds_with_and_without_skipping(shot, build, device, monkeypatch)
            assert (found.low == expected.low).all() and (found.high == expected.high).all()


@pytest.mark.parametrize("aim", [0.0, 0.2])
def test_a_spot_that_lights_fewer_pixels_than_the_sample_is_dense(
    studio, build, builtin, device, monkeypatch: pytest.MonkeyPatch, aim: float
) -> None:
    view = builtin("sphere-and-torus", 64)
    spot = Light("spot", "spot", (0.2 + aim, -1.0, 0.1 - aim), (0.0, 3.0, 0.0), math.radians(1.5))
    shot = studio.shot(replace(view, light=spot))
    found, expected = bounds_with_and_without_skipping(shot, build, device, monkeypatch)
    assert 0 < len(receivers(shot)) < 64
    assert (found.low == expected.low).all() and (found.high == expected.high).all()


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
    found = np.column_stack([local, np.ones(50)]) @ light_view.to_map().T
    assert found[:, :3] / found[:, 3:] == pytest.approx(expected[:, :3] / expected[:, 3:], abs=1e-9)
    assert (light_view.near, light_view.far) == pytest.approx((near * shot.placement.scale, far * shot.placement.scale))


HALTON = [(0, 0), (1 / 2, 1 / 3), (1 / 4, 2 / 3), (3 / 4, 1 / 9), (1 / 8, 4 / 9), (5 / 8, 7 / 9)]


@pytest.mark.parametrize("fit", sorted(Fit.table))
@pytest.mark.parametrize("name", ["cube-on-plane", "spot-lamp"])
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


@pytest.mark.parametrize("fit", ["view", "visible"])
def test_a_camera_inside_the_scene_has_its_shadows(studio, build, builtin, truth_of, scored, fit: str) -> None:
    shot = studio.shot(builtin("room-with-window", 256))
    mask = build(f"shadow-map:fit={fit},size=2048", shot).draw(shot)
    assert scored(mask, truth_of("room-with-window", 256))["iou"] > 0.95


@pytest.mark.parametrize("fit", sorted(Fit.table))
def test_facts_are_in_metres(studio, build, builtin, fit: str) -> None:
    shot = studio.shot(builtin("cube-on-plane", 64))
    one = build(f"shadow-map:fit={fit},size=128,bias=constant(0.01)", shot)
    one.draw(shot)
    light_view, facts = one.technique.light_view, one.technique.facts()
    scale = shot.placement.scale
    width = (light_view.box.high - light_view.box.low)[:2] / scale
    assert facts["texel_m"] == pytest.approx(max(width) / 128)
    assert facts["depth_range_m"] == pytest.approx((light_view.far - light_view.near) / scale)
    assert facts["bias_m"] == pytest.approx(0.01 * facts["depth_range_m"])
    if fit == "fixed":
        assert facts["texel_m"] == pytest.approx(20 / 128) and facts["depth_range_m"] == pytest.approx(6.5)


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=60, deadline=None)
@given(
    eye=st.tuples(*[st.floats(-2, 2)] * 3),
    ahead=directions,
    slope=st.floats(0.1, 1.5),
    near=st.floats(0.01, 0.5),
    depth=st.floats(0.5, 4.0),
    seed=st.integers(0, 1000),
)
def test_corners_of_a_frustum_in_a_box(eye, ahead, slope, near, depth, seed) -> None:
    bounds = np.array([[-0.6, -0.3, -0.5], [0.5, 0.4, 0.7]])
    back = -unit(ahead)
    right = unit(np.cross([0.3, 0.9, 0.2], back))
    basis = np.stack([right, np.cross(back, right), back])
    far = near + depth
    planes = np.vstack([box_planes(bounds), frustum_planes(np.asarray(eye), basis, slope, near, far)])
    found = corners(planes, 1.0)

    # Brute force: points of the box that lie in the frustum, by its definition.
    points = np.random.default_rng(seed).uniform(*bounds, (4000, 3))
    x, y, axial = ((points - eye) @ basis.T * [1, 1, -1]).T
    inside = points[(near <= axial) & (axial <= far) & (np.maximum(np.abs(x), np.abs(y)) <= slope * axial)]
    toward = np.random.default_rng(seed).normal(size=(30, 3))
    if len(inside):
        assert len(found) >= 4
        assert ((inside @ toward.T).max(axis=0) <= (found @ toward.T).max(axis=0) + 1e-9).all()


def test_a_frustum_beside_the_box_meets_it_nowhere() -> None:
    planes = frustum_planes(np.array([5.0, 0, 0]), np.eye(3), 0.5, 0.1, 3.0)
    assert len(corners(np.vstack([box_planes(np.array([[-1.0, -1, -1], [1, 1, 1]])), planes]), 1.0)) == 0


@given(st.integers(0, 200))
def test_hull_points_reach_as_far_as_all_points(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(40, 3)) * random.choice([1.0, 0.0], 3, p=[0.7, 0.3])  # flat ones too
    toward = random.normal(size=(20, 3))
    reach = (hull_points(points) @ toward.T).max(axis=0)
    assert (reach >= (points @ toward.T).max(axis=0) - 1e-9).all()


@pytest.mark.parametrize("kind", ["directional", "spot"])
@pytest.mark.parametrize("reversed_depth", [False, True])
def test_map_and_clip_space_agree(kind: str, reversed_depth: bool) -> None:
    light = Light(kind, kind, (0.3, -1.0, 0.2), (0.0, 3.0, 0.0), 1.0)
    space = light_space(light)
    light_view = LightView(space, Box(np.array([-0.4, -0.3, 1.0]), np.array([0.2, 0.5, 5.0])), 64)
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    points = np.column_stack([points, np.ones(20)])
    on_map, clip = points @ light_view.to_map(reversed_depth).T, points @ light_view.to_clip(reversed_depth).T
    assert on_map[:, :2] / on_map[:, 3:] == pytest.approx(clip[:, :2] / clip[:, 3:] / 2 + 0.5)
    z = clip[:, 2] / clip[:, 3]
    assert on_map[:, 2] / on_map[:, 3] == pytest.approx(z if reversed_depth else z / 2 + 0.5)
    forward = points @ light_view.to_map().T
    depth = forward[:, 2] / forward[:, 3]
    assert on_map[:, 2] / on_map[:, 3] == pytest.approx(1 - depth if reversed_depth else depth)
    axial = -((points[:, :3] - space.origin) @ space.basis.T)[:, 2]
    assert light_view.linear(on_map[:, 2] / on_map[:, 3], reversed_depth) == pytest.approx((axial - 1) / 4)


def test_only_fixed_cuts_off_what_lies_in_front_of_its_near_plane(mask, shape, looking, sun) -> None:
    """A box 2 m up, the sun 6 m up with its near plane at 5: the published pass clips the box, the others keep it."""
    view = looking([shape("plane", 6.0), shape("box", 0.5, (0.0, 2.0, 0.0), receives=False)], sun(90.0), 128)
    fixed = "shadow-map:fit=fixed(half=4,near={near},far=7,distance=6)"
    assert (mask(fixed.format(near=1), view) < 0.5).sum() > 100
    assert (mask(fixed.format(near=5), view) == 1).all()
    assert (mask("shadow-map:fit=visible", view) < 0.5).sum() > 100
