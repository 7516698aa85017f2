"""Planar projection: exact on planes, no shadow elsewhere, none from casters behind the light or below the plane."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.truths.trace import trace

NAME = "planar-projection"
KINDS = ["directional", "spot", "point"]


@dataclass(eq=False)
class Judged:
    """A mask beside its truth, (H, W) bool: `dark` as drawn, `wanted` as traced.

    Of the `decided` receivers, `planar` are on a plane and `other` are on none.
    """

    dark: np.ndarray
    wanted: np.ndarray
    planar: np.ndarray
    other: np.ndarray
    decided: np.ndarray
    triangle: np.ndarray
    facts: dict[str, float]

    def iou(self, where: np.ndarray) -> float:
        """Of the shadow, over some pixels."""
        return float((self.dark & self.wanted & where).sum() / ((self.dark | self.wanted) & where).sum())


@pytest.fixture
def judged(studio, build):
    """A spec's mask of a view beside the truth."""

    def judge(view: View, spec: str = NAME, shot=None) -> Judged:
        shot, truth = shot or studio.shot(view), trace(view, pixel_samples=1)
        built = build(spec, shot)
        mask = built.draw(shot)
        assert set(np.unique(mask)) <= {0.0, 1.0}, "nothing is darkened twice, nor by half"
        on_plane = np.zeros(len(view.scene.geometry.faces) + 1, dtype=bool)
        for plane in built.technique.planes:
            on_plane[plane.triangles] = True
        decided = truth.receivers & ~truth.undecided
        # At a silhouette camera and rasteriser may see different surfaces; that is not the technique's doing.
        planar = decided & on_plane[truth.triangle] & (truth.triangle == shot.triangle)
        facts = built.technique.facts()
        built.stage.release()
        other = decided & ~on_plane[shot.triangle]
        return Judged(mask < 0.5, truth.visibility < 0.5, planar, other, decided, truth.triangle, facts)

    return judge


@pytest.mark.parametrize("name", ["cube-on-plane", "table-top", "lamp-over-table", "spot-lamp", "room-with-lamp"])
def test_planes_are_shadowed_as_rays_say(name, judged, builtin) -> None:
    seen = judged(builtin(name))
    assert (seen.wanted & seen.planar).sum() > 250
    assert seen.iou(seen.planar) >= 0.9999
    assert seen.iou(seen.decided) <= seen.iou(seen.planar)


def test_missing_shadows_off_the_planes_lower_the_score(judged, builtin) -> None:
    seen = judged(builtin("statue", 256))
    assert seen.iou(seen.decided) < 0.75 < seen.iou(seen.planar)
    assert not (seen.dark & seen.other).any(), "what is on no plane stays lit"
    assert (seen.wanted & seen.other).sum() > 200


def test_a_boxs_shadow_is_as_large_as_the_light_makes_it(shape, looking, mask, studio) -> None:
    """A square of 1 m at 1 m under a lamp at 3 m throws a square of 1.5 m; under a sun at 45° one moved by 1 m."""
    meshes = [shape("plane", 8.0), shape("plane", 1.0, (0.0, 1.0, 0.0))]
    lights = {
        (0.0, 0.75): Light("lamp", "point", position=(0.0, 3.0, 0.0)),
        (1.0, 0.5): Light("sun", "directional", (1.0, -1.0, 0.0)),
    }
    for (shift, half), light in lights.items():
        view = looking(meshes, light, 256, eye=(0.0, 6.0, 5.0))
        shot = studio.shot(view)
        x, _, z = np.moveaxis(shot.position[..., :3] / shot.placement.scale + shot.placement.center, -1, 0)
        inside = half - np.maximum(np.abs(x - shift), np.abs(z))
        floor = (shot.triangle >= 0) & (shot.triangle < 2) & (np.abs(inside) > 1e-5)
        assert np.array_equal(mask(NAME, view)[floor] < 0.5, inside[floor] > 0)
        assert (floor & (inside > 0)).sum() > 500


@pytest.mark.parametrize("kind", KINDS)
def test_casters_behind_the_light_or_below_the_plane_cast_nothing(kind, shape, looking, judged) -> None:
    place = (0.3, 2.0, 0.2)
    light = {
        "directional": Light("sun", "directional", (-0.3, -1.0, -0.2)),
        "spot": Light("spot", "spot", (0.0, -1.0, 0.0), place, math.radians(150)),
        "point": Light("point", "point", position=place),
    }[kind]
    floor = shape("plane", 8.0)
    above = shape("sphere", 0.6, (0.5, 3.0, 0.4), receives=False)
    below = shape("box", 1.0, (-0.7, -0.8, 0.5), receives=False)
    alone = looking([floor, below] if kind == "directional" else [floor, below, above], light, 256, eye=(1.5, 1.6, 3.5))
    seen = judged(alone)
    assert not (seen.dark | seen.wanted)[seen.planar].any()
    assert seen.planar.sum() > 20_000
    assert seen.facts["planes_drawn"] >= 1, "it is the casters that are cut off, not the plane"


def straddling(shape) -> list[Mesh]:
    """Walls from below the floor to above the lamp: the shadow of their upper ends is infinitely far away."""
    return [
        shape("plane", 12.0),
        shape("box", [0.2, 4.0, 0.5], (0.9, 0.5, 0.3)),
        shape("cylinder", [0.3, 3.0, 0.3], (-0.8, 0.4, -0.6)),
        shape("sphere", 0.7, (-0.5, 1.2, 0.9)),
        shape("torus", 0.8, (0.2, 1.2, -1.2)),
    ]


