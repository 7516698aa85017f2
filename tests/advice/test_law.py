"""Laws of work: fitted to times that follow one, they give it back; those on record hold for other scenes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.advice.costs import Cost, cost_of
from shadowbench.advice.law import OWN, SHARED, find_law, law_of, laws
from shadowbench.advice.space import full_space
from shadowbench.advice.target import Target
from shadowbench.errors import InputError
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.plugin.registry import techniques
from shadowbench.results.submission import Submission, counted_work
from shadowbench.scenes.model import View
from tests.results.submissions import changed, submission


def timed_by(shared: dict[str, float], own: dict[str, float]) -> Submission:
    """A submission whose times are exactly nanoseconds for each count, the same for all kinds of techniques."""
    work = counted_work()
    columns = work.assign(vertices=work["vertices"] + work["geometry"], frames=1)
    ns = sum(columns[name] * value for name, value in {**shared, **own}.items())
    ms = np.where(work["kind"] == "unshadowed", 0.0, ns / 1e6)
    return changed(submission(), added_ms=ms)


def test_times_that_follow_a_law_give_it_back() -> None:
    shared, own = {"reads": 0.02, "gpu_bytes": 0.01}, {"frames": 2e5, "fragments": 0.3, "triangles": 7.0}
    law = law_of(timed_by(shared, own))
    # Specs of a kind differ in no count of a single frame in all scenes, so that their sums are known, not each share.
    counts = {"vertices": 5e4, "reads": 1e6, "gpu_bytes": 5e6, "fragments": 2e6, "triangles": 3e4}
    expected = (0.02 * 1e6 + 0.01 * 5e6 + 2e5 + 0.3 * 2e6 + 7.0 * 3e4) / 1e6
    assert law.milliseconds("shadow-map", counts) == pytest.approx(expected, rel=0.02)
    assert all(error.median == pytest.approx(1, abs=0.01) for error in law.errors.values())
    assert law.milliseconds("unshadowed", counts) == 0


def test_errors_are_those_of_scenes_left_out() -> None:
    """A scene with times of its own does not teach the law what to predict for it."""
    right = timed_by({}, {"frames": 1e6, "fragments": 0.1})
    own = counted_work()["scene"] == "stairs"
    ms = np.array([cell.added_ms for cell in right.cells])
    law = law_of(changed(right, added_ms=np.where(own, 5 * ms, ms)))
    cells, error = counted_work().query("kind == 'shadow-map fit=scene'"), law.errors["shadow-map fit=scene"]
    assert (error.cells, error.scenes) == (len(cells), cells["scene"].nunique()) == (22, 11)
    assert error.median < 1.2, "one scene in eleven"


def test_a_law_holds_only_for_what_was_timed_in_enough_scenes_and_follows_it() -> None:
    whole = timed_by({}, {"frames": 1e6})
    few = [cell for cell in whole.cells if "cube-map" not in cell.spec or cell.scene == "room-with-lamp"]
    law = law_of(whole.model_copy(update={"cells": tuple(few)}))
    assert law.holds("shadow-map") and not law.holds("cube-map"), "one scene"
    assert not law.holds("light-samples") and not law.holds("hybrid rest=embree"), "without data"
    rng = np.random.default_rng(1)
    noisy = law_of(changed(whole, added_ms=np.exp(rng.normal(0, 1.5, len(whole.cells)))))
    assert not any(noisy.holds(kind) for kind in noisy.errors)


@pytest.mark.parametrize("device", sorted(laws()))
def test_the_laws_on_record_hold_for_maps_and_volumes_in_other_scenes(device: str) -> None:
    """Medians of both devices when they were submitted: maps 1.10 to 1.14, volumes 1.2, planar projection 1.3."""
    errors = laws()[device].errors
    assert errors["shadow-map"].median < 1.2 and errors["cascades"].median < 1.2
    assert errors["shadow-volume"].median < 1.3 and errors["hybrid"].median < 1.3
    assert not errors["ray-traced where=gpu"].holds, "nodes that rays visit are not counted"
    assert set(laws()[device].nanoseconds) == {*SHARED, *(f"{kind} {count}" for kind in errors for count in OWN)}


def test_a_device_is_found_by_words_of_its_name() -> None:
    assert find_law("h100") is H100 and find_law(None) is None
    with pytest.raises(InputError, match=r"^--device: 'radeon' names 0 devices with times; allowed: NVIDIA H100"):
        find_law("radeon")


H100 = laws()["NVIDIA H100 80GB HBM3"]


def test_specs_are_left_out_of_which_a_law_gives_no_times() -> None:
    rule = Cost("ms", H100).rules([])[0]
    space = full_space(techniques(), "directional", 4096)
    left = {spec.technique.name for spec in space if rule(spec) is None}
    assert {"shadow-map", "cascades", "shadow-volume", "hybrid"} <= left and "ray-traced" not in left


def test_times_are_predicted_on_a_software_renderer_for_lights_without_a_size(builtin: Callable[..., View]) -> None:
    law, target = H100, Target("iou", 0.99, 2.0)
    view, soft = builtin("cube-on-plane", 32), builtin("post", 32)
    mesa = DeviceInfo("llvmpipe", "Mesa", 450, True, "finish+wall", 16384, 8, True, True)
    assert cost_of(target, view, mesa, False, True, law) == Cost("ms", law)
    for light, info, told in ((view, replace(mesa, software=False), "not on a GPU"), (soft, mesa, "with a size")):
        with pytest.raises(InputError, match=rf"^--device: .*{told}"):
            cost_of(target, light, info, False, True, law)
