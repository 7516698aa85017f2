"""Biases on a plane, compared with closed forms, and the effects of too little or too much bias.

On a lone inclined plane everything is lit, so every pixel in shadow is acne. Parameters are given in full: a tuned
default must not change what a formula promises. A receiver's float32 position is off by half a step of a depth near 1,
along the light by 1/cos θ as much: up to four steps at 75°, and as many again for the way through matrices.
"""

import math

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.vectors import unit
from tests.samples import by_turns, pairs

SIZE = 160
TILTS = [5.0, 30.0, 60.0, 75.0]  # degrees between the plane's normal and the light
QUAD = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
ROUNDED = 4 * 2.0**-24  # of two depths near 1 that are compared, each the quotient of two rounded sums
EXACT = {
    "receiver-plane": "receiver-plane(gradient=plane,limit=10,slack=0,ulps=12)",
    "texel": "texel(scale=1,limit=8,ulps=4)",
    "normal-offset": "normal-offset(scale=1,ulps=4)",
    "two-planes": "two-planes",
}


@pytest.fixture
def incline(looking):
    """A square plane, turned away by an angle from a light of either kind, seen from the light's side."""

    def make(kind: str, tilt: float, size: int = SIZE):
        normal = unit((0.2, 1.0, 0.35))
        axis = unit(np.cross(normal, (0.9, 0.1, 0.4)))
        other = np.cross(normal, axis)
        corners = 1.5 * np.array([-axis - other, axis - other, axis + other, -axis + other])
        corners = (
            corners[::-1] if np.dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), normal) < 0 else corners
        )
        toward = math.cos(math.radians(tilt)) * normal + math.sin(math.radians(tilt)) * unit(axis + 0.37 * other)
        place = toward * 6.0
        light = Light(kind, kind, tuple((-toward).tolist()), tuple(place.tolist()), math.radians(45))
        mesh = Mesh("plane", corners, QUAD)
        eye = tuple((normal * 3.2 + axis * 0.4).tolist())
        return looking([mesh], light, size, eye=eye, fov=60)

    return make


@pytest.mark.parametrize(
    ("kind", "tilt", "bias", "filter_"),
    pairs(["directional", "spot"], TILTS, EXACT, ["hard", "hardware", "pcf(7)"]),
)
def test_an_inclined_plane_has_no_acne(incline, mask, kind: str, tilt: float, bias: str, filter_: str) -> None:
    for size in (61, 256):
        visibility = mask(f"shadow-map:fit=scene,bias={EXACT[bias]},filter={filter_},size={size}", incline(kind, tilt))
        assert (visibility == 1).all(), f"{(visibility < 1).sum()} pixels at {size}"


@pytest.mark.parametrize(("tilt", "technique"), by_turns([0.0, 1e-4, 1e-3, 0.1, 1.0], ["shadow-map", "cascades"]))
def test_a_plane_square_to_the_light_has_no_acne(incline, mask, technique: str, tilt: float) -> None:
    """Alone, it has so short a range of depths that the rounding of positions is many steps of the format.

    Of those, a receiver's interpolated position takes up to two; three multiply-adds take it into the map, and three
    the caster's corners, each rounded by up to one. On an H100, 4 ulps leave acne in 10 of 25,600 pixels, 5 in none.
    """
    for name, bias in EXACT.items():
        bias = bias.replace("ulps=4", "ulps=8")
        visibility = mask(f"{technique}:bias={bias},filter=hardware,size=256", incline("directional", tilt))
        assert (visibility == 1).all(), f"{(visibility < 1).sum()} pixels with {name}"


@pytest.mark.parametrize(("kind", "tilt"), [("directional", 30.0), ("spot", 75.0)])
def test_without_a_bias_half_of_an_inclined_plane_is_acne(incline, studio, build, kind: str, tilt: float) -> None:
    shot = studio.shot(incline(kind, tilt))
    visibility = build("shadow-map:fit=scene,bias=none,filter=hard,size=256", shot).draw(shot)
    assert 0.45 < (visibility[shot.triangle >= 0] < 0.5).mean() < 0.55


@pytest.mark.parametrize(
    ("falloff", "tilt"), [("sine", 30.0), ("versine", 60.0), ("across", 75.0), ("none", 30.0), ("sine", 75.0)]
)
def test_an_offset_is_enough_where_it_moves_a_receiver_as_far_as_the_plane_s_depth_changes(
    incline, mask, falloff: str, tilt: float
) -> None:
    """An offset s along the normal gains s/cos θ on the plane, across the light s tan θ; the reach times tan θ is due.

    Where the plane descends along a side of the map, 1/√2 of that is due, as the reach is half a texel's diagonal.
    """
    cos, sin = math.cos(math.radians(tilt)), math.sin(math.radians(tilt))
    due = {"sine": 1.0, "versine": sin / (1 - cos), "across": 1 / sin / (1 - cos), "none": sin}[falloff]
    spec = "shadow-map:fit=scene,filter=hard,size=256,bias=normal-offset({},falloff={})"
    enough = mask(spec.format(due, falloff), incline("directional", tilt))
    little = mask(spec.format(0.6 * due, falloff), incline("directional", tilt))
    assert (enough == 1).all(), f"{(enough < 1).sum()} pixels"
    assert (little < 0.5).mean() > 0.01


