"""Specs: formatting and parsing are inverse, and every mistake is a one-line error."""

from typing import Any, Literal, get_args, get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from shadowbench.errors import InputError
from shadowbench.maps.biases import Bias, Constant, Slope, Sum
from shadowbench.plugin.base import Technique
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec

ALL = techniques()


def values_of(field: Any) -> st.SearchStrategy[Any]:
    """Values that a field of a parameter model allows."""
    if isinstance(field.default, Component):
        single = st.one_of([rows(row) for row in field.default.family().table.values()])
        return st.one_of(single, sums(single)) if isinstance(field.default, Bias) else single
    if isinstance(field.default, Spec):
        return st.one_of([specs(one) for one in ALL.values() if Spec not in map(type, defaults(one))])
    if get_origin(field.annotation) is Literal:
        return st.sampled_from(get_args(field.annotation))
    if field.annotation is bool:
        return st.booleans()
    limits = {
        name: getattr(one, name) for one in field.metadata for name in ("ge", "gt", "le", "lt") if hasattr(one, name)
    }
    if field.annotation is int:
        return st.integers(limits["ge"], limits["le"])
    assert field.annotation is float, "a new kind of parameter: say here what it allows"
    low, high = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
    return st.floats(
        low, high, exclude_min="gt" in limits, exclude_max="lt" in limits, allow_nan=False, allow_infinity=False
    )


def defaults(technique: type[Technique]) -> list[Any]:
    return [field.default for field in technique.Params.model_fields.values()]


def rows(row: type[Component]) -> st.SearchStrategy[Component]:
    """Components of valid and compatible values."""
    fields = {key: values_of(field) for key, field in row.model_fields.items()}
    found = st.fixed_dictionaries(fields).map(lambda values: _compatible(row, values))
    return found.filter(lambda component: component is not None)


def sums(single: st.SearchStrategy[Bias]) -> st.SearchStrategy[Bias]:
    """Two biases or three that act together."""
    two = st.builds(Sum, first=single, second=single)
    return st.one_of(two, st.builds(Sum, first=single, second=two))


def specs(technique: type[Technique]) -> st.SearchStrategy[Spec]:
    """Specs of valid and compatible values."""
    fields = {key: values_of(field) for key, field in technique.Params.model_fields.items()}
    found = st.fixed_dictionaries(fields).map(lambda values: _compatible(technique.Params, values))
    return found.filter(lambda params: params is not None).map(lambda params: Spec(technique, params))


def _compatible(model: type[BaseModel], values: dict[str, object]) -> Any:
    """The model of some values; None if each is valid, but not all together."""
    try:
        return model(**values)
    except ValidationError as error:
        if any(one["type"] != "value_error" or one["loc"] for one in error.errors()):
            raise
        return None


@pytest.mark.parametrize("name", sorted(ALL))
@settings(max_examples=40)
@given(data=st.data())
def test_specs_survive_formatting_and_parsing(name: str, data: st.DataObject) -> None:
    spec = data.draw(specs(ALL[name]))
    for full in (False, True):
        text = spec.full_text if full else spec.text
        assert parse_spec(text, ALL) == spec
        again = parse_spec(text, ALL)
        assert (again.full_text if full else again.text) == text, "writing has one form"


@pytest.mark.parametrize("name", [name for name, technique in ALL.items() if technique.presets])
def test_a_preset_stands_for_its_items(name: str) -> None:
    for preset, items in ALL[name].presets.items():
        spec = parse_spec(f"{name}:preset={preset}", ALL)
        assert spec == parse_spec(f"{name}:{items}", ALL)
        assert "preset" not in spec.text and "preset" not in spec.full_text
        assert parse_spec(spec.text, ALL) == spec


def test_biases_that_act_together_are_joined_by_plus() -> None:
    spec = parse_spec("shadow-map:bias = polygon-offset(2,4) + normal-offset+constant(0.001)", ALL)
    assert spec.text == "shadow-map:bias=polygon-offset+normal-offset+constant(units=0.001)"
    with pytest.raises(ValidationError, match="found a sum; allowed: one bias"):
        Sum(first=Sum(first=Slope(), second=Slope()), second=Slope())


