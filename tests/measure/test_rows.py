"""Run folders with a row that no command writes: one line that names the file and the line, never a traceback."""

import json
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.measure.rows import read_rows, read_run_file
from tests.results.cells import cell, rows, timed

NAN = float("nan")
BAD: dict[str, tuple[str, Any]] = {
    "NaN in a metric": ("metrics.iou", NAN),
    "a key that leads out of the folder": ("key", "../../secret"),
    "a scene that leads out of the folder": ("scene", "../../secret"),
    "a map size of half a texel": ("map_size", 0.5),
    "another status": ("status", "fine"),
    "another schema": ("schema", 2),
    "no kind": ("kind", None),
    "half a place on an axis": ("axis", "elevation"),
}
BAD_TIMES = {
    "a time below 0": ("frame_ms", -1.0),
    "0 rounds": ("n", 0),
    "no ratio and no reason": ("ratio", None),
}
BAD_RUN = {"device as text": {"device": "a GPU"}, "a key that leads out": {"keys": ["../../secret"]}, "a list": []}


def test_a_row_that_no_command_writes_is_one_line(tmp_path: Path) -> None:
    good = cell()
    for what, (place, value) in (BAD | BAD_TIMES).items():
        record = json.loads(json.dumps(timed(good) if what in BAD_TIMES else good))
        *parents, last = place.split(".")
        holder = record
        for name in parents:
            holder = holder[name]
        holder[last] = value
        file = rows(tmp_path / what, good, record) / "rows.jsonl"
        with pytest.raises(InputError) as error:
            read_rows(file)
        assert str(error.value).startswith(f"{file} line 2: ") and "\n" not in str(error.value), what
    for text in ("", "notes of mine", "[]", "[" * 10_000):
        file.write_text(f"{json.dumps(good)}\n{text}\n")
        with pytest.raises(InputError, match="line 2: "):
            read_rows(file)


def test_a_run_json_that_no_command_writes_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    for what, content in BAD_RUN.items():
        file.write_text(json.dumps(content))
        with pytest.raises(InputError) as error:
            read_run_file(file)
        assert str(error.value).startswith(f"{file}: ") and "\n" not in str(error.value), what
