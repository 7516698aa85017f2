"""The pytest plug-in, in a suite of its own, as an engine would have it."""

import re
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
    (picture,) = (tmp_path / "base").rglob("*.png")
    assert re.fullmatch(r"test_engine\.test_it-[0-9a-f]{8}\.diff\.png", picture.name)


def test_no_two_tests_share_a_picture(suite: Callable, tmp_path: Path) -> None:
    long = "x" * 200
    text = (
        "import pytest\n"
        "def accurate(shadow_accuracy):\n"
        '    assert shadow_accuracy("empty.png", scene="stairs").iou > 0.98\n'
        f'@pytest.mark.parametrize("case", ["a{long}", "b{long}", "{long}a", "{long}b", "a b", "a/b"])\n'
        "def test_it(shadow_accuracy, case):\n    accurate(shadow_accuracy)\n"
        "class TestOne:\n    def test_it(self, shadow_accuracy):\n        accurate(shadow_accuracy)\n"
    )
    diffs = tmp_path / "diffs"
    (tmp_path / "engine" / "test_another.py").write_text(text)
    done = suite(text, "--shadow-diffs", str(diffs))
    assert "14 failed" in done.stdout
    assert len(list(diffs.iterdir())) == 14


def test_a_metric_that_is_not_defined_is_none_and_a_comparison_says_why(suite: Callable, tmp_path: Path) -> None:
    scene = (
        'name = "bare"\ncamera = { position = [0.0, 2.0, 3.0], target = [0.0, 0.0, 0.0] }\n'
        'light = { kind = "directional", direction = [0.2, -1.0, 0.1] }\nmesh = [{ shape = "plane", scale = 9.0 }]\n'
    )
    (tmp_path / "engine" / "bare.toml").write_text(scene)
    done = suite(
        "def test_read(shadow_accuracy):\n"
        '    assert shadow_accuracy("empty.png", scene="bare.toml").iou is None\n'
        "def test_compared(shadow_accuracy):\n"
        '    assert shadow_accuracy("empty.png", scene="bare.toml").iou > 0.98\n'
        "def test_contact(shadow_accuracy):\n"
        '    assert shadow_accuracy("mask.png", scene="bare.toml").contact < 0.1\n'
        "def test_of_its_own():\n"
        "    assert None > 0.98\n"
    )
    assert "3 failed, 1 passed" in done.stdout
    assert "iou is None (accuracy of empty.png on bare): neither the truth nor the mask has a shadow in" in done.stdout
    assert "contact is None (accuracy of mask.png on bare): undefined here; of" in done.stdout
    # Where CI is set, pytest's summary says every failure a second time, whole.
    said = [line for line in done.stdout.splitlines() if line.startswith("E ") and " is None (" in line]
    assert len(said) == 2 and "pytest_plugin.py" not in done.stdout


def test_bad_input_is_a_failure_of_one_line(suite: Callable) -> None:
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("flipped.png", scene="stairs")\n')
    assert done.returncode == 1
    assert "flipped.png: is flipped vertically, against the truth of stairs" in done.stdout
    assert "Traceback" not in done.stdout and "pytest_plugin.py" not in done.stdout


def test_a_misspelt_metric_or_keyword_is_an_error_that_names_the_right_ones(suite: Callable) -> None:
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("mask.png", scene="stairs").iuo\n')
    assert "AttributeError: 'iuo' is not a metric; allowed: iou, iou_soft" in done.stdout
    done = suite('def test_it(shadow_accuracy):\n    shadow_accuracy("mask.png", scene="stairs", lit="lit.png")\n')
    assert "TypeError: a mask and lit; allowed: a mask, or lit, shadowed and ambient" in done.stdout
