"""`check --repeat`: two runs with known times compared, and a study that is run twice."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.measure.rows import Result
from shadowbench.results.repeat import compare_runs
from tests.results.cells import TIME, cell, read
from tests.results.cells import rows as write


def result(
    name: str, ratio: float | None = 1.0, spread: float = 0.0, scene: str = "cube", fragments: int = 5, **time: Any
) -> Result:
    score = cell(name, scene, None, work={"fragments": fragments})
    quartiles = None if ratio is None else [ratio - spread, ratio + spread]
    timed = TIME | {"ratio": ratio, "ratio_quartiles": quartiles} | time
    return Result(score, None if ratio is None else timed)


def rows(*ratios: float, spread: float = 0.0, **of: Any) -> list[Result]:
    """Cells named 0, 1, 2, … with these ratios."""
    return [result(str(number), ratio, spread, **of) for number, ratio in enumerate(ratios)]


def test_runs_that_order_cells_alike_have_a_tau_of_one() -> None:
    found = compare_runs(rows(1, 2, 3), rows(2, 3, 9))
    (ranking,) = found.rankings
    assert (ranking.block, ranking.cells, ranking.sharp, ranking.swapped) == ("cube camera sun 0", 3, 3, 0)
    assert (ranking.tau, ranking.tau_of_all) == (1, 1)
    assert found.rankings_agree


def test_tau_is_of_pairs_that_agree_less_those_that_do_not() -> None:
    (ranking,) = compare_runs(rows(1, 2, 3, 4), rows(2, 1, 3, 4)).rankings
    assert (ranking.sharp, ranking.swapped) == (6, 1)
    assert ranking.tau == pytest.approx((5 - 1) / 6)
    assert ranking.tau_of_all == pytest.approx(ranking.tau)
    assert not compare_runs(rows(1, 2, 3, 4), rows(2, 1, 3, 4)).rankings_agree


def test_one_cell_has_no_order() -> None:
    """Nor does SciPy warn of it, which would be an error here."""
    (ranking,) = compare_runs(rows(1), rows(2)).rankings
    assert (ranking.cells, ranking.sharp, ranking.tau, ranking.tau_of_all) == (1, 0, None, None)


@pytest.mark.parametrize("near", [0, 1])
def test_a_pair_that_is_within_five_percent_in_either_run_may_swap(near: int) -> None:
    runs = [rows(1.04, 1.0, 2.0), rows(1.0, 1.5, 2.0)]
    (ranking,) = compare_runs(runs[near], runs[1 - near]).rankings
    assert (ranking.sharp, ranking.tau) == (2, 1)
    assert ranking.tau_of_all == pytest.approx(1 / 3)


def test_a_pair_whose_iqrs_overlap_in_either_run_may_swap() -> None:
    wide, sharp = rows(1.0, 1.2, 9.0, spread=0.11), rows(1.2, 1.0, 9.0, spread=0.05)
    for runs in ((wide, sharp), (sharp, wide)):
        (ranking,) = compare_runs(*runs).rankings
        assert (ranking.sharp, ranking.tau) == (2, 1)


def test_every_block_has_a_ranking_of_its_own_and_all_must_hold() -> None:
    first = [*rows(1, 2, 3), *rows(1, 2, 3, scene="torus")]
    second = [*rows(1, 2, 3), *rows(3, 2, 1, scene="torus")]
    found = compare_runs(first, second)
    assert [(one.block.split()[0], one.tau) for one in found.rankings] == [("cube", 1), ("torus", -1)]
    assert not found.rankings_agree


@pytest.mark.parametrize("other", [{"machine": "other"}, {"clock": "other"}, {"reference": "other"}])
def test_times_that_cannot_be_compared_are_left_out(other: dict[str, str]) -> None:
    assert compare_runs(rows(1, 2), [result("0", 1, **other), result("1", 2, **other)]).rankings == ()
    assert compare_runs(rows(1, 2), [result("0", None), result("1", None)]).rankings == ()


def test_work_that_differs_is_named() -> None:
    found = compare_runs(rows(1, 2), [result("0", 1), result("1", 2, fragments=6), result("2", 3)])
    assert (found.counted, found.unequal) == (2, ("cube 1",))


STUDY = """
scenes = ["cube-on-plane"]
map_size = [64, 1024]
view_size = 64
rounds = 1
reference = "shadow-map:size=64"
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "shadow-map"
[[technique]]
spec = "ray-traced"
"""


def retimed(folder: Path, ratios: list[float]) -> None:
    """Times as on a machine without noise, in place of measured ones."""
    times = read(folder, "time")
    assert len(times) == len(ratios)
    changed = [row | {"ratio": ratio, "ratio_quartiles": [ratio] * 2} for row, ratio in zip(times, ratios, strict=True)]
    write(folder, *read(folder), *changed)


def test_the_same_study_run_twice(tmp_path: Path, shadowbench: Callable[..., Any]) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        assert shadowbench("run", "-s", tmp_path / "study.toml", "-o", folder, "-q").code == 0
        retimed(folder, [1.0, 2.0, 3.0, 4.0])
    words = ("check", folders[1], "--baseline", folders[0], "--repeat")
    answer = shadowbench(*words)
    assert answer.code == 0, answer.out
    assert "work: exactly the same in 4 of 4 cells" in answer.out
    found = json.loads(shadowbench(*words, "--json").out)
    (ranking,) = found["rankings"]
    assert (ranking["tau"], found["holds"], found["unequal"]) == (1, True, []) and ranking["sharp"] >= 3
    file = folders[1] / "rows.jsonl"
    file.write_text(file.read_text().replace('"draws": ', '"draws": 1'))
    answer = shadowbench(*words)
    assert answer.code == 1 and "work differs: cube-on-plane shadow-map 64" in answer.out


def test_a_folder_that_was_timed_again_is_compared_with_itself(tmp_path: Path, shadowbench: Callable[..., Any]) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    folder = tmp_path / "out"
    command = ("run", "-s", tmp_path / "study.toml", "-o", folder, "-q")
    assert shadowbench(*command).code == 0
    once = shadowbench("check", folder, "--repeat")
    assert once.code == 2 and "no cell was timed twice" in once.err and "--time-again" in once.err
    assert shadowbench(*command).code == 0 and len(read(folder, "time")) == 4, "a second call times nothing"
    assert shadowbench(*command, "--time-again").code == 0
    keys = [row["key"] for row in read(folder, "time")]
    assert len(keys) == 8 and set(keys[:4]) == set(keys[4:])
    for last in (1, -1):  # the second times in the order of the first, and against it
        retimed(folder, [2.0 ** ((1 if at < 4 else last) * sorted(keys).index(key)) for at, key in enumerate(keys)])
        (ranking,) = json.loads(shadowbench("check", folder, "--repeat", "--json").out)["rankings"]
        assert (ranking["cells"], ranking["sharp"], ranking["tau"]) == (4, 6, last)


def test_runs_that_cannot_be_compared_are_one_line(tmp_path: Path, shadowbench: Callable[..., Any]) -> None:
    run = ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "--rounds", "0", "-q", "-o"]
    assert shadowbench(*run, tmp_path / "a").code == shadowbench(*run, tmp_path / "b").code == 0
    assert shadowbench(*run, tmp_path / "sun", "--sun").code == 0
    recorded = [json.loads((tmp_path / name / "run.json").read_text())["study"]["sun"] for name in ("a", "sun")]
    assert recorded == [False, True]
    for arguments, expected in (
        ((tmp_path / "a", tmp_path / "a"), "named twice; named once,"),
        ((tmp_path / "a", tmp_path / "b"), "no two cells differ sharply"),
        ((tmp_path / "a", tmp_path / "none"), "no such folder"),
        ((tmp_path / "a", tmp_path / "sun"), "sun: was measured with --sun; allowed: as "),
        ((tmp_path / "sun", tmp_path / "a"), "a: was measured without --sun; allowed: as "),
    ):
        baseline, folder = arguments
        answer = shadowbench("check", folder, "--baseline", baseline, "--repeat")
        assert (answer.code, answer.out) == (2, "")
        assert expected in answer.err and len(answer.err.splitlines()) == 1
    for words, expected in (
        (["--repeat", "--update", "--baseline", tmp_path / "b"], "--repeat: found --update, --time or --tolerance"),
        ([], "check: found no --baseline; allowed: --baseline DIR, or --repeat"),
    ):
        answer = shadowbench("check", tmp_path / "a", *words)
        assert (answer.code, answer.out) == (2, "") and expected in answer.err
