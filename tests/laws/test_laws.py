"""The claims of the table of laws, tested on small random scenes; and that every kind of claim can fail."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.files import data_folder
from shadowbench.geometry import convex
from shadowbench.geometry.convex import Slice
from shadowbench.gl.program import Stencil
from shadowbench.maps import caster_map
from shadowbench.maps.biases import Constant, FrontCull, NoBias, ReceiverPlane
from shadowbench.maps.caster_map import caster_state
from shadowbench.maps.filters import PCF, Filter, Hard
from shadowbench.maps.fits import FixedFit
from shadowbench.maps.moments import EVSM, VSM
from shadowbench.maps.pcss import PCSS
from shadowbench.plugin.registry import own_techniques
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Scene, View
from shadowbench.scenes.vectors import unit
from shadowbench.techniques import shadow_volume

from .answers import Answer, Drawing, traced
from .changes import LAWS, with_meshes
from .scenes import Little, littles
from .table import FIXED, SCENE, STABLE, VISIBLE, Claim, Subject, claims, misnamed, subjects

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
MANY = settings(SOME, max_examples=16)
THOROUGH = settings(SOME, max_examples=40)
CLAIMED = [
    pytest.param(law, name, claim, id=f"{law}, {name}, {claim.kind}")
    for law, name, claim in claims()
    if claim.kind != "none"
]

# Answers to unchanged scenes, which every law begins with.
_before: dict[tuple[str, Little], Answer] = {}


class Case:
    """A subject before and after a change."""

    def __init__(self, studio: Any, subject: Subject, little: Little, changed: View, keep: bool) -> None:
        self.studio, self.subject, self.little, self.changed, self.keep = studio, subject, little, changed, keep
        self.views = little.view(changed.size), changed

    def answers(self) -> tuple[Answer, Answer]:
        return self._kept(), self._answer(self.changed)

    def masks(self) -> list[NDArray[np.float32]]:
        spec = self.subject.spec
        if spec is None:
            return [traced(view).visibility for view in self.views]
        masks = []
        for view in self.views:
            with Drawing(self.studio, spec, view) as drawing:
                masks.append(drawing.visibility())
        return masks

    def _kept(self) -> Answer:
        key = self.subject.name, self.little
        if not self.keep:
            return self._answer(self.views[0])
        if key not in _before:
            _before[key] = self._answer(self.views[0])
        return _before[key]

    def _answer(self, view: View) -> Answer:
        spec = self.subject.spec
        if spec is None:
            return traced(view)
        with Drawing(self.studio, spec, view) as drawing:
            return drawing.answer()


def same_bits(case: Case) -> None:
    assert np.array_equal(*case.masks()), "bits differ"


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
    assert case.subject.spec is not None
    errors = []
    for view in case.views:
        with Drawing(case.studio, case.subject.spec, view) as drawing:
            errors.append(drawing.errors(PHASES))
    before, after = errors
    assert len(before) == len(after) == PHASES
    assert min(before) <= max(after) and min(after) <= max(before), "no phase errs as before"


def agree(case: Case) -> None:
    """With so fine a map and so large a bias that most kernels agree."""
    assert case.subject.spec is not None
    rows = Hard(), *(PCF(taps=taps) for taps in (3, 5, 7))
    *fewer, most = (filtered(case, case.views[0], size=512, bias=Constant(world=0.3), filter=row) for row in rows)
    agreed = (most == 0) | (most == 1)
    assert agreed.mean() > 0.6
    for mask in fewer:
        assert (mask == most)[agreed].all(), "taps changed a pixel whose kernel agrees"


def limit(case: Case) -> None:
    """As many texels and as wide a bias as in `agree`; each texel is compared with the receiver's plane."""
    assert case.subject.spec is not None
    hard, box, soft = (
        filtered(case, view, size=512, bias=ReceiverPlane(slack=3.0), filter=row)
        for view, row in zip((*case.views[:1] * 2, case.changed), (Hard(), PCF(taps=3), PCSS()), strict=True)
    )
    agreed = (box == 0) | (box == 1)
    assert agreed.mean() > 0.6
    assert (soft == hard)[agreed].all(), "a light of nearly no size has a penumbra"


