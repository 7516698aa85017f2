"""Charts of a report: every value lies on its axes, and times of different machines are never combined."""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from skimage.color import deltaE_ciede2000, rgb2lab

from shadowbench.reports.charts import bias_charts, default_size, front_chart, pass_chart, section_figure, size_chart
from shadowbench.reports.styles import COLORS, MAX_SHOWN, SHAPES, Styles, styles_of
from shadowbench.results.configurations import Section, sections, specs_of
from shadowbench.results.folder import read_runs
from tests.reports.conftest import CELLS, TRUTH_ERROR, Cell, marks, texts

Chart = dict[str, Any]
TEXT_WIDTH = 6  # pixels of a letter, on average


def charts(section: Section) -> list[Chart]:
    styles = styles_of(specs_of([section]), legend=True)
    made = front_chart(section, styles), size_chart(section, styles), pass_chart(section, default_size(section))
    return [chart for chart in made if chart is not None]


def domain(chart: Chart, channel: str) -> tuple[float, float]:
    (found,) = {
        tuple(layer["encoding"][channel]["scale"]["domain"])
        for layer in chart["layer"]
        if "scale" in layer["encoding"].get(channel, {})
    }
    return found


def test_zero_error_is_on_the_log_axis_below_every_other_error(section_of: Callable[..., Section]) -> None:
    section = section_of()
    for chart in charts(section)[:2]:
        low, high = domain(chart, "y")
        drawn = {point["spec"]: point["drawn"] for point in chart["data"]["values"]}
        assert 0 < low < drawn["ray-traced"] == section.least_error
        assert drawn["ray-traced"] < min(value for spec, value in drawn.items() if spec != "ray-traced")
        assert max(drawn.values()) < high and math.isfinite(high)
        assert any(text.startswith("no wrong pixel") for text in texts(chart))


def test_a_chart_without_zero_errors_has_no_line_for_them(section_of: Callable[..., Section]) -> None:
    (front, sizes, _) = charts(section_of([Cell("a", 512, 0.1, 3.0), Cell("a", 1024, 0.05, 4.0)]))
    for chart in (front, sizes):
        assert not any(text.startswith("no wrong pixel") for text in texts(chart))
        assert domain(chart, "y")[0] > 0.01


def test_errors_of_soft_shadows_are_drawn_down_to_that_of_the_truth(section_of: Callable[..., Section]) -> None:
    soft = [Cell("a", 512, 0.1, 3.0, rmse_pen=0.2), Cell("a", 1024, 0.2, 4.0, rmse_pen=TRUTH_ERROR)]
    section = section_of(soft)
    for chart in charts(section)[:2]:
        points = chart["data"]["values"]
        assert [(point["size"], point["drawn"], point["RMSE"]) for point in points] == [
            (1024, TRUTH_ERROR, "<0.00200"),
            (512, 0.05, "0.0500"),
        ]
        assert any(text.startswith("below the truth's own error") for text in texts(chart))
        (title,) = {layer["encoding"]["y"]["title"] for layer in chart["layer"] if "title" in layer["encoding"]["y"]}
        assert title.startswith("RMSE")


def test_no_label_of_the_front_is_cut_at_the_right_edge(section_of: Callable[..., Section]) -> None:
    drawn = marks(charts(section_of())[0])
    width = max(mark["width"] for mark in drawn if "width" in mark)
    labels = [mark for mark in drawn if "; label: " in mark.get("description", "")]
    assert [mark["text"] for mark in labels][-1] == "ray-traced" and len(labels) > 4
    for mark in labels:
        length = TEXT_WIDTH * len(mark["text"])
        start = mark["x"] + mark["dx"] - (length if mark["align"] == "right" else 0)
        assert start >= 0 and start + length <= width, mark


def test_the_times_of_two_machines_share_no_chart(run_folder: Callable[..., Any]) -> None:
    fast = [Cell(cell.spec, cell.map_size, cell.error, cell.ms / 100) for cell in CELLS if cell.ms]
    folders = [run_folder(name="slow"), run_folder(fast, name="fast", software=False, processor="Another")]
    (parts,) = sections(read_runs(folders)).values()
    assert [part.run.label for part in parts] == ["slow", "fast"]
    for part, times in zip(parts, ({cell.ms for cell in CELLS} - {None}, {cell.ms for cell in fast}), strict=True):
        front, _, passes = charts(part)
        assert {point["ms"] for point in front["data"]["values"]} == times
        assert {bar["frame"] for bar in passes["data"]["values"]} <= times


def test_only_what_was_measured_is_drawn(section_of: Callable[..., Section]) -> None:
    for chart in charts(section_of()):
        assert not {point["spec"] for point in chart["data"]["values"]} & {"planar-projection", "cube-map"}


def test_a_software_renderers_times_are_headed_as_such(section_of: Callable[..., Section]) -> None:
    section = section_of()
    for chart in charts(section):
        said = texts(section_figure(chart, section))
        assert any(
            "times of a software renderer: for trends only, not representative of a GPU" in text for text in said
        )
    gpu = section_of(name="gpu", software=False)
    for chart in charts(gpu):
        assert not any("software" in text for text in texts(section_figure(chart, gpu)))


def test_intervals_enclose_their_median(section_of: Callable[..., Section]) -> None:
    errors = (0.1, 0.3, 0.2, 0.0)
    chart = charts(section_of([Cell("a", 512, error, 3.0, phase=phase) for phase, error in enumerate(errors)]))[1]
    (point,) = chart["data"]["values"]
    assert point["low"] < point["drawn"] < point["high"]


