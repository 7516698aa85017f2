"""The panel of a technique draws every parameter, those of odd plug-ins too, and takes no value that a file may not."""

import math
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.plugin.base import Technique
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.geometry import LARGEST
from shadowbench.scenes.model import Light
from shadowbench.viewer.scene_panels import _edited
from shadowbench.viewer.technique_panel import edited_spec

ODD = """
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Odd(Technique):
    name = "odd"
    class Params(TechniqueParams):
        '''Parameters.'''
        word: str = param("some", "a text")
        perhaps: float | None = param(None, "a number or none", ge=0, le=1)
        pair: tuple[int, int] = param((1, 2), "two")
        count: int = param(4, "without an upper limit", ge=1)
        below: int = param(-4, "without limits")
        seed: int = param(2**40, "of more than 32 bits", ge=0, le=2**62)
        far: float = param(1e30, "beyond what a slider takes")
        wide: float = param(1.0, "of a range beyond float32", ge=0, le=1e300)
    def build(self, stage):
        self.texture = stage.texture()
    def draw(self, frame):
        return self.texture
class Demanding(Odd):
    '''Has a parameter without a default.'''
    name = "demanding"
    class Params(TechniqueParams):
        '''Parameters.'''
        number: int
"""


@pytest.fixture
def odd(tmp_path: Path) -> Spec:
    (tmp_path / "odd.py").write_text(ODD)
    return parse_spec("odd", techniques([tmp_path / "odd.py"]))


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)
def test_a_panel_that_is_not_touched_changes_nothing(frame: None, technique: type[Technique]) -> None:
    spec = parse_spec(technique.name, techniques())
    assert edited_spec(spec, techniques()) is spec


def test_odd_parameters_and_no_docstring_are_drawn(frame: None, odd: Spec) -> None:
    assert edited_spec(odd, {"odd": odd.technique}) is odd


def test_a_text_is_read_as_in_a_spec(frame: None, odd: Spec, monkeypatch: pytest.MonkeyPatch) -> None:
    def type_in(label: str, text: str, *_: Any) -> tuple[bool, str]:
        return (True, typed[label]) if label in typed else (False, text)

    monkeypatch.setattr(imgui, "input_text", type_in)
    typed = {"word": "other"}
    assert edited_spec(odd, {}).text == "odd:word=other"
    typed = {"seed": "7"}
    assert edited_spec(odd, {}).text == "odd:seed=7"
    typed = {"seed": "((("}
    with pytest.raises(InputError, match="expected a number or a word"):
        edited_spec(odd, {})


def test_a_technique_that_cannot_begin_with_its_defaults_is_one_line(
    frame: None, odd: Spec, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = techniques([tmp_path / "odd.py"])
    monkeypatch.setattr("shadowbench.viewer.technique_panel.choice", lambda *_: "demanding")
    with pytest.raises(InputError, match="number: found none; it must be given"):
        edited_spec(odd, known)


@pytest.mark.parametrize("typed", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("kind", ["directional", "spot", "point", "disc", "rectangle"])
def test_a_typed_number_that_no_scene_file_takes_leaves_the_light(
    frame: None, monkeypatch: pytest.MonkeyPatch, kind: Any, typed: float
) -> None:
    """Dear ImGui takes "nan" and "inf" from the keyboard, and clamps what it can, to the limits that it is given."""

    def clamped(low: float, high: float) -> float:
        return min(max(typed, low), high) if math.isfinite(typed) else typed

    monkeypatch.setattr(imgui, "slider_float", lambda _, value, low, high, *__: (True, clamped(low, high)))
    monkeypatch.setattr(imgui, "drag_float", lambda _, value, __, low, high, *___: (True, clamped(low, high)))
    monkeypatch.setattr(imgui, "drag_float3", lambda *_: (True, [typed] * 3))
    light = _edited(Light("light", kind, (0.6, -0.8, 0.0), (0.0, 3.0, 0.0), math.radians(60), 0.0, (1.0, 1.0)))
    numbers = [*light.direction, *light.position, light.angle, light.radius, *light.size]
    assert all(abs(number) <= LARGEST for number in numbers) and any(light.direction)
