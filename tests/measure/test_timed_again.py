"""Repeated timing: after changed rounds, reference or machine, for missing ratios, and after a worker is lost."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shadowbench.measure.executor import CellFailed
from shadowbench.measure.machine import machine_key
from shadowbench.measure.session import Session
from shadowbench.studies.tables import cells_frame
from shadowbench.techniques.shadow_map import ShadowMap
from tests.runs import SMALL

Records = Callable[..., list[dict[str, Any]]]
Added = Callable[[str], tuple[int, int]]

HALVES = SMALL.replace('"shadow-map:size=64"', '"half"').replace('reference = "unshadowed"', 'reference = "REFERENCE"')


@pytest.fixture
def added(bench: Any, tmp_path: Path, records: Records) -> Added:
    """Runs a study into one folder; returns the score and time records added."""
    folder = tmp_path / "out"

    def run(text: str) -> tuple[int, int]:
        before = len(records(folder, "score")), len(records(folder, "time"))
        bench.run(bench.study(tmp_path / "files", text), folder)
        return len(records(folder, "score")) - before[0], len(records(folder, "time")) - before[1]

    return run


def test_more_rounds_or_another_reference_time_again_and_fewer_do_not(
    added: Added, tmp_path: Path, records: Records
) -> None:
    assert added(SMALL.replace("rounds = 1", "rounds = 2")) == (2, 2)
    assert added(SMALL) == (0, 0)
    assert added(SMALL.replace("rounds = 1", "rounds = 3")) == (0, 2)
    other = SMALL.replace('reference = "unshadowed"', 'reference = "shadow-map:size=32"')
    assert added(other) == (0, 2)
    assert {record["reference"] for record in records(tmp_path / "out", "time")[-2:]} == {"shadow-map:size=32"}


def test_a_reference_whose_default_changed_times_again(
    added: Added, tmp_path: Path, changed_default: Any, records: Records
) -> None:
    text = HALVES.replace("REFERENCE", "shadow-map:size=32")
    assert added(text) == (2, 2)
    with changed_default(ShadowMap, "wrap", "edge"):
        assert added(text) == (0, 2)
        assert added(text) == (0, 0)
    found = records(tmp_path / "out", "time")
    assert len({record["reference"] for record in found}) == 1
    assert [record["reference_key"] == found[0]["reference_key"] for record in found] == [True, True, False, False]


def test_a_reference_s_key_is_that_of_its_own_row(added: Added, tmp_path: Path, records: Records) -> None:
    added(SMALL)
    keys = {record["spec"]: record["key"] for record in records(tmp_path / "out", "score")}
    assert [record["reference_key"] for record in records(tmp_path / "out", "time")] == [keys["unshadowed"]] * 2


def test_another_machine_times_again_and_scores_nothing_again(
    added: Added, bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, records: Records
) -> None:
    assert added(SMALL) == (2, 2)
    monkeypatch.setattr("shadowbench.measure.machine.machine", lambda: {"processor": "another"})
    untimed = SMALL.replace("rounds = 1", "rounds = 0")
    foreign = cells_frame(bench.run(bench.study(tmp_path / "files", untimed), tmp_path / "out"))
    assert foreign["iou"].notna().all()
    assert foreign["frame_ms"].isna().all()
    assert added(SMALL) == (0, 2)
    assert added(SMALL) == (0, 0)
    here, there = ({record["machine"] for record in records(tmp_path / "out", "time")[at : at + 2]} for at in (0, 2))
    assert len(here) == len(there) == 1
    assert here != there


def test_a_machine_s_key_has_its_renderer_and_its_clock(bench: Any) -> None:
    info = bench.worker.info
    others = [info, replace(info, renderer="another"), replace(info, clock="another"), replace(info, subpixel_bits=99)]
    machine = bench.worker.machine
    assert len({machine_key(SimpleNamespace(info=other, machine=machine)) for other in others}) == 3


def test_cells_without_a_ratio_are_timed_again_once_the_reference_succeeds(
    added: Added, bench: Any, wild: Path, tmp_path: Path, records: Records
) -> None:
    text = HALVES.replace("REFERENCE", "does:what=lack")
    needed = wild.parent / "needed"
    assert added(text) == (2, 2)
    for record in records(tmp_path / "out", "time"):
        assert record["ratio"] is None
        assert record["no_ratio"].startswith("failed: FileNotFoundError")
    assert added(text) == (0, 0)
    assert "prepare_timing" not in bench.calls
    try:
        needed.touch()
        assert added(text) == (0, 2)
        assert added(text) == (0, 0)
        assert bench.calls == []
    finally:
        needed.unlink()
    assert all(record["ratio"] > 0 for record in records(tmp_path / "out", "time")[2:])


@pytest.mark.parametrize("lost", ["the view", "the floor"])
def test_a_worker_that_dies_while_it_times_costs_times_only(
    bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    call = bench.worker.call

    def dying(method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        if lost == "the view" and method is Session.open:
            raise CellFailed("crashed: SIGKILL")
        if lost == "the floor" and method is Session.prepare_timing and arguments[1].spec == "unshadowed":
            raise CellFailed("crashed: SIGKILL")
        return call(method, *arguments, **options)

    monkeypatch.setattr(bench.worker, "call", dying)
    text = HALVES.replace("REFERENCE", "half").replace("unshadowed", "shadow-map:size=64")
    study = bench.study(tmp_path / "files", text)
    frame = cells_frame(bench.run(study, tmp_path / "out"))
    assert frame["status"].str.startswith("failed: while timed: ").tolist() == [True, True]
    assert ["crashed: SIGKILL" in status and lost in status for status in frame["status"]] == [True, True]
    assert frame["mae"].notna().all()
    monkeypatch.undo()
    again = cells_frame(bench.run(study, tmp_path / "out"))
    assert again["status"].tolist() == ["ok", "ok"]
    assert bench.calls.count("draw") == 0
