"""The artefact gallery: each scene shows its artefact where the text says, in its metric, and its cure removes it."""

import re
import sys
from functools import cache
from typing import Any

import artefact_gallery as gallery
import numpy as np
import pytest
from numpy.typing import NDArray

import shadowbench as sb
from shadowbench.maps.biases import Bias
from shadowbench.maps.filters import Filter
from shadowbench.maps.fits import Fit, Split
from shadowbench.measure.columns import ROW_METRICS
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.techniques.shadow_map import ENGINES

ARTEFACTS = {one.scene: one for one in gallery.artefacts()}
SIZE = 128
FACTOR = 5  # the error of the broken setting over the cured one's
LEAST = 0.03  # of the broken setting's error, in the metric's own unit
WHERE = {  # the pixels that are wrong until they are cured, as sets of the truth
    "acne": "lit_interior",
    "peter-panning": "contact",
    "light-leaks": "contact",
    "aliasing": "edge_zone",
    "perspective-aliasing": "edge_zone",
    "projective-aliasing": "edge_zone",
    "cascade-seams": "shadow_interior",
    **dict.fromkeys(("shimmering", "swimming", "cascade-pop", "stepping-sun", "ghosting"), "edge_zone"),
    "cut-off-casters": "shadow",
    "outside-the-map": "shadow",
    "eye-in-volume": "valid",
    "light-bleeding": "shadow",
    "fixed-width": "penumbra",
    "terminator": "facet_shadow",
    "lamp-far-away": "valid",
    "not-a-plane": "shadow",
    "leaves-lost-to-bias": "shadow",
    "two-sided-cards": "shadow",
}


@pytest.fixture(autouse=True, scope="module")
def end() -> None:
    yield
    sb.close()


@cache
def drawn(scene: str) -> gallery.Drawn:
    return gallery.draw(ARTEFACTS[scene], SIZE)


def error(scene: str, value: float) -> float:
    return 1 - value if ROW_METRICS[ARTEFACTS[scene].metric].better == "higher" else value


def wrong(scene: str, frames: list[Rendering]) -> NDArray[np.bool_]:
    truth = prepare_truth(drawn(scene).truths[-1])
    dark = frames[-1].visibility < 0.5
    return (truth.valid & (dark != truth.shadow)) | (truth.facet_shadow & dark)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ARTEFACTS)
def test_the_metric_sees_the_artefact_and_the_cure_fixes_the_pixels_that_the_text_names(scene: str) -> None:
    one, frames = ARTEFACTS[scene], drawn(scene)
    broken, cured, *others = (error(scene, value) for value in frames.values)
    assert broken >= LEAST and broken >= FACTOR * cured
    mask = wrong(scene, frames.broken)
    fixed = mask & ~wrong(scene, frames.cured)
    region = getattr(prepare_truth(frames.truths[-1]), WHERE[scene])
    assert fixed.any() and region[fixed].mean() >= 0.9
    if one.crop:
        left, top, side = (part * SIZE // gallery.PARTS for part in one.crop)
        part = mask[top : top + side, left : left + side]
        assert part.sum() >= 16 and (part.mean() > 2 * mask.mean() or mask.mean() > 0.2), "more of it than the whole"
    assert all(value <= broken / 2 for value in others), "other cures that the text names"


@pytest.mark.slow
def test_lengths_in_the_text_match_the_scenes() -> None:
    late, seam = drawn("peter-panning").broken[0].facts, drawn("cascade-seams").broken[0].facts
    assert (round(late["depth_range_m"]), round(late["bias_m"], 2)) == (39, 0.19)
    assert (round(seam["bias_1_m"], 2), round(seam["bias_2_m"], 2)) == (0.12, 0.48)
    assert drawn("light-leaks").broken[0].facts["bias_m"] >= 0.1
    near, far = (drawn("cascade-pop").broken[0].facts[f"texel_{number}_m"] for number in (1, 2))
    assert round(far / near) == 5
    grazed = drawn("projective-aliasing").truths[0]
    assert 1 / grazed.cosine[SIZE // 4, SIZE // 2] == pytest.approx(6, abs=0.3)


def test_z_pass_with_the_eye_in_a_volume_inverts_light_and_shadow() -> None:
    scored = prepare_truth(drawn("eye-in-volume").truths[0]).pixels
    assert wrong("eye-in-volume", drawn("eye-in-volume").broken).sum() == scored


def test_settings_of_course_notes_are_specs_whose_sheets_exist_and_name_every_setting_but_engines_and_papers() -> None:
    page = (gallery.PAGE.parent / "course.md").read_text(encoding="utf-8")
    texts = re.findall(r"`((?:shadow-|cube-|cascades|planar-)[^`]*)`", page)
    specs = {text: parse_spec(text, techniques()) for text in texts}
    headings = re.findall(r"^### (.*)", gallery.PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    sheets = {heading.lower().replace(":", "").replace(" ", "-") for heading in headings}
    assert set(re.findall(r"gallery.md#([\w-]+)", page)) <= sheets and len(sheets) == len(ARTEFACTS)
    named = {type(component) for spec in specs.values() for component in spec.components}
    others = {name for family in (Bias, Filter, Fit, Split) for name, one in family.table.items() if one not in named}
    assert others == {"receiver-plane", "two-planes", "terminator", "castano", "dpcf", "view", "ends"}
    presets = {f"{one.name}:preset={name}" for one in own_techniques() for name in {*one.presets} - {*ENGINES}}
    assert presets <= specs.keys()


def test_the_page_is_what_the_tool_writes(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(sys, "argv", ["artefact_gallery", "--check"])
    assert gallery.main() == 0, capsys.readouterr()
