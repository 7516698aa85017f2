"""Planted faults: each fails the tests that are named for it, which pass without; harmless changes fail none.

The tables have the name of tests, and below it the changes that they are run with: edits of a file, of a text that
occurs in it once, and what takes its place. The sources are changed in a copy, one fault at a time.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from shadowbench.plugin.registry import own_techniques
from tests.samples import daily

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
COPIED = ("shadowbench", "shaders", "scenes", "benchmarks", "results/baseline", "tests", "tools", "pyproject.toml")
IN = "cells of "  # what names a technique's cells of the baseline's study on some scenes, in place of tests
EACH = 7  # days until `make test-slow` has planted every fault


@dataclass(frozen=True)
class Fault:
    """Edits (file, before, after) made together, and the tests that they are for."""

    name: str
    tests: str
    edits: tuple[tuple[str, str, str], ...]


def read(file: str) -> list[Fault]:
    tables = tomllib.loads((HERE / file).read_text(encoding="utf-8"))
    return [
        Fault(name, tests, tuple(zip(texts[::3], texts[1::3], texts[2::3], strict=True)))
        for tests, faults in tables.items()
        for name, texts in faults.items()
    ]


def ids(tests: str) -> list[str]:
    if tests.startswith(IN):
        return [f"tests/faults/cells.py::test_the_cells_score_as_in_the_baseline[{tests.removeprefix(IN)}]"]
    return tests.split(" and ")


FAULTS, HARMLESS = read("faults.toml"), read("harmless.toml")
TESTS = list(dict.fromkeys(fault.tests for fault in FAULTS + HARMLESS))
CELLS = [tests.removeprefix(IN) for tests in TESTS if tests.startswith(IN)]
FILES = sorted({test.partition("::")[0] for tests in TESTS for test in ids(tests)})


class Copy:
    """A copy of the sources, and `forked.py`, which runs tests on it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            copy(ROOT / name, folder / name)
        own = {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(folder)}
        self.process = subprocess.Popen(
            [sys.executable, HERE / "forked.py", folder],
            env=os.environ | own,  # of OpenBLAS, no thread would live on in a fork
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def run(self, tests: Sequence[str], edits: Sequence[tuple[str, str, str]] = ()) -> tuple[int, list[str], str]:
        """Exit code of pytest with these edits, the types of what tests raised, and the output."""
        assert self.process.stdin is not None and self.process.stdout is not None
        for file, before, after in edits:
            text = (self.folder / file).read_text(encoding="utf-8")
            assert text.count(before) == 1, f"{file}: {before!r}"
            (self.folder / file).write_text(text.replace(before, after), encoding="utf-8")
        print(json.dumps(tests), file=self.process.stdin, flush=True)
        code, raised, printed = json.loads(self.process.stdout.readline())
        for file, *_ in edits:
            shutil.copy2(ROOT / file, self.folder / file)
        return code, raised, printed


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Iterator[Copy]:
    copy = Copy(tmp_path_factory.mktemp("sources"))
    yield copy
    os.killpg(copy.process.pid, signal.SIGKILL)
    copy.process.communicate()


def test_the_text_that_a_fault_replaces_occurs_exactly_once() -> None:
    edits = [edit for fault in FAULTS + HARMLESS for edit in fault.edits]
    texts = {file: (ROOT / file).read_text(encoding="utf-8") for file, _, _ in edits}
    assert [(file, before) for file, before, after in edits if texts[file].count(before) != 1 or before == after] == []


def test_every_fault_has_a_name_of_its_own_and_every_technique_a_fault() -> None:
    names = [fault.name for fault in FAULTS + HARMLESS]
    assert len(set(names)) == len(names) and len(HARMLESS) >= 10
    files = " ".join(fault.tests + fault.name for fault in FAULTS)
    assert not [one.name for one in own_techniques() if one.name not in files]


@pytest.mark.slow
@pytest.mark.parametrize("file", daily(FILES, EACH))
def test_without_a_fault_the_named_tests_pass(file, copy) -> None:
    """In the copy too: in the sources themselves they are tests as others are."""
    code, _, printed = copy.run([test for tests in TESTS for test in ids(tests) if test.startswith(f"{file}::")])
    assert code == 0, printed


@pytest.mark.slow
@pytest.mark.parametrize("fault", daily(FAULTS + HARMLESS, EACH), ids=lambda fault: fault.name)
def test_a_fault_fails_its_tests_and_a_harmless_change_fails_none(fault, copy) -> None:
    code, raised, printed = copy.run(ids(fault.tests), fault.edits)
    assert code == (fault in FAULTS), printed
    assert set(raised) <= {"AssertionError", "Failed"}, printed
