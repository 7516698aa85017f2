"""Parts of a study: each cell is in one of them, and merged they are the whole."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.errors import InputError
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.rows import Record, stream_rows
from shadowbench.scenes.views import chosen_view
from shadowbench.studies.part import Part, part_of
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec

STUDY = ("stairs", "cube-on-plane", "-t", "shadow-map", "-t", "cube-map", "-t", "unshadowed", "--map-size", "32,64")
RUN = ("run", *STUDY, "--phases", "2", "--view-size", "32", "--rounds", "0", "-q")
STRESS = ("stress", "--quick", "-t", "shadow-map:size=64", "-t", "cube-map:size=64", "--axis", "gap", "-q")


@given(st.lists(st.integers(), unique=True, min_size=1, max_size=40), st.data())
def test_every_item_is_in_one_part_and_parts_are_of_equal_size(items: list[int], data: st.DataObject) -> None:
    count = data.draw(st.integers(1, len(items)))
    parts = [Part(number, count).of(items, lambda item: item) for number in range(1, count + 1)]
    assert sorted(item for part in parts for item in part) == sorted(items)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_a_part_does_not_depend_on_the_order_of_its_items() -> None:
    forth, back = ([*range(100)], [*reversed(range(100))])
    assert sorted(Part(2, 3).of(back, str)) == Part(2, 3).of(forth, str)


def test_phases_of_a_cell_are_dealt_alike_in_any_order() -> None:
    view, spec = chosen_view("cube-on-plane", 16), parse_spec("shadow-map", techniques())
    cells = tuple(Cell(spec, phase) for phase in range(12))
    forth, back = (Part(1, 3).of_blocks([Block(view, order)])[0].cells for order in (cells, cells[::-1]))
    assert set(forth) == set(back)


@pytest.mark.parametrize(
    "text", ["0/0", "4/3", "0/3", "1/0", "-1/2", "1.5/2", "one", "1", "1/2/3", "", "1/99999", "१/२"]
)
def test_what_is_no_part_is_an_error(text: str) -> None:
    with pytest.raises(InputError, match=r"^--part: found '.*'; allowed: K/N, as in 3/16, "):
        part_of(text)


def test_more_parts_than_cells_are_an_error() -> None:
    with pytest.raises(InputError, match=r"^--part 4/4: found 3 to divide; allowed: 1 to 3 parts$"):
        Part(4, 4).of("abc", str)


def test_the_estimate_of_the_whole_is_not_given_for_a_part(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    answer = shadowbench("run", "-t", "unshadowed", "--view-size", 16, "--part", "4/4", "-o", tmp_path / "out")
    assert answer.code == 2 and answer.err == "shadowbench: --part 4/4: found 3 to divide; allowed: 1 to 3 parts\n"


def scores(folder: Path) -> dict[str, Record]:
    """Score rows by key, without the command that made them."""
    rows = [row for row, _ in stream_rows(folder / "rows.jsonl") if row["kind"] == "score"]
    assert len({row["key"] for row in rows}) == len(rows)
    return {row["key"]: {name: value for name, value in row.items() if name != "command"} for row in rows}


@pytest.mark.parametrize("command", [RUN, pytest.param(STRESS, marks=pytest.mark.slow)], ids=["run", "stress"])
def test_merged_parts_equal_the_whole(
    shadowbench: Callable[..., Any], tmp_path: Path, command: tuple[str, ...]
) -> None:
    count = 3 if command is RUN else 2
    parts = [tmp_path / f"part-{number}" for number in range(1, count + 1)]
    for number, part in enumerate(parts, start=1):
        assert shadowbench(*command, "--part", f"{number}/{count}", "-o", part).code == 0
    assert shadowbench(*command, "-o", tmp_path / "whole").code == 0
    assert shadowbench("merge", *parts, "-o", tmp_path / "merged").code == 0
    assert all(map(scores, parts))
    assert scores(tmp_path / "merged") == scores(tmp_path / "whole")
    for kind in ("masks", "pictures", "truth"):
        found, expected = (
            {file.name: file.read_bytes() for file in (folder / kind).glob("*.png")}
            for folder in (tmp_path / "merged", tmp_path / "whole")
        )
        assert found == expected
    tables = [sorted((tmp_path / name).glob("*.csv")) for name in ("merged", "whole")]
    assert [file.name for file in tables[0]] == [file.name for file in tables[1]]
