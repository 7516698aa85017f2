"""The announcement that loops are compiled: only where they are, and not read from Numba's cache."""

import importlib.util
from pathlib import Path
from typing import Any

import pytest

from shadowbench import compiled

MODULE = """
from shadowbench.compiled import compiled


@compiled()
def successor(number):
    return number + 1
"""


def loaded(file: Path) -> Any:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.successor


def test_only_what_is_compiled_and_not_read_from_the_cache_is_announced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "compiled_by_a_test.py"
    file.write_text(MODULE)
    for expected in ([compiled.COMPILING], []):
        monkeypatch.setattr(compiled._Announcer, "announced", False)
        caplog.clear()
        loaded(file)(1)
        assert caplog.messages == expected
