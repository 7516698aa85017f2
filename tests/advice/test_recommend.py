"""`recommend`: the rule of its choice over invented rows, its words, and the command."""

import dataclasses
import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.advice.recommend import (
    Cost,
    Recommendation,
    Steadiness,
    cost_of,
    find_cheapest,
    least_error,
    target_error,
)
from shadowbench.advice.search import full_space
from shadowbench.advice.words import excluded_lines, lines, notes, obstacles, reached, rounded, table
from shadowbench.errors import InputError
from shadowbench.maps.biases import Texel
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.worker import DeviceInfo
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.results.law import laws
from shadowbench.results.summary import Target
from shadowbench.scenes.model import View
from shadowbench.scores import score
from shadowbench.truths.trace import Truth

KNOWN = techniques()
H100 = laws()["NVIDIA H100 80GB HBM3"]
MESA = DeviceInfo("llvmpipe", "Mesa", 450, True, "finish+wall", 16384, 8, True, True)
PIXELS = 128**2
IOU = Target("iou", 0.99)
Row = Callable[[Spec], dict[str, float | None]]


def row_of(spec: Spec, metrics: Mapping[str, float | None], **more: Any) -> Result:
    """A cell whose bytes are its texels, and its work these and the pixels; volumes cost three pixels each."""
    size = spec.map_size or 0
    work = {"cost": size**2 + PIXELS * (3 if spec.technique.name == "shadow-volume" else 1)}
    metrics = {"acne": 0.0, "contact": 0.0, "leak": 0.0, "edge_px": 0.0, "iou": 1.0, **metrics}
    return Result({"status": "ok", "key": "", "gpu_bytes": size**2, "work": work, "metrics": metrics} | more, None)


@pytest.fixture
def advise(builtin: Callable[..., View], truth_of: Callable[..., Truth]) -> Callable[..., Recommendation]:
    """What is recommended in a street by invented metrics of specs."""

    def search(
        target: Target, names: str, row: Row, largest: int = 4096, radius: float = 0.0, steady: Any = None, **more: Any
    ) -> Any:
        view, truth = builtin("street", 128), truth_of("street", 128)
        view = dataclasses.replace(view, light=dataclasses.replace(view.light, radius=radius))
        known = {name: KNOWN[name] for name in names.split()}
        measure = lambda spec: row_of(spec, row(spec), **more)  # noqa: E731
        return find_cheapest(view, truth, target, Cost("work_cost"), known, largest, measure, steady)

    return search


def by_size(**errors: float) -> Row:
    """The IoU of maps is one less 20 texels; of other techniques what is given."""
    return lambda spec: {"iou": 1 - errors.get(spec.technique.name.replace("-", "_"), 20 / (spec.map_size or 20))}


SOFT = dict.fromkeys(("width", "hardening", "hardening_intercept", "bias_pen", "bleed", "false_dark", "banding"))


@pytest.mark.parametrize(
    ("target", "names", "row", "largest", "choice"),
    [
        (IOU, "shadow-map", by_size(), 4096, ("shadow-map", 2048)),
        (IOU, "shadow-map shadow-volume", by_size(shadow_volume=0.0), 4096, ("shadow-volume", None)),
        (IOU, "shadow-map planar-projection", by_size(planar_projection=0.4), 1024, None),
        (Target("edge_px", 0.5), "shadow-map unshadowed", lambda spec: {"edge_px": (spec.map_size or 0) / 1024}, 4096,
         ("shadow-map", 256)),
        (Target("edge_px", 0.5), "shadow-map", lambda spec: {"edge_px": None, "iou": 0.2}, 256, None),
        (IOU, "shadow-map hybrid", lambda spec: {"iou": 1.0 if spec.technique.name == "hybrid" else 0.5}, 256,
         ("hybrid", 256)),
        (IOU, "shadow-map", lambda spec: {"iou": 1.0 if spec.text.endswith("filter=pcf") else 0.1}, 256,
         ("shadow-map", 256)),
    ],
    ids=["the smallest map that meets it", "exact and cheap", "nothing meets it", "smaller is better", "no edges",
         "without a cost if nothing else", "what predictions leave out"],
)  # fmt: skip
def test_the_choice_is_the_cheapest_that_meets_the_target(
    advise: Callable[..., Recommendation],
    target: Target,
    names: str,
    row: Row,
    largest: int,
    choice: tuple[str, int | None] | None,
) -> None:
    advice = advise(target, names, row, largest)
    chosen = advice.choice and (advice.choice.spec.technique.name, advice.choice.spec.map_size)
    assert chosen == choice
    assert advice.choice is None or advice.choice.rank == min(trial.rank for trial in advice.met)
    untried = sum(advice.untried.values()) + sum(one.specs for one in advice.excluded)
    assert advice.space_size == advice.measured + untried, "every spec is accounted for"
    assert all(lines(advice))


