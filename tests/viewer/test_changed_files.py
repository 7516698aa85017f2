"""What is noticed of files that change on disk."""

import os
from pathlib import Path

import pytest

from shadowbench.viewer import changed_files
from shadowbench.viewer.changed_files import ChangedFiles, Changes


def test_a_plug_ins_python_and_its_shader_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(changed_files, "EVERY_S", 0.0)
    plugin, shader = tmp_path / "mine.py", tmp_path / "mine.frag"
    for file in (plugin, shader):
        file.write_text("")
        os.utime(file, ns=(1, 1))
    files = ChangedFiles(None, [plugin])
    assert files.changed() == Changes()
    os.utime(shader, ns=(2, 2))
    assert files.changed() == Changes(shaders=True)
    os.utime(plugin, ns=(2, 2))
    assert files.changed() == Changes(plugins=(plugin,))
    assert files.changed() == Changes()
