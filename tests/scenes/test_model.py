"""Views: near and far planes of the camera."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.errors import InputError
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, view_of

FLOOR = Mesh(
    "floor",
    np.array([[-4.0, 0.0, -4.0], [-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)
SUN = Light("sun", "directional", (0.3, -1.0, 0.2))


@settings(max_examples=50, deadline=None)
@given(height=st.floats(0.5, 50), x=st.floats(-3, 3), z=st.floats(-3, 3), fov=st.floats(5, 150))
def test_planes_from_bounds_cut_nothing_that_the_picture_shows(height: float, x: float, z: float, fov: float) -> None:
    """A floor seen from above has less view depth in the picture's corners than its distance from the camera."""
    camera = Camera("camera", (x, height, z), (0.0, 0.0, 0.0), math.radians(fov))
    view = view_of(Scene("floor", (FLOOR,), (camera,), (SUN,)), camera, SUN, 64)
    near, far = view.near_far
    right, up, back = camera.basis()
    slope = math.tan(camera.fov_y / 2)
    for across in (-1, 1):
        for down in (-1, 1):
            ray = -back + slope * (across * right + down * up)  # length 1 along the view's axis
            depth = -height / ray[1]
            hit = np.array(camera.position) + depth * ray
            if depth > 0 and (np.abs(hit[[0, 2]]) <= 4).all():
                assert near < depth < far


def planes(position: tuple[float, float, float], fov: float = 60.0, **given: float) -> tuple[float, float]:
    """Near and far of a camera over the floor, which spans (±4, 0, ±4)."""
    camera = Camera("camera", position, (0.0, 0.0, 0.0), math.radians(fov), **given)
    return view_of(Scene("floor", (FLOOR,), (camera,), (SUN,)), camera, SUN, 64).near_far


def test_planes_of_a_file_are_kept_inside_the_bounds_and_clamped_to_them() -> None:
    low, high = planes((3.0, 2.0, -1.0))
    assert planes((3.0, 2.0, -1.0), near=2.5, far=6.0) == (2.5, 6.0)
    assert planes((3.0, 2.0, -1.0), near=low / 2, far=2 * high) == (low, high)
    assert planes((3.0, 2.0, -1.0), near=0.25 * low) == (low, high)
    assert planes((3.0, 2.0, -1.0), far=6.0) == (low, 6.0)


def test_planes_that_leave_out_the_scene_are_said() -> None:
    camera = Camera("camera", (0.0, 3.0, 8.0), (0.0, 0.0, 0.0), 0.6, near=500.0, far=900.0)
    with pytest.raises(InputError, match=r"shows nothing: its near and far planes, 500\.0 and 900\.0 m, exclude"):
        view_of(Scene("floor", (FLOOR,), (camera,), (SUN,)), camera, SUN, 64)
