"""Metrics of plug-ins: columns like any other, rows of their own, and faults told in a line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.promises.conftest import table

Command = Callable[..., Any]
AREA = Path(__file__).parents[2] / "examples" / "shadow_area.py"
RUN = ("run", "cube-on-plane", "-t", "unshadowed", "-t", "shadow-map:size=64", "--view-size", "64", "--rounds", "0")


def test_a_metric_of_a_plug_in_is_listed_printed_tabled_and_compared(shadowbench: Command, tmp_path: Path) -> None:
    answer = shadowbench(*RUN, "--plugin", AREA, "-o", tmp_path / "out")
    assert answer.code == 0, answer.err
    assert "shadow-area" in answer.out
    area = {line["technique"]: float(line["shadow-area"]) for line in table(tmp_path / "out")}
    assert area["unshadowed"] == 0 and 0.8 < area["shadow-map"] < 1.2
    assert "shadow-area" in shadowbench("list", "metrics", "--plugin", AREA).out
    assert "shadow-area" not in shadowbench("list", "metrics").out, "the next command does not know it"
    (tmp_path / "double.py").write_text(AREA.read_text().replace("drawn / true if", "2 * drawn / true if"))
    answer = shadowbench(*RUN, "--plugin", tmp_path / "double.py", "-o", tmp_path / "double")
    assert answer.code == 0, answer.err
    check = ("check", tmp_path / "double", "--baseline", tmp_path / "out")
    answer = shadowbench(*check)
    assert (answer.code, "2 cells compared" in answer.out) == (0, True)
    assert "not compared, since their plug-in is not loaded: shadow-area" in answer.err
    answer = shadowbench(*check, "--plugin", AREA)
    assert answer.code == 1 and "shadow-area" in answer.out


@pytest.mark.parametrize(
    ("value", "line"),
    [
        ("float('nan')", "failed: metric shadow-area: found nan; allowed: a finite number, or None"),
        ("'much'", "failed: metric shadow-area: TypeError: must be real number, not str"),
    ],
)
def test_a_metric_that_fails_fails_its_cells(shadowbench: Command, tmp_path: Path, value: str, line: str) -> None:
    plugin = tmp_path / "area.py"
    plugin.write_text(AREA.read_text().replace("drawn / true if true else None", value))
    answer = shadowbench(*RUN, "--plugin", plugin, "-o", tmp_path / "out")
    assert answer.code == 3 and line.removeprefix("failed: ") in answer.err
    assert [row["status"] for row in table(tmp_path / "out")] == [line, line]


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"shadow-area"', '"iou"', "two metrics are called 'iou'"),
        ('"shadow-area"', '"status"', "a metric is called 'status', as is a column; allowed: another name"),
        ('"shadow-area"', '"a b"', "the name 'a b' is not a valid name; allowed: letters, digits, _ and -"),
        ("SHADOW_AREA = Metric(", "(", "defines no subclass of Technique, Bias, Filter, Fit or Split, and no Metric("),
    ],
)
def test_a_plug_in_says_what_a_metric_lacks(
    shadowbench: Command, tmp_path: Path, old: str, new: str, line: str
) -> None:
    plugin = tmp_path / "area.py"
    plugin.write_text(AREA.read_text().replace(old, new))
    answer = shadowbench(*RUN, "--plugin", plugin, "-o", tmp_path / "out")
    assert answer.code == 2 and line in answer.err
    assert not (tmp_path / "out").exists()
