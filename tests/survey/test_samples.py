"""Receivers, casters and penumbrae of a view: by its truth, by trimesh, as shadow volumes draw, and by closed forms."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import shadowbench
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.assumed import sunlit
from shadowbench.scenes.model import SUN_RADIUS, Light, LightShape, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.metrics import ranking, score
from shadowbench.survey.samples import (
    BULB,
    HARD_RMSE,
    Penumbra,
    count_casters,
    penumbra_of,
    receivers_of,
    sample_view,
)
from shadowbench.techniques.planar_projection import PlanarProjection
from shadowbench.truths.trace import trace
from tests.survey.conftest import DOWN, SUN, ball, box, from_above, looking, plate, reasons


def test_samples_are_the_receivers_of_the_truth_with_its_geometry(light: Light) -> None:
    view = looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0)), plate(0.6, (0.8, 1.0, 0.2))], light, size=128)
    truth, samples = trace(view), sample_view(view)
    np.testing.assert_array_equal(samples.pixel, np.flatnonzero(truth.receivers & ~truth.undecided))
    np.testing.assert_array_equal(samples.shadowed, truth.visibility.ravel()[samples.pixel] < 0.5)
    np.testing.assert_allclose(samples.cosine, truth.cosine.ravel()[samples.pixel], rtol=1e-4, atol=1e-6)


# Receivers


def test_planes_beyond_the_maximum_count_are_ignored() -> None:
    most = PlanarProjection.Params().count
    far = [plate(3.0, (0.0, -1.0 - k, 0.0)) for k in range(most)]
    for below, planar in ((far[1:], 1.0), (far, 0.0)):
        seen = receivers_of(sample_view(from_above([plate(2.0), *below], SUN, width=1.0)))
        assert seen.planar == planar and seen.planes == planar


def test_planes_are_counted_in_words() -> None:
    def reason(*meshes: Mesh) -> str:
        return reasons(from_above(meshes, SUN, width=0.8))["receivers"]

    assert reason(plate(8.0)).startswith("all visible receivers are on 1 plane:")
    assert reason(plate(8.0), plate(0.5, (0.0, 0.1, 0.0))).startswith("all visible receivers are on 2 planes:")
    others = reason(plate(50.0), ball(3, 0.2))
    assert others.startswith("planar-projection, on 1 plane, would leave the others lit: ")
    # A table that fills the picture is too small beside 400 m of ground to be a plane for `planar-projection`.
    ground, table = plate(400.0, (0.0, -1.0, 0.0)), box(1.0, (0.0, -0.5, 0.0))
    assert reason(ground, table, box(0.1, (0.0, 0.3, 0.0))).startswith("no visible receiver is on a plane")


# Casters


@pytest.mark.parametrize(
    ("meshes", "light", "counts"),
    [
        ([box(1.0)], SUN, (12, 12, 6, 18)),
        ([box(1.0)], DOWN, (12, 12, 4, 18)),
        ([box(1.0, inside_out=True)], SUN, (12, 0, 6, 18)),
        ([plate(1.0)], SUN, (2, 0, 4, 5)),
        ([plate(9.0), box(1.0, (0.0, 0.5, 0.0))], SUN, (14, 12, 10, 23)),
        ([plate(1.0, casts=False)], SUN, (0, 0, 0, 0)),
    ],
    ids=["box", "box and sun along an edge", "box inside out", "plate", "box on ground", "nothing"],
)
def test_outlines_and_closed_parts(meshes: list[Mesh], light: Light, counts: tuple[int, ...]) -> None:
    casters = count_casters(looking(meshes, light))
    assert (casters.triangles, casters.closed, casters.silhouette, casters.edges) == counts


def test_the_explanation_counts_open_and_inward_wound_casters() -> None:
    mesh, inwards = box(1.0, (0.0, 0.5, 0.0)), box(1.0, (2.0, 0.5, 0.0), inside_out=True)

    def reason(*meshes: Mesh) -> str:
        return reasons(looking(meshes, SUN))["closed casters"]

    signs = "which shadow volumes count with signed weights"
    both = "2 are in open parts, 12 in closed parts not wound outwards"
    assert reason(plate(9.0), mesh, inwards) == f"triangles; {both}, {signs}"
    assert reason(plate(9.0, casts=False), inwards) == f"triangles; 12 are in closed parts not wound outwards, {signs}"
    assert reason(plate(9.0, casts=False), mesh).startswith("triangles, all in closed parts")


def test_a_ball_has_the_outlines_that_lie_between_triangles_turned_to_the_light_and_away(light: Light) -> None:
    mesh = ball(4)
    made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    source, w = light.homogeneous
    seen = ((np.array(source) - w * made.triangles_center) * made.face_normals).sum(axis=1) > 0
    between = seen[made.face_adjacency]
    assert count_casters(looking([mesh], light)).silhouette == np.count_nonzero(between[:, 0] != between[:, 1])


def test_shadow_volumes_draw_two_triangles_for_each_wall_of_closed_and_of_open_parts(tmp_path: Path) -> None:
    """The ground and a box without its lid are open, another box is closed; one triangle covers the screen."""
    scene = tmp_path / "boxes.toml"
    lidless = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\nv 1 1 1\nv 0 1 1\n"
    lidless += "f 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n"
    (tmp_path / "lidless.obj").write_text(lidless)
    scene.write_text(
        '[[mesh]]\nshape = "plane"\nscale = 9.0\n[[mesh]]\nfile = "lidless.obj"\n'
        '[[mesh]]\nshape = "box"\ntranslate = [-2.0, 0.6, 0.0]\n'
    )
    casters = count_casters(chosen_view(str(scene), 32).placed()[0])
    assert casters.open == 12 and casters.closed == 12 and casters.walls > casters.silhouette
    (cell,) = shadowbench.run(str(scene), "shadow-volume", view_size=32, rounds=0).to_dict("records")
    assert cell["work_primitives"] == 2 * casters.walls + 1


# Penumbrae


def penumbra(view: View) -> Penumbra:
    needed = penumbra_of(view, sample_view(view))
    assert needed is not None
    return needed


def test_under_a_plate_it_is_as_wide_as_the_sun_makes_it_and_longer_the_way_the_sun_leans() -> None:
    sun = Light("sun", "directional", (0.5, -1.0, 0.0), radius=math.radians(1.0))
    needed = penumbra(from_above([plate(50.0), plate(0.4, (-0.25, 0.5, 0.0))], sun, size=256))
    assert not needed.assumed and needed.radius == math.radians(1.0)
    distance, sine = 0.5 * math.hypot(0.5, 1.0), 1 / math.hypot(0.5, 1.0)
    across = 2 * math.tan(math.radians(1.0)) * distance
    assert (needed.median, needed.p95) == pytest.approx((across / sine / (2.0 / 256),) * 2, rel=0.01)


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_the_penumbra_of_a_lamp_follows_from_similar_triangles(scale: float) -> None:
    lamp = Light("lamp", "point", position=(-1.0 * scale, 3.0 * scale, 0.0), radius=0.02 * scale)
    meshes = [plate(50.0 * scale), plate(0.1 * scale, (-0.5 * scale, 1.5 * scale, 0.0))]
    needed = penumbra(from_above(meshes, lamp, size=256, width=2.0 * scale))
    # Halfway between lamp and ground, so that the shadow is as soft as the lamp is wide, along the ground by 1/sine.
    sine = 3.0 / math.hypot(3.0, 1.0)
    assert needed.median == pytest.approx(0.04 / sine / (2.0 / 256), rel=0.05)


@pytest.mark.parametrize("kind", ["directional", "point", "rectangle"])
def test_a_light_without_a_size_is_taken_as_the_sun_or_a_bulb(kind: LightShape) -> None:
    light = Light("lamp", kind, (0.1, -1.0, 0.0), (-0.4, 3.0, 0.0), math.radians(60.0))
    needed = penumbra(from_above([plate(50.0), plate(0.1, (-0.2, 1.5, 0.0))], light, size=128))
    assert needed.assumed and needed.radius == pytest.approx(SUN_RADIUS if kind == "directional" else BULB)


@pytest.mark.parametrize("name", ["post", "cube-on-plane"])
def test_the_error_of_hard_shadows_is_the_rmse_of_the_truth_s_own_arrays(
    name: str, builtin: Callable[..., View]
) -> None:
    """Of the scene's own light, or under the sun that is assumed; the centre's visibility is the best that is hard."""
    view = builtin(name, 128)
    needed, sized = penumbra(view), sunlit(view.light)
    soft, hard = (trace(replace(view, light=one)) for one in (sized, replace(sized, radius=0.0, size=(0.0, 0.0))))
    assert needed.hard_rmse == score(hard.visibility, prepare_truth(soft))["rmse"]
    scored = soft.receivers & ~soft.undecided
    partly = scored & (soft.visibility > 0) & (soft.visibility < 1)
    assert needed.share == pytest.approx(partly.sum() / (scored & (soft.visibility < 1)).sum())
    assert ranking(soft=True).targets[1] == HARD_RMSE and needed.hard_is_enough == (needed.hard_rmse <= HARD_RMSE)
