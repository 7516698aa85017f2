"""The pytest plug-in, used in a test suite as an engine would."""

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
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
    assert found.warnings == []

def test_bytes(shadow_accuracy):
    assert shadow_accuracy(np.rint(read_mask("mask.png") * 255).astype(np.uint8), scene="stairs").iou > 0.98

def test_screenshots(shadow_accuracy):
    for linear in (False, True):  # the mask is all but hard
        assert shadow_accuracy(lit="lit.png", shadowed="shadowed.png", linear=linear, scene="stairs").iou > 0.98
"""


EMPTY = """
def test_it(shadow_accuracy):
    assert shadow_accuracy("empty.png", scene="stairs").iou > 0.98
"""
LONG = "x" * 200
ALIKE = f"""
import pytest

def accurate(shadow_accuracy):
    assert shadow_accuracy("empty.png", scene="stairs").iou > 0.98

@pytest.mark.parametrize("case", ["a{LONG}", "b{LONG}", "{LONG}a", "{LONG}b", "a b", "a/b"])
def test_it(shadow_accuracy, case):
    accurate(shadow_accuracy)

class TestOne:
    def test_it(self, shadow_accuracy):
        accurate(shadow_accuracy)
"""
REFUSED = """
def test_flipped(shadow_accuracy):
    shadow_accuracy("flipped.png", scene="stairs")

def test_of_one_view(shadow_accuracy):
    shadow_accuracy("mask.png", scene="stairs.npz", sun=True)
"""
OTHERWISE = """
def test_it(shadow_accuracy):
    assert 0.98 < shadow_accuracy("empty.png", scene="stairs").iou
"""
MISSPELT = """
def test_metric(shadow_accuracy):
    shadow_accuracy("mask.png", scene="stairs").iuo

def test_keyword(shadow_accuracy):
    shadow_accuracy("mask.png", scene="stairs", lit="lit.png")
"""


@dataclass(frozen=True)
class Ran:
    """Output of a test suite, and the pictures it wrote."""

    code: int
    printed: str
    pictures: list[Path]

    def outcomes(self, file: str) -> Counter[str]:
        """Numbers of passed and failed tests of a file."""
        return Counter(re.findall(rf"^(PASSED|FAILED) {file}::", self.printed, re.MULTILINE))


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory, drawn: Callable) -> Callable[..., Ran]:
    """Runs test files in an empty folder with a good mask, with installed plug-ins only."""
    visibility = drawn("stairs")

    def run(pictures: str, option: str, **files: str) -> Ran:
        folder = tmp_path_factory.mktemp("engine")
        write_mask(folder / "mask.png", visibility)
        write_mask(folder / "flipped.png", visibility[::-1])
        write_mask(folder / "empty.png", np.ones_like(visibility))
        for name, values in (("lit", np.ones_like(visibility)), ("shadowed", visibility > 0.5)):
            Image.fromarray(np.rint(values * 255.0).astype(np.uint8)).save(folder / f"{name}.png")
        for name, text in files.items():
            (folder / f"test_{name}.py").write_text(text)
        left = folder / pictures
        command = [sys.executable, "-m", "pytest", "-q", "-rpf", "-p", "no:cacheprovider", f"{option}={left}"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        return Ran(done.returncode, done.stdout, sorted(left.rglob("*.png")))

    return run


@pytest.fixture(scope="module")
def judged(ran: Callable[..., Ran]) -> Ran:
    """Results of all tests without options, with a folder for pictures."""
    suites = {"good": SUITE, "empty": EMPTY, "alike": ALIKE, "alike_too": ALIKE}
    return ran("diffs", "--shadow-diffs", **suites, refused=REFUSED)


@pytest.fixture(scope="module")
def otherwise(ran: Callable[..., Ran]) -> Ran:
    """Results without such a folder."""
    return ran("base", "--basetemp", otherwise=OTHERWISE, misspelt=MISSPELT)


def test_a_good_mask_passes_as_file_array_bytes_and_screenshots(judged: Ran) -> None:
    assert judged.outcomes("test_good.py") == {"PASSED": 4}, judged.printed


def test_a_failure_says_what_kind_of_error_it_is_and_saves_the_picture(judged: Ran) -> None:
    assert judged.code == 1 and judged.outcomes("test_empty.py") == {"FAILED": 1}
    assert "iou 0 > 0.98 (accuracy of empty.png on stairs)" in judged.printed
    assert "of the shadow next to its caster is lit (peter-panning)" in judged.printed
    (picture,) = (file for file in judged.pictures if file.name.startswith("test_empty."))
    assert str(picture) in judged.printed
    with Image.open(picture) as image:
        assert image.size == (256, 256)


@pytest.mark.slow
def test_without_a_folder_the_picture_goes_to_the_tests_own(otherwise: Ran) -> None:
    assert otherwise.code == 1 and "0.98 < iou 0 (accuracy of" in otherwise.printed
    (picture,) = otherwise.pictures
    assert re.fullmatch(r"test_otherwise\.test_it-[0-9a-f]{8}\.diff\.png", picture.name)


def test_no_two_tests_share_a_picture(judged: Ran) -> None:
    assert judged.outcomes("test_alike.py") == judged.outcomes("test_alike_too.py") == {"FAILED": 7}
    assert sum(file.name.startswith("test_alike") for file in judged.pictures) == 14


def test_bad_input_is_a_failure_of_one_line(judged: Ran) -> None:
    assert judged.outcomes("test_refused.py") == {"FAILED": 2}
    assert "--sun: stairs.npz is the truth of one view; allowed: a scene, with --sun" in judged.printed
    assert "flipped.png: is flipped vertically, against the truth of stairs" in judged.printed
    assert "Traceback" not in judged.printed and "shadowbench/pytest_plugin.py" not in judged.printed


def test_a_misspelt_metric_or_keyword_is_an_error_that_names_the_right_ones(otherwise: Ran) -> None:
    assert "AttributeError: 'iuo' is not a metric; allowed: iou, iou_soft" in otherwise.printed
    assert "TypeError: a mask and lit; allowed: a mask, or lit, shadowed, ambient and linear" in otherwise.printed
