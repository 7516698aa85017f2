"""Generated text files, the same for the same count."""

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .cases import Case
from .texts import scene_case, spec_case, study_case


def generated(count: int, number: int = 0, kind: str | None = None) -> list[Case]:
    """Scene files, study files and specs: half, three tenths and the rest of `count`; or all of one kind."""
    if kind is not None:
        return _drawn(STRATEGIES[kind](), count, number)
    scenes, studies = count // 2, count * 3 // 10
    shares = {"scene": scenes, "study": studies, "spec": count - scenes - studies}
    return [case for kind, share in shares.items() for case in generated(share, number, kind)]


STRATEGIES = {"scene": scene_case, "study": study_case, "spec": spec_case}


def _drawn(strategy: st.SearchStrategy[Case], count: int, number: int) -> list[Case]:
    cases: list[Case] = []

    @seed(number)
    @settings(
        max_examples=count,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def collect(case: Case) -> None:
        cases.append(case)

    if count:
        collect()
    return cases
