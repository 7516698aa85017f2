"""Specs: formatting and parsing are inverse, and every mistake is a one-line error."""

from typing import Any, Literal, get_args, get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from shadowbench.errors import InputError
from shadowbench.maps.biases import Bias, Constant, Slope, Sum
from shadowbench.maps.filters import Filter
from shadowbench.maps.fits import Fit
from shadowbench.plugin.base import Technique
from shadowbench.plugin.grammar import parse_value
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import WRITTEN, Spec, format_value, parse_spec

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


@pytest.mark.parametrize("family", [Bias, Filter, Fit])
@given(data=st.data())
def test_every_component_survives_formatting_and_parsing(family: type[Component], data: st.DataObject) -> None:
    row = data.draw(st.one_of([rows(one) for one in family.table.values()]))
    assert family.from_value(format_value(row)) == family.from_value(format_value(row, full=True)) == row


def test_full_writes_the_parameters_of_components_too_and_sizeless_all_but_the_size() -> None:
    assert parse_spec("shadow-map:size=512,wrap=edge", ALL).sizeless_text == "shadow-map:wrap=edge"
    text = parse_spec("shadow-map:bias=slope,filter=pcf", ALL).full_text
    assert "bias=slope(max=0.05,min=0.005)" in text and "filter=pcf(taps=3)" in text and "reversed=false" in text


def test_positional_and_keyword_arguments_are_equivalent() -> None:
    by_name = parse_spec("shadow-map:bias=slope(max=0.1,min=0.01)", ALL)
    assert parse_spec("shadow-map:bias=slope(0.1,0.01)", ALL) == by_name
    assert parse_spec("shadow-map:bias=slope(0.1,min=0.01)", ALL) == by_name
    assert by_name.params.bias == Slope(max=0.1, min=0.01)


def test_spaces_change_nothing() -> None:
    assert parse_spec(" shadow-map : bias = slope ( 0.1 , min = 0.01 ) , size = 512 ", ALL) == parse_spec(
        "shadow-map:bias=slope(0.1,min=0.01),size=512", ALL
    )


@pytest.mark.parametrize(
    ("text", "value"), [("-2.5e-3", -0.0025), (".5", 0.5), ("7", 7), ("true", True), ("d16", "d16")]
)
def test_values(text: str, value: object) -> None:
    assert parse_value(text) == value and type(parse_value(text)) is type(value)


PRESETS = [(name, preset) for name, technique in ALL.items() for preset in technique.presets]


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_a_preset_stands_for_its_items(name: str, preset: str) -> None:
    items = ALL[name].presets[preset]
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


def test_with_changes_one_value_and_validates_it() -> None:
    spec = parse_spec("shadow-map:wrap=edge", ALL)
    assert spec.with_(size=2048) == parse_spec("shadow-map:wrap=edge,size=2048", ALL)
    with pytest.raises(InputError, match="size"):
        spec.with_(size=0)


