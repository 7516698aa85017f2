"""`tune`: its search space, its search, which is repeatable, and the comparison on held-out scenes."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import optuna
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.advice.tune_search import (
    MIN_ERROR,
    Setting,
    TuningCells,
    log_error,
    scene_scores,
)
from shadowbench.advice.tune_space import (
    DEFAULT_PARAMETERS,
    SEARCH_FACTOR,
    SceneSplit,
    SearchSpace,
    family_of,
    searched_parameters,
    span,
    split_scenes,
)
from shadowbench.errors import InputError
from shadowbench.maps.biases import Sum
from shadowbench.measure.rows import Record
from shadowbench.plugin.params import in_metres
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.studies.study import Study

KNOWN = techniques()
SHADOW_MAP = parse_spec("shadow-map", KNOWN)


def row(scene: str, error: float, *, ssim: float | None = None, cost: int = 100, status: str = "ok") -> Record:
    agreement = {"iou": 1 - error, "ssim": 1 - (error if ssim is None else ssim)}
    metrics = {**agreement, "acne": 0.0, "leak": 0.0, "contact": 0.0}
    return {"scene": scene, "status": status, "metrics": metrics, "work": {"cost": cost}}


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda technique: technique.name)
def test_the_default_and_every_preset_are_points_of_the_space_or_said_not_to_be(technique: Any) -> None:
    home = Spec(technique, technique.Params())
    names = [name for name in DEFAULT_PARAMETERS if name in technique.Params.model_fields]
    space = SearchSpace(home, names)
    point = space.point(home)
    assert point is not None
    assert space.spec(optuna.trial.FixedTrial(point)) == home
    for preset in technique.presets:
        spec = parse_spec(f"{technique.name}:preset={preset}", KNOWN)
        found = space.point(spec)
        if found is not None:
            made = space.spec(optuna.trial.FixedTrial(found))
            assert [getattr(made.params, name) for name in names] == [getattr(spec.params, name) for name in names]


def test_published_constants_of_the_shadow_map_lie_in_its_space() -> None:
    space = SearchSpace(SHADOW_MAP, DEFAULT_PARAMETERS)
    presets = {name: parse_spec(f"shadow-map:preset={name}", KNOWN) for name in SHADOW_MAP.technique.presets}
    outside = [name for name, spec in presets.items() if space.point(spec) is None]
    sums = [name for name, spec in presets.items() if isinstance(spec.params.bias, Sum)]
    assert set(outside) == {*sums}, "sums of biases are measured beside the search, which is for one"
    assert "dither" in sums
    assert space.point(parse_spec("shadow-map:bias=texel(scale=99)", KNOWN)) is None
    refusing = SearchSpace(SHADOW_MAP, DEFAULT_PARAMETERS, {"bias": frozenset({"slope"})})
    assert refusing.point(parse_spec("shadow-map:preset=course", KNOWN)) is None


def test_both_ends_of_what_is_searched_of_a_number_are_allowed() -> None:
    families = [family_of(info) for one in own_techniques() for info in one.Params.model_fields.values()]
    searched = {
        (component, name): ends
        for component in {one for family in families for one in family}
        for name, info in component.model_fields.items()
        if (ends := span(info))
    }
    assert len(searched) > 20
    for (component, name), (low, high, _) in searched.items():
        for end in (low, high):
            rounded = type(component.model_fields[name].default)(min(max(float(f"{end:.3g}"), low), high))
            assert getattr(component(**{name: rounded}), name) == rounded


@given(seed=st.integers(0, 10_000))
def test_suggested_specs_survive_formatting_and_parsing(seed: int) -> None:
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=seed))
    spec = SearchSpace(SHADOW_MAP, DEFAULT_PARAMETERS).spec(study.ask())
    assert parse_spec(spec.text, KNOWN) == spec
    for name in DEFAULT_PARAMETERS:
        value = getattr(spec.params, name)
        for key, info in type(value).model_fields.items():
            chosen = getattr(value, key)
            if in_metres(info):
                assert chosen == info.default
            elif isinstance(chosen, float) and info.default > 0:
                assert info.default / SEARCH_FACTOR <= chosen <= info.default * SEARCH_FACTOR


def test_a_number_is_searched_around_its_default_within_its_limits() -> None:
    biases = {bias.name: bias.model_fields for bias in SearchSpace(SHADOW_MAP, DEFAULT_PARAMETERS).components("bias")}
    assert span(biases["slope"]["max"]) == (0.05 / 16, 0.8, True)
    assert span(biases["texel"]["limit"]) == (1, 256, True)
    assert span(biases["constant"]["world"]) is None
    assert span(KNOWN["cascades"].Params.model_fields["count"]) == (1, 8, True)
    assert span(KNOWN["cascades"].Params.model_fields["blend"]) == (0, 0.5, False)


def test_bias_filter_and_fit_are_searched_where_nothing_is_said() -> None:
    assert searched_parameters(SHADOW_MAP, None) == ("bias", "filter", "fit")
    assert searched_parameters(parse_spec("cascades", KNOWN), None) == ("bias", "filter")
    assert searched_parameters(SHADOW_MAP, "depth, bias") == ("depth", "bias")
    with pytest.raises(InputError, match="allowed: fit, depth"):
        searched_parameters(SHADOW_MAP, "")


def test_every_third_scene_is_held_out_whatever_their_order() -> None:
    names = [f"scene-{number}" for number in range(15)]
    split = split_scenes(names)
    assert len(split.held_out) == 5
    assert sorted(split.tuning + split.held_out) == sorted(names)
    assert set(split_scenes(names[::-1]).held_out) == set(split.held_out)
    assert split_scenes(names, ["scene-3"]) == SceneSplit(
        tuple(name for name in names if name != "scene-3"), ("scene-3",)
    )


def test_a_scene_is_one_observation_and_a_setting_has_the_scores_of_both_sets_of_scenes() -> None:
    """However many views a scene has; IoU and SSIM weigh the same, and errors have a lower bound."""
    tuning = [row(scene, error, cost=200) for scene, error in (("a", 0.04), ("b", 0.01))]
    default = scene_scores([{**one, "work": {"cost": 100}} for one in tuning])
    scores = scene_scores([tuning[0]] * 9 + tuning[1:])
    setting = Setting.of(SHADOW_MAP, scores, scene_scores([row("c", 0.3)]), default)
    assert (setting.cost, setting.tuning, setting.held_out) == pytest.approx((2, 0.02, 0.3), rel=0.01)
    assert (setting.acne, setting.leak, setting.contact) == (0, 0, 0)
    scores = scene_scores([row("a", 0.01, ssim=0.0001), row("b", 0.0)])
    assert np.exp(log_error(scores)).to_list() == pytest.approx([0.001, MIN_ERROR])


def test_soft_scenes_are_tuned_by_their_rmse_down_to_the_error_of_the_truth() -> None:
    def soft(rmse: float) -> dict[str, Any]:
        one = row("s", 0.5)
        return one | {"metrics": one["metrics"] | {"rmse": rmse, "rmse_pen": 0.3}, "truth_error": 0.01}

    few, many, none = (scene_scores([soft(rmse), row("h", 0.1)]) for rmse in (0.08, 0.02, 0.001))
    assert np.exp(few - many)[["rmse", "iou", "ssim"]].mean().to_list() == pytest.approx([4, 1, 1])
    assert log_error(none)["s"] == pytest.approx(log_error(many)["s"] - math.log(2) / 2)


def test_cells_without_a_score_are_left_out() -> None:
    without = {**row("b", 0.1), "metrics": {**row("b", 0.1)["metrics"], "iou": None}}
    assert list(scene_scores([row("a", 0.1), row("c", 0.1, status="failed: hung"), without]).index) == ["a"]


def test_a_search_leaves_a_bad_default_behind(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    bad = ("-t", "shadow-map:bias=constant(units=0.08),filter=hard", "--params", "bias", "--trials", "24")
    scenes = ("--scenes", "cube-on-plane,sphere-and-torus", "--held-out", "sphere-and-torus")
    size = ("--map-size", "128", "--view-size", "64", "--phases", "1", "-o", tmp_path / "rows")
    found = json.loads(shadowbench("tune", *bad, *scenes, *size, "--json").out)
    assert found["default"]["cost"] == 1
    assert min(one["tuning"] for one in found["front"] if one["cost"] <= 1) < found["default"]["tuning"] / 2


def test_components_that_no_view_takes_are_not_searched(bench: Any, tmp_path: Path) -> None:
    study = Study.of(["cube-on-plane"], [SHADOW_MAP], view_size=32, rounds=0)
    with bench.campaign(tmp_path / "rows", Mock()) as campaign:
        cells = TuningCells(study, campaign)
        refused = cells.unsupported_components(SHADOW_MAP, DEFAULT_PARAMETERS, cells.eligible_blocks(SHADOW_MAP))
    assert refused == {"bias": frozenset(), "filter": frozenset({"pcf-20"}), "fit": frozenset()}
    found = SearchSpace(SHADOW_MAP, DEFAULT_PARAMETERS, refused).components("filter")
    assert "pcf-20" not in [one.name for one in found]


LITTLE = ("--trials", "3", "--map-size", "64", "--view-size", "48", "--phases", "1")


def test_tune_prints_and_saves_its_result(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    scenes = ("--scenes", "cube-on-plane,spot-lamp,lamp-by-wall", "--held-out", "spot-lamp")
    tune = ("tune", "-t", "shadow-map", *scenes, *LITTLE, "-o", tmp_path / "t")
    answer = shadowbench(*tune, "--json")
    assert answer.code == 0, answer.err
    assert "lamp-by-wall.camera.light.48 takes no part: a point light" in answer.err
    assert "tuning on cube-on-plane; held out: spot-lamp" in answer.err
    found = json.loads(answer.out)
    assert (found["tuning"], found["held_out"]) == (["cube-on-plane"], ["spot-lamp"])
    assert found["default"]["spec"] == "shadow-map" and found["default"]["cost"] == 1
    assert all(one["tuning"] > 0 and one["held_out"] > 0 for one in (*found["front"], found["default"]))
    assert {file.name for file in (tmp_path / "t").iterdir()} == {"rows.jsonl", "run.json", "table.csv"}
    quiet = shadowbench(*tune, "--quiet")
    assert (quiet.code, quiet.err) == (0, "")
    assert "default" in quiet.out and found["front"][0]["spec"] in quiet.out
    assert str(tmp_path) not in quiet.out


@pytest.mark.slow
def test_a_setting_that_fails_costs_its_own_trial_only(
    shadowbench: Callable[..., Any], half: Path, tmp_path: Path
) -> None:
    text = half.read_text().replace('"half"', '"frail"').replace("Half", "Frail")
    text = text.replace("    def draw(", "    def draw_well(").replace(
        "        level:", "        sound: bool = param(True, 'holds')\n        level:"
    )
    text += (
        "\n    def draw(self, frame):\n        if not self.params.sound:\n"
        "            raise ZeroDivisionError('as planned')\n"
        "        return self.draw_well(frame)\n"
    )
    (tmp_path / "frail.py").write_text(text)
    scenes = ("--scenes", "cube-on-plane,stairs", "--held-out", "stairs", "--plugin", tmp_path / "frail.py")
    rest = ("--params", "sound,level", *LITTLE[2:], "--trials", "8", "-o", tmp_path / "t")
    answer = shadowbench("tune", "-t", "frail", *scenes, *rest, "--json")
    assert answer.code == 3
    assert "cells failed; the first: ZeroDivisionError: as planned" in answer.err
    found = json.loads(answer.out)
    assert all("sound=false" not in one["spec"] for one in found["front"])
    assert min(one["tuning"] for one in found["front"]) <= found["default"]["tuning"]
    answer = shadowbench("tune", "-t", "frail:sound=false", *scenes, *rest, "-q")
    assert (answer.code, answer.out) == (3, "")
    (line,) = answer.err.splitlines()
    assert "frail:sound=false" in line and "fails on some scene" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-t", "shadow-mop"], ["shadow-mop", "did you mean 'shadow-map'"]),
        (["-t", "unshadowed"], ["unshadowed has no bias, filter or fit"]),
        (["-t", "shadow-map", "--params", "size"], ["--params", "'size'", "allowed: fit", "--map-size"]),
        (["-t", "shadow-map", "--map-size", "big"], ["--map-size", "'big'", "allowed"]),
        (["-t", "shadow-map", "--map-size", "65536"], ["65536", "allows 1 to"]),
        (["-t", "shadow-map", "--trials", "0"], ["--trials", "equal to 1"]),
        (["-t", "shadow-map", "--scenes", "nowhere,stairs"], ["nowhere"]),
        (["-t", "shadow-map", "--scenes", "cube-on-plane"], ["--scenes", "1 to tune on, 0 held out"]),
        (["-t", "shadow-map", "--scenes", "lamp-by-wall"], ["none takes part"]),
        (["-t", "shadow-map", "--scenes", "cube-on-plane", "--held-out", "x"], ["--held-out", "'x'", "cube-on-plane"]),
        ([], ["-t"]),
    ],
)
def test_a_wrong_command_is_one_line(
    shadowbench: Callable[..., Any], tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    answer = shadowbench("tune", *arguments, "--view-size", "32", "-q", "-o", tmp_path / "t")
    assert (answer.code, answer.out) == (2, "")
    (line,) = answer.err.splitlines()
    assert all(word in line for word in words), line
