"""The pytest plug-in, in a suite of its own, as an engine would have it."""

import statistics
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.scores.masks import write_mask

SUITE = """
import numpy as np
from shadowbench.scores.masks import read_mask

def test_file(shadow_accuracy):
    assert shadow_accuracy("mask.png", scene="stairs").iou > 0.98

def test_array_and_every_metric(shadow_accuracy):
    found = shadow_accuracy(read_mask("mask.png"), scene="stairs", view="camera", light="light")
    assert found.iou > 0.98 and found.acne == 0 and found.ssim > 0.95 and 0 <= found.edge_px < 0.5
    assert found.warnings == ()

def test_bytes(shadow_accuracy):
    assert shadow_accuracy(np.rint(read_mask("mask.png") * 255).astype(np.uint8), scene="stairs").iou > 0.98

def test_screenshots(shadow_accuracy):
    assert shadow_accuracy(lit="lit.png", shadowed="shadowed.png", scene="stairs").iou > 0.98
"""


@pytest.fixture
def suite(tmp_path: Path, drawn: Callable, png: Callable) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs a test file in a folder of its own, where a good mask lies, with nothing but installed plug-ins."""
    folder = tmp_path / "engine"
    folder.mkdir()
    visibility = drawn("stairs")
    write_mask(folder / "mask.png", visibility)
    write_mask(folder / "flipped.png", visibility[::-1])
    write_mask(folder / "empty.png", np.ones_like(visibility))
    png("engine/lit.png", np.ones_like(visibility))
    png("engine/shadowed.png", visibility > 0.5)

    def run(text: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        (folder / "test_engine.py").write_text(text)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)

    return run


def test_the_plugin_is_installed_with_the_package() -> None:
    (found,) = entry_points(group="pytest11", name="shadowbench")
    assert found.value == "shadowbench.pytest_plugin"


def test_a_good_mask_passes_as_file_array_bytes_and_screenshots(suite: Callable) -> None:
    done = suite(SUITE)
    assert done.returncode == 0, done.stdout
    assert "4 passed" in done.stdout


def test_a_failure_says_what_kind_of_error_it_is_and_saves_the_picture(suite: Callable, tmp_path: Path) -> None:
    diffs = tmp_path / "diffs"
    done = suite(
        'def test_it(shadow_accuracy):\n    assert shadow_accuracy("empty.png", scene="stairs").iou > 0.98\n',
        "--shadow-diffs",
        str(diffs),
    )
    assert done.returncode == 1
    assert "iou 0 > 0.98 (accuracy of empty.png on stairs)" in done.stdout
    assert "peter-panning" in done.stdout and "of the shadow next to its caster is lit (contact)" in done.stdout
    (picture,) = diffs.iterdir()
    assert str(picture) in done.stdout
    with Image.open(picture) as image:
        assert image.size == (256, 256)


def test_without_a_folder_the_picture_goes_to_the_tests_own(suite: Callable, tmp_path: Path) -> None:
    done = suite(
        'def test_it(shadow_accuracy):\n    assert 0.98 < shadow_accuracy("empty.png", scene="stairs").iou\n',
        f"--basetemp={tmp_path / 'base'}",
    )
    assert done.returncode == 1 and "0.98 < iou 0 (accuracy of" in done.stdout
    assert [file.name for file in (tmp_path / "base").rglob("*.png")] == ["test_it.diff.png"]


def test_bad_input_is_a_failure_of_one_line(suite: Callable) -> None:
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("flipped.png", scene="stairs")\n')
    assert done.returncode == 1
    assert "flipped.png: is flipped vertically, against the truth of stairs" in done.stdout
    assert "Traceback" not in done.stdout and "pytest_plugin.py" not in done.stdout


def test_a_misspelt_metric_or_keyword_is_an_error_that_names_the_right_ones(suite: Callable) -> None:
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("mask.png", scene="stairs").iuo\n')
    assert "AttributeError: 'iuo' is no metric; there are iou, iou_soft" in done.stdout
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("mask.png", scene="stairs", lit="lit.png")\n')
    assert "TypeError: a mask and lit; allowed: a mask, or lit, shadowed and ambient" in done.stdout


@pytest.mark.alone
def test_the_plugin_is_imported_in_under_20_ms() -> None:
    code = (
        "import time, pytest; start = time.perf_counter(); import shadowbench.pytest_plugin; "
        "print(time.perf_counter() - start)"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(5)]
    assert statistics.median(float(run.stdout) for run in runs) < 0.02
