"""The pytest fixture `shadow_accuracy`, for the test suites of engines. Imports nothing heavy until it is used."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import fields
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from shadowbench.options import ViewOptions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from shadowbench.masks.accuracy import Accuracy

_OPTIONS = [field.name for field in fields(ViewOptions)]


class Score(float):
    """A metric's value; pytest explains what is wrong with the mask when a comparison with it fails."""

    name: str
    accuracy: "ShadowAccuracy"


class ShadowAccuracy:
    """A mask's scores: every metric of `shadowbench list metrics` is an attribute, None where it is not defined.

    accuracy: the scored mask; file: where `explain` writes the difference picture.
    """

    def __init__(self, accuracy: "Accuracy", file: Path) -> None:
        self.accuracy, self.file = accuracy, file

    def __getattr__(self, name: str) -> Score | None:
        metrics = self.accuracy.metrics
        if name not in metrics:
            raise AttributeError(f"{name!r} is not a metric; allowed: {', '.join(metrics)}")
        value = metrics[name]
        if value is None:
            return None
        score = Score(value)
        score.name, score.accuracy = name, self
        return score

    def __repr__(self) -> str:
        return f"accuracy of {self.accuracy.external.name} on {self.accuracy.view.scene.name}"

    @property
    def warnings(self) -> list[str]:
        """A line for each fault of the whole mask: a shift, an sRGB encoding, ambient light."""
        return self.accuracy.warnings

    def explain(self) -> list[str]:
        """What is wrong, in words, and the path of the difference picture, which this writes."""
        from shadowbench.scores.difference import difference_picture, write_difference

        self.file.parent.mkdir(parents=True, exist_ok=True)
        write_difference(self.file, difference_picture(self.accuracy.comparison))
        picture = f"difference: {self.file} (orange false shadow, blue false light)"
        return [*self.accuracy.summary(), *(f"warning: {line}" for line in self.warnings), picture]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option `--shadow-diffs DIR`, a folder for difference pictures."""
    parser.getgroup("shadowbench").addoption(
        "--shadow-diffs",
        metavar="DIR",
        type=Path,
        help="Folder for the difference pictures of failed shadow_accuracy assertions  [the test's tmp_path].",
    )


def pytest_assertrepr_compare(op: str, left: object, right: object) -> list[str] | None:
    """Explain a failed comparison with a Score: the values, the errors in words, the difference picture."""
    score = next((side for side in (left, right) if isinstance(side, Score)), None)
    if score is None:
        return None
    sides = [f"{side.name} {float(side):.5g}" if isinstance(side, Score) else repr(side) for side in (left, right)]
    return [f"{sides[0]} {op} {sides[1]} ({score.accuracy!r})", *score.accuracy.explain()]


@pytest.fixture
def shadow_accuracy(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., ShadowAccuracy]:
    """Score your engine's shadows against ray tracing.

    `assert shadow_accuracy("mask.png", scene="stairs").iou > 0.98`; also `view`, `light`, `assets`, `up`, `sun`,
    `no_ground`, `time`, `clip`, `camera`, `target`, `lamp` and `sun_at`, and `lit`, `shadowed`, `ambient`
    and `linear` in place of a mask, all as `shadowbench score` takes them. mask: a PNG, or an (N, N) array, bool or
    float in [0, 1], uint8 or uint16, row 0 at the top, white is lit; N is taken for the view's size. A mask that is
    flipped, inverted or not square fails the test. A metric that is undefined in the view is None.
    """
    folder = request.config.getoption("--shadow-diffs") or tmp_path
    node = request.node
    plain = re.sub(r"[^\w.-]+", "-", f"{node.path.stem}.{node.name}")[:120]  # a file system takes 255
    name = f"{plain}-{hashlib.sha256(node.nodeid.encode()).hexdigest()[:8]}"  # no other test has it
    numbers = count(1)

    def measure(mask: "str | Path | ArrayLike | None" = None, *, scene: str | Path, **others: Any) -> ShadowAccuracy:
        from shadowbench.errors import InputError
        from shadowbench.masks.accuracy import accuracy_of
        from shadowbench.masks.inputs import external_mask
        from shadowbench.scenes.opening import chosen_view
        from shadowbench.truths.embree import tracer_of

        number = next(numbers)
        file = folder / f"{name}{f'-{number}' if number > 1 else ''}.diff.png"
        try:
            chosen = ViewOptions(**{name: others.pop(name) for name in _OPTIONS if name in others})
            picture = external_mask(mask, **others)
            view = chosen_view(scene, picture.size, chosen, tracer_of=tracer_of)
            return ShadowAccuracy(accuracy_of(picture, view), file)
        except InputError as error:
            pytest.fail(str(error), pytrace=False)

    return measure
