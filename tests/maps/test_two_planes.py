"""The bias by two planes: what bends smoothly over a texel never shadows itself, and no shadow leaves its caster."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.maps.biases import Bias
from shadowbench.scenes.model import Light, Mesh
from tests.samples import pairs

SIZE = 192
LAMP = Light("lamp", "point", position=(0.9, 3.1, 1.3))


@pytest.fixture
def lights(sun, spot):
    """Of each kind of light, one at 62° or so above the ground, and the technique that draws it."""
    return {
        "sun": (sun(62.0, 54.0), "shadow-map:fit=scene,"),
        "cascades": (sun(62.0, 54.0), "cascades:count=3,"),
        "spot": (spot(LAMP.position), "shadow-map:fit=scene,"),
        "lamp": (LAMP, "cube-map:"),
    }


def sheet(height, extent: float = 1.0, count: int = 48) -> Mesh:
    """The open surface of a height over x and z."""
    at = np.linspace(-extent, extent, count + 1)
    z, x = (one.ravel() for one in np.meshgrid(at, at, indexing="ij"))
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    a, b, c, d = first, first + 1, first + count + 1, first + count + 2
    faces = np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])
    return Mesh("sheet", np.column_stack([x, height(x, z), z]), faces.astype(np.int32))


BENT = {  # of slopes below 45°, so that no part of them hides another from the lights
    "dome": lambda x, z: -0.3 * (x**2 + z**2),
    "bowl": lambda x, z: 0.3 * (x**2 + z**2),
    "saddle": lambda x, z: 0.3 * (x**2 - z**2),
    "cylinder": lambda x, z: 0.4 * (0.8 * x + 0.6 * z) ** 2,
    "ridge": lambda x, z: -0.7 * np.abs(x),
    "valley": lambda x, z: 0.7 * np.abs(x),
}


@pytest.mark.parametrize(
    ("bent", "light", "filter_"),
    pairs(BENT, ["sun", "cascades", "spot", "lamp"], ["hard", "hardware", "pcf(5)", "castano(5)", "dither-4", "pcss"]),
)
def test_what_bends_smoothly_or_meets_in_an_edge_never_shadows_itself(
    lights, looking, mask, bent: str, light: str, filter_: str
) -> None:
    source, technique = lights[light]
    if filter_ in ("castano(5)", "dither-4") and light == "lamp":
        filter_ = "pcf(3)"
    view = looking([sheet(BENT[bent])], source, SIZE, eye=(1.2, 2.6, 1.9), fov=45.0)
    for size in (61, 256):
        visibility = mask(f"{technique}size={size},bias=two-planes,filter={filter_}", view)
        assert visibility.min() > 1 - 1e-6, f"{(visibility < 1).sum()} pixels at {size}"


@pytest.mark.parametrize("kind", ["directional", "spot"])
def test_convex_bodies_shadow_only_what_faces_away(kind: str, shape, looking, sun, spot, mask, studio) -> None:
    """Of a sphere alone, all that faces the light is lit, but for facets that it sees nearly edge-on."""
    light = sun(40.0) if kind == "directional" else spot((2.0, 2.5, 1.0), angle=40.0)
    view = looking([shape("sphere", 1.0, subdivisions=5)], light, SIZE, eye=(1.5, 1.2, 1.6), fov=60.0)
    shot, place = studio.shot(view), np.asarray(view.light.position)
    point = shot.position[..., :3] / shot.placement.scale + shot.placement.center
    toward = -np.asarray(light.direction) if kind == "directional" else place - point
    toward = toward / np.linalg.norm(toward, axis=-1, keepdims=True)
    facing = (shot.position[..., 3] > 0) & ((shot.normal[..., :3] * toward).sum(axis=-1) > 0.05)
    visibility = mask("shadow-map:size=512,bias=two-planes,filter=pcf(5)", view)
    assert facing.sum() > 3000 and (visibility[facing] == 1).all()


@pytest.mark.parametrize("light", ["sun", "cascades", "spot", "lamp"])
def test_a_slab_of_a_few_texels_shadows_the_ground_up_to_its_foot(
    lights, shape, looking, sun, mask, studio, light: str
) -> None:
    """Where the ray to the light leaves through its top, but for a texel along the edge; `texel` lights most."""
    height, edge = 0.015, 0.012
    source, technique = lights[light]
    source = sun(25.0, 54.0) if source.kind == "directional" else replace(source, position=(1.7, 1.3, 2.1))
    source = replace(source, direction=(-0.59, -0.45, -0.73)) if source.kind == "spot" else source
    slab = shape("box", (1.0, height, 1.0), (0.0, height / 2, 0.0))
    view = looking([shape("plane", 4.0), slab], source, 384, (-1.4, 1.4, -1.5), (-0.3, 0.0, -0.3), 40.0)
    shot = studio.shot(view)
    point = shot.position[..., :3] / shot.placement.scale + shot.placement.center
    place, w = (np.asarray(source.homogeneous[0]), source.homogeneous[1])
    toward = place - w * point
    top = np.abs(point + toward * (height / toward[..., 1:2]))[..., [0, 2]].max(axis=-1)
    ground = (shot.position[..., 3] > 0) & (np.abs(point[..., 1]) < 1e-5)
    strip = ground & (np.abs(point[..., [0, 2]]).max(axis=-1) > 0.5) & (top < 0.5 - edge)
    dark = {
        bias: (mask(f"{technique}size=512,bias={bias},filter=pcf(5)", view)[strip] < 0.5).mean()
        for bias in ("two-planes", "texel")
    }
    assert strip.sum() > 200 and dark["two-planes"] > 0.99, dark
    assert light != "sun" or dark["texel"] < 0.5


def test_flat_ground_under_the_lowest_sun_is_lit(shape, looking, sun, mask) -> None:
    view = looking([shape("plane", 4.0)], sun(0.1), SIZE)
    for filter_ in ("hardware", "pcf(5)"):
        assert (mask(f"shadow-map:bias=two-planes,filter={filter_}", view) == 1).all()


def test_a_cube_s_face_answers_as_the_spot_that_it_is(shape, looking, mask) -> None:
    """But for its stored distances, which round otherwise."""
    down, place = (0.0, -1.0, 0.0), (0.2, 2.0, -0.1)
    meshes = [shape("plane", 3.0), shape("torus", 0.5, (0.0, 0.8, 0.0)), shape("box", 0.3, (0.4, 0.15, 0.3))]
    one, other = (
        mask(spec, looking(meshes, light, 256))
        for spec, light in (
            (
                "shadow-map:size=256,bias=two-planes,filter=hard,fit=fixed(near=0.1,far=4,fov=90)",
                Light("spot", "spot", down, place, math.radians(89.9)),
            ),
            ("cube-map:size=256,bias=two-planes,filter=hard", Light("lamp", "point", position=place)),
        )
    )
    assert (one < 0.5).mean() > 0.01 and (one != other).mean() < 1e-3


def test_two_comparisons_of_a_texel_do_not_add_up() -> None:
    for value in ("two-planes+receiver-plane", "constant(0.1)+receiver-plane+two-planes"):
        with pytest.raises(ValueError, match="both compare texels"):
            Bias.from_value(value)
    assert Bias.from_value("terminator+two-planes").comparing == Bias.from_value("two-planes")


class CastersPlane(Bias):
    """The caster's plane alone (Dai et al. 2008), as a plug-in would have it."""

    name = "casters-plane"
    shader = """
ShadowCoord bias(ShadowCoord p) {
    p.bias += 4.0 * resolution(p) + 0.1 * tan_slope(p) * p.texel.x * p.depth_per_length;
    return p;
}
"""
    comparison = """
bool texel_lit(ShadowCoord p, Texel t) { return depth_sign * (p.depth - t.depth + caster_change(p, t)) <= p.bias; }
"""
    gradients = True
    maps = frozenset({"2d", "array", "cube"})


del Bias.table[CastersPlane.name]  # as if no plug-in was loaded


@pytest.mark.parametrize("light", ["sun", "cascades", "spot", "lamp"])
def test_a_plug_in_s_comparison_sees_the_caster_s_plane(lights, shape, looking, mask, light: str, monkeypatch) -> None:
    """On flat ground nothing is in front of it."""
    monkeypatch.setitem(Bias.table, CastersPlane.name, CastersPlane)
    source, technique = lights[light]
    view = looking([shape("plane", 2.0), shape("box", 0.4, (0.0, 0.6, 0.0))], source, SIZE)
    for filter_ in ("hardware", "pcf(5)"):
        own, two = (
            mask(f"{technique}size=256,filter={filter_},bias={bias}", view) for bias in ("casters-plane", "two-planes")
        )
        assert (two < 0.5).sum() > 90 and ((own < 0.5) != (two < 0.5)).mean() < 0.01