def test_a_technique_of_which_nothing_met_the_target_is_told_apart_from_one_that_was_not_tried_further(
    advise: Callable[..., Recommendation],
) -> None:
    """Maps of 2048² and 4096² would meet it, but cost more than the volumes: that was predicted, and is said."""
    names = "shadow-map cascades planar-projection shadow-volume"
    advice = advise(IOU, names, by_size(shadow_volume=0.0, planar_projection=0.4))
    assert advice.choice is not None and advice.choice.spec.text == "shadow-volume"
    standings = {trial.spec.technique.name: advice.standing(trial) for trial in advice.runners_up}
    assert standings["planar-projection"] == "misses"
    assert "misses" not in [standings.get(name) for name, _ in advice.untried]
    (line,) = [line for line in excluded_lines(advice) if "predicted to cost at least as much as the choice" in line]
    assert f"shadow-map {advice.untried['shadow-map', 'dearer']}" in line

    late = dataclasses.replace(advice, budget_ms=advice.choice.cost / 2)
    assert late.choice is None and late.standing(advice.choice) == "too slow", "it meets the accuracy"
    assert any("predicted to cost at least as much as shadow-volume (" in line for line in excluded_lines(late))
    assert any(line.startswith("obstacle: the budget") for line in obstacles(late))


@pytest.mark.parametrize(
    ("metrics", "obstacle"),
    [
        ({"iou": 0.98, "edge_px": 0.7}, "edges, 0.7 px off on average"),
        ({"iou": 0.98, "contact": 0.1, "leak": 0.3}, "leak, 30% of the umbra away from edges is lit"),
        ({"rmse": 0.03, **SOFT, "rmse_pen": 0.1, "noise": None}, "an RMSE of 0.1 in the penumbra (rmse_pen)"),
        (
            {"rmse": 0.03, **SOFT, "rmse_pen": 0.1, "noise": 0.08},
            "noise, the error varies by 0.08 where visibility should be equal (noise)",
        ),
    ],
)
def test_without_a_match_the_closest_spec_and_the_obstacle_are_named(
    advise: Callable[..., Recommendation], metrics: dict[str, float], obstacle: str
) -> None:
    target = Target("rmse", 0.02) if "rmse" in metrics else IOU
    none = advise(target, "shadow-map", lambda spec: metrics)
    assert none.choice is None and none.closest is not None
    first, second = obstacles(none)[:2]
    assert first.startswith(
        f"nothing measured meets {'RMSE ≤ 0.02' if 'rmse' in metrics else 'IoU ≥ 0.99'}; the closest"
    )
    assert second == f"obstacle: {obstacle}"


