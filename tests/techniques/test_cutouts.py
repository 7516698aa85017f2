"""Techniques draw leaves that are cut out by alpha as they draw the same leaves made of triangles."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.vectors import perpendicular_basis, unit
from shadowbench.survey.casters import casters_of
from shadowbench.truths.embree import INFINITE, Tracer
from shadowbench.truths.rays import SUBPIXEL, ViewRays
from shadowbench.truths.trace import trace
from tests.cards import CAMERA, GROUND, alpha_of, cards, made_of_triangles
from tests.cut_out_scenes import SCENES

SIZE = 160
LIGHTS = {
    "directional": Light("sun", "directional", (-0.4, -1.0, -0.3)),
    "spot": Light("spot", "spot", (-0.4, -1.0, -0.3), (1.0, 3.5, 1.0), math.radians(80)),
    "point": Light("point", "point", position=(0.3, 2.6, 0.2)),
}
NOISE = Cutout(alpha_of("noise"), nearest=True, wrap=("mirror", "clamp"))
LEAVES = cards(40, NOISE)
# Triangles too small to be seen at the cards' corners, so that maps cover the same where texels do not reach them.
CORNERS = Mesh(
    "corners",
    (LEAVES.vertices[:, None] + 1e-6 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).reshape(-1, 3),
    np.arange(3 * len(LEAVES.vertices), dtype=np.int32).reshape(-1, 3),
)
KNOWN = techniques()


def leaves_view(light: Light, mesh: Mesh = LEAVES, *more: Mesh, size: int = SIZE) -> View:
    return view_of(Scene("leaves", (GROUND, mesh, *more), (CAMERA,), (light,)), CAMERA, light, size)


def refusal(spec: str, view: View, device) -> str | None:
    parsed = parse_spec(spec, KNOWN)
    return parsed.technique.declines(parsed.params, view, device)


@pytest.fixture(params=LIGHTS)
def light(request: pytest.FixtureRequest) -> Light:
    return LIGHTS[request.param]


@pytest.fixture(scope="module")
def exact():
    """The truth of the leaves made of triangles, by kind of light."""
    return {kind: trace(leaves_view(one, made_of_triangles(LEAVES)), pixel_samples=1) for kind, one in LIGHTS.items()}


@pytest.mark.parametrize(
    "spec", ["ray-traced:where=gpu", "hybrid", "hybrid:size=16", "hybrid:fit=scene,size=128", "planar-projection"]
)
def test_exact_techniques_draw_the_leaves_that_triangles_make(spec, light, exact, studio, mask) -> None:
    truth, view = exact[light.kind], leaves_view(light)
    triangle = studio.shot(view).triangle
    decided = truth.receivers & ~truth.undecided & ((triangle > 1) == (truth.triangle > 1))
    if spec == "planar-projection":
        decided &= truth.triangle < 2
    assert (decided & (truth.visibility == 0)).sum() > 1000
    # Of a silhouette for both camera and light, planar-projection draws single pixels too much.
    assert (mask(spec, view) != truth.visibility)[decided].sum() <= (spec == "planar-projection")


@pytest.mark.parametrize("name", SCENES)
def test_traced_pixels_are_those_of_exact_triangles(name, light, studio, mask, tmp_path) -> None:
    cut, exact = (
        view_of(Scene(name, meshes, (CAMERA,), (light,)), CAMERA, light, SIZE)
        for meshes in SCENES[name](light, tmp_path)
    )
    truth, ground = trace(exact, pixel_samples=1), len(cut.scene.meshes[0].faces)
    decided, seen = truth.receivers & ~truth.undecided, studio.shot(cut).triangle
    same = np.where(seen < ground, seen, ground) == truth.triangle.clip(max=ground)
    rays = ViewRays(exact.placed()[0])
    around = [
        rays.nearest(rays.directions(slice(0, SIZE), 0.5 + x, 0.5 + y)).reshape(SIZE, SIZE) >= ground
        for x, y in product((-SUBPIXEL, 0, SUBPIXEL), repeat=2)
    ]
    sure = (np.array(around) == around[4]).all(axis=0)
    assert sure.mean() > 0.99
    assert np.array_equal((seen >= ground)[sure], around[4][sure]), "the rasteriser rounds places in a texture too"
    assert (decided & (truth.visibility == 0)).sum() > 30
    for spec in ("ray-traced:where=gpu", "hybrid:size=256", "hybrid:size=1024"):
        assert (mask(spec, cut) != truth.visibility)[decided & same].sum() == 0


@pytest.mark.parametrize("spec", ["ray-traced", "ray-traced:where=gpu", "hybrid:size=128", "hybrid:rest=embree"])
@pytest.mark.parametrize("nearest", [True, False])
def test_rays_are_the_truth_s(spec, nearest, light, studio, mask) -> None:
    """Whatever the sampler and the vertices' alphas say."""
    leaves = cards(60, Cutout(alpha_of("noise"), 0.9, 0.4, nearest, ("clamp", "mirror")))
    view = leaves_view(light, leaves)
    truth, triangle = trace(view, pixel_samples=1), studio.shot(view).triangle
    decided = truth.receivers & ~truth.undecided
    assert (triangle != truth.triangle)[decided].mean() < 5e-4
    decided &= triangle == truth.triangle
    assert 0.05 < (truth.visibility[decided] == 0).mean() < 0.9
    assert (mask(spec, view) != truth.visibility)[decided].sum() <= 1


