"""Stability in reports: charts, tables and pictures agree with the rows of a sweep."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import NAMES
from shadowbench.reports.charts import styles_of
from shadowbench.reports.stability import Stability
from shadowbench.reports.sweep_charts import (
    LIMITS,
    UNSUPPORTED_COLOR,
    axis_chart,
    axis_figure,
    metrics_along,
    share_color,
    share_colors,
)
from shadowbench.results.ranges import TOLERANCES, value_text
from shadowbench.scores.masks import read_mask
from tests.reports.conftest import POINTS, Point, color_of, galleries, image_of, swept, texts

OF_HARD = ["1 − IoU", "acne", "leak"]  # metrics of hard shadows, which the lights of these rows cast
UNLIT = [one for one in POINTS if one.light != "spot"]

Chart = dict[str, Any]


def points(found: Stability, axis: str, spec: str = "shadow-map") -> dict[str, Chart]:
    """The points of a spec in the chart along an axis, by value."""
    return {one["tooltip"]["at"]: one for one in axis_chart(found, AXES[axis])["data"]["values"] if one["spec"] == spec}


def test_a_point_that_was_measured_again_counts_once_as_it_was_last(stability_of) -> None:
    found = stability_of(*POINTS, Point("shadow-map", "elevation", 0.2, version=1))
    assert found.sweep.older == 1
    assert found.range_at["shadow-map", "elevation", "directional"].share == 1


def test_what_has_no_range_is_left_out_with_a_note(stability_of) -> None:
    floor = [replace(one, iou=0.0, leak=1.0) for one in swept("unshadowed", "elevation")]
    unknown = Point("a", "weather", 3.0), Point("a", "elevation", 12.5)
    found = stability_of(*swept("a", "elevation"), *swept("a", "gap")[:1], *unknown, *floor)
    assert [axis.name for axis in found.axes] == ["elevation"] and [one.share for one in found.ranges] == [1]
    assert found.headline[1:] == [
        "Left out: 24 cells of `unshadowed`, of an unfinished sweep, or at a value that this version lacks."
    ]
    assert stability_of(*floor).headline[0] == "No spec has an operating range."


# Colours of the table


def luminance(color: str) -> float:
    """WCAG 2.2, "relative luminance"."""
    parts = np.array([int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_colours_differ_in_grey_and_carry_their_text(stability_of) -> None:
    lights = [luminance(share_color(share)) for share in np.linspace(0, 1, 21)]
    assert (np.diff(lights) > 0.01).all()
    one = stability_of().ranges[0]
    for count in range(201):
        made = replace(one, swept=("",) * 200, unsupported=(), in_tolerance=("",) * count)
        ground, ink = luminance(share_color(count / 200)), 1.0 if share_colors(made)[1] == "white" else 0.0
        bright, dim = max(ground, ink), min(ground, ink)
        assert (bright + 0.05) / (dim + 0.05) >= 4.5, count  # level AA
    assert UNSUPPORTED_COLOR not in {share_color(share) for share in np.linspace(0, 1, 1001)}


# Lines


def test_lines_run_in_the_order_of_the_axis_spaced_logarithmically_over_decades(stability_of) -> None:
    found = stability_of(*UNLIT)
    places = {
        name: [one["x"] for one in points(found, name).values()] for name in ("elevation", "map-size", "volume-wall")
    }
    assert all(line == sorted(set(line)) for line in places.values())
    assert np.allclose(np.diff(places["map-size"]), np.log10(2), atol=1e-6)
    assert places["volume-wall"] == list(range(15))


def test_a_point_says_its_value_scores_and_failure_against_the_tolerance(stability_of) -> None:
    stability = stability_of(*UNLIT)
    found = points(stability, "elevation")
    tooltip = found["0.2°"]["tooltip"]
    assert tooltip["scores"] == "1 − IoU 0.200, acne 0.250, leak 0"
    assert tooltip["verdict"] == "out of tolerance: acne 25.00%" and found["0.2°"]["broken"]
    assert found["50°"]["tooltip"]["verdict"] == "in tolerance" and not found["50°"]["broken"]
    (rule,) = [one for one in axis_chart(stability, AXES["elevation"])["layer"] if one["mark"]["type"] == "rule"]
    (limits,) = rule["data"]["values"]
    others = {name: limit for name, limit in TOLERANCES.items() if name != "iou"}
    assert limits == pytest.approx({"1 − IoU": 1 - TOLERANCES["iou"], **others})


def test_unmeasured_values_have_no_point(stability_of) -> None:
    found = stability_of()
    refused, crashed = points(found, "map-size")["8192 texels"], points(found, "volume-wall")["0 m"]
    assert all(one[name] is None for one in (refused, crashed) for name in LIMITS)
    assert not refused["ended"] and refused["tooltip"]["verdict"] == "unsupported: too large"
    assert crashed["ended"] and crashed["tooltip"]["verdict"] == "failed: crashed"
    said = [texts(axis_chart(found, AXES[name])) for name in ("volume-wall", "map-size")]
    assert "✕" in said[0] and "✕" not in said[1]


def test_a_figure_has_every_metric_of_its_axis_flicker_only_where_something_moves(stability_of) -> None:
    found = stability_of()
    assert metrics_along(found, AXES["camera-step"]) == [*OF_HARD, "flicker"]
    assert metrics_along(found, AXES["elevation"]) == OF_HARD
    said = texts(axis_figure(found, AXES["camera-step"], styles_of(found.specs)))
    assert {*OF_HARD, "flicker"} <= set(said) and said.count("tolerance") == len(OF_HARD) + 1


# Pictures


def pixels(uri: str) -> np.ndarray:
    """(N, N, 3) of an image in a page."""
    return np.asarray(image_of(uri).convert("RGB")).astype(float)


def test_every_breaking_point_is_shown_with_the_mask_and_shading_of_its_scene(sweep_folder, page_of) -> None:
    folder = sweep_folder(pictures=True)
    page = page_of(folder)
    assert "<code>shadow-map at volume-wall 0 m,<wbr> sun</code> failed: crashed" in page, "without a picture"
    (shown,) = galleries(page)
    assert {(one["spec"], one["view"]) for one in shown["cells"]} == {
        ("shadow-map", "elevation 0.2°, sun"),
        ("shadow-map", "map-size 16 texels, sun"),
        ("cube-map", "mesh open, sun"),
        ("planar-projection", "elevation 50°, sun"),
    }
    assert "acne 25.00%: IoU 0.80000" in {one["caption"] for one in shown["cells"]}
    measured = {
        (one.spec, f"{one.axis} {value_text(AXES[one.axis], one.value)}, {NAMES[one.light]}"): one for one in POINTS
    }
    for one in shown["cells"]:
        row = measured[one["spec"], one["view"]].record()
        mask = read_mask(folder / "masks" / f"{row['key']}.png")
        assert np.abs(pixels(one["mask"])[..., 0] - 255 * mask).max() <= 1
        stem = ".".join(str(row[name]) for name in ("scene", "view", "light", "view_size"))
        for kind in ("lit", "ambient"):
            shading = pixels(shown["views"][one["view"]][kind])
            assert np.abs(shading - color_of(f"{stem}.{kind}.png")).mean() < 6, "lossy"


# Formats


def test_runs_and_sweeps_share_a_page(run_folder, sweep_folder, page_of) -> None:
    page = page_of(run_folder(pictures=True), sweep_folder(pictures=True), sweep_folder(name="other"))
    assert "the cost of accuracy, and where each breaks</h1>" in page
    assert len(galleries(page)) == 2 and "Pareto front" in page and 'id="stability"' in page
    assert page.count('<h3 class="machine">') == 2 and page.count("No pictures: the folder has neither") == 2
    ids = re.findall(r' id="([^"]+)"', re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL))
    assert len(set(ids)) == len(ids)


def test_markdown_has_a_table_for_each_spec(sweep_folder, shadowbench, tmp_path) -> None:
    assert shadowbench("report", sweep_folder(), "--format", "md", "-o", tmp_path / "table.md").code == 0
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert "| elevation | breaks at 0.2°: acne 25.00% | 0.1…89.9° |" in text
    assert "| map-size | breaks at 16 texels: leak 50.00%; refused: 8192, 16384 |  |" in text
    assert "- `shadow-map at volume-wall 0 m, sun`: failed: crashed" in text
