"""Shell completion, called as bash does: with the words so far and the index of the one to complete."""

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.scenes.library import builtin_names


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("run ", builtin_names()),
        ("score sta", ["stairs", "statue"]),
        ("render -t shadow-", ["shadow-map", "shadow-volume"]),
        ("render -t no-such", []),
        ("run -s pres", ["presets"]),
        ("stress --axis ", list(AXES)),
        ("list a", ["axes"]),
        ("report DIR --format h", ["html"]),
        ("run --up ", ["y", "z"]),
    ],
)
def test_words_are_completed(
    shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, line: str, found: list[str]
) -> None:
    monkeypatch.setenv("_SHADOWBENCH_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"shadowbench {line}")
    monkeypatch.setenv("COMP_CWORD", str(len(line.split(" "))))
    answer = shadowbench()
    assert (answer.code, answer.err, answer.out.split()) == (0, "", found)
