"""Penumbrae that can be computed: a straight edge before a sun and a rectangle, and a sphere before a disc."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit, vec3
from shadowbench.truths.trace import STANDARD_ERROR, Truth, trace

STUDENT = 4.44  # of Student's t with 7 degrees of freedom, 99.7% lies within it
SHARE = 0.997
HEIGHT = 4.0  # of the edge of a half-plane above the ground, along z at x = 0
ELEVATION = math.radians(60.0)
AZIMUTH = math.radians(23.0)
ASIDE = np.array([3.0, 4.0, 1.0])  # of the camera from its target
TOWARD = np.array([-math.cos(AZIMUTH) * math.cos(ELEVATION), math.sin(ELEVATION), math.sin(AZIMUTH) * 0.5])

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
Rays = Callable[[View], tuple[Floats, Floats]]


def cap_beyond(angle: Floats, radius: float) -> Floats:
    """Share of a cone of half angle `radius` on the far side of a plane at `angle` from its axis, both in radians."""
    inside = np.minimum(np.abs(angle), radius)
    if radius < 1e-3:  # cancellation: the cone is a flat disc
        x = inside / radius
        share = 0.5 - (x * np.sqrt(1 - x**2) + np.arcsin(x)) / math.pi
    else:
        around = np.arccos(np.sin(inside) / math.sin(radius))
        across = np.arccos(np.minimum(np.tan(inside) / math.tan(radius), 1.0))
        share = (around - math.cos(radius) * across) / (math.pi * (1 - math.cos(radius)))
    return np.where(angle > 0, share, 1 - share)


def solid_angle(corners: Floats) -> Floats:
    """(N,) solid angles of (N, K, 3) convex polygons seen from the origin (Van Oosterom, Strackee 1983, as a fan)."""
    a = corners / np.maximum(np.linalg.norm(corners, axis=2, keepdims=True), 1e-300)
    first, second, third = a[:, :1], a[:, 1:-1], a[:, 2:]
    triple = (first * np.cross(second, third)).sum(axis=2)
    below = 1 + (first * second).sum(axis=2) + (second * third).sum(axis=2) + (third * first).sum(axis=2)
    angle: Floats = np.abs(2 * np.arctan2(triple, below).sum(axis=1))
    return angle


def clipped(corners: Floats, normals: Floats) -> Floats:
    """(N, 2K, 3) parts of polygons (K, 3) - each of N points' own, (N, K, 3) - where normal · corner ≥ 0.

    Each corner gives itself or nothing, and each side its crossing; missing ones repeat the corner before them, which
    changes no area.
    """
    height = np.einsum("nkc,nc->nk", corners, normals)
    following, height_after = np.roll(corners, -1, axis=1), np.roll(height, -1, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = corners + (height / (height - height_after))[..., None] * (following - corners)
    crosses = (height >= 0) != (height_after >= 0)
    parts = np.stack([corners, crossing], axis=2).reshape(len(corners), -1, 3)
    kept = np.stack([height >= 0, crosses], axis=2).reshape(len(corners), -1)
    twice = np.where(
        np.tile(kept, 2), np.arange(2 * kept.shape[1]), 0
    )  # round the polygon, so that each has one before
    latest = np.maximum.accumulate(twice, axis=1)[:, kept.shape[1] :] % kept.shape[1]
    result: Floats = np.take_along_axis(parts, latest[..., None], axis=1)
    result[~kept.any(axis=1)] = 0.0
    return result


def ground(view: View, truth: Truth, pixel_rays: Rays) -> tuple[np.ndarray, Floats]:
    """(size², ) whether a pixel shows the ground, y = 0, decided; and (size², 3) where its ray meets it."""
    starts, rays = pixel_rays(view)
    first_mesh = (truth.triangle >= 0) & (truth.triangle < 2)
    return (first_mesh & truth.receivers & ~truth.undecided).ravel(), starts - rays * (starts[:, 1:2] / rays[:, 1:2])


def half_plane(shape: Shape, reach: float, scale: float) -> list[Mesh]:
    """The ground, and a caster from x = −reach to the edge x = 0."""
    caster = shape("plane", [reach, 1, 3 * reach], (-reach / 2, HEIGHT, 0))
    meshes = [shape("plane", 3 * reach), caster]
    return [Mesh(str(number), mesh.vertices * scale, mesh.faces) for number, mesh in enumerate(meshes)]


def edge_normals(points: Floats, scale: float) -> Floats:
    """(N, 3) unit normals, to the open side, of the planes through points and the edge of `half_plane`."""
    to_edge = np.array([0.0, HEIGHT * scale, 0.0]) - points * [1, 1, 0]
    normal = np.cross(to_edge, [0.0, 0.0, 1.0])
    normal *= np.sign(normal[:, :1])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def within(deviations: Floats) -> None:
    """99.7% of the errors lie within 4.44 standard errors, up to three deviations of a share of so many pixels."""
    slack = 3 * math.sqrt(SHARE * (1 - SHARE) / len(deviations))
    assert (deviations <= STUDENT).mean() >= SHARE - slack


def check(truth: Truth, shown: np.ndarray, expected: Floats) -> None:
    """Visibility is as expected within its standard error, and outside the penumbra within the default one."""
    value, error = truth.visibility.ravel()[shown], truth.standard_error.ravel()[shown]
    wrong = np.abs(value - expected[shown])
    sampled = error > 0
    assert np.ptp(expected[shown]) > 0.8
    assert ((expected[shown] > 0.02) & (expected[shown] < 0.98)).mean() > 0.1
    within(wrong[sampled] / error[sampled])
    assert wrong[~sampled].max(initial=0) < STANDARD_ERROR


@pytest.mark.parametrize(("degrees", "scale"), [(0.01, 1e3), (3.0, 1e-3), (15.0, 1.0), (29.0, 1.0)])
def test_an_edge_before_a_sun(degrees, scale, shape, looking, pixel_rays) -> None:
    radius = math.radians(degrees)
    light = Light("sun", "directional", direction=vec3(-unit(TOWARD)), radius=radius)
    reach = HEIGHT / math.tan(math.radians(58) - min(radius, 0.5)) + 8
    tilt = math.atan2(TOWARD[1], -TOWARD[0])  # of the plane of the edge and the sun's centre
    low, high = (HEIGHT / math.tan(min(tilt + sign * 1.1 * radius, 1.55)) for sign in (1, -1))
    target = np.array([(low + high) / 2, 0, 0.3])
    eye = target + ASIDE
    fov = math.degrees(2 * math.atan(0.75 * (high - low) / np.linalg.norm(eye - target)))
    view = looking(half_plane(shape, reach, scale), light, 96, vec3(eye * scale), vec3(target * scale), fov=fov)
    truth = trace(view, pixel_samples=1)
    shown, points = ground(view, truth, pixel_rays)
    shown &= (points[:, 0] > (1.5 * low - 0.5 * high) * scale) & (np.abs(points[:, 2]) < 4 * scale)
    away = np.arcsin(edge_normals(points, scale) @ unit(TOWARD))
    check(truth, shown, 1 - cap_beyond(away, radius))


@pytest.mark.parametrize(("size", "scale"), [((0.02, 0.03), 1e-3), ((1.0, 0.5), 1e3), ((6.0, 3.0), 1.0)])
def test_an_edge_before_a_rectangle(size, scale, shape, looking, pixel_rays) -> None:
    center = np.array([-2.0, 7.0, 0.5])
    direction, up = unit([0.5, -1.0, -0.1]), (0.0, 0.3, 1.0)
    light = Light(
        "window", "rectangle", vec3(direction), vec3(center * scale), size=(size[0] * scale, size[1] * scale), up=up
    )
    middle = -center[0] * HEIGHT / (center[1] - HEIGHT)
    span = 1.5 * max(size) * HEIGHT / (center[1] - HEIGHT)
    target = np.array([middle, 0, 0.3])
    eye = target + ASIDE
    fov = math.degrees(2 * math.atan(0.5 * min(span, 10.0) / np.linalg.norm(eye - target)))
    view = looking(half_plane(shape, 10.0, scale), light, 96, vec3(eye * scale), vec3(target * scale), fov=fov)
    truth = trace(view, pixel_samples=1)
    shown, points = ground(view, truth, pixel_rays)
    right, above, _ = perpendicular_basis(-direction, up)
    corners = [
        center + across * right * size[0] / 2 + along * above * size[1] / 2
        for across, along in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    seen = np.array(corners) * scale - points[:, None, :]
    share = solid_angle(clipped(seen, edge_normals(points, scale))) / solid_angle(seen)
    check(truth, shown, share)


@pytest.mark.parametrize("radius", [0.1, pytest.param(2.0, marks=pytest.mark.slow)])
def test_a_sphere_before_a_disc_on_its_axis(radius, shape, looking, pixel_rays) -> None:
    light = Light("disc", "disc", (0.0, -1.0, 0.0), (0.0, 4.0, 0.0), radius=radius)
    ball, middle = 0.4, np.array([0.0, 1.5, 0.0])
    sphere = shape("sphere", 2 * ball, middle, subdivisions=6)
    view = looking([shape("plane", 8.0), sphere], light, 40, (1.5, 1.0, 1.2), (0.1, 0, 0.1), fov=30.0)
    truth = trace(view, pixel_samples=1)
    shown, points = ground(view, truth, pixel_rays)
    chosen = np.flatnonzero(shown)[::6]

    # Midpoints of equal areas of the disc, weighted by cos/d³ as seen from the ground below it.
    r, turn = (np.arange(200) + 0.5) / 200, (np.arange(200) + 0.5) / 200 * 2 * math.pi
    flat = radius * np.sqrt(r)[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    lamp = np.stack([flat[..., 0], np.full(flat.shape[:2], 4.0), flat[..., 1]], axis=-1).reshape(-1, 3)
    expected = np.full(len(points), np.nan)
    for pixel in chosen:
        away = lamp - points[pixel]
        distance = np.linalg.norm(away, axis=1)
        weight = away[:, 1] / distance**3
        to_ball = middle - points[pixel]
        along = away @ to_ball / distance
        clear = to_ball @ to_ball - along**2 > ball**2
        expected[pixel] = (weight * clear).sum() / weight.sum()
    only = np.zeros_like(shown)
    only[chosen] = True
    value, error = truth.visibility.ravel()[only], truth.standard_error.ravel()[only]
    wrong = np.abs(value - expected[only])
    sampled = error > 0
    assert ((value > 0.02) & (value < 0.98)).mean() > 0.1
    within(np.maximum(wrong[sampled] - 2e-3, 0) / error[sampled])  # the mesh is inscribed in the sphere
    assert wrong[~sampled].max(initial=0) < STANDARD_ERROR


SUN_RADIUS = math.radians(25)
LOOKING = (5.6, 4.0, 1.3), (2.6, 0.0, 0.3)  # eye and target


def test_an_edge_before_a_sphere(shape, looking, pixel_rays) -> None:
    center, radius = np.array([-2.0, 7.0, 0.5]), 1.5
    light = Light("bulb", "point", position=vec3(center), radius=radius)
    view = looking(half_plane(shape, 20.0, 1.0), light, 48, *LOOKING, fov=75.0)
    truth = trace(view, pixel_samples=1)
    shown, points = ground(view, truth, pixel_rays)
    shown &= (np.abs(points[:, 2]) < 5) & (points[:, 0] > -1) & (points[:, 0] < 8)
    away = center - points
    distance = np.linalg.norm(away, axis=1)
    angles = np.arcsin((edge_normals(points, 1.0) * away).sum(axis=1) / distance)
    each = zip(angles, np.arcsin(radius / distance), strict=True)
    check(truth, shown, np.array([1 - float(cap_beyond(angle, cone)) for angle, cone in each]))


def test_of_a_sun_half_below_the_horizon_the_half_above_it_counts(shape, looking) -> None:
    light = Light("sun", "directional", (1.0, -math.tan(math.radians(5.0)), 0.0), radius=math.radians(20.0))
    truth = trace(looking([shape("box", [8.0, 1.0, 8.0], (0.0, -0.5, 0.0))], light, 32), pixel_samples=1)
    assert truth.receivers.any()
    assert (truth.visibility[truth.receivers] == 1).all()


def test_what_stands_behind_a_lamp_casts_no_shadow(shape, looking) -> None:
    light = Light("disc", "disc", (0.0, -1.0, 0.0), (0.0, 2.0, 0.0), radius=0.5)
    truth = trace(looking([shape("plane", 8.0), shape("plane", 1.5, (0.0, 2.5, 0.0))], light, 32), pixel_samples=1)
    on_ground = truth.receivers & (truth.triangle < 2)
    assert on_ground.any()
    assert (truth.visibility[on_ground] == 1).all()


def test_irradiance_weights_the_part_of_the_sun_high_above_the_horizon_more(shape, looking, pixel_rays) -> None:
    light = Light("sun", "directional", vec3(-unit(TOWARD)), radius=SUN_RADIUS)
    view = looking(half_plane(shape, 20.0, 1.0), light, 48, *LOOKING, fov=75.0)
    truth = trace(view, pixel_samples=1)
    shown, points = ground(view, truth, pixel_rays)
    pixel = np.flatnonzero(shown & (truth.visibility.ravel() > 0.4) & (truth.visibility.ravel() < 0.6))[0]
    below, turn = np.meshgrid((np.arange(300) + 0.5) / 300, (np.arange(300) + 0.5) / 300 * 2 * math.pi)
    cosine = 1 - below * (1 - math.cos(SUN_RADIUS))
    sine = np.sqrt(1 - cosine**2)
    local = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1).reshape(-1, 3)
    toward = local @ perpendicular_basis(unit(TOWARD), (0.0, 1.0, 0.0))
    seen = toward @ edge_normals(points[pixel : pixel + 1], 1.0)[0] > 0
    expected = toward[seen, 1].sum() / toward[:, 1].sum()
    assert truth.irradiance.ravel()[pixel] == pytest.approx(expected, abs=4 * STANDARD_ERROR)
    assert abs(truth.visibility.ravel()[pixel] - expected) > 8 * STANDARD_ERROR
