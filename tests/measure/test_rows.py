"""The row store: complete lines or none, the last row of a key counts, and other programs' files are not touched."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.rows import stream_rows
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of

SCORE = {
    "kind": "score", "key": key_of("a"), "scene": "s", "view": "camera", "light": "sun", "phase": 0,
    "technique": "unshadowed", "spec": "unshadowed", "full_spec": "unshadowed", "map_size": None, "view_size": 16,
    "coordinates": "relative", "renderer": "r", "status": "ok", "metrics": dict.fromkeys(METRICS, 0.5), "receivers": 9,
    "undecided": 1, "gpu_bytes": 100, "work": {"draws": 1}, "facts": {}, "assumptions": [],
}  # fmt: skip
TIME = {
    "kind": "time", "key": key_of("a"), "machine": "m", "clock": "wall", "n": 3, "frame_ms": 1.0, "passes": {},
    "reference": "shadow-map", "ratio": 2.0, "ratio_iqr": 0.1,
}  # fmt: skip
POINT = {"axis": "elevation", "axis_value": 5.0, "axis_unit": "°", "light_kind": "directional", "home_spec": "half"}
FAILED = {name: value for name, value in SCORE.items() if name not in ("metrics", "receivers", "gpu_bytes", "work")}


@contextmanager
def opened(folder: Path, sweep: bool = False) -> Iterator[RowStore]:
    store = RowStore(folder, sweep)
    try:
        yield store
    finally:
        store.close()


def test_a_record_is_on_disk_when_append_returns_with_the_command_that_made_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["/bin/shadowbench", "run", "a scene"])
    with opened(tmp_path / "deep" / "run") as store:
        store.append(SCORE)
        assert json.loads(store.file.read_text()) == {"schema": 1, **SCORE, "command": "shadowbench run 'a scene'"}


def test_the_last_record_of_a_key_and_kind_counts(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        store.append(FAILED | {"status": "failed: once"})
        store.append(SCORE)
        store.append(TIME)
    with opened(tmp_path) as store:
        assert store.scores[key_of("a")]["status"] == "ok"
        assert store.time_on("m", key_of("a"))["n"] == 3
        assert len(store.file.read_text().splitlines()) == 3


@pytest.mark.parametrize("kept", [1, 5, 12, 20, -1])
def test_an_incomplete_last_line_is_dropped(tmp_path: Path, kept: int) -> None:
    a, b, c = map(key_of, "abc")
    with opened(tmp_path) as store:
        store.append(SCORE)
        store.append(SCORE | {"key": b})
    whole = store.file.read_bytes()
    first = whole.index(b"\n") + 1
    store.file.write_bytes(whole[: first + kept] if kept > 0 else whole[:kept])
    with opened(tmp_path) as store:
        assert list(store.scores) == [a]
        store.append(SCORE | {"key": c})
    with opened(tmp_path) as store:
        assert list(store.scores) == [a, c]


@pytest.mark.parametrize(
    "foreign",
    [
        "a,b\n1,2\n",
        "no newline at all",
        json.dumps({"schema": 2, **SCORE}) + "\n",
        json.dumps({"schema": 1, **SCORE, "kind": "opinion"}) + "\n",
        json.dumps({"schema": 1, **SCORE, "key": ["a"]}) + "\n",
        '{"schema": 1, "kind": "score"}\n',
        "[]\n",
        "\n",
        json.dumps({"schema": 1, **SCORE}) + "\nnotes of mine",
    ],
)
def test_a_foreign_file_is_refused_and_left_alone(tmp_path: Path, foreign: str) -> None:
    file = tmp_path / "rows.jsonl"
    file.write_text(foreign)
    with pytest.raises(InputError, match=r"rows\.jsonl line \d"):
        RowStore(tmp_path)
    assert file.read_text() == foreign


@pytest.mark.parametrize("sweep", [False, True])
def test_a_folder_of_the_other_command_is_refused(tmp_path: Path, sweep: bool) -> None:
    with opened(tmp_path, sweep) as store:
        store.append(SCORE | (POINT if sweep else {}))
    before = store.file.read_bytes()
    named = "stress" if sweep else "run"
    with pytest.raises(InputError, match=f"found cells of `{named}`; allowed: "):
        RowStore(tmp_path, not sweep)
    assert store.file.read_bytes() == before


def test_fields_of_newer_versions_are_kept_in_rows(tmp_path: Path) -> None:
    newer: dict[str, Any] = {"luck": {"of": [1, 2.5, None, "seven"]}, "passes": {"depth": {"ms": 1.0, "mood": "good"}}}
    with opened(tmp_path) as store:
        store.append(SCORE | {"metrics": SCORE["metrics"] | {"novel": 0.25}, **newer})  # type: ignore[operator]
        store.append(TIME | newer)
    (score, _), (time, end) = stream_rows(store.file)
    assert score["luck"] == time["luck"] == newer["luck"] and time["passes"] == newer["passes"]
    assert score["metrics"]["novel"] == 0.25 and end == store.file.stat().st_size


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "run" / "rows.jsonl").mkdir(parents=True)
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "run"):
        with pytest.raises(InputError, match=r"cannot be written|is not a file") as error:
            RowStore(folder)
        assert str(folder) in str(error.value)
        assert "\n" not in str(error.value)


def test_a_name_that_is_no_utf8_is_written_as_what_can_be_read(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        store.append(SCORE | {"assumptions": ["b\udcff.obj: Größe"]})
    with opened(tmp_path) as store:
        assert store.scores[key_of("a")]["assumptions"] == ["b?.obj: Größe"]


def test_a_number_that_json_lacks_is_never_written(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        with pytest.raises(ValueError, match="JSON"):
            store.append(SCORE | {"metrics": {"iou": float("nan")}})
        assert store.file.read_text() == ""


FILL = """
import resource, sys
from pathlib import Path
from shadowbench.errors import InputError
from shadowbench.measure.row_store import RowStore
from tests.conftest import key_of
from tests.measure.test_rows import SCORE

resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
store = RowStore(Path(sys.argv[1]))
for number in range(100):
    try:
        store.append(SCORE | {"key": key_of(number)})
    except InputError as error:
        print(number, list(store.scores) == [key_of(one) for one in range(number)], error)
        break
store.close()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_a_full_disk_is_one_line_and_leaves_complete_rows(tmp_path: Path) -> None:
    said = subprocess.run([sys.executable, "-c", FILL, tmp_path], capture_output=True, text=True, check=True)
    count, kept, message = said.stdout.strip().split(" ", 2)
    assert said.stderr == "" and kept == "True"
    assert message == f"{tmp_path / 'rows.jsonl'}: cannot be written (file too large)"
    assert (tmp_path / "rows.jsonl").read_bytes().endswith(b"\n")
    rows = [row for row, _ in stream_rows(tmp_path / "rows.jsonl")]
    assert [row["key"] for row in rows] == [key_of(number) for number in range(int(count))] and rows
    with opened(tmp_path) as store:  # there is room again
        store.append(SCORE | {"key": key_of("more")})
        assert len(store.scores) == int(count) + 1


def test_a_folder_that_another_run_writes_into_is_refused(tmp_path: Path) -> None:
    first = RowStore(tmp_path)
    with pytest.raises(InputError, match="another run writes into it"):
        RowStore(tmp_path)
    first.close()
    RowStore(tmp_path).close()
    assert [file.name for file in tmp_path.iterdir()] == ["rows.jsonl"]


def test_the_lock_of_a_killed_run_does_not_block_the_next(tmp_path: Path) -> None:
    (tmp_path / "writing.lock").write_text("")
    RowStore(tmp_path).close()


@pytest.mark.skipif(sys.platform == "win32", reason="an open file cannot be removed there")
def test_a_process_that_opened_a_lock_before_its_release_does_not_write_with_the_next_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, holders = RowStore(tmp_path), []
    import fcntl

    lock = fcntl.flock

    def late(file: Any, operation: int) -> None:
        """Delays the second process's lock until the first has released the file and a third has locked a new one."""
        monkeypatch.setattr(fcntl, "flock", lock)
        first.close()
        holders.append(RowStore(tmp_path))
        lock(file, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(InputError, match="another run writes into it"):
        RowStore(tmp_path)
    (third,) = holders
    third.append(SCORE)
    third.close()
    RowStore(tmp_path).close()


def test_images_that_a_killed_run_left_half_written_are_removed_by_the_next(tmp_path: Path) -> None:
    kept = ["masks/key.png", "masks/.mine.png", ".report.0123456789ab.html"]
    for name in [
        *kept,
        "masks/.key.0123456789ab.png",
        "truth/.key.0123456789ab.png",
        "differences/.a.camera.sun.64.0123456789ab.png",
    ]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with opened(tmp_path):
        (tmp_path / "pictures").mkdir()
        (tmp_path / "pictures" / ".key.0123456789ab.png").touch()
        with pytest.raises(InputError, match="another run writes"):
            RowStore(tmp_path)
    left = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*") if file.is_file()}
    assert left == {*kept, "rows.jsonl", "pictures/.key.0123456789ab.png"}, "those of a run that goes on are its own"
