"""A repeated command measures what is missing, what changed, and nothing else; rows are the same whenever made."""

from pathlib import Path

import pytest

from tests.promises.conftest import Study, by_spec, study_text, table, unsigned

SMALL = study_text("unshadowed", "shadow-map:size=64")
TWO_SCENES = study_text(
    "unshadowed", "shadow-map", scenes=["cube-on-plane", "room-with-lamp"], map_size=[64, 128], rounds=2, phases=2
)


def replaced(old: str, new: str) -> str:
    assert old in SMALL
    return SMALL.replace(old, new)


def test_a_second_call_measures_nothing_and_another_folder_has_the_same_rows(study: Study, tmp_path: Path) -> None:
    first = study.run(TWO_SCENES)
    assert (first.code, len(study.rows("score")), len(study.rows("time"))) == (0, 10, 4)
    kept = {file: file.read_bytes() for file in study.folder.rglob("*") if file.is_file() and file.name != "run.json"}
    again = study.run(TWO_SCENES)
    assert again.out == first.out
    assert all(file.read_bytes() == data for file, data in kept.items())
    other = Study(study.shadowbench, study.records, tmp_path / "other")
    assert other.run(TWO_SCENES).code == 0
    assert unsigned(other.rows("score")) == unsigned(study.rows("score"))
    for kind in ("masks", "pictures", "truth"):
        images = sorted((study.folder / kind).iterdir())
        assert images
        for image in images:
            assert (other.folder / kind / image.name).read_bytes() == image.read_bytes()


def test_only_what_changed_is_measured(study: Study) -> None:
    assert study.added(SMALL) == (2, 2)
    assert study.added(replaced("size=64", "size=64,filter=hard")) == (1, 1)
    assert study.added(SMALL) == (0, 0)
    assert study.added(replaced("view_size = 64", "view_size = 65")) == (2, 2)
    assert study.added(replaced("size=64", "size=32")) == (1, 1)
    assert {line["status"] for line in table(study.folder)} == {"ok"}


def test_rounds_come_later_without_scoring_again(study: Study) -> None:
    assert study.added(replaced("rounds = 1", "rounds = 0")) == (2, 0)
    assert {line["frame_ms"] for line in table(study.folder)} == {""}
    assert study.added(replaced("rounds = 1", "rounds = 2")) == (0, 2)
    assert "" not in {line["frame_ms"] for line in table(study.folder)}
    assert study.added(SMALL) == (0, 0), "fewer are enough"
    assert study.added(replaced("rounds = 1", "rounds = 3")) == (0, 2)
    assert study.added(replaced("rounds = 1", "rounds = 3"), "--time-again") == (0, 2)
    other = replaced('reference = "unshadowed"', 'reference = "shadow-map:size=32"')
    assert study.added(other) == (0, 2)
    times = study.rows("time")
    assert [row["reference"] for row in times] == ["unshadowed"] * 6 + ["shadow-map:size=32"] * 2
    keys = {row["spec"]: row["key"] for row in study.rows("score")}
    assert {row["reference_key"] for row in times[:6]} == {keys["unshadowed"]}, "that of its own row"


def test_another_machine_times_again_and_scores_nothing_again(study: Study) -> None:
    assert study.added(SMALL) == (2, 2)
    here = study.rows("time")[0]["machine"]
    file = study.folder / "rows.jsonl"
    file.write_text(file.read_text().replace(here, "of another machine"))
    assert study.added(replaced("rounds = 1", "rounds = 0")) == (0, 0)
    assert [(bool(line["iou"]), line["frame_ms"]) for line in table(study.folder)] == [(True, "")] * 2
    assert study.added(SMALL) == (0, 2)
    assert study.added(SMALL) == (0, 0)
    assert [row["machine"] for row in study.rows("time")] == ["of another machine"] * 2 + [here] * 2
    assert {line["machine"] for line in table(study.folder)} == {here}


@pytest.mark.parametrize("kept", [1, -1])
def test_a_row_that_was_torn_is_measured_again(study: Study, kept: int) -> None:
    text = replaced("rounds = 1", "rounds = 0")
    assert study.added(text) == (2, 0)
    file = study.folder / "rows.jsonl"
    whole, rows = file.read_bytes(), study.rows("score")
    first = whole.index(b"\n") + 1
    file.write_bytes(whole[: first + kept] if kept > 0 else whole[:kept])
    assert study.run(text).code == 0
    assert unsigned(study.rows("score")) == unsigned(rows) and file.read_bytes().endswith(b"\n")
    assert file.read_bytes()[:first] == whole[:first]


def test_a_failed_cell_is_tried_again_and_no_other(study: Study, half: Path, wild: Path, tmp_path: Path) -> None:
    study.plugins = (half, wild)
    text = study_text("half", "does:what=lack", "does:what=lack,after=2", reference='"does:what=lack,level=0.25"')
    needed = wild.parent / "needed"
    try:
        assert study.added(text) == (3, 1)
        assert [line["status"].partition(" (")[0][:25] for line in by_spec(study.folder).values()] == [
            "ok", "failed: FileNotFoundError", "failed: while timed: File",
        ]  # fmt: skip
        (timed,) = study.rows("time")
        assert timed["ratio"] is None and timed["no_ratio"].startswith("failed: FileNotFoundError")
        assert study.added(text) == (1, 1), "a crash may be the machine's: it is tried again, also of the reference"
        needed.touch()
        assert study.added(text) == (1, 3), "also the time whose reference failed"
        assert study.added(text) == (0, 0)
    finally:
        needed.unlink(missing_ok=True)
    assert {line["status"] for line in by_spec(study.folder).values()} == {"ok"}
    assert all(row["ratio"] > 0 for row in study.rows("time")[2:])


RECORDER = '''
import os
import time
from shadowbench.techniques.shadow_map import ShadowMap

now, passed = time.perf_counter, [0.0]
time.perf_counter = lambda: now() + passed[0]


class Recorder(ShadowMap):
    """A shadow map that notes when it is built, and the index of each frame that it draws."""

    name = "recorder"

    def note(self, what):
        with open(os.environ["NOTES"], "a") as file:
            file.write(f"{self.params.size} {what}\\n")

    def build(self, stage):
        self.note("built")
        passed[0] += 1e3
        super().build(stage)

    def draw(self, frame):
        self.note(frame.index)
        passed[0] += 1e4
        return super().draw(frame)
'''


def test_a_technique_is_built_once_and_scored_without_history(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its first frame, for the mask and its work, has index 0; those of the timing are counted from there."""
    plugin, notes = tmp_path / "recorder.py", tmp_path / "notes"
    plugin.write_text(RECORDER)
    monkeypatch.setenv("NOTES", str(notes))
    study.plugins = (plugin,)
    assert study.added(study_text("recorder:size=32", "recorder:size=64", rounds=3)) == (2, 2)
    noted = [line.split() for line in notes.read_text().splitlines()]
    for size in ("32", "64"):
        of_one = [what for which, what in noted if which == size]
        timed = [str(index) for index in range(1 + 3 + 1)]  # to warm up, three rounds of frames, one of passes
        assert of_one == ["built", "0", *timed]
    rounds = [which for which, what in noted if what in ("1", "2", "3")]
    assert rounds == ["32", "64"] * 3, "techniques take turns"
    for line in table(study.folder):
        assert 1e6 <= float(line["prepare_ms"]) < 2e6, "seconds of building, without those of frames to warm up"
