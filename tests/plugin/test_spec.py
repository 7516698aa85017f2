"""Specs: formatting and parsing are inverse, and every mistake is a one-line error."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.errors import InputError
from shadowbench.maps.biases import Constant, Sum, Texel
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.study import read_study

ALL = techniques()
ROOT = Path(__file__).parents[2]


def test_every_spec_of_the_baseline_survives_formatting_and_parsing() -> None:
    """Which has every component."""
    study = read_study(ROOT / "results" / "baseline" / "study.toml", ALL)
    assert len(study.specs) > 30
    for spec in study.specs:
        for text in (spec.text, spec.full_text):
            assert parse_spec(text, ALL) == spec
        assert parse_spec(spec.full_text, ALL).text == spec.text, "writing has one form"


@given(st.floats(0, 1), st.floats(0, 1e6))
def test_a_number_survives_formatting_and_parsing(units: float, ulps: float) -> None:
    spec = parse_spec("shadow-map:bias=constant+texel", ALL).with_(
        bias=Sum(first=Constant(units=units), second=Texel(ulps=ulps))
    )
    assert parse_spec(spec.text, ALL) == parse_spec(spec.full_text, ALL) == spec


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
    "shadow-map:fit=scene+view": r"fit: unknown fit '\+'; allowed: fixed, scene",
    "shadow-map:bias=slope(0.1": r"expected '\)'",
    "shadow-map:siz=512": r"unknown field 'siz'; did you mean 'size'\? allowed: contact, history, fit, size",
    "shadow-map:size=512,size=1024": "size is given twice",
    "shadow-map:preset=nobody": "unknown preset 'nobody'; presets of shadow-map: course",
    "unshadowed:size=512": "unknown field 'size'; allowed: contact, history",
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
        assert repr(text)[:300] in message or "unknown technique" in message


@given(st.text(alphabet="abd=,+():0123.-_ eslopthwmxin\n", max_size=40))
def test_no_text_raises_anything_but_one_line(text: str) -> None:
    for spec in (text, f"shadow-map:{text}", f"shadow-map:bias={text}"):
        message = ""
        try:
            parse_spec(spec, ALL)
        except InputError as error:
            message = str(error)
        assert "\n" not in message
