"""Every parameter has its widget, made of its pydantic model alone."""

from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum, Texel
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.viewer.widgets import (
    SUM,
    Widget,
    preset_of,
    presets,
    summary,
    widgets,
    with_inner,
    with_params,
    with_value,
)

PLUGIN = """
from typing import Literal
from shadowbench.plugin.base import Technique, TechniqueParams, param
class Striped(Technique):
    '''Stripes.'''
    name = "striped"
    class Params(TechniqueParams):
        '''Parameters.'''
        width: int = param(4, "width in pixels", ge=1, le=64)
        level: float = param(0.5, "visibility between", ge=0, lt=1)
        shape: Literal["rows", "columns"] = param("rows", "direction")
        inverted: bool = param(False, "exchanges both")
    def build(self, stage):
        self.texture = stage.texture()
    def draw(self, frame):
        return self.texture
"""


def of(model: object, key: str) -> Widget:
    return next(one for one in widgets(model) if one.key == key)  # type: ignore[arg-type]


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)
def test_every_parameter_has_a_widget_with_its_help(technique: type[Technique]) -> None:
    made = widgets(technique.Params())
    assert [one.key for one in made] == list(technique.Params.model_fields)
    for one in made:
        assert (technique.Params.model_fields[one.key].description or "") in one.help


@pytest.mark.parametrize("family", Component.__subclasses__(), ids=lambda one: one.__name__)
def test_every_component_is_a_choice_and_unfolds_its_own_parameters(family: type[Component]) -> None:
    host = {"Split": "cascades"}.get(family.__name__, "shadow-map")
    key, params = family.__name__.lower(), techniques()[host].Params()
    assert set(of(params, key).choices) - {SUM} == set(family.table)
    for name, component in family.table.items():
        if (key, name) in (("split", "fixed"), ("split", "shares")):
            continue  # a split of its own number of slices
        chosen = with_value(params, key, name)
        inner = of(chosen, key).inner
        assert type(inner) is component
        assert [one.key for one in widgets(inner)] == list(component.model_fields)


def test_a_plug_ins_parameters_have_widgets_too(tmp_path: Path) -> None:
    file = tmp_path / "striped.py"
    file.write_text(PLUGIN)
    params = techniques([file])["striped"].Params()
    kinds = {one.key: (one.kind, one.low, one.high, tuple(one.choices)) for one in widgets(params)}
    assert kinds["width"] == ("whole", 1.0, 64.0, ())
    assert kinds["level"] == ("number", 0.0, pytest.approx(1.0, rel=1e-5), ())
    assert kinds["shape"] == ("choice", None, None, ("rows", "columns"))
    assert kinds["inverted"] == ("flag", None, None, ())
    assert with_value(params, "level", kinds["level"][2]).level < 1, "an open limit is not reached"


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)
def test_the_limits_of_a_widget_are_allowed_values(technique: type[Technique]) -> None:
    params = technique.Params()
    for one in widgets(params):
        for value in (one.low, one.high):
            if value is not None:
                new = int(value) if one.kind == "whole" else value
                assert getattr(with_value(params, one.key, new), one.key) == new


def test_a_value_that_is_not_allowed_is_one_line() -> None:
    with pytest.raises(InputError, match="size=0: size: found 0; allowed: greater than or equal to 1"):
        with_value(ShadowMap.Params(), "size", 0)


def test_a_sum_begins_with_the_bias_that_was_there() -> None:
    params = with_value(ShadowMap.Params(), "bias", SUM)
    assert params.bias == Sum(first=Texel(), second=NoBias())
    assert with_value(params, "bias", SUM) == params
    second = with_value(params.bias, "second", "constant")
    text = with_params(parse_spec("shadow-map", techniques()), with_inner(params, "bias", second)).text
    assert text == "shadow-map:bias=texel+constant"


def test_a_parameter_of_a_parameter_changes_the_spec() -> None:
    spec = parse_spec("light-samples", techniques())
    inner = with_value(with_value(spec.params, "of", "shadow-map").of.params, "size", 64)  # type: ignore[attr-defined]
    changed = with_inner(with_value(spec.params, "of", "shadow-map"), "of", inner)
    assert with_params(spec, changed).text == "light-samples:of=shadow-map(size=64)"


def test_presets_are_the_defaults_and_those_of_the_command_line() -> None:
    assert list(presets(ShadowMap)) == ["default", *ShadowMap.presets]
    assert presets(ShadowMap)["default"] == parse_spec("shadow-map", techniques())
    assert presets(ShadowMap)["webgl"] == parse_spec("shadow-map:preset=webgl", techniques())


@pytest.mark.parametrize(
    ("text", "name"),
    [("shadow-map", "default"), ("shadow-map:preset=unity", "unity"), ("shadow-map:preset=unity,size=64", "custom")],
)
def test_the_preset_that_a_spec_has_is_found(text: str, name: str) -> None:
    assert preset_of(parse_spec(text, techniques())) == name


def test_every_component_and_technique_says_in_a_line_what_it_is() -> None:
    params = ShadowMap.Params()
    assert all(of(params, key).choices[name] for key in ("fit", "bias", "filter") for name in of(params, key).choices)
    assert summary(ShadowMap).startswith("One depth map from the light")
    assert summary(type("Undocumented", (Technique,), {})) == ""
