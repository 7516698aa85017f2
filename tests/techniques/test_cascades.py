"""Cascades: splits, fits, selection, and stability under camera motion."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shadowbench.geometry.lights import LightView, light_space
from shadowbench.gl.gbuffer import download
from shadowbench.maps.fits import EndSplit, PracticalSplit, ShareSplit, Split
from shadowbench.plugin.base import Frame, Phase
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.sequences import BUILT_IN, frames_of
from shadowbench.scenes.vectors import unit, vec3
from shadowbench.techniques.cascades import Cascades
from tests.samples import by_turns

SIZE = 96
BOXES = ["scene", "tight", "sphere", "sphere,stable=true", "scene,oriented=false"]


# Where the frustum is cut


def test_practical_is_between_equal_ratios_and_equal_lengths() -> None:
    ratios, lengths, both = (PracticalSplit(weight=x).depths(1.0, 10_000.0, 4) for x in (1.0, 0.0, 0.9))
    assert ratios == pytest.approx([1, 10, 100, 1000, 10_000])
    assert lengths == pytest.approx([1, 2500.75, 5000.5, 7500.25, 10_000])
    assert both == pytest.approx(0.9 * ratios + 0.1 * lengths)


def test_slices_end_at_shares_of_far_that_engines_set_and_those_before_near_are_empty() -> None:
    assert Split.from_value("fixed").depths(3.0, 50.0, 5).tolist() == [3, 3, 3, 5, 25, 50]
    unity = parse_spec("cascades:preset=unity", techniques()).params.split
    assert unity.depths(0.3, 50.0, 4) == pytest.approx([0.3, 3.35, 10.0, 23.35, 50.0])
    assert ShareSplit(first=0.5, second=0.2).depths(1.0, 10.0, 4) == pytest.approx([1.0, 5.0, 5.0, 5.0, 10.0])


def test_slices_end_in_metres_whatever_the_size_of_the_scene_and_its_far_plane(studio, build, builtin) -> None:
    assert EndSplit().depths(20.0, 50.0, 4).tolist() == [20, 20, 28, 78, 150]
    for scene in ("statue", "street"):
        shot = studio.shot(builtin(scene, 16))
        bevy = build("cascades:preset=bevy", shot)
        bevy.draw(shot)
        facts = bevy.technique.facts()
        assert [facts[f"far_{number}_m"] for number in (1, 2, 3, 4)] == pytest.approx([10, 28, 78, 150]), scene


# What a map shows


@pytest.mark.parametrize(("name", "box"), by_turns(["cube-on-plane", "street", "terrain", "canopy", "street"], BOXES))
def test_every_receiver_in_view_lies_in_a_box(name: str, box: str, studio, build, builtin) -> None:
    shot = studio.shot(builtin(name, SIZE))
    one = build(f"cascades:box={box},size=128", shot)
    one.draw(shot)
    assert (held_by(one, shot)[shot.triangle >= 0] < 5).all()


# Which one answers


def held_by(one, shot, slack: float = 0.0) -> np.ndarray:
    """The first layer whose box contains a pixel's position and the filter radius, or the number of layers."""
    technique = one.technique
    layer = np.full(shot.triangle.shape, len(technique.light_views))
    for number, light_view in reversed(list(enumerate(technique.light_views))):
        at = (shot.position[..., :3] @ light_view.space.basis.T * [1, 1, -1] - light_view.box.low) / (
            light_view.box.high - light_view.box.low
        )
        reach = np.array([technique.params.filter.radius(light_view.size) / light_view.size] * 2 + [0]) + slack
        layer[((at >= reach) & (at <= 1 - reach)).all(axis=-1)] = number
    return layer


def tinted(one) -> np.ndarray:
    return download(one.technique.tint()).astype(np.float64)


def colors_of(tint: np.ndarray, layer: np.ndarray, sure: np.ndarray) -> list[tuple[float, ...]]:
    """The colour of each layer, which must be uniform."""
    tints = [np.unique(tint[sure & (layer == number)], axis=0) for number in np.unique(layer[sure])]
    assert all(len(colors) == 1 for colors in tints)
    return [tuple(colors[0]) for colors in tints]


