"""Planted faults: the sources are changed in a copy, one change at a time, and the change's technique runs its cells of
the committed baseline. `check` catches every fault and names the technique, and passes every harmless rewriting."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from shadowbench.commands import main
from shadowbench.scenes.library import load_scene
from shadowbench.studies.study import read_study
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import own_techniques, techniques
from shadowbench.techniques.unshadowed import Unshadowed

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BASELINE = ROOT / "results" / "baseline"
SOURCES = ("shadowbench", "shaders", "scenes", "benchmarks")
AT_ONCE = 2


@dataclass(frozen=True)
class Change:
    """Edits, (file, before, after), made together; cells of `technique` on `scenes` show them."""

    name: str
    technique: str
    scenes: tuple[str, ...]
    edits: tuple[tuple[str, str, str], ...]
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
    """The fault on the first scene of the study whose light the technique answers."""
    kinds = {name: load_scene(file).lights[0].kind for name, file in SCENES.items()}
    scene = next(name for name, kind in kinds.items() if kind in technique.lights)
    return Change(f"{technique.name}-of-moved-receivers", technique.name, (scene,), (MOVED_RECEIVERS,))


def planted() -> list[Change]:
    """Those of the file, and one for each technique of ours that it forgets."""
    written = changes("faults.toml")
    covered = {change.technique for change in written}
    return [*written, *(misplaced(one) for one in own_techniques() if one.name not in covered)]


FAULTS, HARMLESS = planted(), changes("harmless.toml")


def test_there_are_enough_of_them() -> None:
    names = [change.name for change in FAULTS + HARMLESS]
    assert len(FAULTS) >= 20 and len(HARMLESS) >= 10 and len(set(names)) == len(names)
    assert {change.technique for change in FAULTS} == {one.name for one in own_techniques()}


def test_a_technique_without_a_fault_of_its_own_is_planted_one(monkeypatch: pytest.MonkeyPatch) -> None:
    newcomer = type("Newcomer", (Unshadowed,), {"name": "newcomer", "lights": frozenset({"point"})})
    monkeypatch.setattr(sys.modules[__name__], "own_techniques", lambda: (newcomer,))
    fault = planted()[-1]
    assert (fault.technique, fault.scenes) == ("newcomer", ("lamp-by-wall",))
    ((file, before, _),) = fault.edits
    assert (ROOT / file).read_text(encoding="utf-8").count(before) == 1


@pytest.mark.parametrize("change", FAULTS + HARMLESS, ids=lambda change: change.name)
def test_what_a_change_replaces_is_there_exactly_once(change: Change) -> None:
    for file, before, after in change.edits:
        assert (ROOT / file).read_text(encoding="utf-8").count(before) == 1, f"{file}: {before!r}"
        assert before != after


def ran(change: Change, edits: tuple[tuple[str, str, str], ...], sources: Path, folder: Path) -> tuple[int, str]:
    """Exit code and stderr of the change's cells, measured by a copy of the sources with these edits."""
    copy = folder / "sources"
    shutil.copytree(sources, copy)
    for file, before, after in edits:
        text = (copy / file).read_text(encoding="utf-8")
        assert text.count(before) == 1, f"{file}: {before!r}"
        (copy / file).write_text(text.replace(before, after), encoding="utf-8")
    cells = [cell.spec for cell in STUDY.cells() if cell.spec.technique.name == change.technique]
    specs = [spec.full_text for spec in cells] or [change.technique]
    command = [sys.executable, "-m", "shadowbench", "run", *(SCENES[scene] for scene in change.scenes)]
    command += ["-s", str(BASELINE / "study.toml"), "--phases", str(change.phases), "-o", str(folder / "run"), "-q"]
    command += [word for spec in specs for word in ("-t", spec)]
    environment = os.environ | {"PYTHONPATH": str(copy)}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=240)
    shutil.rmtree(copy)
    return done.returncode, done.stderr


def write_cells(change: Change, folder: Path) -> bool:
    """The committed baseline's rows of the change's cells; False where it has none."""
    if change.phases != STUDY.phases:
        return False
    lines = (BASELINE / "rows.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    rows = {line: json.loads(line) for line in lines}
    mine = [
        line for line, row in rows.items() if row["technique"] == change.technique and row["scene"] in change.scenes
    ]
    folder.mkdir()
    (folder / "rows.jsonl").write_text("".join(mine), encoding="utf-8")
    return bool(mine)


@dataclass
class Copies:
    """Runs changed copies ahead of the tests that look at them."""

    sources: Path
    folder: Path
    pool: ThreadPoolExecutor
    runs: dict[str, Future[tuple[int, str]]] = field(default_factory=dict)

    def begin(self, change: Change) -> None:
        self.runs[change.name] = self.pool.submit(self._run, change)

    def _run(self, change: Change) -> tuple[int, str]:
        folder = self.folder / change.name
        folder.mkdir()
        if not write_cells(change, folder / "baseline"):
            unchanged = folder / "unchanged"
            code, errors = ran(change, (), self.sources, unchanged)
            assert code == 0, errors
            shutil.rmtree(folder / "baseline", ignore_errors=True)
            (unchanged / "run").rename(folder / "baseline")
        return ran(change, change.edits, self.sources, folder)


@pytest.fixture(scope="module")
def copies(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Copies]:
    pool, sources = ThreadPoolExecutor(AT_ONCE), tmp_path_factory.mktemp("sources")
    for name in SOURCES:  # once, so that all changes are made to the same text, whatever is edited meanwhile
        shutil.copytree(ROOT / name, sources / name)
    copies = Copies(sources, tmp_path_factory.mktemp("faults"), pool)
    for item in request.session.items:
        if item.path == Path(__file__) and item.get_closest_marker("slow"):
            copies.begin(item.callspec.params["change"])  # type: ignore[attr-defined]
    yield copies
    pool.shutdown(cancel_futures=True)


@dataclass(frozen=True)
class Verdict:
    """How the run of a change ended, and what `check` says of it."""

    run: int
    errors: str
    check: int
    said: str


@pytest.fixture
def verdict(
    copies: Copies, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[Change], Verdict]:
    """The verdict on a change, by the unchanged sources."""

    def check(change: Change) -> Verdict:
        code, errors = copies.runs[change.name].result()
        folder = copies.folder / change.name
        words: list[Any] = ["shadowbench", "check", folder / "run", "--baseline", folder / "baseline"]
        monkeypatch.setattr(sys, "argv", [str(word) for word in words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        assert isinstance(stop.value.code, int)
        return Verdict(code, errors, stop.value.code, capsys.readouterr().out)

    return check


@pytest.mark.slow
@pytest.mark.parametrize("change", FAULTS, ids=lambda change: change.name)
def test_a_fault_is_caught_and_its_technique_named(change: Change, verdict: Callable[[Change], Verdict]) -> None:
    found = verdict(change)
    assert found.run == 0, f"it does not even run, which anything would catch: {found.errors}"
    assert found.check == 1, found.said
    assert " missing " not in found.said, "a cell that was not run says nothing of the fault"
    regressed = found.said.partition("improved, largest change first")[0]
    assert f" {change.technique}" in regressed, found.said


@pytest.mark.slow
@pytest.mark.parametrize("change", HARMLESS, ids=lambda change: change.name)
def test_a_harmless_change_passes(change: Change, verdict: Callable[[Change], Verdict]) -> None:
    found = verdict(change)
    assert found.run == 0, found.errors
    assert found.check == 0, found.said
