"""Every column of a table is described, in one list."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.measure.columns import described
from shadowbench.results.frame import read_runs
from shadowbench.scores.metrics import METRICS
from tests.engine_rows import ROWS
from tests.reports.conftest import run_file, write_folder

BASELINE = Path(__file__).resolve().parents[2] / "results" / "baseline"


def test_every_column_of_tables_of_techniques_and_engines_is_described(tmp_path: Path) -> None:
    engines = write_folder(tmp_path / "engines", ROWS, run_file(True, "A"), pictures=False)
    for run in read_runs([BASELINE, engines]):
        found = described(run.frame.columns)
        assert list(found) == list(run.frame.columns) and all(text.endswith(".") for text in found.values())
    assert found["iou"].startswith(METRICS["iou"].help)
    with pytest.raises(KeyError, match="new"):
        described(["new"])


def test_the_row_of_an_engine_has_its_version_box_and_sides(tmp_path: Path) -> None:
    (run,) = read_runs([write_folder(tmp_path / "engines", ROWS, run_file(True, "A"), pictures=False)])
    frame = run.frame.set_index("spec")
    assert frame.loc["three:bias=-0.5", ["engine_version", "box", "sides"]].tolist() == ["1", "given", "closed"]
    assert frame.loc["three:sides=double", "sides"] == "double"


def test_csv_of_a_report_has_described_columns(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "engines", ROWS, run_file(True, "A"), pictures=False)
    answer = shadowbench("report", folder, "--format", "csv", "-o", tmp_path / "cells.csv")
    assert answer.code == 0
    with (tmp_path / "cells.csv").open(newline="", encoding="utf-8") as stream:
        assert described(next(csv.reader(stream)))
