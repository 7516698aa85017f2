"""Every generated file gives a result or one clear line; `FUZZ=10000 pytest tests/fuzz -m exhaustive` tries so many."""

import os
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .cases import Case
from .corrupt import FORMATS, corrupted
from .texts import scene_case, spec_case, study_case
from .verdict import Watch, judged

pytestmark = pytest.mark.timeout(1200)
CASES: dict[str, tuple[int, st.SearchStrategy[Case]]] = {  # and how many of each for one of another kind
    "scene": (5, scene_case()),
    "study": (3, study_case()),
    "spec": (2, spec_case()),
    **{kind: (1, st.integers(0, 10**6).map(lambda number, kind=kind: corrupted(kind, number))) for kind in FORMATS},
}
MANY = int(os.environ.get("FUZZ", "2000"))


@pytest.fixture(scope="session")
def watch() -> Watch:
    """With what is imported and compiled on first use, for lights with and without a size, with files of its own."""
    watch = Watch()  # a hook stays for the life of the process
    for light in ("", '[light]\nkind = "point"\nposition = [0, 5, 0]\nradius = 0.1\n'):
        judged(Case("scene", "a.toml", {"a.toml": f'{light}[[mesh]]\nshape = "box"\n'.encode()}), watch)
    return watch


def each(kind: str, count: int, number: int, do: Callable[[Case], None]) -> None:
    """Calls a function with so many cases, the same for the same number; reports the first that fails."""
    options = settings(
        max_examples=count,
        phases=[Phase.generate],
        database=None,
        deadline=30_000,  # milliseconds; what never ends, the time limit of the test ends
        suppress_health_check=list(HealthCheck),
    )
    seed(number)(options(given(CASES[kind][1])(do)))()


@pytest.mark.parametrize(
    ("number", "files"),
    [
        (0, 48),
        pytest.param(1, 500, marks=pytest.mark.slow),
        pytest.param(2, MANY, marks=[pytest.mark.slow, pytest.mark.exhaustive]),
    ],
    ids=["some", "five hundred", "many"],
)
@pytest.mark.parametrize("kind", CASES)
def test_every_file_gives_a_result_or_one_line(watch: Watch, kind: str, number: int, files: int) -> None:
    seen: set[str] = set()
    count = files * CASES[kind][0] // 16

    def judge(case: Case) -> None:
        verdict = judged(case, watch)
        assert verdict.kind != "failure", verdict.line
        seen.add(verdict.kind)

    each(kind, count, number, judge)
    assert count < 10 or seen == {"result", "refusal"}
