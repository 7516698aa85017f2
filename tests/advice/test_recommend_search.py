"""The search of `recommend`: it finds the cheapest spec that meets a target, with few measurements."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import pytest

from shadowbench.advice.costs import Cost
from shadowbench.advice.recommend import Recommendation, find_cheapest
from shadowbench.advice.search import Search, Trial, extrapolate, point_of, reads_of
from shadowbench.advice.space import full_space, prune, specs_of, start_size, unavailable, untried_filters
from shadowbench.advice.target import Target, least_error
from shadowbench.advice.words import (
    cost_notes,
    cost_text,
    excluded_lines,
    facet_notes,
    obstacles,
    step_lines,
    target_notes,
)
from shadowbench.maps.filters import Filter
from shadowbench.measure.rows import Result
from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.results.law import laws
from shadowbench.scenes.model import View
from shadowbench.scores import score
from shadowbench.survey.survey import Needs, needs
from shadowbench.truths.trace import Truth

KNOWN = techniques()
H100 = "NVIDIA H100 80GB HBM3"
PIXELS = 256**2
MARGINS = (1.8, 2.0)
UNREAD = Result({}, None)
FILTERS = {"hard": 1.0, "hardware": 1.0, "pcf": 1.3, "pcf(taps=5)": 1.8}


def sun_space() -> list[Spec]:
    """The specs for which `Model` has formulas."""
    space = [spec for spec in full_space(KNOWN, "directional", 16384) if getattr(spec.params, "depth", "d16") == "d16"]
    return [spec for spec in space if spec.map_size is None or point_of(spec).filter in FILTERS]


def read_once(spec: Spec) -> float:
    """Work of reading a map at each pixel."""
    return PIXELS * (1.0 + reads_of(spec))


class Model:
    """Costs and errors by formula; records the specs that are measured."""

    def __init__(self, sharpness: float, spread: float, slope: float, vertices: float, volume: float) -> None:
        self.sharpness, self.spread, self.slope = sharpness, spread, slope
        self.vertices, self.volume = vertices, volume
        self.asked: list[Spec] = []

    def trial(self, spec: Spec) -> Trial:
        point = point_of(spec)
        if point.size is None:
            planar = spec.technique.name == "planar-projection"
            cost, error = (2.0 * PIXELS, 0.4) if planar else (self.volume * PIXELS, 0.0)
            return Trial(spec, cost, 0.0, PIXELS, error, UNREAD)
        # Groups differ, but always in the same way.
        number = sum(map(ord, point.group)) % 7 / 7
        layers = getattr(spec.params, "count", 1)
        texels = layers * point.size**2 * (1 + number)
        cost = read_once(spec) + self.vertices + texels
        error = FILTERS[point.filter] * self.sharpness * (1 + self.spread * number) / layers / point.size**self.slope
        return Trial(spec, cost, self.vertices, int(texels), error, UNREAD)

    def measure(self, spec: Spec) -> Trial:
        self.asked.append(spec)
        return self.trial(spec)


def search_for(model: Model, limit: float, space: list[Spec], start: float = 1024) -> Trial | None:
    return Search(space, limit, read_once, lambda spec: start, model.measure, MARGINS).run()


def test_smooth_errors_let_the_search_find_one_of_the_cheapest_with_a_fifth_of_the_measurements() -> None:
    """In 19 of 20 models one that costs at most 1.15 × the cheapest: predictions are no bounds, so none is certain."""
    space, random, ratios = sun_space(), np.random.default_rng(0), []
    for _ in range(60):
        sharpness, spread, slope, vertices, volume = random.uniform([1, 0, 0.7, 0, 3], [100, 3, 1.3, 1e6, 300])
        model, limit = Model(sharpness, spread, slope, vertices, volume), random.choice([0.1, 0.05, 0.02, 0.01])
        best = search_for(model, limit, space, random.choice([300, 1000, 9000]))
        assert best is not None and best.error <= limit
        ratios.append(best.cost / min(one.cost for one in map(model.trial, space) if one.error <= limit))
        assert len(model.asked) == len(set(model.asked))
        assert len(model.asked) <= 0.2 * len(full_space(KNOWN, "directional", 16384))
    assert np.quantile(ratios, 0.95) <= 1.15


def test_nothing_is_chosen_where_nothing_meets_the_target() -> None:
    space = [spec for spec in sun_space() if point_of(spec).size is not None]
    blurred, sharp = (Model(sharpness, spread=1, slope=1, vertices=0, volume=3) for sharpness in (100, 1e-9))
    assert search_for(blurred, 1e-5, space) is None
    assert search_for(sharp, 1e-5, space) is not None


def test_no_map_is_drawn_where_something_costs_less_than_reading_one() -> None:
    model = Model(sharpness=1, spread=1, slope=1, vertices=0, volume=1.5)
    best = search_for(model, 0.1, sun_space())
    assert best is not None and best.spec.technique.name == "shadow-volume"
    assert all(point_of(spec).size is None for spec in model.asked)


def test_a_spec_with_unsuccessful_cells_is_skipped() -> None:
    model = Model(sharpness=10, spread=1, slope=1, vertices=0, volume=300)
    cascades: list[Spec] = []

    def measure(spec: Spec) -> Trial | None:
        if spec.technique.name == "cascades":
            cascades.append(spec)
            return None
        return model.measure(spec)

    best = Search(sun_space(), 0.05, read_once, lambda spec: 1024, measure, MARGINS).run()
    assert best is not None and best.spec.technique.name != "cascades"
    assert [spec.map_size for spec in cascades] == [1024] * 3 + [256] * 3  # smaller might have held, larger not


@pytest.mark.parametrize("limit", [0.05, 0.02, 0.01])
def test_of_each_technique_that_meets_the_target_the_cheapest_is_nearly_found(limit: float) -> None:
    """Exact volumes are cheap, so that no map is needed; but what one costs is to be told as it is."""
    model, space = Model(sharpness=20, spread=1, slope=1, vertices=0, volume=3), sun_space()
    search = Search(space, limit, read_once, lambda spec: 4096, model.measure, MARGINS)
    best = search.run()
    assert best is not None and best.spec.technique.name == "shadow-volume"
    for name in {trial.spec.technique.name for trial in search.trials if trial.error <= limit}:
        cost, least = (
            min(one.cost for one in trials if one.spec.technique.name == name and one.error <= limit)
            for trials in (search.trials, map(model.trial, space))
        )
        assert cost <= 1.15 * least, name
    assert len(model.asked) <= 0.2 * len(full_space(KNOWN, "directional", 16384))


def test_another_filter_at_a_size_says_more_than_the_same_at_a_quarter_of_it() -> None:
    """The hard filter at 256 predicts that it misses at 1024; the hardware's error there, that it may meet it."""
    errors = {
        ("visible", "hard", 512): 0.012,
        ("visible", "hardware", 512): 0.031,
        ("scene", "hard", 256): 0.077,
        ("scene", "hard", 1024): 0.0091,
        ("scene", "hardware", 1024): 0.0167,
    }
    spec_of = {
        key: parse_spec(f"shadow-map:fit={key[0]},filter={key[1]},size={key[2]},depth=d16", KNOWN) for key in errors
    }
    exact = parse_spec("shadow-volume", KNOWN)

    def trial(spec: Spec) -> Trial:
        if spec is exact:
            return Trial(spec, 1.2 * 1024**2 + 2 * PIXELS, 0.0, 0, 0.0, UNREAD)
        error = next(errors[key] for key, one in spec_of.items() if one == spec)
        return Trial(spec, (spec.map_size or 0) ** 2 + 2.0 * PIXELS, 0.0, 0, error, UNREAD)

    search = Search([exact, *spec_of.values()], 0.01, read_once, lambda spec: 512, trial, MARGINS)
    for key in errors.keys() - {("scene", "hard", 1024)}:
        search._measure(spec_of[key])
    best = search.run()
    assert best is not None and best.spec == spec_of["scene", "hard", 1024]