def blurred(case: Case) -> None:
    equal(case)
    for row in (VSM(bleed=0.0), EVSM()):
        before, after = (filtered(case, view, filter=row) for view in case.views)
        assert np.abs(before - after).max() < 1e-3, "a blur is not the same elsewhere"


def bleeds(case: Case) -> None:
    """Between the changed view, and the same with the upper sheet halfway down to the lower one."""
    *others, upper = case.changed.scene.meshes
    toward = -unit(case.changed.light.direction)
    halfway = replace(
        upper, vertices=upper.vertices - 0.5 * toward * ((upper.vertices[0] - others[-1].vertices[0]) @ toward)
    )
    fit = FixedFit(half=6.5, near=1.0, far=60.0, distance=50.0)
    low, high = (
        filtered(case, view, fit=fit, bias=NoBias(), filter=VSM(bleed=0.0))
        for view in (with_meshes(case.changed, [*others, halfway]), case.changed)
    )
    assert (high > low - 1e-3).all() and high.mean() > low.mean() + 1e-3, "no more light through casters farther apart"


def filtered(case: Case, view: View, **parameters: Any) -> NDArray[np.float32]:
    """Visibility of a view with some of the subject's parameters changed."""
    assert case.subject.spec is not None
    with Drawing(case.studio, case.subject.spec.with_(**parameters), view) as drawing:
        return drawing.visibility()


CHECKS: dict[str, Callable[[Case], None]] = {
    "bits": same_bits,
    "equal": equal,
    "within": within,
    "subset": subset,
    "agree": agree,
    "limit": limit,
    "blurred": blurred,
    "bleeds": bleeds,
}


@cache
def shadowed(little: Little) -> bool:
    """Whether the view shows a shadow."""
    return bool(traced(little.view(32)).shadow.mean() > SHADOWED)


def check(studio: Any, law: str, name: str, kind: str, lights: frozenset, how: settings, keep: bool = True) -> None:
    subject = subjects()[name]

    @how
    @given(littles(subject.lights & lights), st.integers(0, 2**32 - 1))
    def holds(little: Little, seed: int) -> None:
        assume(shadowed(little))
        view = little.view(PIXELS[subject.spec is None])
        changed = LAWS[law].change(view, np.random.default_rng(seed))
        CHECKS[kind](Case(studio, subject, little, changed, keep))

    holds()


@pytest.mark.parametrize(("law", "name", "claim"), CLAIMED)
def test_law(studio, law: str, name: str, claim: Claim) -> None:
    check(studio, law, name, claim.kind, claim.lights, MORE if name == "truth" else SOME)


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [pytest.param(MORE, id="10 scenes"), pytest.param(THOROUGH, id="40 scenes", marks=pytest.mark.exhaustive)]
)
@pytest.mark.parametrize(("law", "name", "claim"), CLAIMED)
def test_law_on_many_scenes(studio, law: str, name: str, claim: Claim, how: settings) -> None:
    check(studio, law, name, claim.kind, claim.lights, how)


def test_the_table_has_every_law_and_every_technique() -> None:
    assert not misnamed()
    assert {subject.technique for subject in subjects().values()} == {"", *(one.name for one in own_techniques())}
    cells = [(law, name) for law, name, _ in claims()]
    assert len(set(cells)) == len(cells) == len(LAWS) * len(subjects())
    assert all(law.text and law.why for law in LAWS.values()) and all(claim.why for *_, claim in claims())