def test_selection_uses_the_first_cascade_that_contains_the_point_or_that_of_its_view_depth(
    studio, build, builtin
) -> None:
    shot = studio.shot(builtin("deep-street", SIZE))
    hit = shot.triangle >= 0
    for spec in ("cascades:count=8,size=128,bias=texel(grazing=1e6)", "cascades:count=8,size=128,select=depth"):
        one = build(spec, shot)  # the first moves no receiver
        one.draw(shot)
        if "depth" in spec:
            camera = shot.view.camera
            depth = (shot.position[..., :3] - camera.position) @ -camera.basis()[2]
            cuts = PracticalSplit().depths(*shot.view.near_far, 8)
            layer = np.searchsorted(cuts[1:-1], depth)
            sure = hit & (np.abs(depth[..., None] - cuts).min(axis=-1) > 1e-5)
        else:
            layer, high = held_by(one, shot, 1e-5), held_by(one, shot, -1e-5)
            sure = hit & (layer == high)
            assert sure.mean() > 0.5
        assert (sure & (layer == 0)).any()
        colors = colors_of(tinted(one), layer, sure)
        assert len(colors) >= 4 and len(set(colors)) == len(colors)
        assert (tinted(one)[~hit] == 1).all(), "the background is not tinted"


# Against a single map, and among the ways of drawing


def test_one_cascade_is_one_map_of_that_box(studio, build, builtin) -> None:
    for name, bias in (("cube-on-plane", "texel"), ("street", "texel"), ("street", "two-planes")):
        shot = studio.shot(builtin(name, SIZE))
        one = build(f"cascades:count=1,box=scene,z_mult=1,size=256,bias={bias}", shot)
        single = build(f"shadow-map:fit=view(oriented=true),size=256,bias={bias}", shot)
        masks = [technique.draw(shot) for technique in (one, single)]
        assert np.abs(masks[0] - masks[1]).max() <= 4e-3 and masks[0].min() == 0  # samplers may weight by 1/256
        assert np.array_equal(one.technique.map_image(), single.technique.map_image())


def test_one_layered_draw_and_one_draw_per_layer_store_the_same_bits(studio, build, builtin) -> None:
    shot = studio.shot(builtin("street", SIZE))
    both = [
        build(f"cascades:count=8,bias=front-cull,size=128,layers={layers}", shot) for layers in ("geometry", "passes")
    ]
    masks = [one.draw(shot) for one in both]
    maps = [one.technique.map.texture.read() for one in both]
    assert np.array_equal(*maps) and np.array_equal(*masks)
    assert (maps[0] < 1).any(axis=(1, 2)).sum() > 4, "most layers have something"


# Casters outside a cascade's box


def test_a_caster_far_towards_the_light_needs_the_clamp_or_a_long_reach(shape, looking, studio, build) -> None:
    """A close look at a ground below a roof 30 m up."""
    light = Light("sun", "directional", (0.2, -1.0, 0.1))
    meshes = [shape("plane", 80.0), shape("plane", 60.0, (0.0, 30.0, 0.0))]
    view = looking(meshes, light, 64, eye=(0.0, 1.5, 2.0), near=0.5, far=6.0)
    shot = studio.shot(view)
    ground = shot.triangle >= 0
    for items, shadowed in (
        ("depth_clamp=true,z_mult=1", 1.0),
        ("depth_clamp=true,z_mult=10", 1.0),
        ("depth_clamp=false,z_mult=1", 0.0),
        ("depth_clamp=false,z_mult=1000", 1.0),
    ):
        for box in BOXES:
            mask = build(f"cascades:{items},box={box},size=128", shot).draw(shot)
            assert (mask[ground] < 0.5).mean() == shadowed, (items, box)


# A camera that moves


def creeping(one, shot) -> list[tuple[np.ndarray, np.ndarray]]:
    """(mask, tint) of one surface while the camera that the boxes are made for creeps sideways, by quarter texels."""
    one.draw(shot)
    camera, first = shot.view.camera, one.technique.light_views[0]
    sideways, drawn = first.space.basis[0] * first.texel[0] / 4, []
    for step in range(13):
        moved = [vec3(np.add(point, sideways * step)) for point in (camera.position, camera.target)]
        view = replace(shot.view, camera=replace(camera, position=moved[0], target=moved[1]))
        mask = one.technique.draw(Frame(view, Phase(), step, shot.surface, one.clock))
        drawn.append((download(mask)[..., 0].copy(), tinted(one)))
    return drawn


