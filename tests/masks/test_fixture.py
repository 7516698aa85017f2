"""The pytest plug-in, used in a test suite as an engine would."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.scores.masks import write_mask

pytestmark = pytest.mark.slow

SUITE = """
import numpy as np
import pytest
from shadowbench.scores.masks import read_mask

def test_good(shadow_accuracy):
    mask = read_mask("mask.png")
    score = shadow_accuracy(mask, scene="stairs", view="camera", light="light")
    assert score.iou > 0.98 and score.acne == 0 and score.ssim > 0.95 and 0 <= score.edge_px < 0.5
    assert score.warnings == []
    assert shadow_accuracy("mask.png", scene="stairs").iou > 0.98
    assert shadow_accuracy(np.rint(mask * 255).astype(np.uint8), scene="stairs").iou > 0.98
    for linear in (False, True):  # the mask is all but hard
        assert shadow_accuracy(lit="lit.png", shadowed="shadowed.png", linear=linear, scene="stairs").iou > 0.98

@pytest.mark.parametrize("case", ["{LONG}a", "{LONG}b", "a b", "a/b"])
def test_bad(shadow_accuracy, case):
    assert shadow_accuracy("empty.png", scene="stairs").iou > 0.98

class TestOther:
    def test_bad(self, shadow_accuracy):
        assert 0.98 < shadow_accuracy("empty.png", scene="stairs").iou

def test_flipped(shadow_accuracy):
    shadow_accuracy("flipped.png", scene="stairs")

def test_metric(shadow_accuracy):
    shadow_accuracy("mask.png", scene="stairs").iuo

def test_keyword(shadow_accuracy):
    shadow_accuracy("mask.png", scene="stairs", lit="lit.png")
""".replace("{LONG}", "x" * 200)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, drawn: Callable) -> Path:
    """A folder with the suite and its masks, with installed plug-ins only."""
    folder, visibility = tmp_path_factory.mktemp("engine"), drawn("stairs")
    write_mask(folder / "mask.png", visibility)
    write_mask(folder / "flipped.png", visibility[::-1])
    write_mask(folder / "empty.png", np.ones_like(visibility))
    for name, values in (("lit", np.ones_like(visibility)), ("shadowed", visibility > 0.5)):
        Image.fromarray(np.rint(values * 255.0).astype(np.uint8)).save(folder / f"{name}.png")
    (folder / "test_suite.py").write_text(SUITE)
    return folder


def run(folder: Path, *options: str) -> str:
    """What pytest prints of the suite; its exit code is that of failed tests."""
    command = [sys.executable, "-m", "pytest", "-q", "-rpf", "-p", "no:cacheprovider", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    return done.stdout


@pytest.fixture(scope="module")
def printed(folder: Path) -> str:
    return run(folder, f"--shadow-diffs={folder / 'diffs'}")


def test_a_good_mask_passes_as_file_array_bytes_and_screenshots(printed: str) -> None:
    assert re.findall(r"(?m)^PASSED test_suite\.py::(\w+)", printed) == ["test_good"]


def test_a_failure_says_what_is_wrong_and_each_saves_a_picture_of_its_own(printed: str, folder: Path) -> None:
    assert "iou 0 > 0.98 (accuracy of empty.png on stairs)" in printed
    assert "0.98 < iou 0 (accuracy of" in printed
    assert "of the shadow next to its caster is lit (peter-panning)" in printed
    pictures = sorted((folder / "diffs").iterdir())
    assert len(pictures) == 5 and all(str(picture) in printed for picture in pictures)
    with Image.open(pictures[0]) as image:
        assert image.size == (256, 256)


def test_bad_input_is_a_failure_of_one_line(printed: str) -> None:
    assert "flipped.png: is flipped vertically, against the truth of stairs" in printed
    assert "AttributeError: 'iuo' is not a metric; allowed: iou, iou_soft" in printed
    assert "score: found MASK and --lit; allowed: MASK; or --lit and --shadowed" in printed
