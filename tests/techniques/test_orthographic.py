"""Orthographic views: exact techniques, near planes that cut casters, a camera far away, a bias in closed form."""

import math

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, view_of
from shadowbench.scenes.vectors import unit, vec3
from shadowbench.truths.trace import trace
from tests.parallel import parallel
from tests.samples import by_turns

SCENES = ["inside-volume", "lamp-by-wall", "railings", "spot-lamp", "stairs"]
EXACT = ["shadow-volume", "shadow-volume:compare=depth", "hybrid", "ray-traced", "ray-traced:where=gpu"]
ZENITH = Light("zenith", "directional", (0.0, -1.0, 0.0))


@pytest.mark.parametrize(("name", "spec"), [(name, spec) for name in SCENES for spec in EXACT])
def test_exact_techniques_are_exact(name: str, spec: str, mask, scored) -> None:
    view = parallel(load_scene(name), 256)
    assert scored(mask(spec, view), trace(view, 1))["iou"] >= 0.9995


def test_projection_onto_planes_is_exact(mask, scored) -> None:
    for name in ("cube-on-plane", "railings", "stairs"):
        view = parallel(load_scene(name), 256)
        assert scored(mask("planar-projection:count=1024", view), trace(view, 1))["iou"] >= 0.9995


@pytest.mark.parametrize(
    ("away", "light", "spec"),
    by_turns(
        [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0), (-0.32, 1.0, 0.2)],
        [None, ZENITH, Light("over", "point", position=(-0.9, 2.5, -3.2))],
        EXACT[:2],
    ),
)
def test_a_camera_among_casters_sees_the_shadows_of_what_its_near_plane_cuts_off(away, light, spec, mask) -> None:
    """From any side, along the sun's rays too: a section through the scene, as a plan is."""
    scene = load_scene("inside-volume")
    target = np.array(scene.cameras[0].target)
    position = target + 4 * np.array(away) / np.linalg.norm(away)
    up = (0.0, 0.0, -1.0) if away[1] == 1.0 == sum(away) else (0.0, 1.0, 0.0)
    camera = Camera("cut", tuple(position.tolist()), tuple(target.tolist()), 0.0, up, height=6.1)
    view = view_of(scene, camera, light or scene.lights[0], 192)
    truth = trace(view, 1)
    wrong = (mask(spec, view) < 0.5) != (truth.visibility < 0.5)
    assert np.count_nonzero(wrong & truth.receivers & ~truth.undecided) <= 2


@pytest.mark.parametrize("kind", ["directional", "spot"])
def test_an_orthographic_camera_is_one_at_a_distance_of_20_km(kind: str, shape) -> None:
    """Half a metre from the target, 64 px from the middle, rays are 0.0016 px apart: 0.4 of the grid's step."""
    meshes = shape("plane", 2.0), shape("torus", 0.7, (0.0, 0.4, 0.0))
    light = Light("light", kind, (0.5, -1.0, -0.3), (-1.0, 2.0, 0.6), math.radians(50.0))
    truths = []
    for away, lens in ((2.0, {"fov_y": 0.0, "height": 1.2}), (20e3, {"fov_y": 2 * math.atan(0.6 / 20e3)})):
        position = away * unit((1.0, 1.5, 2.0)) + np.array([0.0, 0.3, 0.0])
        camera = Camera("camera", vec3(position), (0.0, 0.3, 0.0), **lens)
        truths.append(trace(view_of(Scene("torus", meshes, (camera,), (light,)), camera, light, 128), 1))
    near, far = truths
    decided = ~near.undecided & ~far.undecided
    assert decided.mean() > 0.995 and 0.05 < (near.visibility < 0.5).mean() < 0.5
    assert np.array_equal(near.receivers[decided], far.receivers[decided])
    assert np.array_equal(near.visibility[decided], far.visibility[decided])


@pytest.mark.parametrize("elevation", [12.0, 35.0, 60.0, 85.0])
def test_a_constant_bias_lights_what_is_nearer_than_its_length_times_the_sine_of_the_elevation(elevation, mask) -> None:
    """Under a plate square to the sun, whose foot is on the plane: its depth is one in all texels of the map.

    At s from the foot it is s cos e away along the ray, so s cos e sin e above the plane. The near plane cuts it off.
    """
    e, bias = math.radians(elevation), 0.15
    sun = Light("sun", "directional", (math.cos(e), -math.sin(e), 0.0))
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    foot = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]])
    plate = Mesh("plate", np.vstack([foot, foot[::-1] + np.array([2 * math.sin(e), 2 * math.cos(e), 0.0])]), quad)
    plane = Mesh("plane", 6.0 * np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1.0]]), quad)
    camera = Camera("above", (1.0, 4.0, 0.0), (1.0, 0.0, 0.0), 0.0, (0.0, 0.0, -1.0), near=3.999, height=2.4)
    view = view_of(Scene("plate", (plane, plate), (camera,), (sun,)), camera, sun, 192)
    s = np.broadcast_to(1.0 + 2.4 * ((np.arange(192) + 0.5) / 192 - 0.5), (192, 192))
    height, limit = s * math.cos(e) * math.sin(e), bias * math.sin(e)
    below = (s > 0.02) & (s < 2 / math.sin(e) - 0.02) & (np.abs(height - limit) > 1e-5)  # not the map's outline of it
    assert (trace(view, 1).visibility[below] == 0).all()
    visibility = mask(f"shadow-map:fit=scene,bias=constant(world={bias}),filter=hard,size=1024", view)
    assert 0.05 < (height < limit)[below].mean() < 0.95
    assert np.array_equal(visibility[below] > 0.5, (height < limit)[below])
