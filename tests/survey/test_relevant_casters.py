"""Casters reported as irrelevant: removing them leaves the truth unchanged."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from shadowbench.scenes.library import hard_names
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.casters import RelevantCasters, relevant_casters
from shadowbench.survey.maps import fitted_map
from shadowbench.survey.sampling import sample_view
from shadowbench.truths.trace import trace
from tests.survey.conftest import LIGHTS, box, from_above, looking, plate

SUN = Light("sun", "directional", (0.5, -1.0, 0.0))


def relevant(view: View) -> RelevantCasters:
    return relevant_casters(fitted_map(sample_view(view)))


def without(view: View, useless: np.ndarray) -> View:
    """The view with some triangles, by index, no longer casting; visibility to the camera is unchanged."""
    geometry = view.scene.geometry
    casts = geometry.casts.copy()
    casts[useless] = False
    kinds = [(casting, receiving) for casting in (True, False) for receiving in (True, False)]
    meshes = [
        Mesh("part", geometry.vertices, geometry.faces[chosen], casts=casting, receives=receiving)
        for casting, receiving in kinds
        if (chosen := (casts == casting) & (geometry.receives == receiving)).any()
    ]
    return replace(view, scene=replace(view.scene, meshes=tuple(meshes)))


def assert_same_shadows(view: View) -> int:
    """Assert that the truth does not change without the irrelevant casters; returns their number."""
    found = relevant(view)
    useless = np.flatnonzero(view.scene.geometry.casts)[~found.matters]
    assert found.sure and found.useless == len(useless)
    if len(useless):
        whole, rest = trace(view, 1), trace(without(view, useless), 1)
        np.testing.assert_array_equal(whole.receivers, rest.receivers)
        np.testing.assert_array_equal(whole.visibility, rest.visibility)
    return len(useless)


def test_a_box_whose_shadow_falls_outside_the_picture_is_left_out() -> None:
    seen, unseen = box(0.3, (0.0, 0.15, 0.0), "seen"), box(0.3, (3.0, 0.15, 0.0), "unseen")
    view = from_above([plate(50.0), seen, unseen], SUN)
    found = relevant(view)
    assert found.useless == 12 and not found.matters[14:].any() and found.matters[2:14].any()
    assert assert_same_shadows(view) == 12


def test_a_box_outside_the_picture_that_shadows_into_it_stays() -> None:
    tall = box(0.3, (-2.0, 4.0, 0.0))  # four metres up, and its shadow two metres on
    assert relevant(from_above([plate(50.0), tall], SUN)).useless == 0


def test_a_box_below_all_that_is_seen_is_left_out() -> None:
    found = relevant(from_above([plate(50.0), box(0.3, (0.0, -1.0, 0.0))], SUN))
    assert found.matters.tolist() == [True] * 2 + [False] * 12


def test_a_box_behind_a_spot_is_left_out() -> None:
    spot = Light("spot", "spot", (0.0, -1.0, 0.0), (0.0, 3.0, 0.0), 1.0)
    assert relevant(from_above([plate(50.0), box(0.3, (0.0, 4.0, 0.0))], spot)).useless == 12


places = st.tuples(st.floats(-3, 3), st.floats(-1, 3), st.floats(-3, 3))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0.05, 1.0), places), min_size=1, max_size=6), st.sampled_from(LIGHTS))
@example([(0.65625, (1.0, 1.75, 1.8125))], next(light for light in LIGHTS if light.kind == "spot"))
def test_translated_scenes_keep_their_shadows(boxes: list, light: Light) -> None:
    view = looking([plate(8.0), *(box(side, center) for side, center in boxes)], light, size=32, eye=(0.9, 2.0, 1.5))
    assume(trace(view).receivers.any())  # not from within a box
    assert_same_shadows(view)


@pytest.mark.parametrize("name", hard_names())
def test_no_shadow_changes_in_our_scenes(name: str) -> None:
    assert_same_shadows(chosen_view(name, 128))


@pytest.mark.parametrize(("radius", "size"), [(0.1, 64), (0.0, 1024)], ids=["an area light", "a part of the pixels"])
def test_casters_may_matter_beside_the_centre_of_a_light_and_between_pixels(radius: float, size: int) -> None:
    view = from_above([plate(50.0), box(0.3, (0.0, 0.15, 0.0))], replace(SUN, radius=radius), size=size)
    assert not relevant(view).sure
