"""Charts of a report: every value lies on its axes, and times of different machines are never combined."""

import math
from typing import Any

import vl_convert

from shadowbench.reports.charts import (
    COLORS,
    MAX_SHOWN,
    SHAPES,
    front_chart,
    pass_chart,
    size_chart,
    styles_of,
)
from shadowbench.reports.report import figures
from shadowbench.results.summary import Summary, specs_of
from tests.reports.conftest import TRUTH_ERROR, Cell, marks, texts

Chart = dict[str, Any]
TEXT_WIDTH = 6  # pixels of a letter, on average


def charts(summary: Summary) -> list[Chart]:
    styles = styles_of(specs_of([summary.run]))
    drawn = front_chart(summary, styles), size_chart(summary, styles), pass_chart(summary)
    return [chart for chart in drawn if chart is not None]


def domain(chart: Chart, channel: str) -> tuple[float, float]:
    scales = [layer["encoding"].get(channel, {}).get("scale") for layer in chart["layer"]]
    (found,) = {tuple(scale["domain"]) for scale in scales if scale}
    return found


def values(chart: Chart, field: str) -> list[Any]:
    return [point[field] for point in chart["data"]["values"]]


def test_zero_error_is_on_the_log_axis_below_every_other_error(measured) -> None:
    section, other = measured()[0], measured(Cell("a", 512, 0.1, 3.0), Cell("a", 1024, 0.05, 4.0))[0]
    for chart, without in zip(charts(section)[:2], charts(other)[:2], strict=True):
        low, high = domain(chart, "y")
        drawn = dict(zip(values(chart, "spec"), values(chart, "drawn"), strict=True))
        assert 0 < low < drawn["ray-traced"] == section.least_error
        assert drawn["ray-traced"] < min(value for spec, value in drawn.items() if spec != "ray-traced")
        assert max(drawn.values()) < high and math.isfinite(high)
        assert any(text.startswith("no wrong pixel") for text in texts(chart))
        assert not any(text.startswith("no wrong pixel") for text in texts(without)) and domain(without, "y")[0] > 0.01


def test_errors_of_soft_shadows_are_drawn_down_to_that_of_the_truth(measured) -> None:
    soft = Cell("a", 512, 0.1, 3.0, rmse_pen=0.2), Cell("a", 1024, 0.2, 4.0, rmse_pen=TRUTH_ERROR)
    for chart in charts(measured(*soft)[0])[:2]:
        points = chart["data"]["values"]
        assert [(point["size"], point["drawn"], point["tooltip"]["RMSE"]) for point in points] == [
            (1024, TRUTH_ERROR, "<0.00200"),
            (512, 0.05, "0.0500"),
        ]
        assert any(text.startswith("below the truth's own error") for text in texts(chart))
        (title,) = {layer["encoding"]["y"]["title"] for layer in chart["layer"] if "title" in layer["encoding"]["y"]}
        assert title.startswith("RMSE")


def test_no_label_of_the_front_is_cut_at_the_right_edge(measured) -> None:
    chart = charts(measured()[0])[0]
    drawn, wanted = marks(chart), {point.get("label") for point in chart["data"]["values"]} - {None, ""}
    width = max(mark["width"] for mark in drawn if "width" in mark)
    labels = [mark for mark in drawn if mark.get("text") in wanted and "dx" in mark]
    assert {mark["text"] for mark in labels} == wanted and len(wanted) > 4
    for mark in labels:
        length = TEXT_WIDTH * len(mark["text"])
        start = mark["x"] + mark["dx"] - (length if mark.get("align") == "right" else 0)
        assert start >= 0 and start + length <= width, mark


def test_only_what_was_measured_is_drawn(measured) -> None:
    for chart in charts(measured()[0]):
        assert not set(values(chart, "spec")) & {"planar-projection", "cube-map"}
    (untimed,) = measured(Cell("a", 512, 0.1, None))
    assert front_chart(untimed, None) is None and pass_chart(untimed) is None
    phases = [Cell("a", 512, error, None, phase=phase) for phase, error in enumerate((0.1, 0.3, 0.2, 0.0))]
    (point,) = size_chart(measured(*phases)[0], None)["data"]["values"]
    assert point["low"] < point["drawn"] < point["high"], "an interval encloses its median"


def test_figures_say_whose_times_they_have_and_why_passes_do_not_add_up(measured) -> None:
    said = {}
    for software in (True, False):
        scenes = measured(software=software)
        said[software] = [texts(chart) for _, chart in figures([(scenes[0].run, scenes)], [])]
    trend = "times of a software renderer: for trends only, not representative of a GPU"
    assert len(said[True]) == len(said[False]) == 3
    assert all(any(trend in text for text in one) for one in said[True])
    assert not any("software" in text for one in said[False] for text in one)
    assert {"ms; passes are timed separately,", "each finished before the next,"} <= set(said[True][2])
    assert {"so that their sum may exceed the frame;", "tick: the whole frame, timed separately"} <= set(said[True][2])


def test_passes_are_those_of_one_map_size_stacked_as_each_spec_draws_them(measured) -> None:
    chart = pass_chart(measured()[0])
    assert chart is not None and chart["description"].endswith("map size 1024")
    assert set(values(chart, "spec")) == {"shadow-map", "shadow-map:bias=none", "unshadowed", "ray-traced"}
    orders = {"a": ("depth", "blur", "resolve"), "b": ("resolve", "depth"), "c": ("blur", "again", "depth")}
    cells = [Cell(spec, 512, 0.1, 9.0, passes=tuple((one, 1.0) for one in order)) for spec, order in orders.items()]
    chart = pass_chart(measured(*cells)[0])
    assert chart is not None
    bars = sorted(chart["data"]["values"], key=lambda bar: bar["rank"])
    assert {spec: tuple(bar["pass"] for bar in bars if bar["spec"] == spec) for spec in orders} == orders
    assert chart["layer"][0]["encoding"]["order"] == {"field": "rank"}


def test_no_two_of_many_passes_or_specs_look_alike(measured) -> None:
    names = [f"pass {number}" for number in range(16)]
    chart = pass_chart(measured(Cell("a", 512, 0.1, 9.0, passes=tuple((name, 1.0) for name in names)))[0])
    assert chart is not None
    scale = chart["layer"][0]["encoding"]["color"]["scale"]
    assert scale["domain"] == names and len(set(scale["range"])) == 16
    assert not {*scale["range"][:8]} & {*COLORS[:MAX_SHOWN]}, "those of specs"
    many = len(COLORS) * len(SHAPES)
    assert len(set(styles_of(map(str, range(many))).values())) == many


def test_a_preset_has_its_name_in_every_chart(measured) -> None:
    spec = "shadow-map:fit=scene,bias=slope,filter=pcf"
    section = measured(Cell(spec, 512, 0.1, 3.0), Cell("shadow-map", 512, 0.05, 4.0))[0]
    for chart in charts(section):
        svg = vl_convert.vegalite_to_svg({**chart, "width": 400})
        assert ">shadow-map:preset=course<" in svg and f">{spec}<" not in svg