def posts(shape) -> list[Mesh]:
    return [
        shape("plane", 10.0),
        *(shape("box", [0.05, 0.3, 0.05], (x, 0.15, 0.37 * x)) for x in np.linspace(-1.5, 1.5, 12)),
    ]


@pytest.mark.parametrize(
    ("meshes", "light", "options", "shadowed"),
    [
        (straddling, Light("lamp", "point", position=(0.1, 1.2, 0.1)), {"eye": (3.3, 5.0, 4.4)}, 10_000),
        (
            lambda shape: [
                shape("plane", 12.0),
                shape("sphere", 0.3, (2.0, 0.15, 0.2)),
                shape("box", 0.3, (2.5, 0.1, 0)),
            ],
            3.0,  # a low sun throws long shadows
            {"eye": (-3.0, 3.0, 4.0)},
            5000,
        ),
        (
            # Each face of the frustum has corners of the ground on its outer side, and yet it fills the picture.
            lambda shape: [shape("plane", 60.0), shape("box", [0.2, 0.5, 0.2], (0.0, 0.25, -1.0))],
            45.0,
            {"eye": (0.0, 2.0, 1.0), "target": (0, 0, -1), "near": 0.2, "far": 9.0},
            500,
        ),
        (posts, Light("lamp", "point", position=(1e6, 1e6, 3e5)), {}, 500),
    ],
)
def test_the_ground_is_shadowed_as_rays_say(meshes, light, options, shadowed, shape, looking, sun, judged) -> None:
    """Where casters are cut at the plane and at the light's height, and where shadows are long."""
    light = light if isinstance(light, Light) else sun(light)
    seen = judged(looking(meshes(shape), light, 512, **options))
    floor = seen.planar & (seen.triangle < 2)
    assert (seen.wanted & floor).sum() > shadowed and (~seen.wanted & floor).sum() > shadowed
    assert seen.iou(floor) >= 0.9999


def test_triangles_in_the_plane_cast_nothing_and_those_above_do(shape, looking, sun, judged) -> None:
    floor, box = shape("plane", 6.0), shape("box", 1.0, (0.0, 0.5, 0.0))
    for height, casts in ((0.0, False), (0.01, True)):
        sheet = shape("plane", [1.0, 1.0, 0.6], (1.3, height, 0.9), receives=False)
        bare, covered = (judged(looking([floor, box, *extra], sun(35.0), 256)) for extra in ([], [sheet]))
        same = bare.planar & covered.planar
        assert (bare.dark != covered.dark)[same].any() == casts
        assert covered.iou(covered.planar) >= 0.9999


def test_a_plane_is_shadowed_on_whichever_side_the_light_is(shape, looking, judged) -> None:
    plane, ball = shape("plane", 4.0), shape("sphere", 1.0, (0.0, 0.0, 0.0), receives=False)
    for side in (1.0, -1.0):
        light = Light("sun", "directional", (1.2, -side, 0.2))
        seen = judged(looking([plane, ball], light, 256, eye=(1.0, side * 3.0, 3.0)))
        assert (seen.dark & seen.planar).sum() > 500 and seen.iou(seen.planar) >= 0.9999
        behind = judged(looking([plane, ball], light, 256, eye=(1.0, -side * 3.0, 3.0)))
        assert not behind.dark.any() and behind.facts["planes_drawn"] == 0


def test_share_and_count_choose_the_planes(judged, builtin) -> None:
    view = builtin("table-top", 256)
    spread = {items: judged(view, f"{NAME}:{items}") for items in ("count=1", "count=3", "share=0.002", "share=0.0001")}
    assert [spread[items].facts["planes"] for items in ("count=1", "count=3")] == [1, 3]
    floor_only = spread["count=1"]
    table = range(2, 14)
    assert not floor_only.dark[np.isin(floor_only.triangle, table)].any()
    assert floor_only.dark[floor_only.triangle < 2].any()
    assert spread["count=3"].dark[np.isin(floor_only.triangle, table)].any()
    few, many = spread["share=0.002"], spread["share=0.0001"]
    assert few.facts["planar_share"] < many.facts["planar_share"] < 1.0
    assert few.iou(few.decided) < many.iou(many.decided)


def test_a_scene_without_a_plane_is_declined(device, studio, shape, looking, sun) -> None:
    view, spec = studio.shot(looking([shape("sphere", 1.0)], sun(40.0))).view, parse_spec(NAME, techniques())
    assert spec.technique.unsupported(spec.params, view, device) == "no receiver is a plane"


def test_a_rounded_mesh_is_a_plane_that_does_not_shadow_itself(shape, looking, sun, judged) -> None:
    """Four decimals in 10 m: corners are off the plane by more than float32 rounding, on both sides of it."""
    x, z = np.meshgrid(*[np.linspace(-5.0, 5.0, 33)] * 2, indexing="ij")
    first = (np.arange(32)[:, None] * 33 + np.arange(32)).ravel()
    corners = [first, first + 1, first + 33, first + 1, first + 34, first + 33]
    heights = 0.05 * x + 0.03 * z
    vertices = np.column_stack([x.ravel(), heights.ravel(), z.ravel()]).round(4)
    floor = Mesh("floor", vertices, np.stack(corners, axis=1).reshape(-1, 3).astype(np.int32))
    seen = judged(looking([floor, shape("box", 1.0, (0.0, 0.9, 0.0))], sun(40.0), 256))
    ground = seen.decided & (seen.triangle < 2048)
    assert (ground & ~seen.other).sum() == ground.sum() and (seen.wanted & ground).sum() > 500
    assert seen.iou(ground) >= 0.9999
