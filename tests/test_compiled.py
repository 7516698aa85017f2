"""The announcement that loops are compiled: only where they are, and not read from Numba's cache."""

import importlib.util
from pathlib import Path
from typing import Any

import numba
import pytest

from shadowbench import compiled

MODULE = """
from shadowbench.compiled import compiled


@compiled()
def successor(number):
    return number + 1
"""


@pytest.fixture
def announced(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Any:
    """What is announced when a function is called for the first time in a process."""

    def announce(function: Any) -> list[str]:
        monkeypatch.setattr(compiled._Announcer, "announced", False)
        caplog.clear()
        function(1)
        return caplog.messages

    return announce


def loaded(file: Path) -> Any:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.successor


def test_what_the_cache_has_is_not_announced_however_long_it_takes(announced: Any, tmp_path: Path) -> None:
    file = tmp_path / "compiled_by_a_test.py"
    file.write_text(MODULE)
    assert announced(loaded(file)) == [compiled.COMPILING]
    assert announced(loaded(file)) == []


def test_only_what_cannot_be_cached_is_said_to_be_compiled_in_every_process(announced: Any) -> None:
    scope: dict[str, Any] = {}
    exec(MODULE, scope)  # a source without a file
    assert announced(scope["successor"]) == [compiled.UNCACHED]
    assert announced(numba.njit(lambda number: number + 2)) == [], "another's function"