MISTAKES = {
    "": "expected a technique's name",
    "csm": "unknown technique 'csm'.*; csm is written cascades$",
    "Ray_Tracing": "unknown technique 'Ray_Tracing'.*; Ray_Tracing is written ray-traced$",
    "pcss": "unknown technique 'pcss'.*; pcss is a filter: shadow-map:filter=pcss$",
    "texel:scale=2": "unknown technique 'texel'.*; texel is a bias: shadow-map:bias=texel$",
    "practical": "; practical is a split: cascades:split=practical$",
    "shadow-mop": "unknown technique 'shadow-mop'; did you mean 'shadow-map'. allowed: .*shadow-map",
    "shadow-map:": "expected key=value",
    "shadow-map:size": "expected key=value",
    "shadow-map:size=": "expected a number or a word, found its end",
    "shadow-map:size=512;wrap=edge": "expected a comma or the end, found ';wrap=edge'",
    "shadow-map:bias=slope+": "expected a number or a word, found its end",
    "shadow-map:bias=slope+heavy": "bias.second: unknown bias 'heavy'; allowed: none, constant",
    "shadow-map:bias=slope+2": "expected a comma or the end",
    "shadow-map:fit=scene+view": "fit: fits cannot be added, only biases can; allowed: one of fixed, scene",
    "shadow-map:filter=hard+pcf(2)": "filter: filters cannot be added, only biases can; allowed: one of hard, ",
    "shadow-map:bias=slope(0.1": r"expected '\)'",
    "shadow-map:siz=512": r"unknown field 'siz'; did you mean 'size'\? allowed: fit, size",
    "shadow-map:size=512,size=1024": "size is given twice",
    "shadow-map:preset=webgl,preset=course": "preset is given twice",
    "shadow-map:preset=nobody": "unknown preset 'nobody'; presets of shadow-map: course",
    "unshadowed:size=512": "unknown field 'size'; allowed: none at all",
    "shadow-map:size=0": "size: .*greater than or equal to 1",
    "shadow-map:size=big": "size: ",
    "shadow-map:depth=d8": "depth: .*'d16', 'd24' or 'd32f'",
    "shadow-map:bias=heavy": "bias: unknown bias 'heavy'; allowed: none, constant",
    "shadow-map:bias=3": "bias: unknown bias '3'; allowed: [^;]*$",
    "shadow-map:bias=0.005": r"unknown bias '0.005'; allowed: .*; a number alone is written constant\(0.005\)$",
    "shadow-map:filter=4": "unknown filter '4'; allowed: [^;]*$",
    "shadow-map:filter=5": r"unknown filter '5'; allowed: .*; a number alone is written pcf\(5\)$",
    "shadow-map:fit=2": "unknown fit '2'; allowed: [^;]*$",
    "cascades:split=0.5": r"unknown split '0.5'; allowed: .*; a number alone is written practical\(0.5\)$",
    "shadow-map:bias=constant(2)": "units: .*less than or equal to 1",
    "shadow-map:bias=slope(0.1,0.2,0.3)": "slope takes at most 2 parameters: max, min",
    "shadow-map:bias=none(1)": "none takes at most 0 parameters: none",
    "shadow-map:bias=slope(0.1,max=0.2)": "slope: max is given twice",
    "shadow-map:bias=constant(units=nan)": "units: ",
    "shadow-map:preset=slope(1)": "unknown preset",
    "shadow-map(size=512)": "expected a comma or the end",
}


def test_names_of_the_field_are_those_of_no_technique_and_lead_to_specs() -> None:
    assert not WRITTEN.keys() & ALL.keys()
    for text in WRITTEN.values():
        assert parse_spec(text, ALL).technique in ALL.values()


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_one_line_that_names_the_spec(text: str) -> None:
    with pytest.raises(InputError, match=MISTAKES[text]) as caught:
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


@pytest.mark.parametrize("name", sorted(ALL))
def test_every_parameter_has_one_line_of_help(name: str) -> None:
    models = [ALL[name].Params, *Bias.table.values(), *Filter.table.values(), *Fit.table.values()]
    for model in models:
        for key, field in model.model_fields.items():
            assert field.description and "\n" not in field.description, f"{model.__name__}.{key}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("shadow-map:size=" + "9" * 5000, "5016 characters; allowed are at most 1000"),
        ("shadow-map:bias=" + "a(" * 400, "nested deeper than 8"),
        ("shadow-map:bias=" + "none+" * 10 + "none", "nested deeper than 8"),
        ("shadow-map:size=" + "9" * 300, "size"),
        ("z" * 900, "unknown technique"),
        ("shadow-map:" + "k" * 900 + "=1", "unknown field"),
        ("shadow-map:preset=" + "p(" * 3 + "1" + ")" * 3, "preset"),
    ],
)
def test_a_spec_beyond_its_limits_is_one_short_line(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as error:
        parse_spec(text, ALL)
    assert str(error.value).isprintable() and len(str(error.value)) < 3000
