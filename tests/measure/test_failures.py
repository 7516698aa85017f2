"""Plug-ins that crash, hang, exhaust memory, raise or return invalid masks: only their own cells fail."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.studies.tables import cells_frame, slopes, summary

Records = Callable[..., list[dict[str, Any]]]

HEAD = """
scenes = ["cube-on-plane"]
view_size = 64
rounds = 1
memory_limit = 1
reference = "unshadowed"
"""
HANGS = HEAD + "time_limit = 5\n"  # what does not hang may take its time
EXPECTED = {
    "abort": "failed: crashed: SIGABRT",
    "segv": "failed: crashed: SIGSEGV",
    "exit": "failed: crashed: the worker ended with code 0",
    "hang": "failed: hung: no answer within 5 s",
    "eat": "failed: ate memory",
    "raise": "failed: ZeroDivisionError: as planned (wild.py:",
    "raise-wordless": "failed: WordlessError: (no message) (wild.py:",
    "nan": "failed: ValueError: does:level=0.5,what=nan,after=0 drew visibility is NaN",
    "bright": "outside [0, 1]",
    "small": "failed: ValueError: does:level=0.5,what=small,after=0 drew 8 × 8 pixels",
    "none": "failed: TypeError: does:level=0.5,what=none,after=0 drew str",
    "gl-error": "failed: RuntimeError: OpenGL error",
    "odd-facts": "failed: ValueError: does:level=0.5,what=odd-facts,after=0: fact 'odd' is nan",
    "print": "ok",
    "litter": "ok",
}


def spec(text: str) -> str:
    return f'[[technique]]\nspec = "{text}"\n'


@pytest.fixture(scope="module")
def study_text() -> str:
    """A study of every kind of misbehaviour between two correct techniques."""
    misdeeds = "".join(spec(f"does:what={what}") for what in EXPECTED if what != "hang")
    return HEAD + spec("shadow-map:size=64") + misdeeds + spec("half") + spec("shadow-map:size=128")


@pytest.fixture(scope="module")
def survivors(bench: Any, study_text: str, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The table of cells of that study, including hanging ones."""
    folder = tmp_path_factory.mktemp("failures")
    texts = [study_text, HANGS + spec("does:what=hang")]
    results = [result for text in texts for result in bench.run(bench.study(folder, text), folder / "out")]
    return cells_frame(results).set_index("spec", drop=False)


@pytest.mark.parametrize("what", EXPECTED)
def test_a_misbehaving_plug_in_is_the_status_of_its_cell(survivors: Any, what: str) -> None:
    name = "does" if what == "nothing" else f"does:what={what}"
    assert EXPECTED[what] in survivors.loc[name, "status"]
    assert (survivors.loc[name, "status"] == "ok") == (what in ("print", "litter"))
    assert "\n" not in survivors.loc[name, "status"]


def test_all_other_techniques_keep_their_scores(bench: Any, survivors: Any, tmp_path: Path) -> None:
    alone = HEAD + spec("shadow-map:size=64") + spec("half") + spec("shadow-map:size=128")
    frame = cells_frame(bench.run(bench.study(tmp_path, alone), tmp_path / "out"))
    keys = frame["key"].tolist()
    beside = survivors[survivors["key"].isin(keys)]
    assert len(beside) == 3
    assert beside["status"].tolist() == ["ok"] * 3
    for column in ("key", "mask_sha256", "iou", "ssim", "work_fragments", "gpu_bytes"):
        assert beside[column].tolist() == frame[column].tolist()
    assert beside["frame_ms"].notna().all()


def test_failed_cells_have_no_numbers_and_the_table_is_still_printed(survivors: Any) -> None:
    failed = survivors[survivors["status"].str.startswith("failed")]
    assert len(failed) == len(EXPECTED) - 2
    assert failed["iou"].isna().all()
    assert failed["frame_ms"].isna().all()
    rows = summary(survivors.reset_index(drop=True))["cube-on-plane"]
    assert [row.cells > 0 for row in rows] == sorted((row.cells > 0 for row in rows), reverse=True)
    assert len(slopes(survivors.reset_index(drop=True))) == 1


def test_a_failed_cell_is_tried_again_and_no_other(bench: Any, tmp_path: Path, records: Records) -> None:
    study = bench.study(tmp_path, HEAD + spec("half") + spec("does:what=raise"))
    bench.run(study, tmp_path / "out")
    bench.run(study, tmp_path / "out")
    assert bench.calls.count("release_timed") == 0
    statuses = [record["status"].partition(":")[0] for record in records(tmp_path / "out", "score")]
    assert statuses == ["ok", "failed", "failed"]


@pytest.mark.parametrize(
    ("what", "status"),
    [
        ("abort", "failed: while timed: crashed: SIGABRT"),
        ("raise", "failed: while timed: ZeroDivisionError: as planned (wild.py:"),
        ("gl-error", "failed: while timed: RuntimeError: OpenGL error"),
        ("hang", "failed: while timed: hung: no answer within 5 s"),
    ],
)
def test_misbehaviour_during_timing_costs_only_that_time(
    bench: Any, tmp_path: Path, records: Records, what: str, status: str
) -> None:
    head = HANGS if what == "hang" else HEAD
    text = head + spec("half") + spec(f"does:what={what},after=2") + spec("shadow-map:size=64")
    study = bench.study(tmp_path, text)
    frame = cells_frame(bench.run(study, tmp_path / "out"))
    assert frame["status"].tolist()[::2] == ["ok", "ok"]
    assert frame["status"][1].startswith(status)
    assert frame["frame_ms"].notna().tolist() == [True, False, True]
    assert frame["iou"].notna().all()
    assert [record["status"] for record in records(tmp_path / "out", "score")] == ["ok"] * 3
    assert len(records(tmp_path / "out", "time")) == 2
    again = bench.run(study, tmp_path / "out")
    assert bench.calls.count("release_timed") == 1
    assert len(records(tmp_path / "out", "score")) == 3
    assert [result.status.partition(":")[0] for result in again] == ["ok", "failed", "ok"]


def test_a_reference_that_crashes_costs_ratios_only(bench: Any, tmp_path: Path) -> None:
    text = HEAD.replace('"unshadowed"', '"does:what=abort"') + spec("half") + spec("shadow-map:size=64")
    frame = cells_frame(bench.run(bench.study(tmp_path, text), tmp_path / "out"))
    assert frame["status"].tolist() == ["ok", "ok"]
    assert frame["frame_ms"].notna().all()
    assert frame["ratio"].isna().all()
    assert sum("no ratios to this reference: crashed: SIGABRT" in note for note in bench.notebook.notes) == 1
