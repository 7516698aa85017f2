"""The panel of a technique has a widget for every parameter, and takes no value that a file may not."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum, Texel
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.model import Light
from shadowbench.scenes.triangles import LARGEST
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.viewer.scene_panels import _edited
from shadowbench.viewer.technique_panel import (
    SUM,
    choices_of,
    edited_spec,
    limits,
    preset_of,
    presets,
    summary,
    with_inner,
    with_params,
    with_value,
)

KNOWN = techniques()
ODD = """
from typing import Literal
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Odd(Technique):
    name = "odd"
    class Params(TechniqueParams):
        '''Parameters.'''
        width: int = param(4, "width in pixels", ge=1, le=64)
        level: float = param(0.5, "visibility between", ge=0, lt=1)
        shape: Literal["rows", "columns"] = param("rows", "direction")
        inverted: bool = param(False, "exchanges both")
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
every_technique = pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)


@pytest.fixture
def odd(tmp_path: Path) -> Spec:
    (tmp_path / "odd.py").write_text(ODD)
    return parse_spec("odd", techniques([tmp_path / "odd.py"]))


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The functions of Dear ImGui that have drawn widgets, by their labels."""
    found: dict[str, str] = {}

    def recorded(name: str) -> Callable[..., Any]:
        make = getattr(imgui, name)
        return lambda label, *rest: found.update({label: name}) or make(label, *rest)

    for name in ("begin_combo", "checkbox", "drag_float", "drag_int", "input_text", "slider_float", "slider_int"):
        monkeypatch.setattr(imgui, name, recorded(name))
    return found


@every_technique
def test_every_parameter_has_a_widget_whose_limits_are_allowed(
    frame: None, drawn: dict[str, str], technique: type[Technique]
) -> None:
    spec = parse_spec(technique.name, KNOWN)
    assert edited_spec(spec, KNOWN) is spec, "a panel that is not touched changes nothing"
    fields = technique.Params.model_fields
    assert set(fields) <= set(drawn)
    for key, info in fields.items():
        for limit in limits(info):
            if limit is not None:
                value = int(limit) if info.annotation is int else limit
                assert getattr(with_value(spec.params, key, value), key) == value


@pytest.mark.parametrize("family", Component.__subclasses__(), ids=lambda one: one.__name__)
def test_every_component_is_a_choice_and_unfolds_its_own_parameters(
    frame: None, drawn: dict[str, str], family: type[Component]
) -> None:
    host = {"Split": "cascades"}.get(family.__name__, "shadow-map")
    key, spec = family.__name__.lower(), parse_spec(host, KNOWN)
    choices = choices_of(type(spec.params).model_fields[key], getattr(spec.params, key))
    assert set(choices) - {SUM} == set(family.table) and all(choices.values()), "each says in a line what it is"
    for name, component in family.table.items():
        if key == "split" and name != "practical":
            continue  # a split of its own number of slices
        drawn.clear()
        edited_spec(with_params(spec, with_value(spec.params, key, name)), KNOWN)
        assert set(component.model_fields) <= set(drawn)


def test_a_plug_ins_parameters_have_widgets_too(frame: None, drawn: dict[str, str], odd: Spec) -> None:
    assert edited_spec(odd, {"odd": odd.technique}) is odd, "they are drawn, without a docstring too"
    assert summary(odd.technique) == ""
    assert {key: drawn[key] for key in type(odd.params).model_fields} == {
        "width": "slider_int",
        "level": "slider_float",
        "shape": "begin_combo",
        "inverted": "checkbox",
        **dict.fromkeys(("word", "perhaps", "pair", "seed", "far"), "input_text"),
        **dict.fromkeys(("count", "below"), "drag_int"),
        "wide": "slider_float",
    }
    assert with_value(odd.params, "level", limits(type(odd.params).model_fields["level"])[1]).level < 1, "as is allowed"


def test_a_text_is_read_as_in_a_spec(frame: None, odd: Spec, monkeypatch: pytest.MonkeyPatch) -> None:
    def type_in(label: str, text: str, *_: Any) -> tuple[bool, str]:
        return (True, typed[label]) if label in typed else (False, text)

    monkeypatch.setattr(imgui, "input_text", type_in)
    for typed in ({"word": "other"}, {"seed": "7"}):
        ((key, text),) = typed.items()
        assert edited_spec(odd, {}).text == f"odd:{key}={text}"
    typed = {"seed": "((("}
    with pytest.raises(InputError, match="expected a number or a word"):
        edited_spec(odd, {})


def test_a_value_that_is_not_allowed_is_one_line(
    frame: None, odd: Spec, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="size=0: size: found 0; allowed: greater than or equal to 1"):
        with_value(ShadowMap.Params(), "size", 0)
    monkeypatch.setattr("shadowbench.viewer.technique_panel.choice", lambda *_: "demanding")
    with pytest.raises(InputError, match="number: found none; it must be given"):
        edited_spec(odd, techniques([tmp_path / "odd.py"]))


def test_a_sum_begins_with_the_bias_that_was_there() -> None:
    params = with_value(ShadowMap.Params(), "bias", SUM)
    assert params.bias == Sum(first=Texel(), second=NoBias())
    assert with_value(params, "bias", SUM) == params
    second = with_value(params.bias, "second", "constant")
    text = with_params(parse_spec("shadow-map", KNOWN), with_inner(params, "bias", second)).text
    assert text == "shadow-map:bias=texel+constant"


def test_a_parameter_of_a_parameter_changes_the_spec() -> None:
    spec = parse_spec("light-samples", KNOWN)
    params = with_value(spec.params, "of", "shadow-map")
    inner = with_value(params.of.params, "size", 64)  # type: ignore[attr-defined]
    assert with_params(spec, with_inner(params, "of", inner)).text == "light-samples:of=shadow-map(size=64)"


def test_presets_are_the_defaults_and_those_of_the_command_line() -> None:
    assert list(presets(ShadowMap)) == ["default", *ShadowMap.presets]
    for text, name in (("", "default"), (":preset=unity", "unity"), (":preset=unity,size=64", "custom")):
        spec = parse_spec(f"shadow-map{text}", KNOWN)
        assert preset_of(spec) == name and presets(ShadowMap).get(name, spec).params == spec.params


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