def test_screen_derivatives_agree_with_the_plane_where_there_is_one(incline, mask) -> None:
    bias = "receiver-plane(gradient=derivative,limit=10,slack=0.1,ulps=4)"
    for kind in ("directional", "spot"):
        visibility = mask(f"shadow-map:fit=scene,bias={bias},filter=pcf(5),size=256", incline(kind, 60))
        inner = visibility[40:-40, 40:-40]
        assert (inner == 1).mean() > 0.999


def test_with_front_faces_culled_back_faces_cast(shape, looking, sun, mask) -> None:
    """No surface shadows itself; an open plane that shows the light its face casts nothing at all."""
    sheet = shape("plane", 1.0, (0.0, 1.0, 0.0))
    box = shape("box", 1.0, (0.0, 0.5, 0.0))
    ground = shape("plane", 6.0)
    view = looking([ground, box], sun(azimuth=150.0), SIZE)
    lit = looking([ground, sheet], sun(azimuth=150.0), SIZE)
    spec = "shadow-map:fit=scene,bias=front-cull,filter=hard,size=512"
    assert (mask(spec, view) < 0.5).sum() > 200
    assert (mask(spec, lit) == 1).all()
    assert (mask("shadow-map:fit=scene,filter=hard,size=512", lit) < 0.5).sum() > 200


@pytest.mark.parametrize(
    ("whole", "parts"),
    [
        ("polygon-offset(2,4)", "polygon-offset(0.5,1)+polygon-offset(0.5,1)+polygon-offset(1,2)"),
        ("constant(0.0078125)", "constant(0.00390625)+before-divide(0.00390625)"),
        ("normal-offset(2,0)", "normal-offset(1,0)+normal-offset(1,0)"),
    ],
)
def test_the_terms_of_a_bias_add_up_to_it(builtin, mask, whole: str, parts: str) -> None:
    view, spec = builtin("sphere-and-torus", SIZE), "shadow-map:fit=scene,filter=hard,size=256,bias="
    together = mask(f"{spec}{parts}", view)
    assert np.array_equal(together, mask(f"{spec}{whole}", view))
    assert not np.array_equal(together, mask(f"{spec}{parts.partition('+')[0]}", view))


@pytest.mark.parametrize(("height", "units"), [(3.0, 0.3), (4.5, 0.6)])
def test_before_divide_is_that_constant_over_the_distance_in_metres(looking, shape, mask, height, units) -> None:
    """On ground square to a spot's axis all receivers have this distance; a ramp's shadow begins where biases end."""
    ramp = Mesh("ramp", np.array([[-0.5, 0.0, -0.8], [0.5, 0.0, -0.8], [0.5, 1.2, 0.8], [-0.5, 1.2, 0.8]]), QUAD)
    light = Light("spot", "spot", (0.0, -1.0, 0.0), (0.3, height, 0.2), math.radians(60))
    view = looking([shape("plane", 6.0), ramp], light, SIZE, eye=(1.5, 1.2, 2.5))  # under the ramp
    spec = "shadow-map:fit=scene,filter=hard,size=512,bias={}({})"
    divided, larger = (mask(spec.format("before-divide", bias), view) for bias in (units, 1.05 * units))
    less, more = (mask(spec.format("constant", units / height + sign * ROUNDED), view) for sign in (-1, 1))
    assert (less <= divided).all() and (divided <= more).all()
    assert (less < more).sum() < 5 < (divided < larger).sum()


def test_at_grazing_light_texel_is_an_offset_along_the_normal_alone(builtin, mask) -> None:
    view, spec = builtin("sphere-and-torus", SIZE), "shadow-map:fit=scene,filter=hard,size=256,bias="
    offset = mask(f"{spec}normal-offset(scale=1,ulps=4)", view)
    assert np.array_equal(mask(f"{spec}texel(scale=1,ulps=4,grazing=0)", view), offset)
    assert not np.array_equal(mask(f"{spec}texel(scale=1,ulps=4)", view), offset)


def test_the_biases_of_engines_are_as_long_as_in_their_sources(builtin, build, studio) -> None:
    """Along the light in metres, from the depth range and the texel's width, and along the normal in texels."""
    shot = studio.shot(builtin("cube-on-plane", 32))
    shipped = {
        "babylon": lambda depth, texel: (0.01 / 2 * depth, None),  # of clip space, which is 2 deep
        "godot": lambda depth, texel: (0.1 / 100 * 2 * (depth + 20), 2),  # times the filter's radius; 20 m of pancakes
        "bevy": lambda depth, texel: (0.02, 1.8 * math.sqrt(2)),
        "filament": lambda depth, texel: (0.001, 0.5),
        "unity": lambda depth, texel: (2.5 * texel, 2.5),
    }
    for preset, lengths in shipped.items():
        one = build(f"shadow-map:preset={preset}", shot)
        one.draw(shot)
        facts = one.technique.facts()
        along, normal = lengths(facts["depth_range_m"], facts["texel_m"])
        assert facts["bias_m"] == pytest.approx(along), preset
        assert facts.get("normal_offset_texels") == (normal and pytest.approx(normal, rel=2e-3)), preset
        one.stage.release()