@pytest.mark.parametrize("limit", [0.0, 1e-9])
def test_a_target_without_any_error_is_searched_for_among_maps(limit: float) -> None:
    """Errors are multiples of a pixel of the shadow; predictions are never 0."""
    pixel = 1 / 5000

    class Counted(Model):
        def trial(self, spec: Spec) -> Trial:
            one = super().trial(spec)
            return dataclasses.replace(one, error=round(one.error / pixel) * pixel)

    model, space = Counted(sharpness=0.2, spread=1, slope=1, vertices=0, volume=300), sun_space()
    best = Search(space, limit, read_once, lambda spec: 256, model.measure, MARGINS, least=pixel).run()
    met = [one for one in map(model.trial, space) if one.error == 0]
    assert best is not None and best.error == 0 and best.spec.map_size is not None
    assert best.cost <= 1.15 * min(one.cost for one in met)
    assert len(model.asked) <= 0.2 * len(full_space(KNOWN, "directional", 16384))


@pytest.mark.parametrize("metric", ["iou", "edge_px", "rmse"])
def test_one_wrong_pixel_is_about_the_least_error(
    metric: Literal["iou", "edge_px", "rmse"], truth_of: Callable[..., Truth]
) -> None:
    truth = truth_of("cube-on-plane", 64)
    prepared = prepare_truth(truth)
    found = least_error(truth, metric)
    for y, x in np.argwhere(prepared.edge)[::7]:
        mask = truth.visibility.copy()
        mask[y, x] = 1.0
        error = Target(metric, 0.5).error(score(mask, prepared))
        assert 0.4 * found < error < 4 * found


