"""The claims of the table of laws, tested on small random scenes.

That every kind of claim can fail is shown by tests/faults, which plants a fault for each.
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.maps.biases import Constant, NoBias, ReceiverPlane
from shadowbench.maps.filters import PCF, Hard
from shadowbench.maps.fits import FixedFit
from shadowbench.maps.moments import EVSM, VSM
from shadowbench.maps.pcss import PCSS
from shadowbench.plugin.registry import own_techniques
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import unit

from .answers import Answer, Drawing, traced
from .changes import LAWS, with_meshes
from .scenes import Little, littles
from .table import ANALYSED, TABLE, Subject, claims, subjects

PIXELS = {True: 96, False: 48}  # along a side, of the truth and of techniques
PHASES = 8
SHADOWED = 0.01  # least share of the picture
SOME = settings(
    max_examples=2,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],  # shrinking a failure would take minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
)
MORE = settings(SOME, max_examples=10)
THOROUGH = settings(SOME, max_examples=40)
CLAIMED = [
    pytest.param(law, name, claim, id=f"{law}, {name}, {claim.kind}")
    for law, name, claim in claims()
    if claim.kind != "none"
]

# Answers to unchanged scenes, which every law begins with, by the subject's name and the scene.
_before: dict[tuple[str, Little], Answer] = {}


@dataclass
class Case:
    """A subject before and after a change."""

    studio: Any
    subject: Subject
    little: Little
    views: tuple[View, View]

    def drawing(self, view: View, **parameters: Any) -> Drawing:
        """The subject, which is a technique, with some of its parameters changed."""
        assert self.subject.spec is not None
        return Drawing(self.studio, self.subject.spec.with_(**parameters), view)

    def visibility(self, view: View, **parameters: Any) -> NDArray[np.float32]:
        if self.subject.spec is None:
            return traced(view).visibility
        with self.drawing(view, **parameters) as drawing:
            return drawing.visibility()

    def answers(self) -> tuple[Answer, Answer]:
        key = self.subject.name, self.little
        if key not in _before:
            _before[key] = self._answer(self.views[0])
        return _before[key], self._answer(self.views[1])

    def _answer(self, view: View) -> Answer:
        if self.subject.spec is None:
            return traced(view)
        with self.drawing(view) as drawing:
            return drawing.answer()


def bits(case: Case) -> None:
    assert np.array_equal(*map(case.visibility, case.views)), "bits differ"


def equal(case: Case) -> None:
    before, after = case.answers()
    both = before.decided & after.decided
    assert both.mean() > 0.95, "nearly all is compared"
    assert not (before.shadow != after.shadow)[both].any(), "a decided pixel differs"


def subset(case: Case) -> None:
    before, after = case.answers()
    both = before.decided & after.decided & (before.triangle == after.triangle)
    assert both.any()
    assert not (before.shadow & ~after.shadow)[both].any(), "a caster lights a pixel"


def within(case: Case) -> None:
    """A permutation test: if the change only shifted the grid, it would fail by chance once in 6435."""
    errors = []
    for view in case.views:
        with case.drawing(view) as drawing:
            errors.append(drawing.errors(PHASES))
    before, after = errors
    assert len(before) == len(after) == PHASES
    assert min(before) <= max(after) and min(after) <= max(before), "no phase errs as before"


def agree(case: Case) -> None:
    """With so fine a map and so large a bias that most kernels agree."""
    rows = Hard(), *(PCF(taps=taps) for taps in (3, 5, 7))
    *fewer, most = (case.visibility(case.views[0], size=512, bias=Constant(world=0.3), filter=row) for row in rows)
    agreed = (most == 0) | (most == 1)
    assert agreed.mean() > 0.6
    for mask in fewer:
        assert (mask == most)[agreed].all(), "taps changed a pixel whose kernel agrees"


def limit(case: Case) -> None:
    """As many texels and as wide a bias as in `agree`; each texel is compared with the receiver's plane."""
    (view, changed), same = case.views, {"size": 512, "bias": ReceiverPlane(slack=3.0)}
    hard, box = (case.visibility(view, **same, filter=row) for row in (Hard(), PCF(taps=3)))
    agreed = (box == 0) | (box == 1)
    assert agreed.mean() > 0.6
    soft = case.visibility(changed, **same, filter=PCSS())
    assert (soft == hard)[agreed].all(), "a light of nearly no size has a penumbra"


def blurred(case: Case) -> None:
    equal(case)
    for row in (VSM(bleed=0.0), EVSM()):
        with case.drawing(case.views[0], filter=row) as drawing:
            before, by_nudge = drawing.visibility(), drawing.by_nudge()
        change = np.abs(case.visibility(case.views[1], filter=row) - before)
        assert by_nudge.mean() < 0.01
        assert (change < by_nudge + 1e-3).all(), "a blur is not the same elsewhere"


def bleeds(case: Case) -> None:
    """Between the changed view, and the same with the upper sheet halfway down to the lower one."""
    _, changed = case.views
    *others, upper = changed.scene.meshes
    toward = -unit(changed.light.direction)
    down = 0.5 * toward * ((upper.vertices[0] - others[-1].vertices[0]) @ toward)
    halfway = with_meshes(changed, [*others, replace(upper, vertices=upper.vertices - down)])
    fit = FixedFit(half=6.5, near=1.0, far=60.0, distance=50.0)
    low, high = (case.visibility(view, fit=fit, bias=NoBias(), filter=VSM(bleed=0.0)) for view in (halfway, changed))
    assert (high > low - 1e-3).all() and high.mean() > low.mean() + 1e-3, "no more light through casters farther apart"


CHECKS: dict[str, Callable[[Case], None]] = {
    check.__name__: check for check in (bits, equal, within, subset, agree, limit, blurred, bleeds)
}


@cache
def shadowed(little: Little) -> bool:
    """Whether the view shows a shadow."""
    return bool(traced(little.view(32)).shadow.mean() > SHADOWED)


@pytest.mark.parametrize(
    "how",
    [
        pytest.param(None, id="few scenes"),
        pytest.param(MORE, id="10 scenes", marks=pytest.mark.slow),
        pytest.param(THOROUGH, id="40 scenes", marks=[pytest.mark.slow, pytest.mark.exhaustive]),
    ],
)
@pytest.mark.parametrize(("law", "name", "claim"), CLAIMED)
def test_law(studio, law, name, claim, how) -> None:
    subject = subjects()[name]

    @(how or (MORE if name == "truth" else SOME))
    @given(littles(subject.lights & claim.lights), st.integers(0, 2**32 - 1))
    def holds(little: Little, seed: int) -> None:
        assume(shadowed(little))
        view = little.view(PIXELS[subject.spec is None])
        changed = LAWS[law](view, np.random.default_rng(seed))
        CHECKS[claim.kind](Case(studio, subject, little, (view, changed)))

    holds()


def test_the_table_has_every_law_and_every_technique() -> None:
    assert set(TABLE) == set(LAWS) and set(ANALYSED) <= set(subjects())
    assert {name for rows in TABLE.values() for names, *_ in rows for name in names} <= set(subjects())
    assert {subject.technique for subject in subjects().values()} == {"", *(one.name for one in own_techniques())}
    cells = [(law, name) for law, name, _ in claims()]
    assert len(set(cells)) == len(cells) == len(LAWS) * len(subjects())
    assert all("\n\n" in (change.__doc__ or "") for change in LAWS.values()), "a text, and its reason"


def test_the_page_is_up_to_date() -> None:
    tool = Path(__file__).resolve().parents[2] / "tools" / "law_docs.py"
    done = subprocess.run([sys.executable, tool, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