def test_passes_are_those_of_one_map_size_and_of_what_has_no_map(section_of: Callable[..., Section]) -> None:
    section = section_of()
    assert default_size(section) == 1024
    chart = pass_chart(section, 2048)
    assert chart is not None
    assert {bar["spec"] for bar in chart["data"]["values"]} == {"shadow-map", "unshadowed", "ray-traced"}


def test_passes_are_stacked_as_each_spec_draws_them(section_of: Callable[..., Section]) -> None:
    orders = {"a": ("depth", "blur", "resolve"), "b": ("resolve", "depth"), "c": ("blur", "again", "depth")}
    section = section_of(
        [Cell(spec, 512, 0.1, 9.0, passes=tuple((one, 1.0) for one in order)) for spec, order in orders.items()]
    )
    chart = pass_chart(section, 512)
    assert chart is not None
    bars = sorted(chart["data"]["values"], key=lambda bar: bar["rank"])
    assert {spec: tuple(bar["pass"] for bar in bars if bar["spec"] == spec) for spec in orders} == orders
    assert chart["layer"][0]["encoding"]["order"] == {"field": "rank"}


def test_each_of_many_passes_has_a_colour_of_its_own(section_of: Callable[..., Section]) -> None:
    names = [f"pass {number}" for number in range(16)]
    chart = pass_chart(section_of([Cell("a", 512, 0.1, 9.0, passes=tuple((name, 1.0) for name in names))]), 512)
    assert chart is not None
    scale = chart["layer"][0]["encoding"]["color"]["scale"]
    assert scale["domain"] == names and len(set(scale["range"])) == 16
    levels = [[int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)] for color in (*scale["range"], "#ffffff")]
    lab = rgb2lab(levels)
    apart = deltaE_ciede2000(lab[:, None], lab[None]) + 100 * np.eye(len(lab))
    assert apart.min() > 20, "a difference of 2 can just be seen side by side"
    assert not {*scale["range"][:8]} & {*COLORS[:MAX_SHOWN]}, "those of specs"


def test_the_chart_of_passes_says_why_they_do_not_add_up(section_of: Callable[..., Section]) -> None:
    section = section_of()
    chart = pass_chart(section, 1024)
    assert chart is not None
    said = set(texts(section_figure(chart, section)))
    assert {"ms; passes are timed separately,", "each finished before the next,"} <= said
    assert {"so that their sum may exceed the frame;", "tick: the whole frame, timed separately"} <= said


def test_the_page_says_so_too_and_counts_one_thing_as_one(
    run_folder: Callable[..., Any], page_of: Callable[..., str]
) -> None:
    page = " ".join(page_of(run_folder([Cell("a", 512, 0.1, 3.0)])).split())
    assert "each finished before the next, so that their sum may exceed the frame" in page
    assert "1 cell on" in page and "1 cell, all that" in page
    assert not re.search(r"\b1 (cells|pictures|records|times|configurations)\b", page)


def test_without_times_there_is_no_chart_of_times(section_of: Callable[..., Section]) -> None:
    section = section_of([Cell("a", 512, 0.1, None)])
    styles = styles_of(specs_of([section]), legend=True)
    assert front_chart(section, styles) is None and pass_chart(section, 512) is None
    assert size_chart(section, styles) is not None


def test_no_two_of_many_specs_look_alike() -> None:
    styles = Styles(tuple(map(str, range(len(COLORS) * len(SHAPES)))), legend=True)
    assert len({styles.color_and_shape(spec) for spec in styles.specs}) == len(COLORS) * len(SHAPES)


def test_a_swept_bias_has_a_chart_with_a_line_for_each_map_size(run_folder: Callable[..., Any]) -> None:
    specs = {"shadow-map:bias=texel(scale=4.0)": 4.0, "shadow-map": 1.0, "shadow-map:bias=texel(scale=0.5)": 0.5}
    cells = [Cell(spec, size, 0.01 * factor, None) for spec, factor in specs.items() for size in (1024, 512)]
    floor = Cell("unshadowed", None, 1.0, None)
    folder = run_folder([*cells, floor])
    lines = [f"{one.key},{one.spec},{one.map_size},shadow-map,{specs[one.spec]}" for one in cells]
    head = "key,spec,map_size,bias_of,bias_factor"
    (folder / "table.csv").write_text("\n".join([head, *lines, f"{floor.key},unshadowed,,,"]))
    ((section,),) = sections(read_runs([folder])).values()
    ((base, chart),) = bias_charts(section)
    assert base == "shadow-map"
    points = chart["data"]["values"]
    assert [(point["map"], point["factor"]) for point in points] == [
        (size, factor) for size in ("512", "1024") for factor in (0.5, 1.0, 4.0)
    ]
    assert [point["factor"] for point in points if point["best"]] == [0.5, 0.5]
    assert {"×0.5", "×1", "×4", "512", "1024"} <= set(texts(chart))


def test_a_swept_bias_of_soft_shadows_has_no_chart_of_contact(run_folder: Callable[..., Any]) -> None:
    cell = Cell("shadow-map", 512, 0.1, None, rmse_pen=0.2)
    folder = run_folder([cell])
    line = f"{cell.key},shadow-map,512,shadow-map,1"
    (folder / "table.csv").write_text(f"key,spec,map_size,bias_of,bias_factor\n{line}")
    ((section,),) = sections(read_runs([folder])).values()
    assert section.run.sweep_positions and bias_charts(section) == []


def test_without_a_bias_sweep_there_is_no_bias_chart(section_of: Callable[..., Section]) -> None:
    assert bias_charts(section_of()) == []