def test_the_page_is_up_to_date() -> None:
    tool = Path(__file__).resolve().parents[2] / "tools" / "law_docs.py"
    done = subprocess.run([sys.executable, tool, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


# Faults planted into techniques: each kind of claim can fail.


def assert_caught(studio, law: str, name: str, kind: str, told: str) -> None:
    claim = {(one, subject): claim for one, subject, claim in claims()}[law, name]
    assert claim.kind == kind
    with pytest.raises(AssertionError, match=told):
        check(studio, law, name, kind, claim.lights, MANY, keep=False)


def test_coordinates_that_are_not_made_relative_are_caught(studio, monkeypatch) -> None:
    monkeypatch.setattr(Scene, "placement", property(lambda scene: IDENTITY_PLACEMENT))
    assert_caught(studio, "translation", VISIBLE, "bits", "bits differ")


def test_casters_drawn_by_the_side_that_they_turn_to_the_light_are_caught(studio, monkeypatch) -> None:
    monkeypatch.setattr(caster_map, "caster_state", lambda bias, *rest: caster_state(FrontCull(), *rest))
    assert_caught(studio, "reversed winding", VISIBLE, "equal", "a decided pixel differs")


def test_a_fit_that_takes_whichever_vertices_come_first_is_caught(studio, monkeypatch) -> None:
    monkeypatch.setattr(convex, "hull_points", lambda points: points[: len(points) // 2])
    assert_caught(studio, "reordered triangles", SCENE, "equal", "a decided pixel differs")


def test_texels_that_grow_with_a_tilt_of_the_camera_are_caught(studio, monkeypatch) -> None:
    sphere = Slice.sphere

    def grown(part: Slice) -> tuple[np.ndarray, float]:
        center, radius = sphere.fget(part)
        return center, radius * (1 if part.camera.up == (0, 1, 0) else 4)

    monkeypatch.setattr(Slice, "sphere", property(grown))
    assert_caught(studio, "any rotation", STABLE, "within", "no phase errs as before")


def test_volumes_that_take_a_second_layer_for_light_are_caught(studio, monkeypatch) -> None:
    monkeypatch.setattr(shadow_volume, "Stencil", lambda **_: Stencil(test="==", reference=1))
    assert_caught(studio, "an additional caster", "shadow-volume", "subset", "a caster lights a pixel")


def replace_in_shader(monkeypatch, folder: Path, row: type[Filter], old: str, new: str) -> None:
    text = data_folder("shaders").joinpath(row.shader).read_text(encoding="utf-8")
    assert old in text
    (folder / "faulty.glsl").write_text(text.replace(old, new), encoding="utf-8")
    monkeypatch.setattr(row, "shader", str(folder / "faulty.glsl"))


SHADER_FAULTS = {
    "a kernel that does not hold the narrower one": (
        PCF,
        ("vec2(x, y)", "vec2(x + 2 * FILTER_TAPS, y)"),
        ("more PCF taps", "agree", "taps changed"),
    ),
    "a penumbra that is never narrower than some texels": (
        PCSS,
        ("0.5 * length(p.texel)", "4.0 * length(p.texel)"),
        ("a vanishing light", "limit", "has a penumbra"),
    ),
    "a read that depends on the place in the map": (
        VSM,
        ("contents_at(p, vec2(0.0))", "contents_at(p, 4.0 * p.uv)"),
        ("translation by texels of the map", "blurred", "not the same elsewhere"),
    ),
    "a bound that falls with the casters' distance": (
        VSM,
        ("filter_min_variance)", "0.001)"),
        ("a caster over another", "bleeds", "no more light"),
    ),
}


@pytest.mark.parametrize(("row", "texts", "found"), SHADER_FAULTS.values(), ids=SHADER_FAULTS)
def test_a_fault_in_a_filter_is_caught(studio, monkeypatch, tmp_path: Path, row, texts, found) -> None:
    replace_in_shader(monkeypatch, tmp_path, row, *texts)
    law, kind, words = found
    assert_caught(studio, law, FIXED, kind, words)
