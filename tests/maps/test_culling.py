"""Caster culling: masks are identical with and without it."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.maps.culling import may_shadow
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from tests.samples import by_turns

SIZE = 96


SPECS = [
    "shadow-map:size=128",
    "shadow-map:fit=scene,size=128",
    "shadow-map:fit=view,size=128",
    "shadow-map:fit=fixed,size=128",
    "shadow-map:fit=visible(oriented=false),size=128",
    "shadow-map:bias=polygon-offset(-2,-4),size=128",
    "shadow-map:bias=front-cull,depth=d16,size=128",
    "cascades:size=128",
    "cascades:size=128,depth_clamp=false",
    "cascades:size=128,oriented=false",
    "cascades:size=128,layers=geometry",
    "shadow-volume:compare=position",
    "shadow-volume:faces=triangle",
    "shadow-volume:counter=color",
    "shadow-volume:count=z-pass",
]
SCENES = ["street", "deep-street", "canopy", "terrain", "colonnade"]
LAMPS = by_turns(
    ["cube-map:size=128", "cube-map:layers=passes,size=128", "shadow-volume:compare=position", "shadow-map:size=128"],
    ["room-with-lamp", "lamp-by-wall", "lamp-over-table", "spot-lamp"],
)


@pytest.mark.parametrize(("spec", "name"), [*by_turns(SPECS, SCENES), *LAMPS])
def test_a_mask_is_the_same_without_culling(spec: str, name: str, build, studio) -> None:
    scene, lights = load_scene(name), techniques()[spec.partition(":")[0]].lights
    for camera, light in product(scene.cameras, scene.lights):
        if light.hard_kind in lights:
            shot = studio.shot(view_of(scene, camera, light, SIZE))
            culled, whole = (build(f"{spec},cull={cull}", shot).draw(shot) for cull in ("true", "false"))
            assert (culled == whole).all(), camera.name


@pytest.mark.parametrize(
    ("spec", "name", "fact", "least"),
    [
        ("shadow-map", "terrain", "culled_triangles", 100),
        ("cascades", "deep-street", "culled_triangles", 100),
        ("cube-map", "room-with-lamp", "culled_triangles", 100),
        ("shadow-volume", "deep-street", "culled_parts", 1),
    ],
)
def test_culled_casters_are_counted_in_the_row(spec, name, fact, least, build, studio, builtin) -> None:
    shot = studio.shot(builtin(name, SIZE))
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


def test_a_caster_that_a_lamp_lies_on_may_shadow_what_is_above_it() -> None:
    box, above = np.array([[[-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]]]), np.array([[0.0, 1.0, 0.0, -2.0]])
    kept = {height: bool(may_shadow(box, (0.2, height, 0.1, 1.0), above)[0]) for height in (0.9, 1.0, 1.1)}
    assert kept == {0.9: True, 1.0: True, 1.1: False}
