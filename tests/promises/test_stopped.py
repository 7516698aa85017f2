"""Runs that are killed or interrupted: the next one goes on, measures nothing twice, and no process is left behind."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import Record, gone, study_text, unsigned

Records = Callable[..., list[Record]]

GATE = "does:what=gate"
LATE_GATE = "does:what=gate,after=2"  # drawn to be scored and to warm up, so it waits when it is timed
OTHERS = ["unshadowed", "shadow-map:size=64", "half"]
STOPPED = "shadowbench: stopped; repeat the command to resume"

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")]


@pytest.fixture
def arguments(tmp_path: Path, half: Path, wild: Path) -> Callable[..., list[str | Path]]:
    """Arguments of a run with a technique that waits until a file exists, behind the first of others."""

    def make(gate: str = LATE_GATE, folder: str = "out") -> list[str | Path]:
        flags = [word for spec in (OTHERS[0], gate, *OTHERS[1:]) for word in ("-t", spec)]
        plugins = ["--plugin", half, "--plugin", wild]
        return [
            "run", "cube-on-plane", *flags, *plugins, "--view-size", "64", "--rounds", "2", "-o", tmp_path / folder,
        ]  # fmt: skip

    return make


def test_while_a_run_goes_on_its_rows_are_on_disk_and_no_other_writes_into_its_folder(
    start: Any, shadowbench: Any, arguments: Any, records: Records, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed, it resumes; what it left half-written is removed, but not while it may still be written."""
    out = tmp_path / "out"
    for name in ("masks", "truth", "pictures", "differences"):
        (out / name).mkdir(parents=True)
        (out / name / ".a.0123456789ab.png").touch()
        (out / name / ".mine.png").touch()
    (out / "rows.jsonl").touch()
    killed = start(*arguments(), GATE=tmp_path / "shut")
    killed.until(lambda: len(records(out)) == 4)
    images = {file.stem for file in (out / "masks").glob("[!.]*")}
    assert images == {record["key"] for record in records(out)}, "a row promises its images"
    assert sorted(file.name for file in out.rglob(".*")) == [".mine.png"] * 4
    (out / "masks" / ".b.0123456789ab.png").touch()
    for command in (arguments(), ["recommend", "stairs", "-o", out]):
        answer = shadowbench(*command)
        assert (answer.code, answer.err) == (
            2, f"shadowbench: {out}: another run writes into it; wait for it, or choose another with -o\n",
        )  # fmt: skip
    assert (out / "masks" / ".b.0123456789ab.png").exists()
    family = killed.family()
    killed.process.kill()
    killed.end()
    assert family and gone(family)
    before = (out / "rows.jsonl").read_text()
    with (out / "rows.jsonl").open("a") as stream:
        stream.write('{"schema": 1, "kin')
    monkeypatch.setenv("GATE", str(tmp_path))
    for folder in ("out", "whole"):
        assert shadowbench(*arguments(folder=folder)).code == 0
    assert (out / "rows.jsonl").read_text().startswith(before)
    assert unsigned(records(out, "score")) == unsigned(records(tmp_path / "whole", "score"))
    assert len({(record["kind"], record["key"]) for record in records(out)}) == len(records(out)) == 8
    assert sorted(file.name for file in out.rglob(".*")) == [".mine.png"] * 4


def test_a_worker_deep_in_c_does_not_outlive_its_run(
    start: Any, arguments: Any, records: Records, tmp_path: Path
) -> None:
    killed = start(*arguments("does:what=hold"))
    killed.until(lambda: len(records(tmp_path / "out")) == 1)
    family = killed.family()
    killed.process.kill()
    killed.end()
    assert family and gone(family)


@pytest.mark.parametrize(
    ("gate", "sent"), [(GATE, signal.SIGINT), (LATE_GATE, signal.SIGINT), (LATE_GATE, signal.SIGTERM)]
)
def test_a_run_stops_without_a_word_too_many(
    start: Any, shadowbench: Any, arguments: Any, records: Records, tmp_path: Path, gate: str, sent: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    out, rows = tmp_path / "out", 1 if gate == GATE else 4
    warnings = "always::ResourceWarning"  # no process is left to the garbage collector
    stopped = start(*arguments(gate), GATE=tmp_path / "shut", PYTHONWARNINGS=warnings)
    stopped.until(lambda: len(records(out)) == rows)
    family = stopped.family()
    if sent == signal.SIGINT:
        os.killpg(stopped.process.pid, sent)
    else:
        stopped.process.send_signal(sent)
    code, printed, err = stopped.end()
    if sent == signal.SIGINT:
        assert (code, printed, err) == (130, "", f"{STOPPED}\n")
    else:
        assert code == -sent and printed == "" and "Traceback" not in err
    assert family and gone(family)
    assert len(records(out)) == rows
    monkeypatch.setenv("GATE", str(tmp_path))
    assert shadowbench(*arguments(gate), "--json").code == 0
    assert len(records(out)) == 8


def test_a_full_disk_is_one_line_and_leaves_complete_rows(tmp_path: Path, shadowbench: Any, records: Records) -> None:
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(study_text(*(f"shadow-map:size={size}" for size in range(16, 32)), view_size=16, rounds=0))
    assert shadowbench("run", "-s", file, "-o", tmp_path / "whole", "-q").code == 0  # keeps the truth, which is larger
    command = f"ulimit -f 8; exec '{sys.executable}' -m shadowbench run -s '{file}' -o '{out}' -q"
    full = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    line = f"shadowbench: {out / 'rows.jsonl'}: cannot be written (file too large)\n"
    assert (full.returncode, full.stdout, full.stderr) == (2, "", line)
    before = (out / "rows.jsonl").read_bytes()
    assert before.endswith(b"\n") and 1 < len(records(out)) < 16
    assert shadowbench("run", "-s", file, "-o", out, "-q").code == 0  # there is room again
    assert (out / "rows.jsonl").read_bytes().startswith(before)
    assert unsigned(records(out)) == unsigned(records(tmp_path / "whole"))


def test_a_run_of_a_sequence_that_is_killed_between_two_frames_goes_on_with_that_cell(
    start: Any, shadowbench: Any, arguments: Any, records: Records, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sequence(folder: str) -> list[str | Path]:
        return [*arguments(folder=folder), "--sequence", "pan", "--frames", "4", "--rounds", "0"]

    out = tmp_path / "out"
    killed = start(*sequence("out"), GATE=tmp_path / "shut")  # which opens for the third frame of the second cell
    killed.until(lambda: len(records(out)) == 1)
    killed.process.kill()
    killed.end()
    before = (out / "rows.jsonl").read_text()
    monkeypatch.setenv("GATE", str(tmp_path))
    for folder in ("out", "whole"):
        assert shadowbench(*sequence(folder)).code == 0
    assert (out / "rows.jsonl").read_text().startswith(before)
    resumed, whole = records(out, "score"), records(tmp_path / "whole", "score")
    assert unsigned(resumed) == unsigned(whole) and len({row["key"] for row in resumed}) == len(resumed) == 4
    assert {row["frames"] for row in resumed} == {4}
    for row in resumed:
        for name in (f"{row['key']}.png", f"{row['key']}.frames.png"):
            assert (out / "masks" / name).read_bytes() == (tmp_path / "whole" / "masks" / name).read_bytes()
