"""Shell completion, called as bash does: with the words so far and the index of the one to complete."""

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.measure.flips import ROW_METRICS
from shadowbench.scenes.library import builtin_names

Complete = Callable[[str], list[str]]


@pytest.fixture
def complete(shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Complete:
    """Completions of the last word of a line."""

    def ask(line: str) -> list[str]:
        monkeypatch.setenv("_SHADOWBENCH_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", f"shadowbench {line}")
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" "))))
        answer = shadowbench()
        assert (answer.code, answer.err) == (0, "")
        return answer.out.split()

    return ask


@pytest.mark.parametrize("command", ["run", "truth", "render", "needs", "recommend", "export", "score"])
def test_scenes_are_completed(complete: Complete, command: str) -> None:
    assert complete(f"{command} ") == list(builtin_names())
    assert complete(f"{command} sta") == [name for name in builtin_names() if name.startswith("sta")] != []


def test_lists_of_scenes_are_completed_at_their_end(complete: Complete) -> None:
    assert complete("tune --scenes stairs,sph") == ["stairs,sphere-and-torus"]
    assert complete("tune --held-out sph") == ["sphere-and-torus"]


@pytest.mark.parametrize("command", ["run", "render", "stress", "tune"])
def test_techniques_are_completed(complete: Complete, command: str) -> None:
    assert complete(f"{command} -t shadow-") == ["shadow-map", "shadow-volume"]
    assert complete(f"{command} -t no-such") == []


def test_parameters_of_the_technique_that_is_tuned_are_completed(complete: Complete) -> None:
    assert complete("tune -t shadow-map --params bias,fi") == ["bias,fit", "bias,filter"]


def test_studies_axes_metrics_and_kinds_are_completed(complete: Complete) -> None:
    assert "presets" in complete("run -s ")
    assert complete("stress --axis ") == list(AXES)
    assert complete("check DIR --tolerance ") == [f"{name}=" for name in ROW_METRICS]
    assert complete("list a") == ["axes"]
    assert complete("list metrics i") == ["iou", "iou_soft"]
    assert complete("report DIR --format h") == ["html"]
    assert complete("run --up ") == ["y", "z"]
    assert complete("run --step ") == ["camera", "light"]