@pytest.mark.parametrize(("filter_", "select"), [("hard", "depth"), ("hardware", "box"), ("pcf(3)", "depth")])
def test_snapped_a_pixel_changes_only_with_its_cascade(filter_, select, studio, build, builtin) -> None:
    shot = studio.shot(builtin("street", 128))
    changed = {}
    for stable in ("true", "false"):
        one = build(f"cascades:box=sphere,stable={stable},select={select},size=256,filter={filter_}", shot)
        drawn = pairwise(creeping(one, shot))
        changed[stable] = sum(((a != b) & (tint == other).all(axis=-1)).sum() for (a, tint), (b, other) in drawn)
    # None, but where a texel's centre lies on a caster's edge as nearly as the rasteriser's grid can tell.
    assert changed["true"] <= 1 and changed["false"] > 100


def test_snapped_texels_do_not_depend_on_where_the_camera_looks(studio, build, builtin) -> None:
    shot = studio.shot(builtin("street", 32))
    one = build("cascades:box=sphere,stable=true,size=128", shot)
    texels, grids = [], []
    for angle in np.linspace(0, 2 * math.pi, 7):
        camera = shot.view.camera
        target = vec3(np.add(camera.position, unit((math.sin(angle), -0.2, math.cos(angle)))))
        one.technique.draw(
            Frame(replace(shot.view, camera=replace(camera, target=target)), Phase(), 0, shot.surface, one.clock)
        )
        texels.append([light_view.texel for light_view in one.technique.light_views])
        grids.append([light_view.box.low[:2] / light_view.texel for light_view in one.technique.light_views])
    assert np.ptp(texels, axis=0).max() <= 1e-15
    assert np.abs(np.array(grids) - np.round(grids)).max() < 1e-6, "whole texels from the light's own origin"


@pytest.mark.parametrize("engine", sorted(Cascades.presets))
def test_maps_of_engines_are_level_and_move_by_whole_texels_where_engines_stabilise_them(
    engine: str, studio, build, builtin
) -> None:
    """Of a constant size too, and thus even while the camera turns, except Babylon's. Zooming changes all of them."""

    def drawn(view: View) -> list[LightView]:
        shot = studio.shot(view)
        one = build(f"cascades:preset={engine},size=128", shot)
        one.draw(shot)
        return one.technique.light_views

    before = builtin("street", 32)
    turned, zoomed = (frames_of(before, BUILT_IN[name], 6)[5] for name in ("pan", "zoom"))
    first, second, third = map(drawn, (before, turned, zoomed))
    basis = light_space(before.light).basis
    assert all(np.array_equal(one.space.basis, basis) for one in (*first, *second, *third))
    changes = [abs(np.subtract(other.texel, one.texel)).max() for one, other in zip(first, second, strict=True)]
    steps = [(other.box.low - one.box.low)[:2] / one.texel for one, other in zip(first, second, strict=True)]
    kept = max(changes) < 1e-12 and np.abs(steps - np.round(steps)).max() < 1e-5
    assert kept == (engine != "babylon")
    assert all(abs(other.texel[0] / one.texel[0] - 1) > 0.01 for one, other in zip(first, third, strict=True))


# What the map and the facts show


def test_facts_are_metres_and_a_blend_reads_two_cascades_for_every_pixel(studio, build, builtin) -> None:
    shot = studio.shot(builtin("street", 32))
    plain, faded = (build(f"cascades:size=128,bias=constant(0.01),blend={blend}", shot) for blend in (0, 0.1))
    plain.draw(shot), faded.draw(shot)
    facts, scale = plain.technique.facts(), shot.placement.scale
    assert facts["far_5_m"] == pytest.approx(shot.filed.near_far[1])
    first = plain.technique.light_views[0]
    assert facts["texel_1_m"] == pytest.approx(max(first.texel) / scale)
    assert facts["bias_1_m"] == pytest.approx(0.01 * (first.far - first.near) / scale)
    assert facts["texel_1_m"] < facts["texel_2_m"]
    assert [one.technique.facts()["reads"] for one in (plain, faded)] == [32 * 32, 2 * 32 * 32]
