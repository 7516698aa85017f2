"""Stability in reports: heat map, charts, tables and pictures agree with the rows of a sweep."""

import csv
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import NAMES
from shadowbench.reports import gallery
from shadowbench.reports.along_axes import LIMITS, axis_chart, axis_figure, metrics_along
from shadowbench.reports.gallery import GalleryCell, size_limit
from shadowbench.reports.heat_map import UNSUPPORTED_COLOR, heat_map, is_dark, share_color
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import styles_of
from shadowbench.reports.words import range_text, stability_headline
from shadowbench.results.ranges import TOLERANCES, value_text
from shadowbench.scores.masks import read_mask
from tests.reports.conftest import CELLS, POINTS, Point, color_of, galleries, image_of, scripts, swept, texts

OF_HARD = ["1 − IoU", "acne", "leak"]  # metrics of hard shadows, which the lights of these rows cast

Chart = dict[str, Any]
Shadowbench = Callable[..., Any]
Write = Callable[..., Path]
Make = Callable[..., Stability]


def axis_of(found: Stability, name: str, **options: Any) -> Chart:
    return axis_chart(found, AXES[name], styles_of(found.specs, legend=False), **options)


def cells(chart: Chart) -> dict[tuple[str, str], Chart]:
    return {(one["row"], one["axis"]): one for one in chart["data"]["values"]}


def points(chart: Chart, spec: str) -> dict[str, Chart]:
    return {one["at"]: one for one in chart["data"]["values"] if one["spec"] == spec}


def test_a_point_that_was_measured_again_counts_once_as_it_was_last(stability_of: Make) -> None:
    found = stability_of([*POINTS, Point("shadow-map", "elevation", 0.2, version=1)])
    assert found.sweep.older == 1
    assert found.range_at["shadow-map", "elevation", "directional"].share == 1


def test_a_sweep_that_stopped_before_its_default_value_is_left_out_with_a_note(stability_of: Make) -> None:
    found = stability_of([*swept("shadow-map", "elevation"), *swept("shadow-map", "gap")[:1]])
    assert [axis.name for axis in found.axes] == ["elevation"]
    assert stability_headline(found)[-1] == "Left out as unfinished: 1 sweep, the first of `shadow-map` along gap."


def test_rows_at_unknown_axes_or_values_are_left_out_with_a_note(stability_of: Make) -> None:
    found = stability_of([*swept("a", "elevation"), Point("a", "weather", 3.0), Point("a", "elevation", 12.5)])
    assert [one.share for one in found.ranges] == [1]
    assert stability_headline(found)[-1] == "Left out because this version has no such axis or value: 2 cells."


# The heat map


def test_the_share_is_that_of_the_values_around_the_default(stability_of: Make) -> None:
    found = cells(heat_map(stability_of()))
    shares = {place: one["share"] for place, one in found.items()}
    assert shares == {
        ("shadow-map, sun", "elevation"): pytest.approx(19 / 21),  # 0.1° lies beyond the break
        ("shadow-map, spot", "elevation"): 1,
        ("shadow-map, sun", "map-size"): pytest.approx(8 / 9),
        ("shadow-map, sun", "camera-step"): 1,
        ("shadow-map, sun", "volume-wall"): pytest.approx(7 / 15),
        ("cube-map, sun", "mesh"): pytest.approx(6 / 7),
        ("cube-map, sun", "elevation"): None,
        ("planar-projection, sun", "elevation"): 0,
    }


def test_a_heat_map_cell_has_the_operating_range_or_the_failure(stability_of: Make) -> None:
    found = cells(heat_map(stability_of()))
    assert found["shadow-map, spot", "elevation"]["text"] == "0.1…89.9"
    assert found["shadow-map, sun", "elevation"]["text"] == "0.5…89.9\nnot 0.2\nacne 25.0%"
    assert found["shadow-map, sun", "volume-wall"]["text"] == "1e-6…0.5\nnot 0\ncrash"
    assert found["cube-map, sun", "mesh"]["text"] == "6 of 7\nleak 3.00%"
    assert found["planar-projection, sun", "elevation"]["text"] == "not 50\nleak 100%"


