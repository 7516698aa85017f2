"""Laws of work: fitted to times that follow one, they give it back; those on record hold for other scenes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.advice.costs import Cost, cost_of
from shadowbench.advice.law import OWN, SHARED, counts_of, find_law, law_of, laws
from shadowbench.advice.space import full_space
from shadowbench.advice.target import Target
from shadowbench.errors import InputError
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.plugin.registry import techniques
from shadowbench.results.submission import Submission, counted_work
from shadowbench.scenes.model import View
from tests.results.submissions import changed, submission

H100 = laws()["NVIDIA H100 80GB HBM3"]


def timed_by(shared: dict[str, float], own: Callable[[str], dict[str, float]]) -> Submission:
    """A submission whose times are exactly nanoseconds for each count; own: by kind of technique."""
    work, pixels = counted_work(), 1024**2
    counts = work.assign(
        vertices=work["vertices"] + work["geometry"],
        fragments=work["fragments"] - pixels,
        gpu_bytes=work["gpu_bytes"] - 4 * pixels,
        frames=1,
    )
    rows = counts.to_dict("records")
    ns = np.array([sum(row[name] * value for name, value in (shared | own(row["kind"])).items()) for row in rows])
    ms = np.where(work["kind"] == "unshadowed", 0.0, ns / 1e6)
    return changed(submission(), added_ms=ms, frame_ms=ms + 0.2)


def test_times_that_follow_a_law_give_it_back() -> None:
    """Each kind of technique has nanoseconds of its own."""

    def own(kind: str) -> dict[str, float]:
        return {"frames": 1e5 * len(kind), "fragments": 0.02 * len(kind), "triangles": 3.0 * len(kind)}

    law = law_of(timed_by({"reads": 0.02, "gpu_bytes": 0.01}, own))
    counts = {"vertices": 5e4, "reads": 1e6, "gpu_bytes": 5e6, "fragments": 2e6, "triangles": 3e4}
    for kind in ("shadow-map", "cascades", "shadow-volume"):
        shares = own(kind)
        expected = 0.02 * 1e6 + 0.01 * 5e6 + shares["frames"] + shares["fragments"] * 2e6 + shares["triangles"] * 3e4
        assert law.milliseconds(kind, counts) == pytest.approx(expected / 1e6, rel=0.05), kind
    assert all(error.median == pytest.approx(1, abs=0.02) for error in law.errors.values())
    assert law.milliseconds("unshadowed", counts) == 0


def test_a_law_counts_the_vertices_of_geometry_shaders_and_nothing_of_the_floor() -> None:
    work = {"vertices": 100, "geometry": 40, "reads": 7, "fragments": 64**2 + 5}
    counts = counts_of({"work": work, "gpu_bytes": 4 * 64**2 + 3, "view_size": 64}, triangles=9)
    assert counts == {"vertices": 140, "reads": 7, "gpu_bytes": 3, "fragments": 5, "triangles": 9}


def test_errors_are_those_of_scenes_left_out() -> None:
    """Of two cells with times of their own, a fit to both has no error, and one to the other alone misses each."""
    right, work = timed_by({}, lambda kind: {"frames": 1e6}), counted_work()
    two = [cell for cell in right.cells if cell.scene in ("stairs", "statue")]
    ms = [5 * cell.added_ms if cell.scene == "stairs" else cell.added_ms for cell in two]
    error = law_of(changed(right.model_copy(update={"cells": tuple(two)}), added_ms=ms)).errors["planar-projection"]
    assert (error.cells, error.scenes) == (2, 2) and error.median > 3
    planar = law_of(right).errors["planar-projection"]
    assert planar.cells == planar.scenes == work.query("kind == 'planar-projection'")["scene"].nunique() == 13


def test_times_count_as_by_the_same_clock_rate() -> None:
    """`unshadowed` is the same picture in every view: where it takes twice as long, the GPU ran at half of its rate."""
    right = timed_by({}, lambda kind: {"frames": 1e6, "fragments": 0.1})
    slow = np.where(counted_work()["scene"] == "stairs", 2.0, 1.0)
    times = {name: slow * [getattr(cell, name) for cell in right.cells] for name in ("frame_ms", "added_ms")}
    assert law_of(changed(right, **times)).nanoseconds == pytest.approx(law_of(right).nanoseconds)


def test_a_law_holds_only_for_what_was_timed_in_enough_scenes_and_follows_it() -> None:
    whole = timed_by({}, lambda kind: {"frames": 1e6})
    few = [cell for cell in whole.cells if "cube-map" not in cell.spec or cell.scene == "room-with-lamp"]
    law = law_of(whole.model_copy(update={"cells": tuple(few)}))
    assert law.holds("shadow-map") and not law.holds("cube-map"), "one scene"
    assert not law.holds("light-samples") and not law.holds("hybrid rest=embree"), "without data"
    noise = np.exp(np.random.default_rng(1).normal(0, 1.5, len(whole.cells)))
    noisy = law_of(changed(whole, added_ms=noise, frame_ms=noise + 0.2))
    assert not any(noisy.holds(kind) for kind in noisy.errors)


@pytest.mark.parametrize("device", sorted(laws()))
def test_the_laws_on_record_hold_for_maps_and_volumes_in_other_scenes(device: str) -> None:
    """Medians of the first device: maps 1.07 to 1.09, planar projection and `hybrid` 1.15, volumes 1.18."""
    errors = laws()[device].errors
    assert all(errors[kind].median < 1.15 for kind in ("shadow-map", "shadow-map fit=scene", "cascades", "cube-map"))
    assert all(errors[kind].median < 1.25 for kind in ("planar-projection", "hybrid", "shadow-volume"))
    assert not errors["ray-traced where=gpu"].holds, "nodes that rays visit are not counted"
    assert set(laws()[device].nanoseconds) == {*SHARED, *(f"{kind} {count}" for kind in errors for count in OWN)}


def test_a_device_is_found_by_words_of_its_name() -> None:
    assert find_law("h100") is H100 and find_law(None) is None
    assert find_law("NVIDIA H100 80GB HBM3") is H100
    for name in ("", "-", "h10"):
        with pytest.raises(InputError, match=r"^--device: '.*' names 0 devices"):
            find_law(name)
    with pytest.raises(InputError, match=r"^--device: 'radeon' names 0 devices with times; allowed: NVIDIA H100"):
        find_law("radeon")


def test_specs_have_no_cost_of_which_a_law_gives_no_times() -> None:
    space = full_space(techniques(), "directional", 4096)
    left = {spec.technique.name for spec in space if Cost("ms", H100).unranked(spec) is None}
    assert {"shadow-map", "cascades", "shadow-volume", "hybrid"} <= left and "ray-traced" not in left


def test_times_are_predicted_on_a_software_renderer_for_lights_without_a_size(builtin: Callable[..., View]) -> None:
    law, target = H100, Target("iou", 0.99, 2.0)
    view, soft = builtin("cube-on-plane", 32), builtin("post", 32)
    mesa = DeviceInfo("llvmpipe", "Mesa", 450, True, "finish+wall", 16384, 8, True, True)
    assert cost_of(target, view, mesa, law=law) == Cost("ms", law)
    assert cost_of(target, view, mesa) == Cost("ms", law), "that on record, unless something else is asked for"
    assert cost_of(target, view, mesa, "time") == Cost("ms")
    assert cost_of(Target("iou", 0.99), view, mesa, "work") == Cost("work")
    assert cost_of(target, view, replace(mesa, software=False)) == Cost("ms"), "a GPU's own"
    assert "with a size" in cost_of(Target("rmse", 0.02), soft, mesa).without_law
    for light, info, told in ((view, replace(mesa, software=False), "not on a GPU"), (soft, mesa, "with a size")):
        with pytest.raises(InputError, match=rf"^--device: .*{told}"):
            cost_of(target, light, info, law=law)


def test_a_row_has_the_time_that_its_law_gives_to_its_counts() -> None:
    """Nanoseconds by hand: what `unshadowed` takes too, a triangle of the screen, is counted in neither."""
    work = {"vertices": 1000, "geometry": 500, "fragments": 128**2 + 4000, "reads": 2000}
    row = {
        "spec": "shadow-map:fit=scene",
        "view_size": 128,
        "triangles": 12,
        "gpu_bytes": 4 * 128**2 + 5e8,
        "metrics": {},
    }
    ns = H100.nanoseconds
    shared = 1500 * ns["vertices"] + 2000 * ns["reads"] + 5e8 * ns["gpu_bytes"]
    own = [ns[f"shadow-map fit=scene {name}"] for name in ("frames", "fragments", "triangles")]
    assert H100.of_row(row | {"work": work}) == pytest.approx((shared + own[0] + 4000 * own[1] + 12 * own[2]) / 1e6)
    assert H100.of_row(row | {"work": work, "spec": "unshadowed"}) == 0
    without = row | {"work": work}
    del without["triangles"]  # as rows of earlier versions
    unknown = [without, row | {"work": {"draws": 1}}, row | {"work": work, "spec": "ray-traced:where=gpu"}]
    soft = row | {"work": work, "metrics": {"rmse_pen": 0.1}}
    assert [H100.of_row(one) for one in (*unknown, soft)] == [None] * 4
