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


@given(st.lists(st.integers(), unique=True, min_size=1, max_size=40), st.data())
def test_every_item_is_in_one_part_and_parts_are_of_equal_size(items: list[int], data: st.DataObject) -> None:
    count = data.draw(st.integers(1, len(items)))
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


def test_more_parts_than_views_are_an_error_without_an_estimate_of_the_whole(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    answer = shadowbench("run", "-t", "unshadowed", "--view-size", 16, "--part", "4/4", "-o", tmp_path / "out")
    assert answer.code == 2
    line = "shadowbench: --part 4/4: found 3 to divide, as the cells of a view stay together; allowed: 1 to 3 parts"
    assert answer.err.splitlines() == [line]
