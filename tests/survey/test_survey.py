"""`needs`: all needs of a scene in numbers and words, and the command that prints them."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.samples import sample_view
from shadowbench.survey.survey import Receivers, explanations_of, needs, planes_of, receivers_of, verdict_of
from shadowbench.techniques.planar_projection import PlanarProjection
from shadowbench.truths.trace import trace
from tests.survey.conftest import LIGHTS, SUN, ball, box, from_above, looking, plate, reasons

ALWAYS = {"light", "receivers", "closed casters", "silhouette", "texel", "map size"}
EDGES = {"map size, edges", "bias", "thinnest gap", "depth bits", "penumbra"}
ROOM = box(1.0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", ["leaves", "room-with-lamp", "spot-lamp", "window"])
def test_a_scene_of_each_kind_of_light_has_needs_in_words(name: str) -> None:
    needed = needs(chosen_view(name, 64))
    rows = explanations_of(needed)
    assert {row.need for row in rows} >= ALWAYS | EDGES
    assert all(row.number and row.reason and "nan" not in row.number + row.reason for row in rows)
    assert ("cascades" in {row.need for row in rows}) == (needed.light == "directional")


def test_samples_are_the_receivers_of_the_truth_with_its_geometry(light: Light) -> None:
    view = looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0)), plate(0.6, (0.8, 1.0, 0.2))], light, size=128)
    truth, samples = trace(view), sample_view(view)
    np.testing.assert_array_equal(samples.pixel, np.flatnonzero(truth.receivers & ~truth.undecided))
    np.testing.assert_array_equal(samples.shadowed, truth.visibility.ravel()[samples.pixel] < 0.5)
    np.testing.assert_allclose(samples.cosine, truth.cosine.ravel()[samples.pixel], rtol=1e-4, atol=1e-6)


def receivers(view: View) -> Receivers:
    return receivers_of(sample_view(view), planes_of(view.placed()[0].scene))


def test_planes_cover_a_box_on_a_ground_and_nothing_of_a_sphere() -> None:
    flat = receivers(looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], SUN))
    assert flat.planar == 1.0 and flat.projection_suffices
    assert receivers(looking([ball(4)], SUN)).planar < 0.2


def test_planes_too_small_for_the_scene_count_for_nothing_even_if_nothing_else_is_visible() -> None:
    """A table that fills the picture is too small beside 400 m of ground to be a plane for `planar-projection`."""
    table, above = box(1.0, (0.0, -0.5, 0.0)), box(0.1, (0.0, 0.3, 0.0), "above")
    view = from_above([plate(400.0, (0.0, -1.0, 0.0)), table, above], SUN, width=0.8)
    small = receivers(view)
    assert small.shadowed > 0 and small.planar == 0.0 and small.planes == 0 and not small.projection_suffices
    assert "no visible receiver is on a plane" in reasons(view)["receivers"]
    alone = receivers(from_above([table, above], SUN, width=0.8))
    assert alone.planar == 1.0 and alone.planes == 2


def test_planes_beyond_the_maximum_count_are_ignored() -> None:
    most = PlanarProjection.Params().count
    far = [plate(3.0, (0.0, -1.0 - k, 0.0), f"plate {k}") for k in range(most)]
    for below, planar in ((far[1:], 1.0), (far, 0.0)):
        seen = receivers(from_above([plate(2.0), *below], SUN, width=1.0))
        assert seen.planar == planar and seen.planes == planar


def test_planes_are_counted_in_words() -> None:
    def reason(*meshes: Mesh) -> str:
        return reasons(from_above(meshes, SUN))["receivers"]

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


def test_a_closed_room_under_a_sun_outside_has_no_edges() -> None:
    """A ray from a pixel at the joint of its walls may start outside, where it is lit."""
    room = Mesh("room", ROOM.vertices * (4.0, 3.0, 4.0), ROOM.faces)
    sun = Light("sun", "directional", (-0.368687826495, -0.819152044289, -0.439385041771))
    needed = needs(looking([room], sun, 512, (1.5, 1.2, 1.7), (-1.2, -0.5, -1.0), 60.0), penumbrae=False)
    assert needed.receivers.pixels > 0.5 and needed.receivers.shadowed == 1.0
    assert not {"map size, edges", "cascades", "bias"} & {row.need for row in explanations_of(needed)}
    assert verdict_of(needed).startswith("all that is seen is in shadow")


@pytest.mark.parametrize(
    ("view", "words"),
    [
        (looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], LIGHTS[1], 128), "one map of {one}², 16 bits of depth"),
        (looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], LIGHTS[2], 128), "a cube map with faces of {one}², 16 bits"),
        (chosen_view("deep-street", 128), "{best} cascades of {each}² in place of one map of {one}², "),
        (chosen_view("statue", 192), "one map of {one}², cascades for shadows elsewhere in view, "),
        (from_above([plate(8.0)], SUN), "no shadow is seen, and no edge, so that any map size does"),
    ],
    ids=["spot", "lamp", "street", "statue", "nothing"],
)
def test_the_verdict_is_what_a_scene_needs_with_the_numbers_of_the_rows(view: View, words: str) -> None:
    needed = needs(view)
    numbers = {row.need: row.number for row in explanations_of(needed)}
    best, _, each = numbers.get("cascades", "").partition(" × ")
    verdict = verdict_of(needed)
    assert verdict.startswith(words.format(one=numbers.get("map size, edges"), best=best, each=each))
    if needed.texels.edge_size is not None:
        assert f"a bias of {numbers['bias'].removesuffix(' m')} m at 1024²" in verdict
        enough = float(numbers["error of hard"]) <= 0.02
        assert verdict.endswith("hard shadows suffice" if enough else "hard shadows are too sharp")


@pytest.mark.parametrize("size", [1, 3, 700])
def test_views_of_any_size_have_needs(size: int) -> None:
    needed = needs(looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], SUN, size=size))
    assert needed.view_size == size and 1 <= needed.pixels <= 512**2
    assert explanations_of(needed)


def test_a_large_view_needs_what_its_sampled_pixels_say() -> None:
    meshes = [plate(50.0), box(1.0, (0.0, 0.5, 0.0)), box(0.5, (1.0, 0.25, 0.5))]
    small, large = (needs(looking(meshes, SUN, size=size), penumbrae=False) for size in (512, 1024))
    assert large.texels.size == pytest.approx(2 * small.texels.size, rel=0.01)
    assert large.texels.edge_size == pytest.approx(2 * (small.texels.edge_size or 0), rel=0.05)


def test_the_command_prints_a_table_and_json(shadowbench: Callable[..., Any]) -> None:
    table = shadowbench("needs", "cube-on-plane", "--view-size", "1024")
    assert table.code == 0 and "map size, edges" in table.out
    assert "note: 25.0% of the pixels were sampled" in table.err
    assert table.out.startswith("cube-on-plane, 1024 × 1024 pixels: ")
    answer = shadowbench("needs", "cube-on-plane", "--view-size", "1024", "--json")
    needed = json.loads(answer.out)
    assert f": {needed['verdict']}\n" in table.out
    assert answer.code == 0 and needed["casters"]["silhouette"] == 10 and needed["casters"]["triangles"] == 14
    assert {row["need"] for row in needed["told"]} >= ALWAYS
