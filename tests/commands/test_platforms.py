"""Platforms for which OpenGL's binding, Embree or Numba has no wheel: what works there, and what the rest says."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.api import run

LIBRARIES = ("moderngl", "glcontext", "embreex", "numba", "llvmlite")
Elsewhere = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def elsewhere(tmp_path: Path) -> Elsewhere:
    """Calls the command line in a folder of its own, in a Python without some libraries, its workers too."""

    def call(*words: str | Path, without: tuple[str, ...] = LIBRARIES) -> subprocess.CompletedProcess[str]:
        absent = tmp_path / "absent"
        absent.mkdir()
        for name in without:
            (absent / f"{name}.py").write_text(f"raise ModuleNotFoundError('No module of this name', name={name!r})\n")
        path = os.pathsep.join(filter(None, [str(absent), os.environ.get("PYTHONPATH")]))
        return subprocess.run(
            [sys.executable, "-m", "shadowbench", *map(str, words)],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )

    return call


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder that another machine made."""
    made = tmp_path_factory.mktemp("made") / "run"
    run("cube-on-plane", "shadow-map:size=64", view_size=64, rounds=1, folder=made)
    return made


@pytest.mark.parametrize("words", ["list techniques", "check FOLDER --baseline FOLDER", "report FOLDER -o report.html"])
def test_lists_and_what_reads_rows_need_neither_gl_nor_embree_nor_numba(
    elsewhere: Elsewhere, folder: Path, words: str
) -> None:
    done = elsewhere(*(folder if word == "FOLDER" else word for word in words.split()))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


@pytest.mark.parametrize(
    ("words", "library"),
    [
        ("truth post --view-size 16 -o truth.npz", "embreex"),
        ("run post -t unshadowed --view-size 16 --rounds 0", "moderngl"),
    ],
)
def test_what_needs_an_absent_library_names_it_in_one_line(elsewhere: Elsewhere, words: str, library: str) -> None:
    done = elsewhere(*words.split(), "-q", without=(library,))
    assert done.returncode == 3
    assert done.stderr.startswith(f"shadowbench: {library} is not installed; docs/how-to/install.md ")
    assert len(done.stderr.splitlines()) == 1