def test_unsupported_is_no_number_and_struck_out(stability_of: Make) -> None:
    chart = heat_map(stability_of([one for one in POINTS if one.spec == "cube-map" and one.axis == "elevation"]))
    (cell,) = chart["data"]["values"]
    assert cell["text"] == "unsupported" and cell["share"] is None
    refused = [layer["mark"]["type"] for layer in chart["layer"] if "=== null" in str(layer["transform"])]
    assert refused == ["rect", "rule"]


def test_the_heat_map_is_drawn_with_every_text(stability_of: Make) -> None:
    found = stability_of()
    said = texts(heat_map(found))
    assert {"shadow-map, spot", "unsupported", "0.5…89.9\nnot 0.2\nacne 25.0%", "volume"} <= set(said)


def test_rows_are_ordered_best_first(stability_of: Make) -> None:
    assert stability_of().specs == ["shadow-map", "cube-map", "planar-projection"]


def luminance(color: str) -> float:
    """WCAG 2.2, "relative luminance"."""
    parts = np.array([int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_colours_differ_in_grey_and_carry_their_text() -> None:
    lights = [luminance(share_color(share)) for share in np.linspace(0, 1, 21)]
    assert (np.diff(lights) > 0.01).all()
    for share in np.linspace(0, 1, 201):
        ground, ink = luminance(share_color(share)), 1.0 if is_dark(share) else 0.0
        bright, dim = max(ground, ink), min(ground, ink)
        assert (bright + 0.05) / (dim + 0.05) >= 4.5, share  # level AA
    assert UNSUPPORTED_COLOR not in {share_color(share) for share in np.linspace(0, 1, 1001)}


# Lines


def test_lines_run_in_the_order_of_the_axis(stability_of: Make) -> None:
    found = stability_of([one for one in POINTS if one.light != "spot"])
    for name in ("elevation", "map-size", "volume-wall"):
        places = [one["x"] for one in points(axis_of(found, name), "shadow-map").values()]
        assert places == sorted(places) and len(set(places)) == len(places)


def test_positive_values_over_decades_are_spaced_logarithmically_and_others_evenly(stability_of: Make) -> None:
    found = stability_of()
    sizes = points(axis_of(found, "map-size"), "shadow-map")
    steps = np.diff([one["x"] for one in sizes.values()])
    assert np.allclose(steps, np.log10(2), atol=1e-6)
    assert [one["x"] for one in points(axis_of(found, "volume-wall"), "shadow-map").values()] == list(range(15))


def test_the_tolerance_is_a_rule_where_it_is_held(stability_of: Make) -> None:
    (rule,) = [one for one in axis_of(stability_of(), "elevation")["layer"] if one["mark"]["type"] == "rule"]
    (limits,) = rule["data"]["values"]
    assert limits["1 − IoU"] == pytest.approx(1 - TOLERANCES["iou"])
    assert {name: limits[name] for name in limits if name != "1 − IoU"} == {
        name: limit for name, limit in TOLERANCES.items() if name != "iou"
    }


def test_a_point_tells_value_scores_and_failure(stability_of: Make) -> None:
    found = points(axis_of(stability_of([one for one in POINTS if one.light != "spot"]), "elevation"), "shadow-map")
    assert found["0.2°"]["scores"] == "1 − IoU 0.200, acne 0.250, leak 0"
    assert found["0.2°"]["verdict"] == "out of tolerance: acne 25.00%" and found["0.2°"]["broken"]
    assert found["50°"]["verdict"] == "in tolerance" and not found["50°"]["broken"]


def test_unmeasured_values_have_no_point(stability_of: Make) -> None:
    found = stability_of()
    refused = points(axis_of(found, "map-size"), "shadow-map")["8192 texels"]
    crashed = points(axis_of(found, "volume-wall"), "shadow-map")["0 m"]
    for one in (refused, crashed):
        assert all(one[name] is None for name in LIMITS)
    assert not refused["ended"] and refused["verdict"] == "unsupported: too large"
    assert crashed["ended"] and crashed["verdict"] == "failed: crashed"
    assert "✕" in texts(axis_of(found, "volume-wall")) and "✕" not in texts(axis_of(found, "map-size"))


def test_flips_belong_to_axes_of_movement(stability_of: Make) -> None:
    found = stability_of()
    assert metrics_along(found, AXES["camera-step"]) == [*OF_HARD, "flips"]
    assert metrics_along(found, AXES["elevation"]) == OF_HARD


def test_a_paper_has_every_metric_of_an_axis(stability_of: Make) -> None:
    found = stability_of()
    said = texts(axis_figure(found, AXES["camera-step"], styles_of(found.specs, legend=True)))
    assert {*OF_HARD, "flips"} <= set(said) and said.count("tolerance") == len(OF_HARD) + 1


# Pictures


def test_every_breaking_point_with_a_mask_has_its_pictures(sweep_folder: Write, page_of: Callable[..., str]) -> None:
    (shown,) = galleries(page_of(sweep_folder(pictures=True)))
    places = {(one["spec"], one["view"]) for one in shown["cells"]}
    assert places == {
        ("shadow-map", "elevation 0.2°, sun"),
        ("shadow-map", "map-size 16 texels, sun"),
        ("cube-map", "mesh open, sun"),
        ("planar-projection", "elevation 50°, sun"),
    }
    for one in shown["cells"]:
        assert one["mask"].startswith("data:image/webp;base64,")
        assert all(image.startswith("data:image/webp;base64,") for image in shown["views"][one["view"]].values())
    assert "acne 25.00%: IoU 0.80000" in {one["caption"] for one in shown["cells"]}


def test_a_breaking_point_is_shown_with_the_mask_and_shading_of_its_scene(
    sweep_folder: Write, page_of: Callable[..., str]
) -> None:
    folder = sweep_folder(pictures=True)
    (shown,) = galleries(page_of(folder))
    keys = {
        (one.spec, f"{one.axis} {value_text(AXES[one.axis], one.value)}, {NAMES[one.light]}"): one.key for one in POINTS
    }
    for one in shown["cells"]:
        key = keys[one["spec"], one["view"]]
        mask = read_mask(folder / "masks" / f"{key}.png")
        assert np.abs(pixels(one["mask"])[..., 0] - 255 * mask).max() <= 1
        (row,) = [point.record() for point in POINTS if point.key == key]
        stem = ".".join(str(row[name]) for name in ("scene", "view", "light", "view_size"))
        for kind in ("lit", "ambient"):
            shading = pixels(shown["views"][one["view"]][kind])
            assert np.abs(shading - color_of(f"{stem}.{kind}.png")).mean() < 6, "lossy"


def test_unshadowed_has_no_operating_range(
    stability_of: Make, sweep_folder: Write, page_of: Callable[..., str]
) -> None:
    floor = [replace(one, iou=0.0, leak=1.0) for one in swept("unshadowed", "elevation")]
    found = stability_of([*POINTS, *floor])
    assert found.ranges and found.ranges == stability_of(name="without").ranges
    assert stability_headline(found)[-1] == "Left out because `unshadowed` is out of tolerance by design: 21 cells."
    page = page_of(sweep_folder([*POINTS, *floor], name="page", pictures=True))
    (shown,) = galleries(page)
    assert "unshadowed" not in {one["spec"] for one in shown["cells"]}
    assert stability_headline(stability_of(floor, name="alone"))[0] == "No spec has an operating range."


def pixels(uri: str) -> np.ndarray:
    """(N, N, 3) of an image in a page."""
    return np.asarray(image_of(uri).convert("RGB")).astype(float)


def test_a_breaking_point_without_a_picture_is_listed(sweep_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(sweep_folder(pictures=True))
    assert "<code>shadow-map at volume-wall 0 m,<wbr> sun</code> failed: crashed" in page


def test_small_pictures_keep_their_size_where_large_ones_must_shrink(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gallery, "MAX_PIXELS", 100**2 + 2 * 300**2)
    monkeypatch.setattr(gallery, "_MIN_SIZE", 8)
    cells = [GalleryCell({"view_size": size}, "", None, "", "", "") for size in (100, 512, 1024)]
    assert size_limit(cells) == 300
    assert size_limit(cells[:1]) > 100


# Formats


def test_a_page_of_a_sweep_alone_says_where_each_breaks(sweep_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(sweep_folder(pictures=True))
    assert "<h1>Shadow techniques: where each breaks</h1>" in page and 'href="#stability"' in page
    assert "times of" not in page and "Pareto" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    charts = [script for script in scripts(page) if "layer" in script]
    assert len(charts) == 5, "one for each axis"


def test_the_table_of_a_page_has_every_range_in_the_heat_map_s_colours(
    stability_of: Make, sweep_folder: Write, page_of: Callable[..., str]
) -> None:
    page = page_of(sweep_folder(name="again"))
    (table,) = re.findall(r'<table class="ranges">.*?</table>', page, re.DOTALL)
    told = re.findall(r"<td style=[^>]*>(.*?)</td>", table)
    found = stability_of()
    assert sorted(told) == sorted(range_text(one) for one in found.ranges)
    assert "<b>map size</b> (texels)" in table and AXES["map-size"].invariant in table
    assert table.count(f"background: {UNSUPPORTED_COLOR}") == 1 and f"background: {share_color(1)}" in table


def test_runs_and_sweeps_share_a_page(run_folder: Write, sweep_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder(pictures=True), sweep_folder(pictures=True))
    assert "the cost of accuracy, and where each breaks</h1>" in page
    assert len(galleries(page)) == 2 and "Pareto front" in page and 'id="stability"' in page
    ids = re.findall(r' id="([^"]+)"', re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL))
    assert len(set(ids)) == len(ids)


def test_two_sweeps_have_a_part_each(sweep_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(sweep_folder(name="one"), sweep_folder(name="two"))
    assert page.count('<h3 class="machine">') == 2 and "No pictures: one has neither" in page


def test_markdown_has_a_table_for_each_spec(sweep_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    assert shadowbench("report", sweep_folder(), "--format", "md", "-o", tmp_path / "table.md").code == 0
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert "| elevation | breaks at 0.2°: acne 25.00% (19 of 21) | 0.1…89.9° (21 of 21) |" in text
    assert "| map-size | breaks at 16 texels: leak 50.00% (8 of 9; 8192, 16384 unsupported) |  |" in text
    assert "- `shadow-map at volume-wall 0 m, sun`: failed: crashed" in text


def test_csv_has_the_cells_of_sweeps_beside_those_of_runs(
    run_folder: Write, sweep_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    folders = [run_folder(), sweep_folder()]
    assert shadowbench("report", *folders, "--format", "csv", "-o", tmp_path / "cells.csv").code == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "cells.csv").read_text(encoding="utf-8"))))
    assert len(rows) == len(CELLS) + len(POINTS)
    (one,) = [
        row for row in rows if row["axis"] == "elevation" and row["axis_value"] == "0.2" and row["acne"] == "0.25"
    ]
    assert (one["run"], one["failure"], one["range"]) == ("sweep", "acne 25.00%", "breaks at 0.2°: acne 25.00%")
    assert {row["axis"] for row in rows if row["run"] == "run"} == {""}


def test_png_has_the_heat_map_and_a_file_for_each_axis(
    sweep_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    points = [one for one in POINTS if one.axis == "mesh"]
    assert shadowbench("report", sweep_folder(points), "--format", "png", "-o", tmp_path / "charts").code == 0
    files = sorted(file.name for file in (tmp_path / "charts").iterdir())
    assert files == ["stability.mesh.png", "stability.png"]
    for file in files:
        with Image.open(tmp_path / "charts" / file) as image:
            assert len(image.getcolors(1 << 20)) > 20
