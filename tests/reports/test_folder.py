"""Reading of run folders: complete, truncated, measured twice, moved between machines, or of another kind."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.results.folder import read_folders, read_runs
from tests.reports.conftest import POINTS, Cell

Write = Callable[..., Path]


def test_an_incomplete_last_line_is_ignored(run_folder: Write) -> None:
    folder = run_folder([Cell("a", 512, 0.1, 3.0)])
    with (folder / "rows.jsonl").open("a") as rows:
        rows.write('{"schema": 1, "kind": "sco')
    (run,) = read_runs([folder])
    assert len(run.results) == 1


def test_a_cell_that_was_measured_again_counts_once_as_it_was_last(run_folder: Write) -> None:
    (run,) = read_runs([run_folder([Cell("a", 512, 0.1, 3.0), Cell("a", 512, 0.2, 4.0, version=1)])])
    (result,) = run.results
    assert result.score["metrics"]["iou"] == 0.8 and result.time is not None and result.time["frame_ms"] == 4.0
    assert run.older == 1


def test_times_of_another_machine_do_not_stand_beside_the_last(run_folder: Write) -> None:
    (run,) = read_runs([run_folder([Cell("a", 512, 0.1, 3.0, machine="m0"), Cell("a", 1024, 0.1, 4.0)])])
    assert [result.time is not None for result in run.results] == [False, True]
    assert run.foreign == 1


def table(folder: Path, *cells: Cell) -> None:
    """Write a `table.csv` with these cells."""
    (folder / "table.csv").write_text("key\n" + "".join(f"{cell.key}\n" for cell in cells))


OLD, NEW = Cell("a", 512, 0.1, 3.0), Cell("a", 512, 0.7, 4.0, version=1)  # one cell, of two texts of a scene


@pytest.mark.parametrize(("last", "iou", "ms"), [(OLD, 0.9, 3.0), (NEW, 0.3, 4.0)])
def test_a_cell_counts_as_the_last_study_has_it(run_folder: Write, last: Cell, iou: float, ms: float) -> None:
    folder = run_folder([OLD, NEW])  # after them a run of OLD finds its rows and appends none
    table(folder, last)
    (run,) = read_runs([folder])
    (result,) = run.results
    assert result.score["metrics"]["iou"] == pytest.approx(iou)
    assert result.time is not None and result.time["frame_ms"] == ms
    assert (run.older, run.earlier) == (1, frozenset())


def test_without_a_table_the_last_of_the_rows_counts(run_folder: Write) -> None:
    (run,) = read_runs([run_folder([OLD, NEW, OLD])])
    (result,) = run.results
    assert (result.score["key"], run.older, run.earlier) == (OLD.key, 1, frozenset())


def test_the_order_of_cells_is_that_of_their_first_rows(run_folder: Write) -> None:
    other = Cell("b", 512, 0.2, 3.0)
    folder = run_folder([OLD, other, NEW, OLD])
    assert [row["spec"] for row in read_runs([folder])[0].rows] == ["a", "b"]
    table(folder, OLD, other)
    assert [row["spec"] for row in read_runs([folder])[0].rows] == ["a", "b"]


def test_a_key_of_digits_alone_is_no_number(run_folder: Write) -> None:
    folder, key = run_folder([OLD, NEW]), "001234567890123456789012"
    text = (folder / "rows.jsonl").read_text()
    (folder / "rows.jsonl").write_text(text.replace(f'"{OLD.key}"', f'"{key}"'))
    (folder / "table.csv").write_text(f"key\n{key}\n")
    assert [row["key"] for row in read_runs([folder])[0].rows] == [key]


def test_cells_of_earlier_commands_are_known(run_folder: Write) -> None:
    other = Cell("b", 512, 0.2, 3.0)
    folder = run_folder([OLD, other, NEW])
    engine = {**Cell("my-engine", None, 0.1, None).records()[0], "content": "c"}
    with (folder / "rows.jsonl").open("a") as rows:
        rows.write(json.dumps(engine) + "\n")
    table(folder, OLD)
    (run,) = read_runs([folder])
    assert len(run.rows) == 3 and run.earlier == {other.key}, "an engine's row is of no study"


def last_command(folder: Path, *cells: Cell) -> None:
    """Make `run.json` list these cells."""
    about = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(about | {"keys": [cell.key for cell in cells]}))


def test_the_keys_of_run_json_say_what_the_last_command_was(run_folder: Write) -> None:
    other = Cell("b", 512, 0.2, 3.0)
    folder = run_folder([OLD, other, NEW])
    table(folder, OLD, other)
    last_command(folder, OLD)
    (run,) = read_runs([folder])
    assert [row["key"] for row in run.rows] == [OLD.key, other.key] and run.earlier == {other.key}
    last_command(folder, NEW)  # whose table was not written: it was killed in between
    (run,) = read_runs([folder])
    assert [row["key"] for row in run.rows] == [NEW.key, other.key] and run.earlier == {other.key}


def test_the_last_row_of_an_engine_is_used_whatever_the_table_has(run_folder: Write) -> None:
    folder, older, newer = (
        run_folder([OLD]),
        Cell("my-engine", None, 0.1, None),
        Cell("my-engine", None, 0.2, None, version=1),
    )
    with (folder / "rows.jsonl").open("a") as rows:
        for cell in (older, newer):
            rows.write(json.dumps(cell.records()[0] | {"content": "c"}) + "\n")
    table(folder, OLD, older)
    last_command(folder, OLD)
    (run,) = read_runs([folder])
    assert [row["key"] for row in run.rows] == [OLD.key, newer.key] and run.earlier == frozenset()


def test_a_spec_whose_default_has_changed_is_listed_once(run_folder: Write) -> None:
    folder, other = run_folder([OLD, NEW]), Cell("b", 512, 0.2, 3.0)
    file = folder / "rows.jsonl"
    first, *rest = file.read_text().splitlines(keepends=True)
    changed = first.replace('"full_spec": "a[512]"', '"full_spec": "a:bias=none[512]"')
    assert changed != first
    file.write_text("".join([changed, *rest, *(json.dumps(one) + "\n" for one in other.records())]))
    assert [row["key"] for row in read_runs([folder])[0].rows] == [NEW.key, other.key]
    table(folder, OLD, other)  # which the last command found measured, with the default that it had before
    assert [row["key"] for row in read_runs([folder])[0].rows] == [OLD.key, other.key]


@pytest.mark.parametrize(("machine", "timed"), [("m0", [True, False]), ("m1", [False, True]), ("m2", [False, False])])
def test_times_are_those_of_the_machine_that_run_json_names(run_folder: Write, machine: str, timed: list[bool]) -> None:
    folder = run_folder([Cell("a", 512, 0.1, 3.0, machine="m0"), Cell("a", 1024, 0.1, 4.0, machine="m1")])
    about = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(about | {"machine_key": machine}))
    (run,) = read_runs([folder])
    assert [result.time is not None for result in run.results] == timed
    assert run.foreign == timed.count(False)


def test_runs_are_called_by_their_folders_or_by_paths_where_those_are_the_same(run_folder: Write) -> None:
    one, other, third = (run_folder([Cell("a", 512, 0.1, 3.0)], name=name) for name in ("x/run", "y/run", "z"))
    assert [run.label for run in read_runs([one, other, third])] == [str(one), str(other), "z"]
    assert len(read_runs([one, one])) == 1


def test_a_folder_without_run_json_is_read_and_says_so(run_folder: Write) -> None:
    (run,) = read_runs([run_folder([Cell("a", 512, 0.1, 3.0)], about=False)])
    assert (run.software, run.renderer) == (None, "a renderer")


def test_every_assumption_is_listed_once(run_folder: Write) -> None:
    (run,) = read_runs([run_folder()])
    assert run.assumptions == ["no camera: assumed one", "no light: assumed a sun"]


def test_runs_and_sweeps_are_told_apart_by_their_rows(run_folder: Write, sweep_folder: Write) -> None:
    runs, sweeps = read_folders([sweep_folder(name="b"), run_folder(name="a"), sweep_folder(name="c")])
    assert [one.label for one in runs] == ["a"] and [one.label for one in sweeps] == ["b", "c"]
    assert len(sweeps[0].rows) == len(POINTS)


def test_commands_for_runs_refuse_a_sweep(sweep_folder: Write) -> None:
    with pytest.raises(InputError, match=r"sweep: found a sweep of `shadowbench stress`; allowed: a folder of a run"):
        read_runs([sweep_folder()])


def test_rows_of_both_kinds_in_a_folder_are_one_line(run_folder: Write, sweep_folder: Write) -> None:
    folder = run_folder()
    with (folder / "rows.jsonl").open("a") as rows:
        rows.write((sweep_folder() / "rows.jsonl").read_text())
    with pytest.raises(InputError, match=r"found cells of `run` and of `stress`; allowed: those of one"):
        read_folders([folder])


def test_a_row_on_an_axis_that_lacks_its_place_is_one_line(sweep_folder: Write) -> None:
    folder = sweep_folder()
    row = POINTS[0].record()
    del row["home_spec"]
    (folder / "rows.jsonl").write_text(json.dumps(row) + "\n")
    with pytest.raises(InputError, match=r"rows\.jsonl line 1: score: found no home_spec; it must be given"):
        read_folders([folder])


def no_folder(folder: Path) -> None:
    (folder / "rows.jsonl").unlink()
    (folder / "run.json").unlink()
    folder.rmdir()


def no_rows(folder: Path) -> None:
    (folder / "rows.jsonl").unlink()


def empty_rows(folder: Path) -> None:
    (folder / "rows.jsonl").write_text("")


def foreign_rows(folder: Path) -> None:
    (folder / "rows.jsonl").write_text('{"schema": 1, "kind": "score", "key": "1"}\n')


def foreign_table(folder: Path) -> None:
    (folder / "table.csv").write_text("scene,iou\nstairs,0.9\n")


def empty_table(folder: Path) -> None:
    (folder / "table.csv").write_text("")


def broken_run_json(folder: Path) -> None:
    (folder / "run.json").write_text("[")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (no_folder, r"run: no such folder; allowed: "),
        (no_rows, r"run: found no rows\.jsonl; allowed: "),
        (empty_rows, r"rows\.jsonl: found no cell; allowed: "),
        (foreign_rows, r"rows\.jsonl line 1: score\.scene: found none; it must be given"),
        (foreign_table, r"table\.csv: found no column `key`; allowed: "),
        (empty_table, r"table\.csv: found no column `key`; allowed: "),
        (broken_run_json, r"run\.json: found no JSON \(EOF .*\); allowed: a JSON object"),
    ],
)
def test_a_folder_without_a_run_is_one_line(run_folder: Write, spoil: Callable[[Path], None], message: str) -> None:
    folder = run_folder([Cell("a", 512, 0.1, 3.0)])
    spoil(folder)
    with pytest.raises(InputError, match=re.compile(message)) as error:
        read_runs([folder])
    assert "\n" not in str(error.value) and error.value.exit_code == 2
