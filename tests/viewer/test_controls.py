"""The panels have a widget for every parameter, take no value that a file may not, and open files."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum, Texel
from shadowbench.options import ViewSize
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light
from shadowbench.scenes.triangles import LARGEST
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.viewer import controls
from shadowbench.viewer.controls import (
    SUM,
    edited_spec,
    limits,
    preset_of,
    presets,
    with_inner,
    with_value,
)
from shadowbench.viewer.drawing import Viewer
from shadowbench.viewer.state import save_state

KNOWN = techniques()
ODD = """
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Odd(Technique):
    name = "odd"
    class Params(TechniqueParams):
        '''Parameters.'''
        width: int = param(4, "width in pixels", ge=1, le=64)
        level: float = param(0.5, "visibility between", ge=0, lt=1)
        word: str = param("some", "a text")
        pair: tuple[int, int] = param((1, 2), "two")
        count: int = param(4, "without an upper limit", ge=1)
        seed: int = param(2**40, "of more than 32 bits", ge=0, le=2**62)
        far: float = param(1e30, "beyond what a slider takes")
    def build(self, stage):
        self.texture = stage.texture()
    def draw(self, frame):
        return self.texture
"""


@pytest.fixture
def drawn(frame: None, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The functions of Dear ImGui that have drawn widgets, by their labels."""
    widgets: dict[str, str] = {}

    def recorded(name: str) -> Callable[..., Any]:
        make = getattr(imgui, name)
        return lambda label, *rest: widgets.update({label: name}) or make(label, *rest)

    for name in ("begin_combo", "checkbox", "drag_float", "drag_int", "input_text", "slider_float", "slider_int"):
        monkeypatch.setattr(imgui, name, recorded(name))
    return widgets


def test_every_parameter_has_a_widget_whose_limits_are_allowed(drawn: dict[str, str]) -> None:
    for technique in own_techniques():
        spec = parse_spec(technique.name, KNOWN)
        drawn.clear()
        assert edited_spec(spec, KNOWN) is spec, "a panel that is not touched changes nothing"
        assert set(technique.Params.model_fields) <= set(drawn)
        for key, info in technique.Params.model_fields.items():
            for limit in limits(info):
                if limit is not None:
                    value = int(limit) if info.annotation is int else limit
                    assert getattr(with_value(spec.params, key, value), key) == value


def test_a_plug_ins_parameters_have_widgets_too_and_a_text_is_read_as_in_a_spec(
    drawn: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "odd.py").write_text(ODD)
    odd = parse_spec("odd", techniques([tmp_path / "odd.py"]))
    assert edited_spec(odd, {"odd": odd.technique}) is odd, "they are drawn, without a docstring too"
    assert {key: drawn[key] for key in type(odd.params).model_fields} == {
        **dict.fromkeys(("contact", "history"), "begin_combo"),
        "width": "slider_int",
        "level": "slider_float",
        "count": "drag_int",
        **dict.fromkeys(("word", "pair", "seed", "far"), "input_text"),
    }
    assert with_value(odd.params, "level", limits(type(odd.params).model_fields["level"])[1]).level < 1, "as is allowed"
    typed = {"seed": "7"}
    monkeypatch.setattr(imgui, "input_text", lambda label, text, *_: (label in typed, typed.get(label, text)))
    assert edited_spec(odd, {}).text == "odd:seed=7"
    typed["seed"] = "((("
    with pytest.raises(InputError, match="expected a number or a word"):
        edited_spec(odd, {})
    with pytest.raises(InputError, match="size=0: size: found 0; allowed: greater than or equal to 1"):
        with_value(ShadowMap.Params(), "size", 0)


def test_a_component_of_a_component_and_a_technique_of_a_technique_change_the_spec() -> None:
    params = with_value(ShadowMap.Params(), "bias", SUM)
    assert params.bias == Sum(first=Texel(), second=NoBias()), "a sum begins with the bias that was there"
    assert with_value(params, "bias", SUM) == params
    second = with_value(params.bias, "second", "constant")
    spec = replace(parse_spec("shadow-map", KNOWN), params=with_inner(params, "bias", second))
    assert spec.text == "shadow-map:bias=texel+constant"
    samples = parse_spec("light-samples", KNOWN)
    outer: Any = with_value(samples.params, "of", "shadow-map")
    inner = with_inner(outer, "of", with_value(outer.of.params, "size", 64))
    assert replace(samples, params=inner).text == "light-samples:of=shadow-map(size=64)"


def test_presets_are_the_defaults_and_those_of_the_command_line() -> None:
    assert list(presets(ShadowMap)) == ["default", *ShadowMap.presets]
    for text, name in (("", "default"), (":preset=unity", "unity"), (":preset=unity,size=64", "custom")):
        spec = parse_spec(f"shadow-map{text}", KNOWN)
        assert preset_of(spec) == name and presets(ShadowMap).get(name, spec).params == spec.params


@pytest.mark.usefixtures("frame")
@pytest.mark.parametrize(
    ("kind", "typed"), [("directional", math.nan), ("spot", -math.inf), ("rectangle", 1e300), ("point", math.inf)]
)
def test_a_typed_number_that_no_scene_file_takes_leaves_the_light(
    monkeypatch: pytest.MonkeyPatch, kind: Any, typed: float
) -> None:
    """Dear ImGui takes "nan" and "inf" from the keyboard, and clamps what it can, to the limits that it is given."""

    def clamped(low: float, high: float) -> float:
        return min(max(typed, low), high) if math.isfinite(typed) else typed

    monkeypatch.setattr(imgui, "slider_float", lambda _, value, low, high, *__: (True, clamped(low, high)))
    monkeypatch.setattr(imgui, "drag_float", lambda _, value, __, low, high, *___: (True, clamped(low, high)))
    monkeypatch.setattr(imgui, "drag_float3", lambda *_: (True, [typed] * 3))
    lamp = Light("light", kind, (0.6, -0.8, 0.0), (0.0, 3.0, 0.0), math.radians(60), 0.0, (1.0, 1.0))
    light = controls.edited_light(lamp)
    numbers = [*light.direction, *light.position, light.angle, light.radius, *light.size]
    assert all(abs(number) <= LARGEST for number in numbers) and any(light.direction)


def test_meshes_and_states_are_opened_and_other_files_are_one_line(viewer: Viewer, tmp_path: Path) -> None:
    mesh, before = tmp_path / "own.obj", viewer.state

    def opened(file: Path) -> None:
        viewer.attempt(lambda: controls.open_file(viewer, file))

    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\nf 1 2 4\n")
    for name in ("nothing.glb", "nothing.toml", "text.txt"):
        opened(tmp_path / name)
        assert name in viewer.message and viewer.state is before
    opened(mesh)
    assert viewer.state.scene.name == "own"
    assert viewer.message.startswith(f"{mesh} is shown; ") and "no ground in own.obj: assumed" in viewer.message
    save_state(replace(before, specs=before.specs[1:], overlay="error", size=ViewSize(96, 54)), tmp_path / "state.toml")
    opened(tmp_path / "state.toml")
    assert (viewer.state.specs, viewer.state.overlay, viewer.state.size) == (before.specs[1:], "error", (96, 54))
