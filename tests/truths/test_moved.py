"""Shadows do not depend on the position or unit of a scene."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Light, Scene, view_of
from shadowbench.scenes.vectors import Vec3, vec3
from shadowbench.truths.trace import trace

MOVED = 1e6
CHANGES = {"moved": (MOVED, 1.0), "scaled": (0.0, 1e-4), "moved, then scaled": (MOVED, 1e-4)}


def changed(scene: Scene, move: float, scale: float) -> Scene:
    """The scene, its cameras and lights moved along all axes, then scaled about the origin, in float64."""

    def point(place: Vec3) -> Vec3:
        return vec3((np.asarray(place) + move) * scale)

    def camera(old: Camera) -> Camera:
        near, far = (None if plane is None else plane * scale for plane in (old.near, old.far))
        return replace(old, position=point(old.position), target=point(old.target), near=near, far=far)

    def light(old: Light) -> Light:
        return replace(old, position=point(old.position))

    meshes = tuple(replace(mesh, vertices=(mesh.vertices + move) * scale) for mesh in scene.meshes)
    cameras, lights = tuple(map(camera, scene.cameras)), tuple(map(light, scene.lights))
    return replace(scene, meshes=meshes, cameras=cameras, lights=lights)


def assert_unchanged(scene: Scene, size: int) -> None:
    truth = trace(view_of(scene, scene.cameras[0], scene.lights[0], size), pixel_samples=1)
    assert 0 < truth.visibility[truth.receivers].mean() < 1
    for change, (move, scale) in CHANGES.items():
        other = changed(scene, move, scale)
        there = trace(view_of(other, other.cameras[0], other.lights[0], size), pixel_samples=1)
        both = ~truth.undecided & ~there.undecided
        assert both.mean() > 0.98
        assert (truth.receivers == there.receivers)[both].all(), change
        assert (truth.visibility == there.visibility)[both].all(), change
        assert there.diagonal == pytest.approx(truth.diagonal * scale, rel=1e-3)
        inner = both & np.isfinite(truth.blocker)
        near = np.isclose(there.blocker[inner], truth.blocker[inner] * scale, rtol=1e-2, atol=1e-5 * there.diagonal)
        assert near.mean() > 0.99, change


@pytest.mark.parametrize("name", ["cube-on-plane", "room-with-lamp", "spot-lamp"])
def test_moving_and_scaling_changes_no_decided_pixel(name) -> None:
    assert_unchanged(load_scene(name), 256)


@pytest.mark.slow
def test_moving_and_scaling_changes_no_decided_pixel_of_a_large_mesh(shared_scenes) -> None:
    assert_unchanged(load_scene(shared_scenes / "armadillo.obj"), 1024)
