"""The claims of the table of laws, tested on small random scenes.

That every kind of claim can fail is shown by tests/faults, which plants a fault for each.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import Phase as Stage
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.base import Phase
from shadowbench.scenes.model import Camera, Light, View
from shadowbench.scenes.vectors import perpendicular_basis, unit, vec3
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import iou
from shadowbench.truths.trace import trace

from .changes import LAWS
from .scenes import Little, littles
from .table import ANALYSED, SUBJECTS, TABLE, Claim, claims

PIXELS = {True: 96, False: 48}  # along a side, of the truth and of techniques
PHASES = 8
SHADOWED = 0.01  # least share of the picture
SCENES = 3
NUDGE = 1 / 256  # of a pixel or texel: the rasteriser's sub-pixel grid, as in the truth's definition of undecided
DIAGONALS = list(product((-NUDGE, NUDGE), repeat=2))
CLAIMED: dict[tuple[str, str], list[tuple[str, Claim]]] = {}  # variants of a technique with a claim, by law
for _law, _name, _claim in claims():
    if _claim.kind != "none":
        CLAIMED.setdefault((_law, _name.partition(":")[0]), []).append((_name, _claim))


@dataclass(frozen=True, eq=False)
class Answer:
    """Arrays of one view, (size, size), row 0 at the top: visibility, decided pixels, visible triangles."""

    visibility: NDArray[np.float32]
    decided: NDArray[np.bool_]
    triangle: NDArray[np.int32]

    @property
    def shadow(self) -> NDArray[np.bool_]:
        return self.visibility < 0.5


# What unchanged scenes give, with which every law begins, by the subject's name, the scene and the function.
_before: dict[tuple[str, Little, str], Any] = {}


class Nudged(Phase):
    """A phase slightly shifted from that of its index."""

    def __init__(self, x: float, y: float) -> None:
        super().__init__(0)
        object.__setattr__(self, "_shift", (x, y))

    @property
    def shift(self) -> tuple[float, float]:
        return self._shift


def traced(view: View) -> Answer:
    truth = trace(view, pixel_samples=1)
    return Answer(truth.visibility, ~truth.undecided, truth.triangle)


@dataclass
class Case:
    """A subject before and after a change."""

    studio: Any
    build: Any
    subject: str
    spec: Any  # None for the truth
    little: Little
    views: tuple[View, View]

    def draw(self, view: View, phases: Any = (0,)) -> list[NDArray[np.float32]]:
        """Visibility in some phases by the subject, a technique."""
        shot = self.studio.shot(view)
        built = self.build(self.spec.text, shot)
        masks = [built.draw(shot, phase) for phase in phases]
        built.stage.release()
        return masks

    def both(self, of: Callable[[View], Any]) -> tuple[Any, Any]:
        """What a function gives of the view before and after the change."""
        key = self.subject, self.little, of.__name__
        if key not in _before:
            _before[key] = of(self.views[0])
        return _before[key], of(self.views[1])

    def visibility(self, view: View) -> NDArray[np.float32]:
        return traced(view).visibility if self.spec is None else self.draw(view)[0]

    def answers(self) -> tuple[Answer, Answer]:
        return self.both(traced if self.spec is None else self._decided)

    def _decided(self, view: View) -> Answer:
        """Decided is what stays on its side of ½ when the picture's grid is nudged along its diagonals, and the map's.

        A boundary nearer to the pixel's centre than that, of a shadow, a texel or an equal depth, parts two of five.
        """
        shot = self.studio.shot(view)
        built = self.build(self.spec.text, shot)
        plain = built.draw(shot)
        others = [replace(view, camera=aside(view, x, y)) for x, y in DIAGONALS]
        if not built.technique.phased and view.light.kind != "directional":
            texels = self.spec.map_size or view.size.height
            others += [replace(view, light=lamp_aside(view, x, y, texels)) for x, y in DIAGONALS]
        nudged = [built.draw(self.studio.shot(other)) for other in others]
        if built.technique.phased:
            nudged += [built.draw(shot, Nudged(x, y)) for x, y in DIAGONALS]
        built.stage.release()
        return Answer(plain, np.all([(other < 0.5) == (plain < 0.5) for other in nudged], axis=0), shot.triangle)

    def errors(self, view: View) -> list[float]:
        """1 − IoU in each phase."""
        prepared = prepare_truth(trace(view, pixel_samples=1))
        return [1 - (iou(Comparison(mask, prepared)) or 0.0) for mask in self.draw(view, range(PHASES))]


def aside(view: View, x: float, y: float) -> Camera:
    """The camera rotated by fractions of a pixel."""
    camera = view.camera
    right, up, _ = camera.basis()
    toward = np.subtract(camera.target, camera.position)
    pixel = view.pixel * np.linalg.norm(toward)
    return replace(camera, target=vec3(camera.target + pixel * (x * right + y * up)))


def lamp_aside(view: View, x: float, y: float, texels: int) -> Light:
    """The lamp moved by fractions of a texel."""
    light = view.light
    low, high = view.scene.geometry.bounds
    toward = np.array(light.position) - (low + high) / 2
    right, up, _ = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))
    texel = 2 * np.linalg.norm(toward) / texels
    return replace(light, position=vec3(light.position + texel * (x * right + y * up)))


def bits(case: Case) -> None:
    assert np.array_equal(*case.both(case.visibility)), "bits differ"


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
    before, after = case.both(case.errors)
    assert min(before) <= max(after) and min(after) <= max(before), "no phase errs as before"


CHECKS: dict[str, Callable[[Case], None]] = {"bits": bits, "equal": equal, "within": within, "subset": subset}


@cache
def shadowed(little: Little) -> bool:
    """Whether the view shows a shadow."""
    return bool(traced(little.view(32)).shadow.mean() > SHADOWED)


@pytest.mark.parametrize(("law", "technique"), [pytest.param(*case, id=", ".join(case)) for case in CLAIMED])
def test_law(studio, build, law, technique) -> None:
    """On a few scenes, each with one of the technique's variants and under one of its kinds of light."""
    variants = CLAIMED[law, technique]

    @settings(
        max_examples=SCENES,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Stage.generate],  # shrinking a failure would take minutes
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
    )
    @given(st.data(), st.integers(0, 2**32 - 1))
    def holds(data: st.DataObject, seed: int) -> None:
        name, claim = variants[seed % len(variants)]
        spec = SUBJECTS[name]
        little = data.draw(littles(claim.lights if spec is None else spec.technique.lights & claim.lights))
        assume(shadowed(little))
        view = little.view(PIXELS[spec is None])
        changed = LAWS[law](view, np.random.default_rng(seed))
        CHECKS[claim.kind](Case(studio, build, name, spec, little, (view, changed)))

    holds()


def test_the_table_has_every_law_and_every_technique() -> None:
    assert set(TABLE) == set(LAWS) and set(ANALYSED) <= set(SUBJECTS)
    assert {name for rows in TABLE.values() for names, *_ in rows for name in names} <= set(SUBJECTS)
    cells = [(law, name) for law, name, _ in claims()]
    assert len(set(cells)) == len(cells) == len(LAWS) * len(SUBJECTS)
