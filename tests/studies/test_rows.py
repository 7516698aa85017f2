"""Rows on disk: whole lines or none, the last of a key counts, nobody else's file is touched."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.studies.rows import RowStore

SCORE = {"kind": "score", "key": "a", "status": "ok"}


@contextmanager
def opened(folder: Path) -> Iterator[RowStore]:
    store = RowStore(folder)
    try:
        yield store
    finally:
        store.close()


def test_a_record_is_on_disk_when_append_returns(tmp_path: Path) -> None:
    with opened(tmp_path / "deep" / "run") as store:
        store.append(SCORE)
        assert json.loads(store.file.read_text()) == {"schema": 1, **SCORE}


def test_the_last_record_of_a_key_and_kind_counts(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        store.append(SCORE | {"status": "failed: once"})
        store.append(SCORE)
        store.append({"kind": "time", "key": "a", "n": 3})
    with opened(tmp_path) as store:
        assert store.scores["a"]["status"] == "ok"
        assert store.times["a"]["n"] == 3
        assert len(store.file.read_text().splitlines()) == 3


@pytest.mark.parametrize("kept", [1, 5, 12, 20, -1])
def test_a_torn_last_line_is_forgotten(tmp_path: Path, kept: int) -> None:
    with opened(tmp_path) as store:
        store.append(SCORE)
        store.append(SCORE | {"key": "b"})
    whole = store.file.read_bytes()
    first = whole.index(b"\n") + 1
    store.file.write_bytes(whole[: first + kept] if kept > 0 else whole[:kept])
    with opened(tmp_path) as store:
        assert list(store.scores) == ["a"]
        store.append(SCORE | {"key": "c"})
    with opened(tmp_path) as store:
        assert list(store.scores) == ["a", "c"]


@pytest.mark.parametrize(
    "foreign",
    [
        "a,b\n1,2\n",
        "no newline at all",
        '{"schema": 2, "kind": "score", "key": "a"}\n',
        '{"schema": 1, "kind": "opinion", "key": "a"}\n',
        '{"schema": 1, "kind": "score", "key": ["a"]}\n',
        '{"schema": 1, "kind": "score"}\n',
        "[]\n",
        "\n",
        '{"schema": 1, "kind": "score", "key": "a", "status": "ok"}\nnotes of mine',
    ],
)
def test_a_foreign_file_is_refused_and_left_alone(tmp_path: Path, foreign: str) -> None:
    file = tmp_path / "rows.jsonl"
    file.write_text(foreign)
    with pytest.raises(InputError, match=r"rows\.jsonl line \d"):
        RowStore(tmp_path)
    assert file.read_text() == foreign


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "run" / "rows.jsonl").mkdir(parents=True)
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "run"):
        with pytest.raises(InputError, match="cannot be written") as error:
            RowStore(folder)
        assert str(folder) in str(error.value)
        assert "\n" not in str(error.value)


def test_a_number_that_json_lacks_is_never_written(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        with pytest.raises(ValueError, match="JSON"):
            store.append(SCORE | {"metrics": {"iou": float("nan")}})
        assert store.file.read_text() == ""


def test_a_folder_that_another_run_writes_into_is_refused(tmp_path: Path) -> None:
    first = RowStore(tmp_path)
    with pytest.raises(InputError, match="another run writes into it"):
        RowStore(tmp_path)
    first.close()
    RowStore(tmp_path).close()
    assert [file.name for file in tmp_path.iterdir()] == ["rows.jsonl"]


def test_a_lock_that_a_killed_run_left_behind_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / "writing.lock").write_text("")
    RowStore(tmp_path).close()
