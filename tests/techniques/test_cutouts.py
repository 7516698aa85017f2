"""Techniques draw leaves that are cut out by alpha as they draw the same leaves made of triangles."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.cutouts import cut_out
from shadowbench.scenes.model import Light, Mesh, Scene, View, view_of
from shadowbench.scenes.vectors import perpendicular_basis, unit
from shadowbench.survey.samples import count_casters
from shadowbench.truths.rays import SUBPIXEL, ViewRays
from shadowbench.truths.trace import trace
from tests.cards import CAMERA, GROUND, alpha_of, cards, crossing, edge_on, made_of_triangles, wraps

SIZE = 160
LIGHTS = {
    "directional": Light("sun", "directional", (-0.4, -1.0, -0.3)),
    "spot": Light("spot", "spot", (-0.4, -1.0, -0.3), (1.0, 3.5, 1.0), math.radians(80)),
    "point": Light("point", "point", position=(0.3, 2.6, 0.2)),
}
NOISE = cut_out(alpha_of("noise"), nearest=True, wrap=("mirror", "clamp"))
LEAVES = cards(40, NOISE)
# Triangles too small to be seen at the cards' corners, so that maps cover the same where texels do not reach them.
CORNERS = Mesh(
    "corners",
    (LEAVES.vertices[:, None] + 1e-6 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).reshape(-1, 3),
    np.arange(3 * len(LEAVES.vertices), dtype=np.int32).reshape(-1, 3),
)


def leaves_view(light: Light, mesh: Mesh = LEAVES, *more: Mesh, size: int = SIZE) -> View:
    return view_of(Scene("leaves", (GROUND, mesh, *more), (CAMERA,), (light,)), CAMERA, light, size)


def test_planar_projection_draws_the_leaves_that_triangles_make(studio, mask) -> None:
    light = LIGHTS["spot"]
    view, truth = leaves_view(light), trace(leaves_view(light, made_of_triangles(LEAVES)), pixel_samples=1)
    decided = truth.receivers & ~truth.undecided & (studio.shot(view).triangle < 2) & (truth.triangle < 2)
    assert (decided & (truth.visibility == 0)).sum() > 1000
    # Of a silhouette for both camera and light, single pixels too much are drawn.
    assert (mask("planar-projection", view) != truth.visibility)[decided].sum() <= 1


@pytest.mark.parametrize(("scene", "kind"), [(wraps, "directional"), (crossing, "point"), (edge_on, "spot")])
def test_traced_pixels_are_those_of_exact_triangles(scene, kind, studio, mask) -> None:
    light, meshes = LIGHTS[kind], scene(LIGHTS[kind])
    cut, exact = (leaves_view(light, *each) for each in (meshes, [made_of_triangles(mesh) for mesh in meshes]))
    truth, ground = trace(exact, pixel_samples=1), len(GROUND.faces)
    decided, seen = truth.receivers & ~truth.undecided, studio.shot(cut).triangle
    same = np.where(seen < ground, seen, ground) == truth.triangle.clip(max=ground)
    rays = ViewRays(exact.placed()[0])
    around = [
        rays.nearest(rays.camera_rays(slice(0, SIZE), 0.5 + x, 0.5 + y)).reshape(SIZE, SIZE) >= ground
        for x, y in product((-SUBPIXEL, 0, SUBPIXEL), repeat=2)
    ]
    sure = (np.array(around) == around[4]).all(axis=0)
    assert sure.mean() > 0.99
    assert np.array_equal((seen >= ground)[sure], around[4][sure]), "the rasteriser rounds places in a texture too"
    assert (decided & (truth.visibility == 0)).sum() > 30
    for spec in ("ray-traced:where=gpu", "hybrid:size=64", "hybrid:size=1024"):
        assert (mask(spec, cut) != truth.visibility)[decided & same].sum() == 0


@pytest.mark.parametrize(
    ("spec", "kind", "leaves"),
    [
        ("ray-traced", "spot", cards(60, cut_out(alpha_of("noise"), 0.9, 0.4, wrap=("clamp", "mirror")))),
        ("ray-traced:where=gpu", "directional", cards(60, cut_out(alpha_of("noise"), 0.8, wrap=("mirror", "clamp")))),
        ("hybrid:size=128", "point", cards(60, cut_out(alpha_of("noise"), 0.8, wrap=("mirror", "clamp")))),
    ],
)
def test_rays_are_the_truth_s(spec, kind, leaves, studio, mask) -> None:
    view = leaves_view(LIGHTS[kind], leaves)
    truth, triangle = trace(view, pixel_samples=1), studio.shot(view).triangle
    decided = truth.receivers & ~truth.undecided
    assert (triangle != truth.triangle)[decided].mean() < 5e-4
    decided &= triangle == truth.triangle
    assert 0.05 < (truth.visibility[decided] == 0).mean() < 0.9
    assert (mask(spec, view) != truth.visibility)[decided].sum() <= 1


@pytest.mark.parametrize(("size", "kind"), [(64, "directional"), (512, "spot"), (64, "point")])
def test_hybrid_traces_where_a_texture_changes_between_triangles(size, kind, studio, mask) -> None:
    """A sheet of triangles, each with a place of its own in a texture that is half opaque, half clear."""
    x, z = np.meshgrid(*2 * [np.linspace(-1.5, 1.5, 11)], indexing="xy")
    k = np.arange(100) // 10 * 11 + np.arange(100) % 10
    faces = np.stack([k, k + 1, k + 11, k + 1, k + 12, k + 11], axis=1).reshape(-1, 3).astype(np.int32)
    alpha = np.repeat(np.array([[0, 255]], np.uint8), 8, axis=1)
    places = np.random.default_rng(3).choice([0.2, 0.4, 0.6, 0.8], (200, 1, 1)) + np.zeros((200, 3, 2))
    places += 0.15 * np.random.default_rng(4).random((200, 3, 2))
    vertices = np.stack([x, 0.9 + 0.1 * np.sin(4 * x) * np.cos(3 * z), z], axis=2).reshape(-1, 3)
    cutout = cut_out(alpha)
    sheet = Mesh("sheet", vertices, faces, cutout=cutout, places=cutout.places(places))
    view = leaves_view(LIGHTS[kind], sheet)
    truth, triangle = trace(view, pixel_samples=1), studio.shot(view).triangle
    decided = truth.receivers & ~truth.undecided & (triangle == truth.triangle)
    assert 0.05 < (truth.visibility[decided] == 0).mean() < 0.9
    assert (mask(f"hybrid:size={size}", view) != truth.visibility)[decided].sum() == 0


MAPS = [
    ("directional", "shadow-map:size=512,filter=pcss"),
    ("directional", "cascades:size=512,layers=geometry,filter=esm,oriented=false"),
    ("spot", "shadow-map:size=512,reversed=true,filter=hard,cull=false"),
    ("spot", "cube-map:size=512"),
    ("point", "cube-map:size=512"),
    ("point", "cube-map:size=512,layers=geometry,filter=vsm"),
]


@pytest.mark.parametrize(("kind", "spec"), MAPS)
def test_maps_hold_the_leaves_that_triangles_make(kind, spec, studio, mask) -> None:
    """Not where a texel of alpha ends within a step of the grid to which a rasteriser moves corners, in map or view."""
    exact, light = made_of_triangles(LEAVES), LIGHTS[kind]
    ours, theirs, whole, *moved = (
        mask(spec, leaves_view(light, mesh, CORNERS))
        for mesh in (LEAVES, exact, replace(LEAVES, cutout=None), *nudged(exact, light))
    )
    places = [studio.shot(leaves_view(light, mesh, CORNERS)).position for mesh in (LEAVES, exact)]
    sure = np.isclose(*places, atol=1e-3).all(axis=2) & (np.max(np.abs(moved - theirs), axis=0) < 1e-3)
    assert sure.mean() > 0.9
    assert (np.abs(ours - theirs) <= 0.01)[sure].all()
    assert (np.abs(whole - theirs) > 0.01).mean() > 0.05


def nudged(mesh: Mesh, light: Light) -> list[Mesh]:
    """The mesh moved across the light by two steps of the rasteriser's grid in a map of 512 texels over 5 m.

    Half a step along either axis are a card's corners moved by it, and half a step those of a texel's triangles; as
    much again is for maps of wider texels.
    """
    toward = -np.array(light.direction) if light.kind == "directional" else np.array(light.position)
    across = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))[:2]
    step = 2 * SUBPIXEL * 5.0 / 512
    moves = [step * (np.array(way) @ across) for way in product((-1, 1), repeat=2)]
    return [replace(mesh, vertices=mesh.vertices + move) for move in moves]


@pytest.mark.parametrize(("kind", "name", "kept"), [("directional", "shadow-map", 0), ("point", "cube-map", 1)])
def test_cut_out_casters_are_culled_as_others_are(kind, name, kept, shape, studio, build, mask) -> None:
    """Before, between and after opaque ones in the file, near ones and far ones, which one face of a cube has."""
    away = cards(200, NOISE)
    away = replace(away, vertices=away.vertices + np.array([40.0, 0.0, 5.0]))
    near, far, last = (shape("sphere", 0.4, at) for at in ((-0.9, 0.5, 0.2), (41.0, 0.5, 5.0), (0.8, 0.3, -0.4)))
    view = leaves_view(LIGHTS[kind], away, near, far, LEAVES, last)
    shot = studio.shot(view)
    one = build(f"{name}:size=512", shot)
    assert np.array_equal(one.draw(shot), mask(f"{name}:size=512,cull=false", view))
    culled, distant = one.technique.facts()["culled_triangles"], len(away.faces) + len(far.faces)
    layers = 1 + 5 * kept
    assert (layers - kept) * distant <= culled < layers * len(shot.view.scene.geometry.faces)


def test_casters_that_are_all_cut_out_and_surfaces_that_cast_nothing_are_drawn(mask) -> None:
    """Leaves that cast alone, over ground that does not, with more leaves that are seen and cast nothing."""
    ground, seen = replace(GROUND, casts=False), replace(cards(10, NOISE, seed=7), casts=False)
    specs = {
        "ray-traced:where=gpu": "spot",
        "hybrid:size=64": "point",
        "shadow-map": "directional",
        "cube-map": "point",
    }
    for spec, kind in specs.items():
        views = [leaves_view(LIGHTS[kind], mesh) for mesh in (LEAVES, made_of_triangles(LEAVES))]
        scenes = [replace(view.scene, meshes=(seen, ground, view.scene.meshes[1])) for view in views]
        ours, theirs = (mask(spec, replace(view, scene=scene)) for view, scene in zip(views, scenes, strict=True))
        assert (ours < 0.5).mean() > 0.02
        assert (np.abs(ours - theirs) > 0.01).mean() < 0.003


@pytest.mark.parametrize("spec", ["shadow-volume", "soft-volume", "light-samples"])
def test_volumes_decline_what_is_cut_out(spec, device) -> None:
    light, parsed = LIGHTS["directional"], parse_spec(spec, techniques())
    opaque, idle = replace(LEAVES, cutout=None), replace(LEAVES, casts=False)  # what casts nothing has no volume
    reasons = [
        parsed.technique.declines(parsed.params, leaves_view(light, mesh), device) for mesh in (LEAVES, opaque, idle)
    ]
    assert "cut out by alpha" in str(reasons[0]) and reasons[1:] == [None, None]


def test_needs_count_what_is_cut_out() -> None:
    """A third of the texture is opaque, once the coordinates' margin is clamped to it."""
    alpha = np.zeros((1, 3), np.uint8)
    alpha[0, 1] = 255
    leaves = cards(30, cut_out(alpha, nearest=True, wrap=("clamp", "clamp")))
    counted = count_casters(leaves_view(LIGHTS["directional"], leaves).placed()[0])
    assert counted.cut_out == 60
    assert counted.opaque == pytest.approx(1 / 3 / 1.5, abs=0.01)
    assert count_casters(leaves_view(LIGHTS["directional"], replace(leaves, cutout=None)).placed()[0]).cut_out == 0
