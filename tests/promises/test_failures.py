"""Plug-ins that crash, hang, exhaust memory, raise, print or return invalid masks: only their own cells fail."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import Study, by_spec, environment, finished, gone, marked, study_text

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals and process groups")]

LATE = "while timed: "
EXPECTED = {
    "leave-processes-and-abort": "failed: crashed: SIGABRT",
    "leave-processes-and-eat": "failed: ate memory",
    "gate": "ok",
    "exit": "failed: crashed: the worker ended with code 0",
    "raise": "failed: ZeroDivisionError: as planned (wild.py:",
    "nan": "failed: ValueError: does:level=0.5,what=nan,after=0 drew visibility is NaN",
    "bright": "outside [0, 1]",
    "small": "failed: ValueError: does:level=0.5,what=small,after=0 drew 8 × 8 pixels",
    "gl-error": "failed: RuntimeError: OpenGL error",
    "decline": "unsupported: reasons reasons",
    "print": "ok",
    "print-foreign": "ok",
    "litter": "ok",
    "abort,after=2": "failed: while timed: crashed: SIGABRT",
}
HANGS = {
    "what=leave-processes-and-hang": "failed: hung: no answer within 5 s",
    "what=hang,after=2": "failed: while timed: hung: no answer within 5 s",
    "what=print-much": "ok",
    "level=0.25,what=print-much": "ok",
    "what=leave-processes": "ok",
}
GOOD = ("shadow-map:size=64", "half", "shadow-map:size=128")


class Survived:
    """A run of misdeeds among good techniques: what it printed, its table, and processes left while it went on."""

    def __init__(self, start: Any, records: Any, folder: Path, plugins: list[str | Path]) -> None:
        self.out = folder / "out"
        (folder / "study.toml").write_text(
            study_text(GOOD[0], *(f"does:what={what}" for what in EXPECTED), *GOOD[1:]), encoding="utf-8"
        )
        run = start(
            "run", "-s", folder / "study.toml", *plugins, "-o", self.out,
            PIDS=folder / "pids", GATE=folder / "gate", PYTHONIOENCODING="ascii",
        )  # fmt: skip
        run.until(lambda: len(records(self.out)) == 3)
        alive = marked("PIDS", folder / "pids")
        # Asked afterwards: a worker that starts meanwhile is of the family, and waits at the gate.
        family = {process.pid for process in (*run.family(), run.process)}
        self.all_ended = gone([process for process in alive if process.pid not in family])
        (folder / "gate").touch()
        self.code, self.printed, self.err = run.end()
        self.lines = by_spec(self.out)

    def line(self, what: str) -> dict[str, str]:
        return self.lines[f"does:what={what}"]


@pytest.fixture(scope="module")
def plugins(half: Path, wild: Path) -> list[str | Path]:
    return ["--plugin", half, "--plugin", wild]


@pytest.fixture(scope="module")
def survived(start_any: Any, records: Any, plugins: list[str | Path], tmp_path_factory: Any) -> Survived:
    return Survived(start_any, records, tmp_path_factory.mktemp("failures"), plugins)


def test_a_misbehaving_plug_in_is_the_status_of_its_cell(survived: Survived) -> None:
    statuses = {what: survived.line(what)["status"] for what in EXPECTED}
    assert [what for what, words in EXPECTED.items() if words not in statuses[what]] == []
    assert [what for what, words in EXPECTED.items() if (words == "ok") != (statuses[what] == "ok")] == []


def test_failed_cells_have_no_numbers_and_the_table_is_still_printed(survived: Survived) -> None:
    for what, status in EXPECTED.items():
        line = survived.line(what)
        assert bool(line["iou"]) == (status == "ok" or LATE in status)
        assert bool(line["frame_ms"]) == (status == "ok")
    assert survived.code == 3
    assert survived.printed.startswith("cube-on-plane, best first")


def test_all_other_techniques_keep_their_scores(survived: Survived, study: Study, plugins: list[Path]) -> None:
    study.plugins = (plugins[1],)
    assert study.run(study_text(*GOOD)).code == 0
    for spec, alone in by_spec(study.folder).items():
        beside = survived.lines[spec]
        assert beside["status"] == "ok" and beside["frame_ms"]
        for column in ("key", "mask_sha256", "iou", "ssim", "work_fragments", "gpu_bytes"):
            assert beside[column] == alone[column]


def test_processes_that_a_plug_in_started_end_with_its_worker_while_the_run_goes_on(survived: Survived) -> None:
    assert survived.all_ended


def test_what_plug_ins_print_goes_to_stderr_also_before_a_crash_and_in_any_encoding(survived: Survived) -> None:
    assert "loud\nlouder\n" in survived.err and "≥ 影\n" in survived.err
    assert "loud" not in survived.printed


def test_what_hangs_costs_its_own_cell(tmp_path: Path, plugins: list[str | Path]) -> None:
    file, out, pids = (tmp_path / name for name in ("study.toml", "out", "pids"))
    file.write_text(study_text(*(f"does:{what}" for what in HANGS), "half", time_limit=5))
    run = finished("run", "-s", file, *plugins, "-o", out, "--json", env=environment(PIDS=pids))
    lines = by_spec(out)
    statuses = {what: lines[f"does:{what}"]["status"] for what in HANGS}
    assert statuses == HANGS and lines["half"]["status"] == "ok" and lines["half"]["frame_ms"]
    assert run.returncode == 3 and pids.exists()
    assert gone(marked("PIDS", pids)), "of the plug-in, whether its worker hung or ended with the run"


def test_processes_of_a_plug_in_end_when_the_whole_run_is_killed(
    start: Callable[..., Any], records: Any, tmp_path: Path, plugins: list[str | Path]
) -> None:
    pids = tmp_path / "pids"
    specs = ("-t", "does:what=leave-processes", "-t", "does:what=hang")
    run = start("run", "cube-on-plane", *specs, *plugins, "--view-size", "16", "-o", tmp_path / "out", PIDS=pids)
    run.until(lambda: len(records(tmp_path / "out")) == 1)
    assert len(marked("PIDS", pids)) >= 5, "the run, its worker, and what the plug-in started"
    run.process.kill()
    run.process.communicate()
    assert gone(marked("PIDS", pids))


def test_no_cell_fails_for_the_memory_that_others_took(study: Study, wild: Path, tmp_path: Path) -> None:
    """Whether they wait to be timed, are timed with it, or have left it behind."""
    study.plugins = (Path(shutil.copy(wild, tmp_path)),)
    specs = ("does:what=leak-memory", "does:what=leak-memory,level=0.25")
    assert study.added(study_text(*specs, rounds=2)) == (2, 2)
    assert [(line["status"], bool(line["ratio"])) for line in by_spec(study.folder).values()] == [("ok", True)] * 2
