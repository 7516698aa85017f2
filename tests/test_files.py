import os
import stat
import subprocess
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.files import replace_file


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def test_the_new_file_takes_the_name_of_the_old_one(tmp_path):
    path = tmp_path / "rows.json"
    path.write_text("old")
    with replace_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["rows.json"]


def test_a_failed_writer_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "rows.json"
    path.write_text("old")

    def fail_half_way():
        with replace_file(path) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["rows.json"]


def test_the_temporary_file_has_the_suffix_and_lies_beside(tmp_path):
    with replace_file(tmp_path / "truth.npz") as temporary:
        assert temporary.suffix == ".npz"
        assert temporary.parent == tmp_path


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes")
def test_the_file_is_as_readable_as_any_other(tmp_path):
    (tmp_path / "plain").touch()
    with replace_file(tmp_path / "replaced"):
        pass
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "replaced")}
    assert len(modes) == 1


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(InputError, match=r"missing: cannot write into this folder") as caught,
        replace_file(tmp_path / "missing" / "rows.json"),
    ):
        pass
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_file_name(tmp_path):
    (tmp_path / "results").mkdir()
    with pytest.raises(InputError, match="results: is a folder"), replace_file(tmp_path / "results"):
        pass
    assert names(tmp_path) == ["results"]


def test_a_report_in_the_checkout_is_ignored_by_git():
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        pytest.skip("no checkout")
    ignored = ["git", "-C", root, "check-ignore", "--quiet"]
    assert subprocess.run([*ignored, "report.html"]).returncode == 0
    assert subprocess.run([*ignored, "docs/report.html"]).returncode == 1
