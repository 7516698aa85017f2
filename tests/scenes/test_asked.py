"""Built-in scenes that are the best or worst case of a technique have the properties that their `about` states."""

from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene, View, view_of
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import Tracer
from shadowbench.truths.trace import Truth, trace

MADE_FOR_ONE = ["deep-street", "inside-volume", "lamp-by-wall", "lamp-over-table", "table-top"]
SIZE = 192
VIEWS = [(name, camera.name) for name in MADE_FOR_ONE for camera in load_scene(name).cameras]


@pytest.fixture(scope="module")
def traced() -> Callable[..., tuple[View, Truth]]:
    """A view of a scene and camera, by default its first, and the truth."""
    known: dict[tuple[str, str], tuple[View, Truth]] = {}

    def get(name: str, camera: str = "") -> tuple[View, Truth]:
        if (name, camera) not in known:
            scene = load_scene(name)
            seen = next((one for one in scene.cameras if one.name == camera), scene.cameras[0])
            view = view_of(scene, seen, scene.lights[0], SIZE)
            known[name, camera] = view, trace(view, pixel_samples=1)
        return known[name, camera]

    return get


def pixel_rays(view: View, x: Floats, y: Floats) -> Floats:
    """(N, 3) directions of length 1 along the axis; x and y run from −1 to 1, y upwards."""
    right, up, back = view.camera.basis()
    slope = np.tan(view.camera.fov_y / 2)
    return slope * (x[:, None] * right + y[:, None] * up) - back


def receiver_points(view: View, truth: Truth) -> tuple[Floats, Floats]:
    """(R, 3) points of the decided receivers, and (R,) their visibility."""
    row, column = np.nonzero(truth.receivers & ~truth.undecided)
    rays = pixel_rays(view, (2 * column + 1) / view.size - 1, 1 - (2 * row + 1) / view.size)
    geometry, hit = view.scene.geometry, truth.triangle[row, column]
    corner, normal = geometry.vertices[geometry.faces[hit, 0]], geometry.normals[hit]
    eye = np.array(view.camera.position)
    along = np.einsum("ij,ij->i", corner - eye, normal) / np.einsum("ij,ij->i", rays, normal)
    return eye + rays * along[:, None], truth.visibility[row, column]


def occluded(scene: Scene, points: Floats) -> np.ndarray:
    """Whether a caster is between each point and the scene's first light, a directional one."""
    towards = np.array(scene.lights[0].homogeneous[0])[None]
    tracer = Tracer(scene.geometry.vertices, scene.geometry.caster_faces)
    return tracer.occluded(points, towards, 1e9)


def test_shadows_are_well_in_view_and_decided(traced) -> None:
    for name, camera in VIEWS:
        view, truth = traced(name, camera)
        assert view.camera.name == camera
        shadowed = float((truth.visibility[truth.receivers] < 0.5).mean())
        assert 0.1 <= shadowed <= 0.6
        assert truth.receivers.mean() > 0.4
        assert truth.undecided[truth.receivers].mean() < 0.004  # at 192²; fewer in larger images


def test_the_deep_street_is_lit_and_shadowed_from_1_m_to_500_m() -> None:
    scene = load_scene("deep-street")
    view = view_of(scene, scene.cameras[0], scene.lights[0], 512)
    points, visibility = receiver_points(view, trace(view, pixel_samples=1))
    distance = np.linalg.norm(points - np.array(view.camera.position), axis=1)
    assert distance.min() < 1.25 and distance.max() > 500
    for low, high in ((0, 5), (5, 20), (20, 80), (80, 500)):
        here = visibility[(distance >= low) & (distance < high)]
        assert (here < 0.5).sum() > 40 and (here > 0.5).sum() > 40, f"{low} to {high} m"


def test_the_eye_and_the_near_plane_stand_inside_a_volume() -> None:
    scene = load_scene("inside-volume")
    view = view_of(scene, scene.cameras[0], scene.lights[0], SIZE)
    near, _ = view.near_far
    x, y = np.array([-1.0, 1.0, -1.0, 1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
    eye = np.array(view.camera.position)
    assert occluded(scene, np.vstack([eye, eye + near * pixel_rays(view, x, y)])).all()
