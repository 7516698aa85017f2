"""Parts of a study: each cell is in one of them, whatever their order."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.errors import InputError
from shadowbench.measure.cells import Block
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.studies.run import Part, names_of


@given(st.lists(st.integers(), unique=True, max_size=40), st.data())
def test_every_item_is_in_one_part_and_parts_are_of_equal_size(items: list[int], data: st.DataObject) -> None:
    count = data.draw(st.integers(1, len(items) + 3))
    parts = [Part(number, count).of(items, lambda item: item) for number in range(1, count + 1)]
    assert sorted(item for part in parts for item in part) == sorted(items)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_blocks_of_two_lights_are_dealt_alike_in_any_order() -> None:
    scene = load_scene("stairs")
    lights = [replace(scene.lights[0], name=f"sun-{number}") for number in range(12)]
    blocks = [Block(view_of(scene, scene.cameras[0], light, 16), ()) for light in lights]
    assert set(Part(1, 3).of(blocks, names_of)) == set(Part(1, 3).of(blocks[::-1], names_of))


@pytest.mark.parametrize(
    "text", ["0/0", "4/3", "0/3", "1/0", "-1/2", "1.5/2", "one", "1", "1/2/3", "", "1/99999", "१/२"]
)
def test_what_is_no_part_is_an_error(text: str) -> None:
    with pytest.raises(InputError, match=r"^--part: found '.*'; allowed: K/N, as in 3/16, "):
        Part.named(text)


def test_the_estimate_of_the_whole_is_not_given_for_a_part(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    answer = shadowbench("run", "-t", "unshadowed", "--view-size", 16, "--part", "4/4", "-o", tmp_path / "out")
    notes = ["note: --part 4/4: nothing to measure, as the cells of a view stay together"]
    assert (answer.code, answer.err.splitlines()) == (0, notes)