def test_an_error_without_a_number_says_nothing_of_larger_maps_and_all_of_smaller_ones() -> None:
    assert extrapolate({256: math.inf}, 128) == extrapolate({256: math.inf}, 256) == math.inf
    assert extrapolate({256: math.inf, 512: math.inf}, 1024) == 0.0
    assert extrapolate({256: math.inf, 512: 0.02}, 1024) == pytest.approx(0.01)
    assert extrapolate({256: 0.08, 512: 0.02, 1024: math.inf}, 2048) < 0.01

    class Coarse(Model):
        def trial(self, spec: Spec) -> Trial:
            one = super().trial(spec)
            coarse = (spec.map_size or 0) < 1024
            return dataclasses.replace(one, error=math.inf if coarse else one.error)

    model, space = Coarse(sharpness=10, spread=0, slope=1, vertices=0, volume=300), sun_space()
    best = search_for(model, 0.02, space, start=300)
    met = [one for one in map(model.trial, space) if one.error <= 0.02]
    assert best is not None and best.cost == min(one.cost for one in met)


@pytest.mark.parametrize(
    ("iou", "error"), [(None, 0.0), (1.0, 0.0), (0.0, math.inf), (0.98, math.inf)], ids=["none", "same", "lit", "most"]
)
def test_without_any_edge_nothing_is_off_only_where_the_shadows_are_the_same(iou: float | None, error: float) -> None:
    assert Target("edge_px", 0.5).error({"edge_px": None, "iou": iou}) == error
    assert Target("edge_px", 0.5).error({"edge_px": 0.25, "iou": iou}) == 0.25


def texels_cost(spec: Spec, metrics: dict[str, float | None]) -> Result:
    """A cell of a map without acne, whose work and bytes are its texels."""
    size = spec.map_size or 0
    row = {"status": "ok", "key": "", "gpu_bytes": size**2, "work": {"cost": size**2}}
    return Result(row | {"metrics": {"acne": 0.0, "contact": 0.0, "leak": 0.0, **metrics}}, None)


@pytest.fixture
def found(builtin: Callable[..., View], truth_of: Callable[..., Truth]) -> Callable[..., Recommendation]:
    """What is found in a street for rows of one's own."""

    def search(
        target: Target,
        names: Sequence[str],
        row: Callable[[Spec], Result],
        largest: int = 4096,
        radius: float = 0.0,
    ) -> Recommendation:
        view, truth = builtin("street", 128), truth_of("street", 128)
        view = dataclasses.replace(view, light=dataclasses.replace(view.light, radius=radius))
        return find_cheapest(view, truth, target, Cost("work"), {name: KNOWN[name] for name in names}, largest, row)

    return search


def test_a_spec_without_a_comparable_edge_is_named_and_meets_no_target(found: Callable[..., Recommendation]) -> None:
    def row(spec: Spec) -> Result:
        return texels_cost(spec, {"edge_px": None, "iou": 1.0 if (spec.map_size or 0) >= 512 else 0.2})

    target, names = Target("edge_px", 0.5), ("shadow-map", "unshadowed")
    some = found(target, names, row, 1024)
    assert some.choice is not None and some.choice.spec.map_size == 512
    assert step_lines(some)[0] == "of those measured, none saves a tenth or more if the target is relaxed"
    none = found(target, names, row, 256)
    assert none.choice is None
    assert obstacles(none)[0].endswith(": no edges to compare, and other shadows")


