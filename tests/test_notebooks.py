"""The notebooks of examples/notebooks/ run as they stand."""

import shutil
from pathlib import Path

import nbclient
import nbformat
import pytest

from tests.samples import daily

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of Jupyter's own
@pytest.mark.parametrize("file", daily(NOTEBOOKS, 2), ids=lambda file: file.stem)
def test_a_notebook_runs_and_shows_a_picture(file: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(ROOT / "examples", tmp_path / "examples") / "notebooks"
    book = nbformat.read(file, 4)
    nbclient.NotebookClient(book, timeout=240, resources={"metadata": {"path": str(folder)}}).execute()
    shown = [output for cell in book.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output.get("name") == "stderr" for output in shown), shown