def test_the_choice_flickers_no_more_than_allowed_or_nothing_is_chosen(advise: Callable[..., Recommendation]) -> None:
    """Without snapping, cascades of 2048² meet an IoU of 0.99, and of 4096² flicker by less than 0.01 px too."""

    def row(spec: Spec) -> dict[str, float | None]:
        moves = spec.technique.name == "cascades" and not spec.params.stable
        return {"iou": 1 - 20 / (spec.map_size or 20), "flicker": moves * 40 / (spec.map_size or 1)}

    still = advise(IOU, "cascades", row)
    assert still.choice is not None and still.choice.spec.map_size == 2048 and not still.choice.spec.params.stable
    snapped = advise(IOU, "cascades", row, steady=Steadiness(0.01, "pan"))
    assert snapped.choice is not None and snapped.choice.spec.params.stable
    assert {snapped.standing(one) for one in snapped.trials if one.flicker > 1} <= {"misses", "so far"}
    assert snapped.measured < 0.2 * snapped.space_size
    assert table(snapped, MESA)[0].startswith("street, IoU ≥ 0.99, flicker ≤ 0.01 px in pan, by work")

    unsteady = {"iou": 0.995, "flicker": 0.02}
    none = advise(IOU, "shadow-map", lambda spec: unsteady, 512, steady=Steadiness(0.01, "pan"))
    assert none.choice is None and none.measured + sum(one.specs for one in none.excluded) == none.space_size
    assert obstacles(none)[0].startswith("nothing measured meets IoU ≥ 0.99, flicker ≤ 0.01 px in pan; the closest is ")
    assert obstacles(none)[1] == "obstacle: flicker, 0.02 px"


POSTS = """
[camera]
position = [0, 2, 6]
target = [0, 0.5, 0]
[light]
kind = "directional"
direction = [0.5, -1, -0.3]
[[mesh]]
shape = "plane"
scale = 60
[[sequence]]
name = "pass"
frames = 6
[[sequence.key]]
time = 1
camera = { position = [0.33, 2.05, 6], target = [0.33, 0.55, 0] }
""" + "".join(
    f"[[mesh]]\nshape = 'box'\nscale = [0.6, 2, 0.6]\ntranslate = [{x}, 1, {z}]\nrotate = [0, {8 * x}, 0]\n"
    for x in (-4.4, -2.2, 0, 2.2)
    for z in (0, -4.1, -8.2)
)


