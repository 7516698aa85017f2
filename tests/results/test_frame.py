"""Reading of run folders: the row that counts, columns, truncated files, other machines, folders of another kind."""

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.measure.columns import FIXED
from shadowbench.results.frame import cells_frame, read_folders, read_runs
from shadowbench.scores.metrics import METRICS
from tests.reports.conftest import POINTS, Cell, run_file, write_folder
from tests.results.cells import result

OLD, NEW = Cell("a", 512, 0.1, 3.0), Cell("a", 512, 0.7, 4.0, version=1)  # one cell, of two texts of a scene
OTHER = Cell("b", 512, 0.2, 3.0)


def folder_of(path: Path, *cells: Cell, **about: Any) -> Path:
    """A run folder with the rows of these cells; about: fields of `run.json` besides its own."""
    records = [record for cell in cells for record in cell.records()]
    return write_folder(path / "run", records, run_file(True, "A") | about, pictures=False)


def keys(folder: Path) -> list[str]:
    return [row["key"] for row in read_runs([folder])[0].rows]


@pytest.mark.parametrize(("last", "iou", "ms"), [([], 0.3, 4.0), ([OLD], 0.9, 3.0), ([NEW], 0.3, 4.0)])
def test_a_cell_counts_once_as_the_last_command_has_it_or_was_last_measured(tmp_path, last, iou, ms) -> None:
    """After rows of NEW a run of OLD finds its own and appends none."""
    folder = folder_of(tmp_path, OLD, OTHER, NEW, **({"keys": [cell.key for cell in last]} if last else {}))
    (run,) = read_runs([folder])
    first, other = run.results
    assert first.score["metrics"]["iou"] == pytest.approx(iou) and first.time["frame_ms"] == ms
    assert (other.score["spec"], run.older) == ("b", 1)
    assert run.earlier == ({OTHER.key} if last else frozenset())
    assert [row["spec"] for row in run.last.rows] == (["a"] if last else ["a", "b"])


def test_a_spec_whose_default_has_changed_is_listed_once(tmp_path) -> None:
    folder = folder_of(tmp_path, OLD, NEW, OTHER)
    file = folder / "rows.jsonl"
    text = file.read_text()
    changed = text.replace('"full_spec": "a[512]"', '"full_spec": "a:bias=none[512]"', 1)
    file.write_text(changed)
    assert changed != text and keys(folder) == [NEW.key, OTHER.key]
    (folder / "run.json").write_text(json.dumps(run_file(True, "A") | {"keys": [OLD.key, OTHER.key]}))
    assert keys(folder) == [OLD.key, OTHER.key], "which the last command found, with the default of then"


def test_a_view_under_a_light_that_has_become_hard_or_soft_counts_as_it_was_last(tmp_path) -> None:
    soft = replace(OLD, rmse_pen=0.2, version=2)
    hard = replace(NEW, map_size=1024)
    assert keys(folder_of(tmp_path, soft, OTHER, hard)) == [OTHER.key, hard.key]


def test_the_last_row_of_an_engine_is_used_and_is_of_no_study(tmp_path) -> None:
    older = Cell("my-engine", None, 0.1, None)
    newer = replace(older, error=0.2, version=1)
    folder = folder_of(tmp_path, OLD, keys=[OLD.key])
    with (folder / "rows.jsonl").open("a") as rows:
        for cell in (older, newer):
            rows.write(json.dumps(cell.records()[0] | {"content": "c"}) + "\n")
    assert keys(folder) == [OLD.key, newer.key] and read_runs([folder])[0].earlier == frozenset()


def test_times_are_those_of_the_machine_that_run_json_names_or_of_the_last(tmp_path) -> None:
    cells = [Cell("a", 512, 0.1, 3.0, machine="m0"), Cell("a", 1024, 0.1, 4.0, machine="m1")]
    for machine, timed in ((None, [False, True]), ("m0", [True, False]), ("m2", [False, False])):
        folder = folder_of(tmp_path / str(machine), *cells, **({"machine_key": machine} if machine else {}))
        (run,) = read_runs([folder])
        assert [one.time is not None for one in run.results] == timed and run.foreign == timed.count(False)


