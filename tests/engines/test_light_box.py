"""The light's box: it holds every caster and receiver, no more, and its texels move by a phase."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.engines.light_box import MARGIN, PADDING, light_box
from shadowbench.scenes.model import Light, View

SIZE = 64


def in_camera(points: np.ndarray, box: dict) -> np.ndarray:
    """(N, 3) right, up and depth of points in the box's orthographic camera, looking from position at target."""
    forward = (np.array(box["target"]) - box["position"]) / box["depth"]
    return (points - box["position"]) @ np.array([np.cross(forward, box["up"]), box["up"], forward]).T


def used(view: View) -> np.ndarray:
    return view.scene.geometry.vertices[view.scene.geometry.faces].reshape(-1, 3)


@pytest.mark.parametrize("name", ["stairs", "terrain", "street", "fence"])
def test_the_box_of_a_directional_light_is_tight(builtin: Callable[..., View], name: str) -> None:
    view = builtin(name, SIZE)
    box = light_box(view)
    travelled = np.subtract(box["target"], box["position"]) / box["depth"]
    np.testing.assert_allclose(travelled, np.negative(view.light.homogeneous[0]), atol=1e-12)
    found = in_camera(used(view), box)
    half = np.array([box["width"], box["height"]]) / 2
    np.testing.assert_allclose(found[:, :2].min(axis=0), -half, rtol=1e-9)
    np.testing.assert_allclose(found[:, :2].max(axis=0), half, rtol=1e-9)
    margin = MARGIN * (half.max() * 2 + box["depth"])
    assert 0 < found[:, 2].min() < margin
    assert 0 < box["depth"] - found[:, 2].max() < margin


def test_a_map_pads_the_box_by_texels_and_a_phase_moves_it_by_parts_of_one(builtin: Callable[..., View]) -> None:
    view = builtin("stairs", SIZE)
    tight, padded = light_box(view), light_box(view, 256)
    texel = {side: padded[side] / 256 for side in ("width", "height")}
    for side, length in texel.items():
        assert padded[side] - tight[side] == pytest.approx(2 * PADDING * length)
    moved = light_box(view, 256, (0.5, -0.25))
    assert {name: moved[name] for name in ("up", "width", "height", "depth")} == {
        name: padded[name] for name in ("up", "width", "height", "depth")
    }
    for end in ("position", "target"):
        step = in_camera(np.array(moved[end]), padded) - in_camera(np.array(padded[end]), padded)
        np.testing.assert_allclose(step, [0.5 * texel["width"], -0.25 * texel["height"], 0], atol=1e-12)


def test_a_plane_across_the_light_or_along_it_has_a_box_with_a_volume(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    plane = replace(view.scene, meshes=view.scene.meshes[:1])
    for direction in ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0)):
        box = light_box(replace(view, scene=plane, light=Light("sun", "directional", direction=direction)))
        assert min(box["width"], box["height"], box["depth"]) > 0


def test_a_mesh_that_neither_casts_nor_receives_does_not_enlarge_the_box(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    sky = replace(view.scene.meshes[1], vertices=100 * view.scene.meshes[1].vertices, casts=False, receives=False)
    assert light_box(replace(view, scene=replace(view.scene, meshes=(*view.scene.meshes, sky)))) == light_box(view)


@pytest.mark.parametrize("name", ["spot-lamp", "lamp-by-wall", "room-with-lamp", "lamp-over-table", "shade", "window"])
def test_near_and_far_of_a_lamp_hold_what_it_lights(builtin: Callable[..., View], name: str) -> None:
    view = builtin(name, SIZE)
    box, offsets = light_box(view), used(view) - view.light.position
    if view.light.kind == "point":
        depths = lit = np.linalg.norm(offsets, axis=1)
    else:
        depths = offsets @ view.light.direction / np.linalg.norm(view.light.direction)
        lit = depths[depths > np.cos(view.light.frustum_angle / 2) * np.linalg.norm(offsets, axis=1)]
    assert 0 < box["near"] < lit.min()
    assert depths.max() < box["far"] < 1.01 * depths.max()


def test_near_is_at_the_triangle_that_is_nearest_not_at_its_corners(builtin: Callable[..., View]) -> None:
    view = builtin("cube-on-plane", SIZE)
    plane = replace(view.scene, meshes=view.scene.meshes[:1])
    down, position = (0.0, -1.0, 0.0), (0.1, 0.5, 0.0)
    for light, near in (
        (Light("bulb", "point", position=position), 0.5),
        (Light("spot", "spot", position=position, direction=down, angle=1.0), 0.5),
        (Light("up", "spot", position=position, direction=(0.0, 1.0, 0.0), angle=1.0), 0.5),  # nothing in its cone
        (Light("in", "point", position=(0.1, 0.0, 0.0)), None),
    ):
        box = light_box(replace(view, scene=plane, light=light))
        assert box["near"] == (pytest.approx(near, rel=2e-3) if near else box["far"] / 1e4)
        assert box["near"] < box["far"]
