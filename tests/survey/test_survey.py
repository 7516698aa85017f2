"""`needs`: all needs of a scene, and the command that prints them."""

import json
import math
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.plugin.base import Stage
from shadowbench.plugin.registry import shader_folder
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.explanations import explanations_of, verdict_of
from shadowbench.survey.sampling import Samples, sample_view
from shadowbench.survey.survey import Receivers, needs, planes_of, receivers_of
from shadowbench.techniques.planar_projection import PlanarProjection
from shadowbench.truths.embree import Tracer
from shadowbench.truths.trace import trace
from tests.survey.conftest import LIGHTS, SUN, ball, box, from_above, looking, plate, told

FOUND = {"light", "receivers", "closed casters", "silhouette", "texel", "map size", "casters to leave out"}


@pytest.mark.parametrize("name", builtin_names())
def test_every_scene_of_ours_has_needs_in_words(name: str) -> None:
    found = needs(chosen_view(name, 64))
    rows = explanations_of(found)
    assert {row.need for row in rows} >= FOUND | {"map size, edges", "bias", "thinnest gap", "depth bits", "penumbra"}
    assert all(row.number and row.reason and "nan" not in row.number + row.reason for row in rows)
    assert ("cascades" in {row.need for row in rows}) == (found.light == "directional")


def test_samples_are_the_receivers_and_shadows_of_the_truth(light: Light) -> None:
    view = looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0)), plate(0.6, (0.8, 1.0, 0.2))], light, size=128)
    truth, samples = trace(view, 1), sample_view(view)
    receivers, shadow = np.zeros((2, 128 * 128), dtype=bool)
    receivers[samples.pixel] = True
    shadow[samples.pixel] = samples.shadowed
    decided = ~truth.undecided.ravel()
    np.testing.assert_array_equal(receivers[decided], truth.receivers.ravel()[decided])
    np.testing.assert_array_equal(shadow[decided], truth.visibility.ravel()[decided] < 0.5)
    blocked = samples.shadowed & decided[samples.pixel]
    metres = samples.blocker[blocked] / samples.placement.scale
    np.testing.assert_allclose(metres, truth.blocker.ravel()[samples.pixel[blocked]], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("kind", ["directional", "spot", "point"])
def test_the_shadow_of_a_wall_no_higher_than_the_offset_is_seen(kind: Any) -> None:
    """In light as low as 1:2000, in which a ray that starts above the surface passes over the wall."""
    slope, height = 0.0005, 5e-6
    corners = [[0.0, 0.0, -2.0], [0.0, 0.0, 2.0], [0.0, height, 2.0], [0.0, height, -2.0]]
    wall = Mesh("wall", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    light = Light(kind, kind, (1.0, -slope, 0.0), (-2.0, 2.0 * slope, 0.0), math.radians(60.0))
    reach = height / slope
    view = looking([plate(8.0), wall], light, 64, (reach, 1.0, 1e-4), (reach, 0.0, 0.0), math.degrees(3.5 * reach))
    truth, samples = trace(view, 1), sample_view(view)
    decided = ~truth.undecided.ravel()[samples.pixel]
    shadow = truth.visibility.ravel()[samples.pixel] < 0.5
    assert decided.mean() > 0.9 and 0.2 < shadow.mean() < 0.8
    np.testing.assert_array_equal(samples.shadowed[decided], shadow[decided])
    metres = samples.blocker[shadow & decided] / samples.placement.scale
    np.testing.assert_allclose(metres, truth.blocker.ravel()[samples.pixel[shadow & decided]], rtol=1e-4)
    assert "map size, edges" in {row.need for row in explanations_of(needs(view))}


@pytest.mark.parametrize("length", [1e-170, 1e17])
def test_the_length_of_a_spot_s_direction_changes_nothing(length: float) -> None:
    meshes = [plate(8.0), box(0.8, (0.0, 0.4, 0.0))]
    usual = Light("spot", "spot", (-0.5, -1.0, 0.25), (2.0, 4.0, -0.8), 1.2)
    light = replace(usual, direction=(-0.5 * length, -1.0 * length, 0.25 * length))
    found, expected = (sample_view(looking(meshes, one)) for one in (light, usual))
    np.testing.assert_array_equal(found.pixel, expected.pixel)


def seen_by(samples: Samples) -> Receivers:
    return receivers_of(samples, planes_of(samples.view.scene))


def test_planes_cover_a_box_on_a_ground_and_nothing_of_a_sphere() -> None:
    flat = seen_by(sample_view(looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], SUN)))
    assert flat.planar.value == 1.0 and flat.projection_suffices
    assert seen_by(sample_view(looking([ball(4)], SUN))).planar.value < 0.2