@pytest.mark.parametrize("size", [64, 512])
def test_hybrid_traces_where_a_texture_changes_between_triangles(size, light, studio, mask) -> None:
    """A sheet of triangles, each with a place of its own in a texture that is half opaque, half clear."""
    x, z = np.meshgrid(*2 * [np.linspace(-1.5, 1.5, 11)], indexing="xy")
    k = np.arange(100) // 10 * 11 + np.arange(100) % 10
    faces = np.stack([k, k + 1, k + 11, k + 1, k + 12, k + 11], axis=1).reshape(-1, 3).astype(np.int32)
    alpha = np.repeat(np.array([[0, 255]], np.uint8), 8, axis=1)
    places = np.random.default_rng(3).choice([0.2, 0.4, 0.6, 0.8], (200, 1, 1)) + np.zeros((200, 3, 2))
    places += 0.15 * np.random.default_rng(4).random((200, 3, 2))
    vertices = np.stack([x, 0.9 + 0.1 * np.sin(4 * x) * np.cos(3 * z), z], axis=2).reshape(-1, 3)
    sheet = Mesh("sheet", vertices, faces, cutout=Cutout(alpha), coordinates=places.astype(np.float32))
    view = leaves_view(light, sheet)
    truth, triangle = trace(view, pixel_samples=1), studio.shot(view).triangle
    decided = truth.receivers & ~truth.undecided & (triangle == truth.triangle)
    assert 0.05 < (truth.visibility[decided] == 0).mean() < 0.9
    assert (mask(f"hybrid:size={size}", view) != truth.visibility)[decided].sum() == 0


def test_hybrid_traces_fewer_rays_where_texels_are_opaque_or_clear_throughout(studio, build) -> None:
    view = leaves_view(LIGHTS["spot"], cards(20, Cutout(alpha_of("leaf"), nearest=True, wrap=("clamp", "clamp"))))
    shot, rays = studio.shot(view), {}
    for spec in ("ray-traced", "hybrid:rest=embree,size=64", "hybrid:rest=embree,size=2048"):
        one = build(spec, shot)
        one.draw(shot)
        rays[spec] = one.technique.facts()["rays"]
    every, coarse, fine = rays.values()
    assert 0 < fine < 0.5 * coarse < 0.5 * every


MAPS = [
    ("directional", "shadow-map"),
    ("directional", "shadow-map:filter=pcss"),
    ("directional", "cascades"),
    ("directional", "cascades:layers=geometry"),
    ("directional", "cascades:layers=geometry,filter=esm"),
    ("spot", "shadow-map:reversed=true,filter=hard,cull=false"),
    ("spot", "shadow-map:filter=vsm"),
    ("spot", "cube-map"),
    ("point", "cube-map"),
    ("point", "cube-map:layers=geometry"),
    ("point", "cube-map:layers=geometry,filter=vsm"),
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
    """The mesh moved across the light by two steps of the rasteriser's grid in a map of 1024 texels over 5 m.

    Half a step along either axis are a card's corners moved by it, and half a step those of a texel's triangles; as
    much again is for maps of wider texels.
    """
    toward = -np.array(light.direction) if light.kind == "directional" else np.array(light.position)
    across = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))[:2]
    step = 2 * SUBPIXEL * 5.0 / 1024
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


