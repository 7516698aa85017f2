"""`needs`: all needs of a scene in numbers and words, and the command that prints them."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.survey import explanations_of, needs, verdict_of
from tests.survey.conftest import LIGHTS, SUN, box, from_above, looking, plate

ALWAYS = {"light", "receivers", "closed casters", "silhouette", "texel", "map size"}
EDGES = {"map size, edges", "bias", "thinnest gap", "depth bits", "penumbra"}


@pytest.mark.parametrize("name", ["leaves", "room-with-lamp", "window"])
def test_a_scene_of_each_kind_of_light_has_needs_in_words(name: str) -> None:
    needed = needs(chosen_view(name, 64))
    rows = explanations_of(needed)
    assert {row.need for row in rows} >= ALWAYS | EDGES
    assert all(row.number and row.reason and "nan" not in row.number + row.reason for row in rows)
    assert ("cascades" in {row.need for row in rows}) == (needed.light == "directional")


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
    cube = box(1.0)
    room = Mesh("room", cube.vertices * (4.0, 3.0, 4.0), cube.faces)
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
        (chosen_view("statue", 192), "one map of {one}², no cascades for these edges, "),
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


def test_a_view_of_one_pixel_has_needs() -> None:
    needed = needs(looking([plate(8.0), box(0.8, (0.0, 0.4, 0.0))], SUN, size=1))
    assert needed.view_size == needed.pixels == 1 and explanations_of(needed)


def test_a_large_view_needs_what_its_sampled_pixels_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shadowbench.survey.samples.LATTICE", 256)
    meshes = [plate(50.0), box(1.0, (0.0, 0.5, 0.0)), box(0.5, (1.0, 0.25, 0.5))]
    small, large = (needs(looking(meshes, SUN, size=size), penumbrae=False) for size in (256, 512))
    assert large.texels.size == pytest.approx(2 * small.texels.size, rel=0.01)
    assert large.texels.edge_size == pytest.approx(2 * (small.texels.edge_size or 0), rel=0.05)


def test_the_command_prints_a_table_and_json(shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shadowbench.survey.samples.LATTICE", 64)
    table = shadowbench("needs", "cube-on-plane", "--view-size", "128")
    assert table.code == 0 and "map size, edges" in table.out
    assert "note: 25.0% of the pixels were sampled" in table.err
    assert table.out.startswith("cube-on-plane, 128 × 128 pixels: ")
    answer = shadowbench("needs", "cube-on-plane", "--view-size", "128", "--json")
    needed = json.loads(answer.out)
    assert f": {needed['verdict']}\n" in table.out
    assert answer.code == 0 and needed["casters"]["silhouette"] == 10 and needed["casters"]["triangles"] == 14
    assert {row["need"] for row in needed["told"]} >= ALWAYS