def test_planes_too_small_for_the_scene_count_for_nothing_even_if_nothing_else_is_visible() -> None:
    """A table that fills the picture is too small beside 400 m of ground to be a plane for `planar-projection`."""
    table, above = box(1.0, (0.0, -0.5, 0.0)), box(0.1, (0.0, 0.3, 0.0), "above")
    seen = from_above([plate(400.0, (0.0, -1.0, 0.0)), table, above], SUN, width=0.8)
    found = seen_by(sample_view(seen))
    assert found.shadowed.value > 0 and found.planar.value == 0.0 and found.planes == 0
    assert not found.projection_suffices
    assert "no visible receiver is on a plane" in told(seen)["receivers"]
    alone = seen_by(sample_view(from_above([table, above], SUN, width=0.8)))
    assert alone.planar.value == 1.0 and alone.planes == 2


def test_planes_beyond_the_maximum_count_are_ignored() -> None:
    most = PlanarProjection.Params().count
    far = [plate(3.0, (0.0, -1.0 - k, 0.0), f"plate {k}") for k in range(most)]
    for below, planar in ((far[1:], 1.0), (far, 0.0)):
        found = seen_by(sample_view(from_above([plate(2.0), *below], SUN, width=1.0)))
        assert found.planar.value == planar and found.planes == planar


@pytest.mark.parametrize("name", builtin_names())
def test_receivers_on_planes_are_covered_by_planar_projection(name: str, device: Device, studio: Any) -> None:
    view = chosen_view(name, 64)
    shot = studio.shot(view)
    folder = shader_folder(PlanarProjection)
    stage = Stage(shot.view.scene, device, (64, 64), shot.geometry, shot.placement, folder)
    technique = PlanarProjection(PlanarProjection.Params())
    technique.build(stage)
    of = np.full(len(view.scene.geometry.faces), -1)
    for index, plane in enumerate(technique.planes):
        of[plane.triangles] = index
    stage.release()
    samples = sample_view(view)
    found, seen = seen_by(samples), of[samples.triangle]
    assert found.planar.value == np.mean(seen >= 0)
    assert found.lost.value == pytest.approx((samples.shadowed & (seen < 0)).sum() / samples.shadowed.sum())
    assert found.planes == len(np.unique(seen[seen >= 0]))


def test_one_and_two_planes_are_found() -> None:
    def reason(*meshes: Mesh) -> str:
        return told(from_above(meshes, SUN))["receivers"]

    assert reason(plate(8.0)).startswith("all visible receivers are on 1 plane:")
    assert reason(plate(8.0), plate(0.5, (0.0, 0.1, 0.0))).startswith("all visible receivers are on 2 planes:")
    others = reason(plate(50.0), ball(3, 0.4))
    assert others.startswith("planar-projection, on 1 plane, would leave the others lit: ")


@pytest.mark.parametrize(
    ("flags", "light", "words"),
    [
        ({"casts": False}, SUN, "no mesh casts a shadow"),
        ({"receives": False}, SUN, "no pixel shows a receiver that 'sun' lights"),
        ({}, Light("sun", "directional", (0.0, 1.0, 0.0)), "no pixel shows a receiver"),
    ],
    ids=["no caster", "no receiver", "light from below"],
)
def test_without_casters_or_receivers_there_is_nothing_to_need(flags: dict, light: Light, words: str) -> None:
    with pytest.raises(InputError, match=words):
        needs(from_above([plate(8.0, **flags)], light))


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.kind)
def test_a_closed_room_under_a_light_outside_has_no_edges(light: Light) -> None:
    """A ray from a pixel at the joint of its walls may start outside, where it is lit."""
    room = box(1.0, (0.0, 0.0, 0.0))
    room = replace(room, vertices=room.vertices * (4.0, 3.0, 4.0))
    light = replace(light, direction=(-0.368687826495, -0.819152044289, -0.439385041771), position=(4.0, 6.0, -1.6))
    if light.kind == "spot":
        light = replace(light, direction=(-0.5, -1.0, 0.2))
    for eye, target in (((1.5, 1.2, 1.7), (-1.2, -0.5, -1.0)), ((-1.6, 0.3, 1.5), (0.4, -1.3, 0.2))):
        found = needs(looking([room], light, 512, eye, target, 60.0), penumbrae=False)
        assert found.receivers.pixels.value > 0.5 and found.receivers.shadowed.value == 1.0
        assert not {"map size, edges", "cascades", "bias"} & {row.need for row in explanations_of(found)}
        assert verdict_of(found).startswith("all that is seen is in shadow")


