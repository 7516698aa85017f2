"""The G-buffer agrees with camera rays in every pixel."""

import math

import numpy as np
import pytest

from shadowbench.gl.gbuffer import download, view_projection
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, View, view_of

SCENES = ["sphere-and-torus", "room-with-lamp", "terrain"]
SIZE = 384


def rays(view: View) -> tuple[np.ndarray, np.ndarray]:
    """The eye and (size, size, 3) directions through pixel centres, from the camera's definition."""
    eye, target = np.asarray(view.camera.position), np.asarray(view.camera.target)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, view.camera.up)
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    steps = (np.arange(view.size.height) + 0.5) / view.size.height * 2 - 1
    half = math.tan(view.camera.fov_y / 2)
    down, across = np.meshgrid(steps, steps, indexing="ij")
    return eye, ahead + half * (across[..., None] * right - down[..., None] * above)


def disagreement(ours: np.ndarray, theirs: np.ndarray, where: np.ndarray, down: int = 0, across: int = 0) -> float:
    moved = np.roll(ours, (down, across), axis=(0, 1))
    inner = np.zeros_like(where)
    inner[1:-1, 1:-1] = where[1:-1, 1:-1]
    return float((moved != theirs)[inner].mean())


@pytest.mark.parametrize("name", SCENES)
def test_triangles_are_those_that_rays_hit(studio, builtin, truth_of, name) -> None:
    shot, truth = studio.shot(builtin(name, SIZE)), truth_of(name, SIZE)
    decided = truth.receivers & ~truth.undecided
    # A rasteriser moves vertices to a grid of 1/256 pixel, so a centre beside an edge may fall to the other triangle:
    # found for 8 in 10,000 pixels of the terrain's thousands of edges, for 2 or fewer elsewhere.
    assert disagreement(shot.triangle, truth.triangle, decided) < (1e-3 if name == "terrain" else 2.5e-4)


@pytest.mark.parametrize("name", SCENES)
def test_positions_are_where_rays_through_pixel_centres_meet_the_triangle(studio, builtin, device, name) -> None:
    shot = studio.shot(builtin(name, SIZE))
    eye, directions = rays(shot.view)
    hit = shot.triangle >= 0
    geometry, triangle = shot.view.scene.geometry, shot.triangle[hit]
    normal, corner = geometry.normals[triangle], geometry.vertices[geometry.faces[triangle, 0]]
    toward = directions[hit]
    slope = np.einsum("ij,ij->i", normal, toward)
    steep = np.abs(slope) > 0.05 * np.linalg.norm(toward, axis=1)  # a grazing ray meets its plane anywhere
    distance = np.einsum("ij,ij->i", normal, corner - eye) / slope
    error = np.linalg.norm(eye + toward * distance[:, None] - shot.position[hit][:, :3], axis=1)[steep]
    assert steep.mean() > 0.99
    # Of a scene whose diagonal is about 1, in float32; GPUs interpolate more coarsely: an H100 was off by 8e-5.
    assert error.max() < (1e-6 if device.software else 1e-4)


@pytest.mark.parametrize("name", [*SCENES, "deep-street"])
def test_normals_are_the_triangles_own_turned_to_the_camera_and_a_miss_has_none(studio, builtin, name) -> None:
    shot = studio.shot(builtin(name, SIZE))
    hit = shot.triangle >= 0
    normal = shot.normal[hit][:, :3]
    to_eye = np.asarray(shot.view.camera.position) - shot.position[hit][:, :3]
    own = shot.view.scene.geometry.normals[shot.triangle[hit]]
    assert (np.einsum("ij,ij->i", normal, to_eye) >= 0).all()
    assert np.abs(np.abs(np.einsum("ij,ij->i", normal, own)) - 1).max() < 1e-6
    assert (shot.triangle[~hit] == -1).all()
    assert ((shot.position[..., 3] == 1) == hit).all()
    assert (shot.normal[..., 3][~hit] == 0).all()


def test_depth_is_linear_in_the_distance_along_the_axis(studio, builtin) -> None:
    shot = studio.shot(builtin("street"))
    hit = shot.triangle >= 0
    shot.surface.depth.compare_func = ""
    stored = download(shot.surface.depth)[..., 0][hit].astype(np.float64)
    back = shot.view.camera.basis()[2]
    axial = -(shot.position[hit][:, :3] - shot.view.camera.position) @ back
    assert stored * shot.view.near_far[1] == pytest.approx(axial, rel=0, abs=2e-6)


def test_the_camera_keeps_the_digits_of_its_place() -> None:
    """A tuple of numbers passed to PyGLM's dvec3 is rounded to float32 on the way."""
    eye = (1.880000601008092, 0.123456789012345, -2.718281828459045)
    scene = load_scene("cube-on-plane")
    view = view_of(scene, Camera("camera", eye, (0.1, 0.2, 0.3), 0.7), scene.lights[0], 8)
    *_, w = view_projection(view) @ [*eye, 1.0]
    assert abs(w) < 1e-14, "the eye lies in its own plane"