def test_later_keys_override_a_preset_and_a_preset_overrides_earlier_keys() -> None:
    after = parse_spec("shadow-map:preset=webgl,size=2048", ALL)
    assert after.params.size == 2048 and after.params.bias == Constant(units=0.001)
    assert parse_spec("shadow-map:size=2048,preset=webgl", ALL).params.size == 512
    assert after.explicit == {"fit", "bias", "filter", "size"}, "the keys that the user wrote"
    assert after.with_(size=512) == parse_spec("shadow-map:preset=webgl", ALL)
    with pytest.raises(InputError, match="size"):
        after.with_(size=0)


MISTAKES = {
    "": "expected a technique's name",
    "shadow-mop": "unknown technique 'shadow-mop'; did you mean 'shadow-map'. allowed: .*shadow-map",
    "shadow-map:": "expected key=value",
    "shadow-map:size=": "expected a number or a word, found its end",
    "shadow-map:size=512;wrap=edge": "expected a comma or the end, found ';wrap=edge'",
    "shadow-map:bias=slope+heavy": "bias.second: unknown bias 'heavy'; allowed: none, constant",
    "shadow-map:fit=scene+view": "fit: fits cannot be added, only biases can; allowed: one of fixed, scene",
    "shadow-map:bias=slope(0.1": r"expected '\)'",
    "shadow-map:siz=512": r"unknown field 'siz'; did you mean 'size'\? allowed: fit, size",
    "shadow-map:size=512,size=1024": "size is given twice",
    "shadow-map:preset=nobody": "unknown preset 'nobody'; presets of shadow-map: course",
    "unshadowed:size=512": "unknown field 'size'; allowed: none at all",
    "shadow-map:size=0": "size: .*greater than or equal to 1",
    "shadow-map:depth=d8": "depth: .*'d16', 'd24' or 'd32f'",
    "shadow-map:bias=0.005": "unknown bias '0.005'; allowed: none, constant",
    "shadow-map:bias=constant(2)": "units: .*less than or equal to 1",
    "shadow-map:bias=slope(0.1,0.2,0.3)": "slope takes at most 2 parameters: max, min",
    "shadow-map:bias=slope(0.1,max=0.2)": "slope: max is given twice",
    "shadow-map:bias=" + "a(" * 400: "nested deeper than 8",
    "shadow-map:bias=" + "none+" * 10 + "none": "nested deeper than 8",
    "cascades:split=fixed,count=4": "split=fixed: found count=4; allowed: 5",
    "hybrid:fit=fixed": "fit=fixed leaves out casters and receivers, allowed: scene, view, visible",
    "ray-traced:where=gpu,samples=4": r"where=gpu .* samples is 4, allowed: 1",
    "light-samples:of=shadow-map(2048)": "a value without a name",
}


def test_a_bias_without_a_meaning_for_a_map_is_declined_in_words(builtin, device) -> None:
    for bias, reason in {"texel+polygon-offset": "polygon-offset has no meaning for a cube map", "texel": None}.items():
        spec = parse_spec(f"cube-map:bias={bias}", ALL)
        assert spec.technique.unsupported(spec.params, builtin("room-with-lamp", 16), device) == reason


def test_a_mistake_is_one_line_that_names_the_spec() -> None:
    for text, words in MISTAKES.items():
        with pytest.raises(InputError, match=words) as caught:
            parse_spec(text, ALL)
        message = str(caught.value)
        assert "\n" not in message
        assert repr(text) in message or "unknown technique" in message


@given(st.text(alphabet="abd=,+():0123.-_ eslopthwmxin\n", max_size=40))
def test_no_text_raises_anything_but_one_line(text: str) -> None:
    for spec in (text, f"shadow-map:{text}", f"shadow-map:bias={text}"):
        message = ""
        try:
            parse_spec(spec, ALL)
        except InputError as error:
            message = str(error)
        assert "\n" not in message