@pytest.mark.parametrize(
    ("view", "words"),
    [
        (
            from_above([plate(8.0), plate(0.5, (0.0, 1.0, 0.0))], SUN),
            "one map of {one}², no cascades, 16 bits of depth",
        ),
        (looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], LIGHTS[1], 128), "one map of {one}², 16 bits of depth"),
        (looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], LIGHTS[2], 128), "a cube map with faces of {one}², 16 bits"),
        (chosen_view("deep-street", 128), "{best} cascades of {each}² in place of one map of {one}², "),
        (from_above([plate(8.0)], SUN), "no shadow is seen, and no edge, so that any map size does"),
    ],
    ids=["sun", "spot", "lamp", "street", "nothing"],
)
def test_the_first_line_is_what_a_scene_needs_with_the_numbers_of_the_rows(view: View, words: str) -> None:
    found = needs(view)
    numbers = {row.need: row.number.split(" ±")[0] for row in explanations_of(found)}
    best, _, each = numbers.get("cascades", "").partition(" × ")
    verdict = verdict_of(found)
    assert verdict.startswith(words.format(one=numbers.get("map size, edges"), best=best, each=each))
    if found.texels.edge_size is not None:
        assert f"a bias of {numbers['bias'].removesuffix(' m')} m at 1024²" in verdict
        enough = float(numbers["error of hard"]) <= 0.02
        assert verdict.endswith("hard shadows suffice" if enough else "hard shadows are too sharp")


def test_a_lit_plane_alone_has_needs_too() -> None:
    found = needs(from_above([plate(8.0)], SUN))
    assert found.bits is None and found.penumbra is None and found.texels.edge_size is None and found.cascades is None
    assert {row.need for row in explanations_of(found)} >= FOUND


@pytest.mark.parametrize("size", [1, 2, 3, 513, 700])
def test_views_of_any_size_have_needs(size: int) -> None:
    found = needs(looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], SUN, size=size))
    assert found.view_size == size and 1 <= found.pixels <= 512**2
    assert explanations_of(found)


def test_the_command_prints_a_table_and_json(shadowbench: Callable[..., Any]) -> None:
    table = shadowbench("needs", "cube-on-plane", "--view-size", "64")
    assert table.code == 0 and "map size, edges" in table.out and not table.err
    assert table.out.startswith("cube-on-plane, 64 × 64 pixels: one map of ")
    answer = shadowbench("needs", "cube-on-plane", "--view-size", "64", "--json")
    found = json.loads(answer.out)
    assert f": {found['verdict']}\n" in table.out
    assert answer.code == 0 and found["casters"]["silhouette"] == 10 and found["reach"]["triangles"] == 14
    assert {row["need"] for row in found["told"]} >= FOUND


def test_needs_prints_the_number_of_sampled_pixels(shadowbench: Callable[..., Any]) -> None:
    answer = shadowbench("needs", "cube-on-plane", "--view-size", "1024")
    assert answer.code == 0 and "25.0% of the pixels" in answer.err and "±" in answer.out


@pytest.mark.slow
def test_needs_make_no_opengl_context() -> None:
    code = (
        "import sys; from shadowbench.scenes.opening import chosen_view; from shadowbench.survey.survey import needs;"
        "needs(chosen_view('cube-on-plane', 32)); sys.exit('glcontext' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode == 0


def test_rays_are_those_of_the_picture_however_many_triangles_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: Counter[str] = Counter()

    def counted(query: str) -> Any:
        ask = getattr(Tracer, query)

        def counting(tracer: Tracer, origins: Any, directions: Any, reach: Any) -> Any:
            asked[query] += len(origins)
            return ask(tracer, origins, directions, reach)

        return counting

    for query in ("hits", "occlusion"):
        monkeypatch.setattr(Tracer, query, counted(query))
    rays = []
    for subdivisions in (1, 3, 5):
        view = looking([plate(8.0), ball(subdivisions, 0.4, (0.0, 0.4, 0.0))], SUN)
        needs(view)  # from here on, its truths are in the cache
        asked.clear()
        needs(view)
        assert not asked["occlusion"], "the points of the light are the truth's"
        rays.append(asked["hits"] - 64 * 64)  # a ray a pixel
    # A ray more for each pixel of the shadow, which grows a little as the ball becomes rounder.
    assert max(rays) <= 2 * 64 * 64 and max(rays) - min(rays) <= 64