def test_runs_are_called_by_their_folders_or_by_paths_and_sweeps_are_apart(tmp_path) -> None:
    one, other = (folder_of(tmp_path / name, OLD) for name in "xy")
    third = write_folder(tmp_path / "z", OLD.records(), {}, pictures=False)
    assert [run.label for run in read_runs([one, other, third, one])] == [str(one), str(other), "z"]
    swept = write_folder(tmp_path / "sweep", [point.record() for point in POINTS], {}, pictures=False)
    runs, sweeps = read_folders([swept, one])
    assert [run.label for run in runs] == ["run"] and [sweep.label for sweep in sweeps] == ["sweep"]
    assert len(sweeps[0].rows) == len(POINTS)
    (bare,) = read_runs([third])
    assert (bare.software, bare.renderer) == (None, "a renderer")
    assert runs[0].assumptions == ["no camera: assumed one", "no light: assumed a sun"], "each once"


LINE = json.dumps(POINTS[0].record())
BAD = {
    "no file": ("rows.jsonl", None, r"run: found no rows\.jsonl; allowed: "),
    "no row": ("rows.jsonl", "", r"rows\.jsonl: found no cell; allowed: "),
    "no cell": (
        "rows.jsonl",
        '{"schema": 1, "kind": "score"}\n',
        r"line 1: score\.key: found none; it must be given",
    ),
    "no axis": ("rows.jsonl", LINE.replace("home_spec", "home") + "\n", r"line 1: found no home_spec; it must"),
    "no JSON": ("run.json", "[", r"run\.json: found no JSON \(EOF .*\); allowed: a JSON object"),
    "a sweep": ("rows.jsonl", LINE + "\n", r"found a sweep of `shadowbench stress`; allowed: a folder of a run"),
    "both": ("rows.jsonl", "+" + LINE + "\n", r"found cells of `run` and of `stress`; allowed: those of one"),
}


def test_a_folder_without_a_run_is_one_line(tmp_path) -> None:
    for what, (name, text, message) in BAD.items():
        file = folder_of(tmp_path / what, OLD) / name
        before = file.read_text()
        file.unlink()
        if text is not None:
            file.write_text(before + text[1:] if text.startswith("+") else text)
        with pytest.raises(InputError, match=re.compile(message)) as error:
            read_runs([file.parent])
        assert "\n" not in str(error.value) and error.value.exit_code == 2, what


# Columns


def test_facts_passes_and_times_have_columns_in_one_piece() -> None:
    """Each technique has passes and facts, and so columns, of its own; warnings of pandas are errors in tests."""
    passes = {f"pass-{number}": {"ms": 1.0} for number in range(120)}
    times = {"wall_ms": 2.0, "still_ms": 0.0, "camera_ms": 3.0, "light_ms": 4.0}
    timed = {"frame_ms": 1.0, "passes": passes, **times}
    frame = cells_frame([result(timed, facts={"open_parts": 2.0}), result(size=64)])
    assert frame["fact_open_parts"].tolist() == pytest.approx([2.0, np.nan], nan_ok=True)
    assert frame.loc[0, list(times)].tolist() == list(times.values()) and frame.loc[1, list(times)].isna().all()
    assert len(frame.assign(more=1).columns) > 190


def test_every_column_is_described(shadowbench: Callable[..., Any], tmp_path) -> None:
    """But metrics, which have their own table, and what passes, work and facts name."""
    engine = {"engine": {"version": "1", "box": "given"}, "commit": "c", "full_spec": "three:sides=closed"}
    records = [Cell("three", None, 0.1, None).records()[0] | engine, *OLD.records()]
    folder = write_folder(tmp_path / "run", records, run_file(True, "A"), pictures=False)
    assert shadowbench("report", folder, "--format", "csv", "-o", tmp_path / "cells.csv", "-q").code == 0
    with (tmp_path / "cells.csv").open(newline="", encoding="utf-8") as stream:
        first, *others = csv.DictReader(stream)
    assert [first[name] for name in ("engine_version", "box", "sides")] == ["1", "given", "closed"] and others
    named = {name for name in first if not name.startswith(("pass_", "work_", "fact_"))}
    assert named - FIXED.keys() - METRICS.keys() == {"run", "processor", "software"}
