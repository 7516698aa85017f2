"""Folders of an older and a newer version with rows of schema 1, which commands must read (docs: schema.md)."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.scores.metrics import METRICS

Shadowbench = Callable[..., Any]

# Of a row that holds, of one that does not, and of a time: no more than schema 1 has asked for from the beginning.
ROWS = """\
{"schema": 1, "scene": "cube-on-plane", "view": "camera", "light": "light", "phase": 0, "technique": "unshadowed", \
"spec": "unshadowed", "full_spec": "unshadowed", "map_size": null, "view_size": 16, "coordinates": "relative", \
"kind": "score", "key": "0123456789abcdef01234567", "renderer": "an old one", "status": "ok", \
"metrics": {"iou": 0.0, "acne": 0.0, "leak": null}, "receivers": 200, "undecided": 1, "gpu_bytes": 1024, \
"work": {"draws": 1}}
{"schema": 1, "scene": "cube-on-plane", "view": "camera", "light": "light", "phase": 0, "technique": "cube-map", \
"spec": "cube-map", "full_spec": "cube-map:size=1024", "map_size": 1024, "view_size": 16, "coordinates": "relative", \
"kind": "score", "key": "89abcdef0123456789abcdef", "renderer": "an old one", "status": "unsupported: a sun"}
{"schema": 1, "kind": "time", "key": "0123456789abcdef01234567", "clock": "wall", "n": 3, "frame_ms": 2.5, \
"passes": {"resolve": {"ms": 2.0}}, "ratio": null, "no_ratio": "unsupported: a sun"}
"""
RUN = '{"schema": 1, "command": "shadowbench run cube-on-plane", "machine": {"cores": 2}}'  # without keys


@pytest.fixture
def older(tmp_path: Path) -> Path:
    folder = tmp_path / "older"
    folder.mkdir()
    (folder / "rows.jsonl").write_text(ROWS, encoding="utf-8")
    (folder / "run.json").write_text(RUN, encoding="utf-8")
    return folder


def lines(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_report_shows_an_older_folder_with_empty_columns(shadowbench: Shadowbench, older: Path, tmp_path: Path) -> None:
    answer = shadowbench("report", older, "--format", "csv", "-o", tmp_path / "cells.csv", "-q")
    assert answer.code == 0, answer.err
    held, declined = lines(tmp_path / "cells.csv")
    assert (held["iou"], held["leak"], held["frame_ms"], held["work_draws"]) == ("0.0", "", "2.5", "1")
    assert [name for name in METRICS if held[name]] == ["iou", "acne"]
    assert declined["status"] == "unsupported: a sun" and not declined["iou"]
    page = shadowbench("report", older, "-o", tmp_path / "report.html", "-q")
    assert page.code == 0, page.err


def test_a_run_goes_on_in_an_older_folder_and_check_compares_what_both_have(
    shadowbench: Shadowbench, older: Path, tmp_path: Path
) -> None:
    baseline = tmp_path / "baseline"
    baseline.mkdir()
    (baseline / "rows.jsonl").write_text(ROWS.splitlines(keepends=True)[0], encoding="utf-8")
    assert shadowbench("check", older, "--baseline", baseline).code == 0
    words = ("cube-on-plane", "-t", "unshadowed", "--view-size", "16", "--rounds", "0", "-o", older, "-q")
    assert shadowbench("run", *words).code == 0
    text = (older / "rows.jsonl").read_text(encoding="utf-8")
    assert text.startswith(ROWS), "what was measured stays as it was"
    (row,) = map(json.loads, text[len(ROWS) :].splitlines())
    assert [one["key"] for one in lines(older / "table.csv") if one["spec"] == "unshadowed"] == [row["key"]]
    answer = shadowbench("check", older, "--baseline", baseline)
    assert answer.code == 0, answer.out
    lacking = [name for name in METRICS if name not in ("iou", "acne", "leak")]
    assert f"note: not compared, since one side lacks them: {', '.join(lacking)}" in answer.err


def test_fields_of_newer_versions_are_kept_in_a_baseline_and_left_out_of_tables(
    shadowbench: Shadowbench, older: Path, tmp_path: Path
) -> None:
    row = json.loads(ROWS.splitlines()[0]) | {"mood": {"of": ["good", 2.5]}}
    row["metrics"]["novel"] = 0.5
    (older / "rows.jsonl").write_text(json.dumps(row) + "\n", encoding="utf-8")
    assert shadowbench("check", older, "--baseline", tmp_path / "baseline", "--update").code == 0
    assert json.loads((tmp_path / "baseline" / "rows.jsonl").read_text(encoding="utf-8")) == row
    assert shadowbench("report", older, "--format", "csv", "-o", tmp_path / "cells.csv", "-q").code == 0
    (line,) = lines(tmp_path / "cells.csv")
    assert line["iou"] == "0.0" and not line.keys() & {"mood", "novel"}
