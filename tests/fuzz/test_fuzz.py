"""Every generated file gives a result or one clear line; `python -m tests.fuzz` tries the full count."""

from multiprocessing.pool import ThreadPool

import pytest

from .cases import Case
from .command import commanded
from .corrupt import FORMATS, corrupted
from .generate import generated
from .pool import verdicts


def failures(cases: list[Case]) -> list[str]:
    found = [(case, verdict) for case, verdict, _ in verdicts(cases, jobs=2)]
    assert len(found) == len(cases)
    assert {"result", "refusal"} <= {verdict.kind for _, verdict in found}
    return [f"{case.kind}: {verdict.line}" for case, verdict in found if verdict.kind == "failure"]


def test_some_files_give_a_result_or_one_line() -> None:
    assert failures([*generated(30), *(corrupted(kind, k) for kind in FORMATS for k in range(2))]) == []


@pytest.mark.slow
def test_five_hundred_files_give_a_result_or_one_line() -> None:
    assert failures([*generated(350, 1), *(corrupted(kind, k) for kind in FORMATS for k in range(100, 125))]) == []


@pytest.mark.slow
@pytest.mark.exhaustive
def test_two_thousand_files_give_a_result_or_one_line() -> None:
    assert failures([*generated(1400, 1), *(corrupted(kind, k) for kind in FORMATS for k in range(100, 200))]) == []


@pytest.mark.slow
def test_the_command_line_gives_a_result_or_one_line() -> None:
    counts = {"scene": 100, "study": 400, "spec": 100}  # few studies are small enough to be run
    cases = [case for kind, count in counts.items() for case in generated(count, 2, kind)]
    cases += [corrupted(kind, k) for kind in FORMATS for k in range(20)]
    found = {}
    for case, verdict, _ in verdicts(cases, jobs=2):
        if verdict.small:
            found[case.kind, verdict.kind] = case
    kinds = ["scene", "study", "spec", *FORMATS]
    assert found.keys() == {(kind, answer) for kind in kinds for answer in ("result", "refusal")}
    with ThreadPool(2) as pool:
        answers = pool.map(commanded, found.values())
    assert [
        f"{case.kind}: {answer.line}"
        for case, answer in zip(found.values(), answers, strict=True)
        if answer.kind == "failure"
    ] == []