@pytest.mark.slow
def test_cascades_that_follow_the_view_are_refused_and_snapped_ones_chosen(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    """As the camera passes, a snapped texel stays where it is in the world; one that does not moves every edge."""
    (tmp_path / "posts.toml").write_text(POSTS)
    command = ("recommend", tmp_path / "posts.toml", "--view-size", "96", "-t", "cascades", "--max-edge-px", "0.7")
    still, moving = (
        shadowbench(*command, "-o", tmp_path / "rows", "--json", *more) for more in ((), ("--max-flicker", "0.005"))
    )
    assert (still.code, moving.code) == (0, 0), moving.err
    assert "stable" not in json.loads(still.out)["choice"]["spec"]
    found = json.loads(moving.out)
    assert "box=sphere,stable=true" in found["choice"]["spec"] and found["choice"]["metrics"]["flicker"] <= 0.005
    assert (found["target"]["max_flicker"], found["target"]["sequence"]) == (0.005, "pass")
    cheaper = [one for one in found["evidence"] if one["cost"] < found["choice"]["cost"]]
    assert all(one["metrics"]["flicker"] > 0.005 or one["metrics"]["edge_px"] > 0.7 for one in cheaper)


def test_a_map_that_is_smaller_than_needed_is_an_obstacle(advise: Callable[..., Recommendation]) -> None:
    assert any("the largest tried has 256" in line for line in obstacles(advise(IOU, "shadow-map", by_size(), 256)))


def test_what_no_target_counts_and_what_has_no_cost_is_noted(advise: Callable[..., Recommendation]) -> None:
    facets = advise(IOU, "shadow-map", lambda spec: {"terminator": 0.54}, 256)
    assert any("54% of the light on smooth surfaces" in line for line in notes(facets))
    assert not any(
        "smooth" in line for line in notes(advise(IOU, "shadow-map", lambda spec: {"terminator": 0.0025}, 256))
    )
    soft = advise(Target("rmse", 0.015), "shadow-map", lambda spec: {"rmse": 0.01}, 256, 0.01, truth_error=0.02)
    assert "the truth's own error is an RMSE of 0.02: a smaller one cannot be told from 0" in notes(soft)
    rays = advise(IOU, "shadow-map hybrid", lambda spec: {"iou": 1.0})
    assert any("no cost is known of" in line and "hybrid" in line for line in notes(rays))


def test_a_rounded_value_is_on_its_own_side_of_the_target_and_meets_what_it_is_called() -> None:
    for value in (0.98996, 0.99, 0.990004, 0.99996, 1.0, 0.0):
        shown = float(rounded(IOU, value))
        assert shown == pytest.approx(value, abs=6e-5)
        assert (shown >= 0.99) == (value >= 0.99) and (shown == 1) == (value == 1)
    assert [reached(IOU, iou) for iou in (0.9592, 0.9999875, 1.0)] == ["0.9592", "0.9999", "1"]
    assert reached(Target("rmse", 0.02), 0.0293444) == "0.0294"


def test_without_any_edge_nothing_is_off_only_where_the_shadows_are_the_same() -> None:
    errors = [target_error(Target("edge_px", 0.5), {"edge_px": None, "iou": iou}) for iou in (None, 1.0, 0.98)]
    assert errors == [0.0, 0.0, math.inf]


@pytest.mark.parametrize("metric", ["iou", "edge_px", "rmse"])
def test_one_wrong_pixel_is_about_the_least_error(metric: Any, truth_of: Callable[..., Truth]) -> None:
    truth = truth_of("cube-on-plane", 64)
    prepared, least = prepare_truth(truth), least_error(truth, metric)
    for y, x in np.argwhere(prepared.edge)[::7]:
        mask = truth.visibility.copy()
        mask[y, x] = 1.0
        assert 0.4 * least < target_error(Target(metric, 0.5), score(mask, prepared)) < 4 * least


def test_costs_on_a_machine_are_ratios_times_one_reference_time(builtin: Callable[..., View]) -> None:
    """Each cell is timed in a separate block, so that the load of the machine must not affect the choice."""

    def trial(size: int, frame_ms: float, reference_ms: float) -> Any:
        spec = parse_spec(f"shadow-map:size={size}", KNOWN)
        names = {"scene": "s", "view": "v", "light": "l", "phase": 0, "spec": str(size), "technique": "t"}
        time = {"frame_ms": frame_ms, "ratio": frame_ms / reference_ms, "ratio_iqr": 0.0, "reference": "r", "n": 9}
        timed = Result({**row_of(spec, {}).score, **names}, time | {"reference_ms": reference_ms})
        return Cost("frame_ms").trial(spec, timed, IOU, builtin("street", 128))

    costs, reference = Cost("frame_ms").compared([trial(512, 8.0, 16.0), trial(1024, 6.0, 8.0)])
    assert [one.cost for one in costs] == [0.5 * 12, 0.75 * 12]
    assert reference is not None and (reference.name, reference.ms, reference.drifted) == ("r", 12, True)


def test_what_ranks_depends_on_the_device_the_light_and_what_is_asked_for(builtin: Callable[..., View]) -> None:
    view, soft = builtin("cube-on-plane", 32), builtin("post", 32)
    mesa, gpu = MESA, dataclasses.replace(MESA, software=False)
    by_law = Cost("predicted_ms", H100)
    assert cost_of(view, mesa) == cost_of(view, mesa, device="h100") == by_law
    assert cost_of(view, mesa, "time") == cost_of(view, gpu) == Cost("frame_ms")
    assert cost_of(view, mesa, "work") == Cost("work_cost")
    assert "with a size" in cost_of(soft, mesa).without_law
    for light, info, why in ((view, gpu, "not on a GPU"), (soft, mesa, "with a size")):
        with pytest.raises(InputError, match=rf"^--device: .*{why}"):
            cost_of(light, info, device="h100")
    space = full_space(KNOWN, "directional", 4096)
    unranked = {spec.text[: spec.text.index("fit=") + 5] for spec in space if by_law.unranked(spec)}
    assert unranked == {"shadow-map:fit=v", "hybrid:fit=v"}, "was not timed"


def test_the_choice_meets_the_target_its_rows_are_kept_and_a_second_call_measures_nothing(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    folder = tmp_path / "rows"
    command = ("recommend", "sphere-and-torus", "--view-size", "96", "-o", folder)
    answer = shadowbench(*command, "--json")
    assert answer.code == 0, answer.err
    found = json.loads(answer.out)
    assert found["choice"]["metrics"]["iou"] >= 0.99
    assert (found["ranked_by"], found["device"]) == ("predicted_ms", "NVIDIA H100 80GB HBM3")
    met = [one for one in found["evidence"] if one["metrics"]["iou"] >= 0.99]
    assert found["choice"]["cost"] == min(one["cost"] for one in met if one["cost"] is not None)
    rows = (folder / "rows.jsonl").read_text()
    assert found["measured"] == rows.count("\n") <= 0.2 * found["space"]
    keys = {json.loads(line)["key"] for line in rows.splitlines()}
    assert {one["key"] for one in found["evidence"]} == keys
    assert (folder / "table.csv").exists() and (folder / "run.json").exists()

    again = shadowbench(*command)
    assert again.code == 0 and (folder / "rows.jsonl").read_text() == rows
    assert again.out.startswith("sphere-and-torus, IoU ≥ 0.99, by predicted times on NVIDIA H100 80GB HBM3\n")
    assert "not tried: cube-map, " in again.out and len(re.findall("^not tried", again.out, re.MULTILINE)) <= 4
    (why,) = [one["why"] for one in found["excluded"] if one["what"] == "cube-map"]
    assert why == "supports point and spot light, not directional"
    assert f"{found['measured']} of {found['space']} specs measured" in again.out
    assert "maps are scored in one phase" in again.out


def test_export_writes_parameters_and_whole_shaders(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    folder = tmp_path / "made" / "mine"
    easy = ("canopy", "--min-iou", "0.9")  # for which a map costs less than volumes
    answer = shadowbench("recommend", *easy, "--view-size", "96", "-o", tmp_path / "rows", "--export", folder, "--json")
    assert answer.code == 0, answer.err
    written = json.loads((folder / "parameters.json").read_text())
    assert written["spec"] == json.loads(answer.out)["choice"]["spec"]
    texts = {file.name: file.read_text() for file in folder.iterdir() if file.suffix != ".json"}
    assert set(texts) == set(written["uniforms"]) and texts
    chosen = written["parameters"]
    assert chosen["bias"] == {"name": "texel", **Texel().model_dump()}
    resolve = next(name for name in texts if name.endswith("-resolve.frag"))
    assert f"#define SIZE {chosen['size']}\n" in texts[resolve]
    assert written["uniforms"][resolve]["bias_limit"] == chosen["bias"]["limit"]
    assert all(text.startswith("#version 410 core\n") and "#include" not in text for text in texts.values())
    assert all("void main" in text for text in texts.values())


BAD_OPTIONS = [
    (("--min-iou", "1.5"), "--min-iou: found 1.5; allowed: 0 to 1"),
    (("--min-iou", "nan"), "--min-iou: found nan"),
    (("--max-edge-px", "-1"), "--max-edge-px: found -1; allowed: 0 and more"),
    (("--budget-ms", "0"), "--budget-ms: found 0; allowed: above 0"),
    (("--min-iou", "0.9", "--max-edge-px", "1"), "allowed: one of them"),
    (("--max-rmse", "nan"), "--max-rmse: found nan; allowed: 0 to 1"),
    (("--max-rmse", "0.1", "--min-iou", "0.9"), "--min-iou and --max-rmse: found both; allowed: one of them"),
    (("--max-flicker", "-1"), "--max-flicker: found -1; allowed: 0 and more"),
    (("--view", "nowhere"), "nowhere"),
    (("-t", "shadowmap"), "unknown technique 'shadowmap'; did you mean 'shadow-map'?"),
    (("-t", "shadow-map:size=512"), "technique 'shadow-map:size=512': found parameters"),
    (("--budget-ms", "3", "--by", "work"), "--budget-ms: found with --by work, which has no times; allowed: "),
    (("--by", "clock"), "--by: found 'clock'; allowed: work, device, time"),
    (("--by", "time", "--device", "h100"), "--device: found with --by time; allowed: --by device"),
    (("-t", "cube-map"), "nothing to search: cube-map supports point and spot light, not directional; allowed: "),
]


def test_invalid_option_values_are_one_line(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    for options, message in BAD_OPTIONS:
        answer = shadowbench("recommend", "cube-on-plane", "-o", tmp_path / "rows", *options)
        assert answer.code == 2 and message in answer.err and len(answer.err.splitlines()) == 1, options
    assert not (tmp_path / "rows" / "rows.jsonl").exists()


@pytest.mark.slow
def test_times_of_this_machine_rank_if_asked_and_an_impossible_budget_is_not_met(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    command = ("recommend", "cube-on-plane", "--view-size", "64", "-o", tmp_path / "rows", "--by", "time")
    answer = shadowbench(*command, "--budget-ms", "0.0001")
    assert answer.code == 1
    assert "closest" in answer.out and "obstacle: the budget" in answer.out
    answer = shadowbench(*command, "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert found["ranked_by"] == "frame_ms" and found["choice"]["cost"] > 0


def test_only_the_techniques_asked_for_are_searched(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    command = ("recommend", "stairs", "--view-size", "64", "-o", tmp_path / "rows", "-t", "planar-projection")
    met = json.loads(shadowbench(*command, "-t", "shadow-volume", "--json").out)
    assert met["techniques"] == ["planar-projection", "shadow-volume"]
    assert {one["spec"] for one in met["evidence"]} <= {"planar-projection", "shadow-volume"}
    missed = shadowbench("recommend", "street", *command[2:])
    assert missed.code == 1 and missed.out.startswith("street, IoU ≥ 0.99, of planar-projection, by predicted times")
    assert "nothing measured of planar-projection meets IoU ≥ 0.99; the closest is planar-projection: IoU" in missed.out


SCENE = """
camera = { position = [0, 3, 6], target = [0, 0, 0] }
[light]
kind = "directional"
direction = [0.3, -1, 0.2]
angular_radius = 0.3
[[mesh]]
shape = "plane"
scale = 6
[[mesh]]
shape = "box"
casts = false
translate = [0, -3, 0]
"""


def test_where_nothing_seen_is_in_shadow_none_is_drawn(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    """Also under a light whose penumbra no pixel hits, which is judged as a hard one."""
    file = tmp_path / "box.toml"
    file.write_text(SCENE)
    answer = shadowbench("recommend", file, "--view-size", "32", "-o", tmp_path / "rows", "--json")
    assert answer.code == 0, answer.err
    advice = json.loads(answer.out)
    assert advice["choice"]["spec"] == "unshadowed" and advice["measured"] == 1
    assert advice["target"]["metric"] == "iou" and not any("soft" in note for note in advice["notes"])
    file.write_text(SCENE.replace("angular_radius = 0.3", ""))
    answer = shadowbench("recommend", file, "--view-size", "32", "-o", tmp_path / "hard")
    assert answer.code == 0 and "unshadowed" in answer.out, "it costs nothing, by the law of a device"