def test_dark_facets_which_no_target_counts_are_told(found: Callable[..., Recommendation]) -> None:
    for share, told in ((None, 0), (0.0025, 0), (0.54, 1)):
        metrics = {"iou": 1.0, "edge_px": 0.0, "terminator": share}
        best = found(Target("iou", 0.99), ["shadow-map"], lambda spec, metrics=metrics: texels_cost(spec, metrics), 256)
        lines = facet_notes(best)
        assert len(lines) == told and all("54% of the light on smooth surfaces" in line for line in lines)


def test_small_maps_may_be_the_best_for_soft_shadows(found: Callable[..., Recommendation]) -> None:
    """Large texels blur, and one map is as good as another of its size by no rule."""

    def row(spec: Spec) -> Result:
        result = texels_cost(spec, {"iou": 0.9, "rmse": 0.01 if spec.map_size == 256 else 0.3})
        return Result(dict(result.score) | {"truth_error": 0.02}, None)

    soft = found(Target("rmse", 0.015), ["shadow-map"], row, radius=0.01)
    assert soft.choice is not None and soft.choice.spec.map_size == 256
    assert target_notes(soft) == ["the truth's own error is an RMSE of 0.02: a smaller one cannot be told from 0"]


def test_costs_on_a_machine_are_ratios_times_one_reference_time(builtin: Callable[..., View]) -> None:
    """Each cell is timed in a separate block, so that the load of the machine must not affect the choice."""
    target = Target("iou", 0.9, budget_ms=9.0)
    specs = [parse_spec(f"shadow-map:size={size}", KNOWN) for size in (512, 1024)]

    def trial(spec: Spec, frame_ms: float, reference_ms: float) -> Trial:
        result = texels_cost(spec, {"iou": 0.95})
        names = {"scene": "s", "view": "v", "light": "l", "phase": 0, "spec": str(spec.map_size), "technique": "t"}
        time = {"frame_ms": frame_ms, "ratio": frame_ms / reference_ms, "ratio_iqr": 0.0, "reference": "r"}
        timed = Result(dict(result.score) | names, time | {"reference_ms": reference_ms})
        return Cost("ms").trial(spec, timed, target, builtin("street", 128))

    busy, quiet = trial(specs[0], 8.0, 16.0), trial(specs[1], 6.0, 8.0)
    assert (busy.cost, quiet.cost) == (0.5, 0.75)
    found, reference = Cost("ms").compared([busy, quiet])
    assert [one.cost for one in found] == [0.5 * 12, 0.75 * 12]
    assert (reference.name, reference.ms, reference.drifted) == ("r", 12, True)


def test_of_two_specs_with_equal_cost_the_one_with_fewer_bytes_is_chosen() -> None:
    space = [parse_spec(f"shadow-map:depth={depth}", KNOWN) for depth in ("d32f", "d16")]
    search = Search(space, 0.1, read_once, lambda spec: 1024, lambda spec: None, MARGINS)
    search.trials = [Trial(spec, 1.0, 0.0, size, 0.0, UNREAD) for spec, size in zip(space, (4, 2), strict=True)]
    assert search.best is not None and search.best.spec is space[1]


def test_an_error_between_and_beyond_sizes_follows_the_line_through_the_two_nearest() -> None:
    line = {256: 0.08, 1024: 0.02}
    assert extrapolate(line, 512) == pytest.approx(0.04)
    assert extrapolate(line, 4096) == pytest.approx(0.005)
    assert extrapolate({1024: 0.02}, 512) == pytest.approx(0.04)
    assert extrapolate({256: 0.02, 512: 0.02}, 4096) < 0.02  # a plateau is believed in part
    assert math.isfinite(extrapolate({256: 0.0, 512: 0.0}, 1024))


@pytest.fixture(scope="module")
def street(builtin: Callable[..., View]) -> Needs:
    return needs(builtin("street", 128))


