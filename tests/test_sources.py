"""The source files that a result depends on, found by imports."""

from pathlib import Path

import pytest

from shadowbench import sources
from shadowbench.sources import code_digest, import_closure


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A test package: `low` imports nothing, `middle` imports `low` within a function, `high` imports `middle`."""
    root = tmp_path / "house"
    (root / "room").mkdir(parents=True)
    for name, text in {
        "__init__": "from house import high\n",
        "room/__init__": "",
        "room/low": "import numpy\n",
        "middle": "def f():\n    from house.room.low import numpy\n",
        "high": "import house.middle\nfrom house import middle\n",
        "beside": "import house.high\nimport scipy.ndimage\n",
    }.items():
        (root / f"{name}.py").write_text(text)
    monkeypatch.setattr(sources, "PACKAGE", root)
    return root


def test_imports_inside_functions_are_part_of_a_key(package: Path) -> None:
    names = [str(file.relative_to(package)) for file in import_closure(package / "high.py")]
    assert names == ["high.py", "middle.py", "room/low.py"]


def test_a_digest_is_of_text_of_what_is_imported_and_of_its_libraries(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def digest() -> str:
        return code_digest(package / "high.py")

    before = digest()
    (package / "beside.py").write_text("import house.high\n")
    assert digest() == before
    monkeypatch.setattr(sources, "version", lambda library: f"another {library}" if library == "scipy" else "1")
    numpy_one = digest()
    monkeypatch.setattr(sources, "version", lambda library: "1")
    assert digest() == numpy_one != before, "scipy is not imported, numpy is"
    (package / "room" / "low.py").write_text("import numpy  # changed\n")
    assert digest() != numpy_one


def test_all_shaders_of_a_folder_beside_a_plug_in_are_in_its_key(package: Path, tmp_path: Path) -> None:
    folder = tmp_path / "shaders"
    folder.mkdir()
    before = code_digest(package / "high.py", extra_files=[folder])
    (folder / "notes.txt").write_text("")
    assert code_digest(package / "high.py", extra_files=[folder]) == before
    (folder / "one.glsl").write_text("")
    assert code_digest(package / "high.py", extra_files=[folder]) != before


def test_a_plug_in_digests_alike_wherever_it_lies(package: Path, tmp_path: Path) -> None:
    """Machines, and workers to which it travels, have it elsewhere: before or after the package in order of paths."""
    digests = set()
    for folder in ("a", "z"):
        plugin = tmp_path / folder / "plugin.py"
        plugin.parent.mkdir()
        plugin.write_text("import house.high\n")
        (plugin.parent / "z.py").write_text("")
        digests.add(code_digest(plugin, package / "high.py", plugin.parent / "z.py"))
    assert len(digests) == 1
