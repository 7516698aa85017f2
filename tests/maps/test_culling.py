"""Caster culling: masks are identical with and without it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.maps.culling import kept_ranges, may_shadow
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import view_of

KNOWN = techniques()
CULLING = [name for name, technique in KNOWN.items() if "cull" in technique.Params.model_fields]
SIZE = 96


def views(name: str):
    """Each camera with each light of a built-in scene."""
    scene = load_scene(name)
    return [view_of(scene, camera, light, SIZE) for camera in scene.cameras for light in scene.lights]


def by_turns(able: Mapping[str, Sequence[str]]) -> list[Any]:
    """Each with each of its own; one of them, by turns, is fast."""
    return [
        pytest.param(name, one, marks=[] if one == ones[turn % len(ones)] else pytest.mark.slow)
        for turn, (name, ones) in enumerate(able.items())
        for one in ones
    ]


def answering(name: str) -> list[str]:
    """Techniques that answer a light of a scene."""
    kinds = {light.hard_kind for light in load_scene(name).lights}
    return [technique for technique in CULLING if kinds & KNOWN[technique].lights]


@pytest.mark.parametrize(("name", "technique"), by_turns({name: answering(name) for name in builtin_names()}))
def test_a_mask_is_the_same_without_culling(name: str, technique: str, build, studio) -> None:
    for view in views(name):
        if view.light.hard_kind not in KNOWN[technique].lights:
            continue
        shot = studio.shot(view)
        size = "size=128," if "size" in KNOWN[technique].Params.model_fields else ""
        culled, whole = (build(f"{technique}:{size}cull={cull}", shot).draw(shot) for cull in ("true", "false"))
        assert (culled == whole).all(), view.camera.name


SCENES = ["street", "deep-street", "canopy"]
OTHERWISE = [
    "shadow-map:fit=scene,size=128",
    "shadow-map:fit=view,size=128,reversed=true",
    "shadow-map:fit=fixed,size=128",
    "shadow-map:bias=polygon-offset(-2,-4),size=128",
    "shadow-map:bias=front-cull,depth=d16,size=128",
    "cascades:size=128,depth_clamp=false",
    "cascades:size=128,layers=geometry",
    "shadow-volume:faces=triangle",
    "shadow-volume:counter=color",
    "shadow-volume:count=z-pass",
]


@pytest.mark.parametrize(("spec", "name"), by_turns(dict.fromkeys(OTHERWISE, SCENES)))
def test_culling_leaves_masks_unchanged_with_other_parameters(spec: str, name: str, build, studio, device) -> None:
    shot = studio.shot(views(name)[0])
    if "reversed" in spec and not device.clip_control:
        spec = spec.replace(",reversed=true", "")
    culled, whole = (
        build(f"{spec},cull={cull}" if ":" in spec else spec, shot).draw(shot) for cull in ("true", "false")
    )
    assert (culled == whole).all()


@pytest.mark.parametrize(
    ("spec", "name", "fact", "least"),
    [
        ("shadow-map", "deep-street", "culled_triangles", 1),
        ("cascades", "deep-street", "culled_triangles", 100),
        ("cube-map", "room-with-lamp", "culled_triangles", 100),
        ("shadow-volume", "deep-street", "culled_parts", 1),
    ],
)
def test_culled_casters_are_counted_in_the_row(spec, name, fact, least, build, studio) -> None:
    shot = studio.shot(views(name)[0])
    culled, whole = (build(f"{spec}:cull={cull}", shot) for cull in ("true", "false"))
    for one in (culled, whole):
        one.draw(shot)
    assert culled.technique.facts()[fact] >= least
    assert whole.technique.facts()[fact] == 0


units = st.floats(-1.0, 1.0, allow_nan=False)
places = st.tuples(units, units, units).map(np.array)
boxes = st.tuples(places, places).map(lambda ends: np.stack([np.minimum(*ends), np.maximum(*ends)]))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(box=boxes, inside=places, along=st.floats(0.0, 2.0), seen=places, turn=places, w=st.sampled_from([0.0, 1.0]))
def test_casters_between_a_receiver_and_the_light_are_kept(box, inside, along, seen, turn, w) -> None:
    """For receivers behind a point of a caster's box, in any convex region that contains them."""
    caster = box[0] + (inside + 1) / 2 * (box[1] - box[0])
    length = np.linalg.norm(seen)
    light = seen * 3 if w else seen / length if length > 1e-3 else np.array([0.0, 1.0, 0.0])  # a unit vector
    receiver = caster + along * (w * caster - light)
    normals = np.vstack([np.eye(3), -np.eye(3), turn[None]])
    planes = np.column_stack([normals, -normals @ receiver])
    assert may_shadow(box[None], (*light, w), planes).all()


def test_draw_ranges_cover_the_kept_chunks_and_small_gaps() -> None:
    ends = np.array([3000, 6000, 6300, 9000, 12000])
    assert kept_ranges(np.array([True, False, True, True, False]), ends) == ((0, 3000), (6000, 3000))
    assert kept_ranges(np.array([False, True, False, True, False]), ends) == ((3000, 6000),)
    assert kept_ranges(np.zeros(5, dtype=bool), ends) == ()
    assert kept_ranges(np.ones(5, dtype=bool), ends) == ((0, 12000),)
    chosen, other = np.array([True, False, True, False, True]), np.array([False, True, False, False, False])
    assert kept_ranges(chosen, np.array([1, 2, 3, 4, 5]), other) == ((0, 1), (2, 3))


def test_a_caster_that_a_lamp_lies_on_may_shadow_what_is_above_it() -> None:
    box, above = np.array([[[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]]]), np.array([[0.0, 1.0, 0.0, -2.0]])
    kept = {height: bool(may_shadow(box, (0.2, height, 0.1, 1.0), above)[0]) for height in (0.9, 1.0, 1.1)}
    assert kept == {0.9: True, 1.0: True, 1.1: False}