def test_the_search_space_has_the_techniques_that_support_the_light() -> None:
    names = {spec.technique.name for spec in full_space(KNOWN, "point", 16384)}
    assert names >= {"cube-map", "shadow-volume", "planar-projection"}
    out = set(unavailable(KNOWN, "point"))
    assert out >= {"shadow-map", "cascades", "ray-traced", "unshadowed"}
    assert not out & names and out | names == set(KNOWN)
    for name in ("shadow-map", "cascades", "cube-map"):
        assert {spec.map_size for spec in specs_of(KNOWN[name], 16384)} == {256, 512, 1024, 2048, 4096}
    soft = {spec.technique.name for spec in full_space(KNOWN, "point", 16384, soft=True)}
    assert soft - names == {"soft-volume"} == out - set(unavailable(KNOWN, "point", soft=True))
    assert {spec.map_size for spec in specs_of(KNOWN["shadow-map"], 1000)} == {256, 512}
    assert {spec.map_size for spec in specs_of(KNOWN["shadow-map"], 100)} == {100}
    texts = [spec.full_text for spec in full_space(KNOWN, "spot", 16384)]
    assert len(texts) == len(set(texts))


def test_the_needed_bits_leave_one_depth_format(street: Needs) -> None:
    space = full_space(KNOWN, "directional", 16384)
    assert street.bits is not None
    for bits, kept in ((16, "d16"), (24, "d32f"), (32, "d32f"), (None, "d32f")):
        needed = dataclasses.replace(street, bits=dataclasses.replace(street.bits, bits=bits))
        left = [spec for spec in space if spec not in prune(space, needed, 0.9)]
        assert {spec.params.depth for spec in left if hasattr(spec.params, "depth")} == {kept}


def test_what_has_no_cost_is_shown_without_one_and_chosen_only_where_nothing_else_meets(
    found: Callable[..., Recommendation],
) -> None:
    """By work rays in a shader have none, and by a law a fit that was not timed; both are measured."""
    for largest, choice, standing in ((4096, "shadow-map", "unranked"), (256, "hybrid", "choice")):

        def row(spec: Spec, largest: int = largest) -> Result:
            exact = spec.technique.name == "hybrid" or (spec.map_size or 0) >= 2048
            return texels_cost(spec, {"iou": 1.0 if exact else 0.5})

        one = found(Target("iou", 0.99), ["shadow-map", "hybrid"], row, largest)
        assert one.choice is not None and one.choice.spec.technique.name == choice
        (rays,) = [one for one in (one.choice, *one.runners_up) if one.spec.technique.name == "hybrid"]
        assert (rays.cost, cost_text(one, rays), one.standing(rays)) == (math.inf, "", standing)
        assert any("hybrid: walks a tree" in line or "of hybrid" in line for line in cost_notes(one))
        assert step_lines(one) and one.unranked
    late = dataclasses.replace(one, choice=None, target=dataclasses.replace(one.target, budget_ms=1.0))
    assert obstacles(late)[1].endswith("IoU 1 in a time that is not known")
    unranked = {spec.text for spec in full_space(KNOWN, "directional", 4096) if Cost("ms", laws()[H100]).unranked(spec)}
    assert {text[: text.index("fit=") + 5] for text in unranked} == {"shadow-map:fit=v", "hybrid:fit=v"}


def test_nothing_meets_the_target_only_if_nothing_in_the_space_does(found: Callable[..., Recommendation]) -> None:
    """By its errors elsewhere no spec is expected to; one that needs and predictions leave out does."""

    def row(spec: Spec) -> Result:
        odd = (spec.map_size, point_of(spec).filter) == (256, "pcf") and spec.params.depth == "d32f"
        return texels_cost(spec, {"iou": 1.0 if odd else 0.1})

    one = found(Target("iou", 0.99), ["shadow-map"], row)
    assert one.choice is not None and "depth" not in one.choice.spec.text and one.choice.spec.map_size == 256
    rest = sum(sum(dataclasses.astuple(of)) for of in one.untried.values())
    assert one.space_size == one.measured + sum(of.specs for of in one.excluded) + rest
    none = found(Target("iou", 0.99), ["shadow-map"], lambda spec: texels_cost(spec, {"iou": 0.1}))
    assert none.choice is None and none.measured == len(specs_of(KNOWN["shadow-map"], 4096))
    assert not any(one.specs for one in none.excluded) and not none.untried


