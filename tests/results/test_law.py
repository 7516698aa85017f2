"""Laws of devices: fitted to times that follow one, they give it back; the one on record holds for other scenes."""

from pathlib import Path

import fit_device
import numpy as np
import pandas as pd
import pytest

from shadowbench.errors import InputError
from shadowbench.results.law import OWN, SHARED, SHORTEST_MS, Law, counts_of, find_law, kind_of, laws

H100 = laws()["NVIDIA H100 80GB HBM3"]
KINDS = {"shadow-map": (1e5, 0.02, 3.0), "shadow-volume": (2e6, 0.3, 100.0)}
EACH = {"vertices": 0.2, "reads": 0.02, "gpu_bytes": 0.01}
PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "devices.md"


def cells(spread: float = 0.0) -> pd.DataFrame:
    """Cells of four scenes whose times follow the nanoseconds above, but for a log-normal factor."""
    random = np.random.default_rng(1)
    rows = []
    for scene, triangles in (("a", 30), ("b", 500), ("c", 4_000), ("d", 90_000)):
        for kind, own in KINDS.items():
            for size in (256, 512, 1024, 2048):
                counts = dict(zip(SHARED, random.integers(1e5, 1e6, 3), strict=True))
                counts |= {"fragments": size**2, "triangles": triangles}
                ns = sum(EACH[name] * counts[name] for name in SHARED) + own[0] + own[1] * size**2 + own[2] * triangles
                ms = ns / 1e6 * np.exp(random.normal(0, spread))
                rows.append({"scene": scene, "spec": kind, **counts, "clock": "finish+wall"})
                rows[-1] |= {"added_ms": ms, "frame_ms": ms + 0.2}
    return pd.DataFrame(rows)


def law_of(frame: pd.DataFrame) -> Law:
    return Law("device", "today", len(frame), **fit_device.fitted(frame))


def test_times_that_follow_a_law_give_it_back() -> None:
    law = law_of(cells())
    assert law.shared == pytest.approx(EACH, rel=1e-3)
    for kind, own in KINDS.items():
        assert [law.kinds[kind][name] for name in OWN] == pytest.approx(own, rel=1e-2), kind
        assert law.kinds[kind]["median"] == pytest.approx(1, abs=1e-3) and law.kinds[kind]["scenes"] == 4
        assert law.holds(kind)
    noisy = law_of(cells(spread=1.5))
    assert not any(noisy.holds(kind) for kind in KINDS), "no time where scenes left out are far off"
    assert not law.holds("cube-map"), "without data"


def test_times_count_as_by_the_same_clock_rate() -> None:
    """`unshadowed` is the same picture in every view: where it takes twice as long, the GPU ran at half of its rate."""
    right = cells().assign(clock="gl_time_elapsed")
    slow = np.where(right["scene"] == "b", 2.0, 1.0)
    again = right.assign(added_ms=right["added_ms"] * slow, frame_ms=right["frame_ms"] * slow)
    assert law_of(again).shared == pytest.approx(law_of(right).shared)


def test_a_law_counts_the_vertices_of_geometry_shaders_and_nothing_of_the_floor() -> None:
    work = {"vertices": 100, "geometry": 40, "reads": 7, "fragments": 64**2 + 5}
    counts = counts_of({"work": work, "gpu_bytes": 4 * 64**2 + 3, "view_size": 64, "view_width": 64}, triangles=9)
    assert counts == {"vertices": 140, "reads": 7, "gpu_bytes": 3, "fragments": 5, "triangles": 9}


def test_a_row_has_the_time_that_its_law_gives_to_its_counts() -> None:
    work = {"vertices": 1000, "geometry": 500, "fragments": 128**2 + 4000, "reads": 2000}
    row = {
        "spec": "shadow-map:fit=scene",
        "view_size": 128,
        "view_width": 128,
        "triangles": 12,
        "gpu_bytes": 4 * 128**2 + 5e8,
    }
    row |= {"metrics": {}, "work": work}
    shared = 1500 * H100.shared["vertices"] + 2000 * H100.shared["reads"] + 5e8 * H100.shared["gpu_bytes"]
    frames, fragments, triangles = (H100.kinds["shadow-map fit=scene"][name] for name in OWN)
    assert H100.of_row(row) == pytest.approx((shared + frames + 4000 * fragments + 12 * triangles) / 1e6)
    assert H100.of_row(row | {"spec": "unshadowed"}) == 0
    small = row | {"gpu_bytes": 4 * 128**2}
    assert H100.of_row(small) == SHORTEST_MS, "below it times are not told apart"
    assert H100.of_row(row | {"spec": "ray-traced:where=gpu"}) is None, "nodes that rays visit are not counted"
    assert H100.of_row(row | {"metrics": {"rmse_pen": 0.1}}) is None, "lights with a size were not timed"


def test_parameters_of_the_default_fit_change_no_kind() -> None:
    assert kind_of("shadow-map:fit=visible(oriented=false),size=512") == "shadow-map"


def test_a_device_is_found_by_words_of_its_name() -> None:
    assert find_law("h100") is H100 and find_law("NVIDIA H100 80GB HBM3") is H100
    for name in ("", "-", "h10", "radeon"):
        with pytest.raises(InputError, match=r"^--device: '.*' names 0 devices with times; allowed: NVIDIA H100"):
            find_law(name)


def test_the_page_has_the_law_on_record() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert set(fit_device.table({"kinds": H100.kinds})) <= set(page.splitlines())
    assert not H100.holds("ray-traced where=gpu") and H100.holds("shadow-volume")