@pytest.mark.parametrize("nearest", [True, False])
@pytest.mark.parametrize(("wrap", "factor"), [("repeat", 1.0), ("mirror", 0.8), ("clamp", 0.9)])
def test_the_camera_sees_through_what_is_not_opaque(nearest: bool, wrap: Wrap, factor: float, studio) -> None:
    """One card that faces the camera; texture coordinates over twice the texture, and negative ones."""
    cutout = Cutout(alpha_of("noise")[:, :11], factor, 0.4, nearest, (wrap, wrap))
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    places = np.array([[-0.7, 1.3], [1.5, 1.3], [1.5, -0.6], [-0.7, -0.6]], np.float32)
    alpha = np.array([[1.0, 0.7, 0.9], [1.0, 0.9, 0.8]], np.float32)
    card = Mesh("card", corners, faces, cutout=cutout, coordinates=places[faces], alpha=alpha)
    wall = Mesh("wall", corners * 3 - [0, 0, 1.0], faces)
    camera = Camera("camera", (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), math.radians(30))
    sun = LIGHTS["directional"]
    shot = studio.shot(view_of(Scene("card", (wall, card), (camera,), (sun,)), camera, sun, 200))
    steps = (np.arange(200) + 0.5) / 200 * 2 - 1
    x, y = np.meshgrid(3 * math.tan(math.radians(15)) * steps, -3 * math.tan(math.radians(15)) * steps)

    def opaque(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Where rays through points of the card's plane meet it."""
        lower = x >= y
        weights = np.where(lower[..., None], np.stack([1 - x, x - y, 1 + y], 2), np.stack([1 - y, 1 + x, y - x], 2)) / 2
        cut = shot.view.scene.geometry.cutouts
        return cut.opaque(np.where(lower, 0, 1).ravel(), weights.reshape(-1, 3)).reshape(x.shape)

    step = 2 / 200 / 256  # of the rasteriser's grid, and more than the pixel's size on the card
    around = [opaque(x + step * i, y + step * j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    sure = np.all([one == around[4] for one in around], axis=0) & (np.abs(x - y) > step)
    assert sure.mean() > 0.95
    assert 0.1 < around[4].mean() < 0.9
    assert np.array_equal((shot.triangle > 1)[sure], around[4][sure])
    assert set(np.unique(shot.triangle)) == {0, 1, 2, 3}


def test_casters_that_are_all_cut_out_and_surfaces_that_cast_nothing_are_drawn(light, exact, mask) -> None:
    """Leaves that cast alone, over ground that does not, with more leaves that are seen and cast nothing."""
    ground, seen = replace(GROUND, casts=False), replace(cards(10, NOISE, seed=7), casts=False)
    views = [leaves_view(light, mesh) for mesh in (LEAVES, made_of_triangles(LEAVES))]
    views = [replace(view, scene=replace(view.scene, meshes=(seen, ground, view.scene.meshes[1]))) for view in views]
    specs = {"directional": "shadow-map", "spot": "shadow-map", "point": "cube-map"}
    for spec in ("ray-traced:where=gpu", "hybrid:size=64", specs[light.kind]):
        ours, theirs = (mask(spec, view) for view in views)
        assert (ours < 0.5).mean() > 0.02
        assert (np.abs(ours - theirs) > 0.01).mean() < 0.003


@pytest.mark.parametrize("spec", ["shadow-volume", "soft-volume", "light-samples"])
def test_volumes_decline_what_is_cut_out_or_draw_it_whole(spec, light, device, mask) -> None:
    view, whole = leaves_view(light), leaves_view(light, replace(LEAVES, cutout=None))
    assert "cutouts=opaque" in str(refusal(spec, view, device))
    assert refusal(spec, whole, device) is None
    of_none = leaves_view(light, replace(LEAVES, casts=False))
    assert refusal(spec, of_none, device) is None, "what casts nothing has no volume"
    opaque = "light-samples:of=shadow-volume(cutouts=opaque)" if spec == "light-samples" else f"{spec}:cutouts=opaque"
    assert refusal(opaque, view, device) is None
    on_ground = [mask(opaque, one)[-20:, :] for one in (view, whole)]  # below the leaves
    assert (on_ground[0] != on_ground[1]).mean() < 0.1


@pytest.mark.parametrize("nearest", [True, False])
@pytest.mark.parametrize(
    ("alpha", "factor", "cutoff", "vertex"),
    [(255, 1, 1, 1), (255, 0.5, 0.5, 1), (255, 1, 0.7, 0.7), (100, 1, 100 / 255, 1)],
)
def test_an_alpha_equal_to_the_cutoff_is_opaque(alpha, factor, cutoff, vertex, nearest, studio, mask) -> None:
    """A card whose inner 6² of 8² texels have that alpha, and the square in which nothing less is mixed in."""
    texels = np.pad(np.full((6, 6), alpha, np.uint8), 1)
    corners = np.array([[-1.0, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]])
    places = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)[GROUND.faces]
    card = Mesh(
        "card",
        corners + np.array([0.0, 1.0, 0.0]),
        GROUND.faces,
        cutout=Cutout(texels, factor, cutoff, nearest),
        coordinates=places,
        alpha=np.full((2, 3), vertex, np.float32),
    )
    square = Mesh("card", corners * (0.75 if nearest else 0.625) + np.array([0.0, 1.0, 0.0]), GROUND.faces)
    for radius in (0.0, 0.03):
        sun = replace(LIGHTS["directional"], radius=radius)
        truth, exact = (trace(leaves_view(sun, mesh, size=96), pixel_samples=1) for mesh in (card, square))
        decided = exact.receivers & truth.receivers & ~truth.undecided
        assert (exact.receivers & ~decided).sum() < 20
        off = np.abs(truth.visibility - exact.visibility) > 4 * np.hypot(truth.standard_error, exact.standard_error)
        assert (exact.visibility[decided] < 0.5).sum() > 300
        assert off[decided].sum() == 0
    for spec in ("ray-traced:where=gpu", "hybrid"):
        masks = [mask(spec, leaves_view(LIGHTS["directional"], mesh, size=96)) for mesh in (card, square)]
        assert (masks[0] != masks[1]).sum() < 5


@pytest.mark.parametrize(
    "spec",
    [
        "shadow-volume",
        *(f"shadow-volume:{one}" for one in ("count=z-pass", "faces=triangle", "compare=depth")),
        "soft-volume",
    ],
)
def test_volumes_of_whole_cards_shadow_what_is_seen_through_holes(spec, light, studio, mask) -> None:
    """As rays from the visible surfaces find, past the same cards without holes."""
    view, parsed = leaves_view(light), parse_spec(spec, KNOWN).with_(cutouts="opaque").text
    shot, whole = (studio.shot(one) for one in (view, leaves_view(light, replace(LEAVES, cutout=None))))
    point, normal = shot.position[..., :3], shot.normal[..., :3]
    xyz, w = shot.view.light.homogeneous
    toward = np.array(xyz) - w * point
    facing = np.einsum("ijk,ijk->ij", normal, toward) > 0.02 * np.linalg.norm(toward, axis=2)
    tracer = Tracer(shot.view.scene.geometry.vertices, shot.view.scene.geometry.faces)
    origins = point[facing] + 1e-5 * normal[facing]
    blocked, _ = tracer.occlusion(origins, toward[facing], 1.0 if w else INFINITE)
    through = blocked[(shot.triangle != whole.triangle)[facing]]
    assert min(through.sum(), (~through).sum()) > 1000
    assert ((mask(parsed, view)[facing] < 0.5) != blocked).sum() <= 5  # at edges
    if spec == "soft-volume":
        soft = leaves_view(replace(light, radius=0.03))
        samples = mask("light-samples:of=shadow-volume(cutouts=opaque),n=32", soft)
        assert ((samples > 0.05) & (samples < 0.95)).sum() > 300
        assert (np.abs(mask(parsed, soft) - samples) > 1 / 64).mean() < 1e-3


def test_needs_count_what_is_cut_out() -> None:
    """A third of the texture is opaque, once the coordinates' margin is clamped to it."""
    alpha = np.zeros((1, 3), np.uint8)
    alpha[0, 1] = 255
    leaves = cards(30, Cutout(alpha, nearest=True, wrap=("clamp", "clamp")))
    found = casters_of(leaves_view(LIGHTS["directional"], leaves).placed()[0])
    assert found.cut_out == 60
    assert found.opaque == pytest.approx(1 / 3 / 1.5, abs=0.01)
    assert casters_of(leaves_view(LIGHTS["directional"], replace(leaves, cutout=None)).placed()[0]).cut_out == 0
