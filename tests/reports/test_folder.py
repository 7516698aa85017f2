"""Reading of run folders: complete, truncated, measured twice, moved between machines, or of another kind."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.results.frame import read_folders, read_runs
from tests.reports.conftest import POINTS, Cell

Write = Callable[..., Path]


def test_an_incomplete_last_line_is_ignored(run_folder) -> None:
    folder = run_folder([Cell("a", 512, 0.1, 3.0)])
    with (folder / "rows.jsonl").open("a") as rows:
        rows.write('{"schema": 1, "kind": "sco')
    (run,) = read_runs([folder])
    assert len(run.results) == 1


def table(folder: Path, *cells: Cell) -> None:
    """Write a `table.csv` with these cells."""
    (folder / "table.csv").write_text("key\n" + "".join(f"{cell.key}\n" for cell in cells))


def about(folder: Path, **fields: Any) -> None:
    """Add fields to `run.json`."""
    found = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(found | fields))


def keys(folder: Path) -> list[str]:
    return [row["key"] for row in read_runs([folder])[0].rows]


OLD, NEW = Cell("a", 512, 0.1, 3.0), Cell("a", 512, 0.7, 4.0, version=1)  # one cell, of two texts of a scene
OTHER = Cell("b", 512, 0.2, 3.0)


@pytest.mark.parametrize(("last", "iou", "ms"), [(None, 0.3, 4.0), (OLD, 0.9, 3.0), (NEW, 0.3, 4.0)])
def test_a_cell_counts_once_as_the_last_study_has_it_or_was_last_measured(run_folder, last, iou, ms) -> None:
    folder = run_folder([OLD, NEW])  # after them a run of OLD finds its rows and appends none
    if last:
        table(folder, last)
    (run,) = read_runs([folder])
    (result,) = run.results
    assert result.score["metrics"]["iou"] == pytest.approx(iou)
    assert result.time is not None and result.time["frame_ms"] == ms
    assert (run.older, run.earlier) == (1, frozenset())


def test_the_order_of_cells_is_that_of_their_first_rows(run_folder) -> None:
    folder = run_folder([OLD, OTHER, NEW, OLD])
    assert keys(folder) == [OLD.key, OTHER.key]
    table(folder, OLD, OTHER)
    assert keys(folder) == [OLD.key, OTHER.key]


def test_a_key_of_digits_alone_is_no_number(run_folder) -> None:
    folder, key = run_folder([OLD, NEW]), "001234567890123456789012"
    text = (folder / "rows.jsonl").read_text()
    (folder / "rows.jsonl").write_text(text.replace(f'"{OLD.key}"', f'"{key}"'))
    (folder / "table.csv").write_text(f"key\n{key}\n")
    assert keys(folder) == [key]


def test_cells_of_earlier_commands_are_known_by_the_table_or_by_the_keys_of_run_json(run_folder) -> None:
    folder = run_folder([OLD, OTHER, NEW])
    for expected, tell in (
        (OLD, lambda: table(folder, OLD)),
        (OLD, lambda: (table(folder, OLD, OTHER), about(folder, keys=[OLD.key]))),
        (NEW, lambda: about(folder, keys=[NEW.key])),  # whose table was not written: it was killed in between
    ):
        tell()
        assert keys(folder) == [expected.key, OTHER.key] and read_runs([folder])[0].earlier == {OTHER.key}


def test_the_last_row_of_an_engine_is_used_whatever_the_table_has(run_folder) -> None:
    folder, older = run_folder([OLD]), Cell("my-engine", None, 0.1, None)
    newer = replace(older, error=0.2, version=1)
    with (folder / "rows.jsonl").open("a") as rows:
        for cell in (older, newer):
            rows.write(json.dumps(cell.records()[0] | {"content": "c"}) + "\n")
    table(folder, OLD, older)
    about(folder, keys=[OLD.key])
    assert keys(folder) == [OLD.key, newer.key]
    assert read_runs([folder])[0].earlier == frozenset(), "an engine's row is of no study"


def test_a_spec_whose_default_has_changed_is_listed_once(run_folder) -> None:
    folder = run_folder([OLD, NEW])
    file = folder / "rows.jsonl"
    first, *rest = file.read_text().splitlines(keepends=True)
    changed = first.replace('"full_spec": "a[512]"', '"full_spec": "a:bias=none[512]"')
    assert changed != first
    file.write_text("".join([changed, *rest, *(json.dumps(one) + "\n" for one in OTHER.records())]))
    assert keys(folder) == [NEW.key, OTHER.key]
    table(folder, OLD, OTHER)  # which the last command found measured, with the default that it had before
    assert keys(folder) == [OLD.key, OTHER.key]


MACHINES = [(None, [False, True]), ("m0", [True, False]), ("m1", [False, True]), ("m2", [False, False])]


@pytest.mark.parametrize(("machine", "timed"), MACHINES)
def test_times_are_those_of_the_machine_that_run_json_names_or_of_the_last(run_folder, machine, timed) -> None:
    folder = run_folder([Cell("a", 512, 0.1, 3.0, machine="m0"), Cell("a", 1024, 0.1, 4.0, machine="m1")])
    if machine:
        about(folder, machine_key=machine)
    (run,) = read_runs([folder])
    assert [result.time is not None for result in run.results] == timed
    assert run.foreign == timed.count(False)


def test_runs_are_called_by_their_folders_or_by_paths_where_those_are_the_same(run_folder) -> None:
    one, other, third = (run_folder([Cell("a", 512, 0.1, 3.0)], name=name) for name in ("x/run", "y/run", "z"))
    assert [run.label for run in read_runs([one, other, third])] == [str(one), str(other), "z"]
    assert len(read_runs([one, one])) == 1


def test_a_folder_without_run_json_says_so_and_every_assumption_is_listed_once(run_folder) -> None:
    (run,) = read_runs([run_folder([OLD], about=False, name="bare")])
    assert (run.software, run.renderer) == (None, "a renderer")
    (run,) = read_runs([run_folder()])
    assert run.assumptions == ["no camera: assumed one", "no light: assumed a sun"]


def test_runs_and_sweeps_are_told_apart_by_their_rows(run_folder, sweep_folder) -> None:
    runs, sweeps = read_folders([sweep_folder(name="b"), run_folder(name="a"), sweep_folder(name="c")])
    assert [one.label for one in runs] == ["a"] and [one.label for one in sweeps] == ["b", "c"]
    assert len(sweeps[0].rows) == len(POINTS)


def test_rows_that_fit_no_run_or_are_of_both_kinds_are_one_line(run_folder, sweep_folder) -> None:
    sweep, folder = sweep_folder(), run_folder()
    with pytest.raises(InputError, match=r"sweep: found a sweep of `shadowbench stress`; allowed: a folder of a run"):
        read_runs([sweep])
    with (folder / "rows.jsonl").open("a") as rows:
        rows.write((sweep / "rows.jsonl").read_text())
    with pytest.raises(InputError, match=r"found cells of `run` and of `stress`; allowed: those of one"):
        read_folders([folder])
    row = POINTS[0].record()
    del row["home_spec"]
    (sweep / "rows.jsonl").write_text(json.dumps(row) + "\n")
    with pytest.raises(InputError, match=r"rows\.jsonl line 1: score: found no home_spec; it must be given"):
        read_folders([sweep])


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("rows.jsonl", None, r"run: found no rows\.jsonl; allowed: "),
        ("rows.jsonl", "", r"rows\.jsonl: found no cell; allowed: "),
        (
            "rows.jsonl",
            '{"schema": 1, "kind": "score"}\n',
            r"line 1: score\.scene: found none; it must be given",
        ),
        ("table.csv", "scene,iou\nstairs,0.9\n", r"table\.csv: found no column `key`; allowed: "),
        ("table.csv", "", r"table\.csv: found no column `key`; allowed: "),
        ("run.json", "[", r"run\.json: found no JSON \(EOF .*\); allowed: a JSON object"),
    ],
)
def test_a_folder_without_a_run_is_one_line(run_folder, file, text, message) -> None:
    folder = run_folder([OLD])
    (folder / file).unlink(missing_ok=True)
    if text is not None:
        (folder / file).write_text(text)
    with pytest.raises(InputError, match=re.compile(message)) as error:
        read_runs([folder])
    assert "\n" not in str(error.value) and error.value.exit_code == 2
