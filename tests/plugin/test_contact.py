"""Contact shadows against closed forms: a tilted strip above the ground, a lone plane, a ball; and on any technique."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.plugin.registry import engines, own_techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.vectors import unit
from tests.drawing import KNOWN
from tests.samples import pairs

LOW, RISE, HALF_WIDTH = 0.3, 0.1, 0.2  # of the strip: its height at x = 0 and per metre of x, in metres; along z
TO_LIGHT = unit((0.0, 1.0, 1.0))
QUAD = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
THIN = 0.04  # metres
DENSE = f"steps=1024,stride=0,reach=0,share=0,thickness={THIN}"


@pytest.fixture
def under_strip(looking, shape, studio, build) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Distances to a strip along the sun's rays, of ground well inside its shadow, and their visibility."""

    def draw(contact: str, target=(0.0, 0.0, -0.2), kind: str = "directional", reach: float = 1e3):
        ends = np.array([(x, LOW + RISE * x, z) for x, z in ((-2, -1), (-2, 1), (2, 1), (2, -1))])
        strip = Mesh("strip", ends * (1.0, 1.0, HALF_WIDTH), QUAD)
        light = Light("light", kind, tuple((-TO_LIGHT).tolist()), tuple((reach * TO_LIGHT).tolist()), math.radians(90))
        shot = studio.shot(looking([shape("plane", 8.0), strip], light, 256, eye=(0, 2.4, -2.6), target=target, fov=40))
        visibility = build(f"unshadowed:contact=screen-space({contact})", shot).draw(shot)
        at = shot.position[..., :3] / shot.placement.scale + shot.placement.center
        ground = (shot.position[..., 3] > 0) & (abs(at[..., 1]) < 1e-4)
        height = LOW + RISE * at[..., 0]
        inside = ground & (abs(at[..., 0]) < 1.5) & (abs(at[..., 2] + height) < 0.9 * HALF_WIDTH)
        return height[inside] * math.sqrt(2), visibility[inside]

    return draw


@pytest.mark.parametrize("length", [0.35, 0.42, 0.5])
def test_the_gap_below_a_strip_is_filled_up_to_the_length_of_the_ray(under_strip, length: float) -> None:
    distance, visibility = under_strip(f"length={length},{DENSE}")
    near, far = distance < length, distance > length + 1.5 * THIN  # where not even the end is as near to the strip
    assert near.sum() > 300 and far.sum() > 300
    assert (visibility[near] == 0).mean() > 0.998 and (visibility[far] == 1).all()


def test_thicker_surfaces_hide_more_of_the_ray_and_those_of_no_thickness_nothing(under_strip) -> None:
    """The strip is higher above the ground than the ray is long."""
    dark = [
        (under_strip(f"length=0.2,steps=1024,stride=0,reach=0,share=0,thickness={thickness}")[1] == 0).sum()
        for thickness in (0, THIN, 2 * THIN, 1)
    ]
    assert dark[0] == 0 and dark[1] < dark[2] < dark[3]


@pytest.mark.parametrize("contact", ["steps=32", "preset=filament", "preset=bevy", "preset=bend-studio"])
def test_outside_the_view_nothing_is_known(under_strip, contact: str) -> None:
    """The strip is above the picture, its shadow in it."""
    distance, visibility = under_strip(contact, target=(0.0, 0.0, -1.48))
    assert len(distance) > 500 and (visibility == 1).mean() > 0.99


def test_a_ray_ends_at_the_light(under_strip) -> None:
    """A lamp between ground and strip."""
    assert (under_strip(f"length=9,{DENSE}", kind="point", reach=0.15)[1] == 1).all()


def incline(looking, tilt: float):
    """A square plane, turned away by an angle from the sun and by 60° from the view."""
    toward = (math.cos(math.radians(tilt)), math.sin(math.radians(tilt)))
    light = Light("sun", "directional", (-0.6 * toward[1], -toward[0], -0.8 * toward[1]))
    corners = np.array([(-2.0, 0, -2.0), (-2.0, 0, 2.0), (2.0, 0, 2.0), (2.0, 0, -2.0)])
    return looking([Mesh("plane", corners, QUAD)], light, 128, eye=(0.4, 1.5, 2.6), fov=60)


@pytest.mark.parametrize(
    ("tilt", "more"), pairs([0.0, 45.0, 80.0, 89.0], ["steps=32", "length=9", "stride=0", "bend=20"])
)
def test_no_plane_shadows_itself_where_rays_are_compared_with_planes(looking, mask, tilt: float, more: str) -> None:
    assert (mask(f"unshadowed:contact=screen-space({more})", incline(looking, tilt)) == 1).all()


def test_a_stair_of_depths_shadows_itself_and_less_so_if_rays_bend(looking, mask) -> None:
    """bevyengine/bevy #25355."""
    view = incline(looking, 80.0)
    straight, bent = (mask(f"unshadowed:contact=screen-space(depth=nearest,bend={bend})", view) for bend in (0, 20))
    assert (straight < 1).mean() > 0.05 and (bent < 1).mean() < 0.5 * (straight < 1).mean()


def test_nothing_is_in_front_of_a_ball(looking, shape, sun, mask) -> None:
    view = looking([shape("sphere", 2.0, subdivisions=4)], sun(30), 128)
    assert (mask("unshadowed:contact=screen-space(length=3)", view) == 1).all()


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)
def test_any_technique_has_them_on_top(technique, builtin, studio, build) -> None:
    name = "stairs" if "directional" in technique.lights else "lamp-by-wall"
    shot, contact = studio.shot(builtin(name, 96)), "contact=screen-space(thickness=0.05)"
    alone, with_contact, march = (
        build(spec, shot).draw(shot)
        for spec in (technique.name, f"{technique.name}:{contact}", f"unshadowed:{contact}")
    )
    assert np.array_equal(with_contact, alone * march) and (march < 1).any()


def test_a_spec_names_them_only_if_there_are_any() -> None:
    assert "contact" not in parse_spec("shadow-map", KNOWN).full_text
    spec = parse_spec("shadow-map:contact=screen-space(preset=bevy,steps=8)", KNOWN)
    assert parse_spec(spec.text, KNOWN) == spec and "preset" not in spec.text and "steps=8" in spec.text
    with pytest.raises(InputError, match="unknown preset 'bevi'"):
        parse_spec("shadow-map:contact=screen-space(preset=bevi)", KNOWN)
    with pytest.raises(InputError, match="unknown field 'contact'"):
        parse_spec("three:contact=none", engines())
