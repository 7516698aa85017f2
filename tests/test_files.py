import os
import stat
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.files import replace_file


def test_the_new_file_lies_beside_the_old_one_and_takes_its_name(tmp_path: Path) -> None:
    path = tmp_path / "rows.json"
    path.write_text("old")
    with replace_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
        assert (temporary.suffix, temporary.parent) == (".json", tmp_path)
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_a_failed_writer_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "rows.json"
    path.write_text("old")

    def fail_half_way() -> None:
        with replace_file(path) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes")
def test_the_file_is_as_readable_as_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    with replace_file(tmp_path / "replaced"):
        pass
    assert len({stat.S_IMODE(file.stat().st_mode) for file in tmp_path.iterdir()}) == 1


@pytest.mark.parametrize(
    ("name", "line"), [("missing/rows.json", "missing: cannot write into this folder"), ("", ": is a folder")]
)
def test_what_cannot_be_written_is_a_line(tmp_path: Path, name: str, line: str) -> None:
    with pytest.raises(InputError, match=rf"^[^\n]*{line}[^\n]*$"), replace_file(tmp_path / name):
        pass
    assert list(tmp_path.iterdir()) == []