def test_projection_is_left_out_only_where_planes_cannot_hold_the_shadow(street: Needs) -> None:
    space = full_space(KNOWN, "directional", 16384)

    def why_not(least: float | None, planes: int = 3, **shares: float) -> list[str]:
        seen = street.receivers
        estimates = {name: dataclasses.replace(seen.planar, value=value) for name, value in shares.items()}
        changed = dataclasses.replace(street, receivers=dataclasses.replace(seen, planes=planes, **estimates))
        return [
            why for spec, (_, why) in prune(space, changed, least).items() if spec.technique.name == "planar-projection"
        ]

    assert not why_not(0.95, planar=0.5, shadowed=0.4), "all of the shadow may lie on the planes"
    assert why_not(0.95, planar=0.5, shadowed=0.9)
    assert not why_not(None, planar=0.5, shadowed=0.9)
    assert why_not(None, planes=0, planar=0.5, shadowed=0.1)
    told = "by `needs` it would leave 59.0% of the shadow lit: its IoU is at most about 0.41"
    assert why_not(0.99, planes=6, planar=0.146, shadowed=0.16, lost=0.59) == [told], "what `needs` says of it"


def test_a_group_is_first_measured_at_the_predicted_map_size(street: Needs) -> None:
    assert street.texels.edge_size is not None and street.cascades is not None and street.cascades.edge_size is not None
    assert start_size(parse_spec("shadow-map", KNOWN), street) == street.texels.edge_size
    assert start_size(parse_spec("cascades:count=3", KNOWN), street) == street.cascades.edge_size[3]


@pytest.mark.parametrize("soft", [False, True])
def test_filters_that_are_not_tried_are_named(soft: bool) -> None:
    space = full_space(KNOWN, "directional", 16384, soft)
    (line,) = untried_filters(space, soft)
    tried = {spec.params.filter.name for spec in space if hasattr(spec.params, "filter")}
    assert set(line.what.removeprefix("the filters ").split(", ")) == set(Filter.table) - tried
    assert ("pcss" in tried, "the light's size" in line.why) == (soft, soft)
    assert untried_filters([spec for spec in space if not hasattr(spec.params, "filter")], soft) == []


def row_of_maps(spec: Spec) -> Result:
    """Volumes are exact and cheap, and maps have an error of 20 texels."""
    size, pixels = spec.map_size or 0, 128**2
    exact = {"shadow-volume": (pixels * 3, 1.0), "planar-projection": (pixels, 0.6)}
    cost, iou = exact.get(spec.technique.name) or (size**2 + pixels, 1 - 20 / size)
    result = texels_cost(spec, {"iou": iou, "contact": 0.1})
    return Result(dict(result.score) | {"work": {"cost": cost}}, None)


def test_a_technique_of_which_nothing_met_the_target_is_told_apart_from_one_that_was_not_tried_further(
    found: Callable[..., Recommendation],
) -> None:
    """Maps of 2048² and 4096² would meet it, but cost more than the volumes: that was predicted, and is said."""
    names = ("shadow-map", "cascades", "planar-projection", "shadow-volume")
    one = found(Target("iou", 0.99), names, row_of_maps)
    assert one.choice is not None and one.choice.spec.text == "shadow-volume"
    standings = {trial.spec.technique.name: one.standing(trial) for trial in one.runners_up}
    assert "misses" not in [standings.get(name) for name in one.untried]
    assert standings["planar-projection"] == "misses" and "planar-projection" not in one.untried
    for name, rest in one.untried.items():
        assert rest.dearer > 0
        (line,) = [line for line in excluded_lines(one) if "predicted to cost" in line]
        assert f"{name} {rest.dearer}" in line and line.endswith("; -t TECHNIQUE searches one alone")
    counts = [sum(dataclasses.astuple(rest)) for rest in one.untried.values()]
    assert one.space_size == one.measured + sum(one.specs for one in one.excluded) + sum(counts)

    budget = dataclasses.replace(one.target, budget_ms=one.choice.cost / 2)
    late = dataclasses.replace(one, target=budget, choice=None)
    assert late.standing(one.choice) == "too slow", "it meets the accuracy, over the budget"
    assert any("predicted to cost at least as much as shadow-volume (" in line for line in excluded_lines(late))


