"""Planted faults: `check` catches each of them and names its technique, and passes every harmless change.

The sources are changed in a copy, one change at a time; then the technique's cells of the committed baseline are run.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from shadowbench.check.baseline import MISSING
from shadowbench.check.baseline import Change as Regressed
from shadowbench.check.check import check
from shadowbench.scenes.library import load_scene
from shadowbench.studies.study import read_study
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import own_techniques, techniques

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BASELINE = ROOT / "results" / "baseline"
SOURCES = ("shadowbench", "shaders", "scenes", "benchmarks")
Edit = tuple[str, str, str]


@dataclass(frozen=True)
class Change:
    """Edits (file, before, after) made together, and the technique and scenes whose cells reveal them."""

    name: str
    technique: str
    scenes: tuple[str, ...]
    edits: tuple[Edit, ...]
    phases: int = 1


def changes(file: str) -> list[Change]:
    tables = tomllib.loads((HERE / file).read_text(encoding="utf-8"))["change"]
    return [
        Change(
            table["name"],
            table["technique"],
            tuple(table["scenes"]),
            tuple((edit["file"], edit["before"], edit["after"]) for edit in table["edit"]),
            table.get("phases", 1),
        )
        for table in tables
    ]


STUDY = read_study(BASELINE / "study.toml", techniques())
SCENES = {load_scene(scene).name: scene for scene in STUDY.scenes}
# What is planted for a technique that has no fault of its own in faults.toml: its receivers lie elsewhere.
MOVED_RECEIVERS = ("shaders/gbuffer/gbuffer.frag", "vec4(world, 1.0)", "vec4(world + vec3(0.1, 0.0, 0.1), 1.0)")


def misplaced(technique: type[Technique]) -> Change:
    """A misplaced shadow, on the first scene of the study whose light the technique supports."""
    kinds = {name: load_scene(file).lights[0].kind for name, file in SCENES.items()}
    scene = next(name for name, kind in kinds.items() if kind in technique.lights)
    return Change(f"{technique.name}-of-moved-receivers", technique.name, (scene,), (MOVED_RECEIVERS,))


def planted() -> list[Change]:
    """The faults of faults.toml, and one for each built-in technique without any."""
    written = changes("faults.toml")
    covered = {change.technique for change in written}
    return [*written, *(misplaced(one) for one in own_techniques() if one.name not in covered)]


FAULTS, HARMLESS = planted(), changes("harmless.toml")


def test_there_are_enough_faults() -> None:
    names = [change.name for change in FAULTS + HARMLESS]
    assert len(FAULTS) >= 20 and len(HARMLESS) >= 10 and len(set(names)) == len(names)
    assert {change.technique for change in FAULTS} == {one.name for one in own_techniques()}


EDITS = [*(edit for change in FAULTS + HARMLESS for edit in change.edits), MOVED_RECEIVERS]


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit[0])
def test_the_text_that_a_fault_replaces_occurs_exactly_once(edit: Edit) -> None:
    file, before, after = edit
    assert (ROOT / file).read_text(encoding="utf-8").count(before) == 1, f"{file}: {before!r}"
    assert before != after


@dataclass(frozen=True)
class Copy:
    """A copy of the sources, and `forked.py`, which measures by it."""

    folder: Path
    process: subprocess.Popen[str]

    def measured(self, scenes: Sequence[str], specs: Sequence[str], phases: int, folder: Path) -> None:
        """Measures the cells with the current sources of the copy into a run folder."""
        assert self.process.stdin is not None and self.process.stdout is not None
        asked = [SCENES[scene] for scene in scenes], specs, phases, str(BASELINE / "study.toml"), str(folder)
        print(json.dumps(asked), file=self.process.stdin, flush=True)
        code, printed = json.loads(self.process.stdout.readline())
        assert code == 0, f"it does not even run, which anything would catch: {printed}"

    @contextmanager
    def changed(self, edits: Sequence[Edit]) -> Iterator[None]:
        """Context in which the copy has these edits."""
        unchanged = {file: (self.folder / file).read_text(encoding="utf-8") for file, *_ in edits}
        for file, before, after in edits:
            text = (self.folder / file).read_text(encoding="utf-8")
            assert text.count(before) == 1, f"{file}: {before!r}"
            (self.folder / file).write_text(text.replace(before, after), encoding="utf-8")
        yield
        for file, text in unchanged.items():
            (self.folder / file).write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Copy]:
    """Made once, so that edits of the sources during the test have no effect."""
    folder = tmp_path_factory.mktemp("sources")
    for name in SOURCES:
        shutil.copytree(ROOT / name, folder / name)
    process = subprocess.Popen(
        [sys.executable, HERE / "forked.py", folder],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},  # no thread would live on in a fork
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    yield Copy(folder, process)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


@dataclass(frozen=True)
class Cells:
    """A technique's cells of the committed baseline's study, measured by a copy and compared with the baseline."""

    copy: Copy
    folder: Path

    def baseline(self, change: Change) -> Path:
        """The baseline's rows of the cells; if it has none, measured with the unchanged sources."""
        folder = self.folder / "baseline"
        lines = (BASELINE / "rows.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
        rows = {line: json.loads(line) for line in lines if change.phases == STUDY.phases}
        mine = [
            line for line, row in rows.items() if row["technique"] == change.technique and row["scene"] in change.scenes
        ]
        if mine:
            folder.mkdir()
            (folder / "rows.jsonl").write_text("".join(mine), encoding="utf-8")
        else:
            self.copy.measured(change.scenes, self.specs(change), change.phases, folder)
        return folder

    def specs(self, change: Change) -> list[str]:
        cells = [cell.spec for cell in STUDY.cells() if cell.spec.technique.name == change.technique]
        return [spec.full_text for spec in cells] or [change.technique]

    def regressed(self, change: Change, baseline: Path) -> list[Regressed]:
        """Regressions found by `check` with the changed sources, worst first."""
        with self.copy.changed(change.edits):
            self.copy.measured(change.scenes, self.specs(change), change.phases, self.folder / "changed")
        return check(self.folder / "changed", baseline).findings.with_verdict("regressed", times=False)

    def unchanged(self, change: Change, of: Regressed, baseline: Path) -> bool:
        """Whether the unchanged sources reproduce the baseline's rows of a regressed cell."""
        self.copy.measured([of.score["scene"]], [of.score["full_spec"]], change.phases, self.folder / "unchanged")
        found = check(self.folder / "unchanged", baseline).findings
        return found.compared == change.phases and all(one.after == MISSING for one in found.changes)


@pytest.fixture
def cells(copy: Copy, tmp_path: Path) -> Cells:
    return Cells(copy, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("change", FAULTS, ids=lambda change: change.name)
def test_a_fault_is_caught_and_its_technique_named(change: Change, cells: Cells) -> None:
    baseline = cells.baseline(change)
    found = cells.regressed(change, baseline)
    assert found
    assert all(one.after != MISSING for one in found), "a cell that was not run says nothing of the fault"
    assert found[0].score["technique"] == change.technique
    assert cells.unchanged(change, found[0], baseline), "the fault stayed"


@pytest.mark.slow
@pytest.mark.parametrize("change", HARMLESS, ids=lambda change: change.name)
def test_a_harmless_change_passes(change: Change, cells: Cells) -> None:
    assert cells.regressed(change, cells.baseline(change)) == []
