import os
import stat
from contextlib import nullcontext
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.files import replace_file


def test_a_file_is_replaced_at_the_end_or_left_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "rows.json"
    for text, error in (("old", None), ("new", None), ("half", ZeroDivisionError)):
        before = path.read_text() if path.exists() else None
        with pytest.raises(error) if error else nullcontext(), replace_file(path) as temporary:
            temporary.write_text(text)
            assert (temporary.suffix, temporary.parent) == (".json", tmp_path)
            if error:
                raise error
        assert path.read_text() == (before if error else text) and list(tmp_path.iterdir()) == [path]


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