@pytest.mark.parametrize("value", [0.98996, 0.99, 0.990004, 0.99996, 1.0, 0.0])
def test_a_rounded_value_is_on_its_own_side_of_the_target(value: float) -> None:
    shown = float(Target("iou", 0.99).digits(value))
    assert shown == pytest.approx(value, abs=6e-5)
    assert (shown >= 0.99) == (value >= 0.99) and (shown == 1) == (value == 1)
    assert float(Target("edge_px", 0.5).digits(0.5001)) > 0.5


@pytest.mark.parametrize(
    ("target", "value", "shown"),
    [
        (Target("iou", 0.99), 0.9863548, "0.9863"),
        (Target("iou", 0.99), 0.9592, "0.9592"),  # 0.9592000000000001 to 16 digits
        (Target("iou", 0.99), 0.9999875, "0.9999"),
        (Target("iou", 0.9999), 0.9999875, "0.99998"),
        (Target("iou", 0.99), 1.0, "1"),
        (Target("rmse", 0.02), 0.0293444, "0.0294"),
        (Target("rmse", 0.02), 0.0, "0"),
    ],
)
def test_another_target_that_is_told_is_met_by_what_was_measured(target: Target, value: float, shown: str) -> None:
    assert target.reached(value) == shown


NOISE = "noise, the error varies by 0.08 where visibility should be equal (noise)"
WIDTH = "penumbra width, half of those drawn are at least 2 times too wide or too narrow (width)"
SOFT = dict.fromkeys(("width", "hardening", "hardening_intercept", "bias_pen", "bleed", "false_dark", "banding"))


@pytest.mark.parametrize(
    ("metrics", "told"),
    [
        ({"iou": 0.98, "edge_px": 0.7}, "edges, 0.7 px off on average"),
        ({"iou": 0.98, "contact": 0.1, "leak": 0.3}, "leak, 30% of the umbra away from edges is lit"),
        ({"rmse": 0.03, "noise": None}, "an RMSE of 0.1 in the penumbra (rmse_pen)"),
        ({"rmse": 0.03, "noise": 0.08}, NOISE),
        ({"rmse": 0.03, "noise": 0.08, "width": 1.0}, WIDTH),
    ],
)
@pytest.mark.parametrize("best", [2048, 4096])
def test_without_a_match_the_closest_spec_and_the_obstacle_are_named(
    found: Callable[..., Recommendation], metrics: dict[str, float], told: str, best: int
) -> None:
    """Of soft shadows the error that stands out, or the RMSE, and that the largest map that is tried is too small."""
    soft = "rmse" in metrics
    name, value = ("rmse", 0.03) if soft else ("iou", 0.98)

    def row(spec: Spec) -> Result:
        off = 0.0 if spec.map_size == best else 1e-4
        own = {name: value + off if soft else value - off}
        return texels_cost(spec, {"iou": 0.9, **(SOFT | {"rmse_pen": 0.1} if soft else {}), **metrics, **own})

    none = found(Target("rmse", 0.02) if soft else Target("iou", 0.99), ["shadow-map"], row)
    assert none.choice is None and none.closest is not None and none.closest.spec.map_size == best
    lines = obstacles(none)
    met = "RMSE ≤ 0.02" if soft else "IoU ≥ 0.99"
    assert lines[0].startswith(f"nothing measured meets {met}; the closest is shadow-map")
    assert lines[1] == f"obstacle: {told}"
    widest = "obstacle: map size; the closest has 4096 texels a side, the most that are tried"
    assert (widest in lines) == (soft and best == 4096)


def test_a_map_that_is_smaller_than_needed_is_an_obstacle(found: Callable[..., Recommendation]) -> None:
    none = found(Target("iou", 0.99), ["shadow-map"], row_of_maps, 256)
    assert "the largest tried has 256" in obstacles(none)[2]
    several = found(Target("iou", 0.99), ["cascades"], row_of_maps, 256)
    assert several.closest is not None
    count = several.closest.spec.technique.view_slices(several.closest.spec.params)
    size = several.needs.cascades.edge_size[count]  # as `needs` prints it
    assert f"`needs` asks for about {size:.0f} texels a side of each of {count} cascades" in obstacles(several)[2]
