"""The pytest fixtures `shadow_accuracy` and `shadow_benchmark`. Imports nothing heavy until one is used."""

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
    and `linear` in place of a mask, all as `shadowbench score` takes them. mask: a PNG, or an (H, W) array, bool or
    float in [0, 1], uint8 or uint16, row 0 at the top, white is lit; its size is the view's. A mask that is
    flipped, turned or inverted fails the test. A metric that is undefined in the view is None.
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


def _reference_frames() -> Callable[..., float]:
    """A timer for pytest-benchmark that a frame advances by its ratio to the reference, rather than by its seconds."""
    now = 0.0

    def frames_of_the_reference(passed: float = 0.0) -> float:
        nonlocal now
        now += passed
        return now

    return frames_of_the_reference


@pytest.hookimpl(optionalhook=True, tryfirst=True)
def pytest_benchmark_scale_unit(unit: str, benchmarks: "list[dict[str, Any]]") -> tuple[str, float] | None:
    """Tables and histograms of groups whose times are ratios say so."""
    from pytest_benchmark.utils import TIME_UNITS  # the histogram's names of its own units

    TIME_UNITS["reference frame"] = "frames of the reference"
    ratios = all("reference_ms" in bench["extra_info"] for bench in benchmarks)
    return ("reference frame", 1.0) if unit == "seconds" and ratios else None


@pytest.fixture
def shadow_benchmark(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Score a technique against ray tracing, and time it on pytest-benchmark.

    `shadow_benchmark("my-shadows:size=1024", scene="stairs", plugin="my-shadows.py", min_iou=0.98)`. In each of the
    `rounds` [9] a frame of it, of `unshadowed` and of the `reference` [shadow-map:size=1024] are timed in turn;
    pytest-benchmark's statistics are of the ratio of the first to the last, so that on a noisy machine too
    `--benchmark-compare-fail=median:25%` fails only if the technique got slower. `extra_info` has metrics, work,
    bytes and milliseconds; the same mapping is returned. The test fails below `min_iou`, and where `check` would
    report a regression against the folder `baseline`; it is skipped where the view is not supported. Also `view_size`
    [512], and `view`, `light` and all else that `shadow_accuracy` takes to choose a view.
    """
    if "benchmark" in request.node.funcargs:
        pytest.fail("`benchmark` stands before `shadow_benchmark` in the arguments of this test; allowed: after it")
    timer = _reference_frames()
    request.node.add_marker(pytest.mark.benchmark(timer=timer))
    benchmark = request.getfixturevalue("benchmark")

    def measure(
        spec: str,
        *,
        scene: Any,
        plugin: str | Path | None = None,
        reference: str | None = None,
        rounds: int = 9,
        view_size: int | str = 512,
        min_iou: float | None = None,
        baseline: str | Path | None = None,
        **others: Any,
    ) -> dict[str, Any]:
        from shadowbench.errors import ShadowbenchError, Unsupported
        from shadowbench.scenes.opening import chosen_view
        from shadowbench.studies.benchmark import measure_cell, regressions
        from shadowbench.truths.embree import tracer_of

        plugins = [] if plugin is None else [Path(plugin)]
        try:
            view = chosen_view(scene, view_size, ViewOptions(**others), tracer_of=tracer_of)
            timed = 0 if benchmark.disabled else rounds
            cell = measure_cell(spec, view, rounds=timed, reference=reference, plugins=plugins)
            faults = [] if baseline is None else regressions(cell.result, Path(baseline))
        except Unsupported as reason:
            raise pytest.skip.Exception(str(reason)) from None
        except ShadowbenchError as error:
            raise pytest.fail.Exception(str(error), pytrace=False) from None
        benchmark.group = benchmark.group or view.scene.name
        benchmark.extra_info |= (summary := cell.summary)
        ratios = iter(cell.ratios)
        benchmark.pedantic(lambda: timer(next(ratios, 0.0)), rounds=max(timed, 1))
        if min_iou is not None and not (summary["iou"] or 0.0) >= min_iou:
            faults.append(f"iou is {summary['iou']:.6g}; min_iou is {min_iou}")
        if faults:
            pytest.fail(f"{spec} on {view.scene.name}: {'; '.join(faults)}", pytrace=False)
        return summary

    return measure
