"""The panels of what was measured: scores, times of passes, work, and the shadow map."""

from collections.abc import Mapping, Sequence

import numpy as np
from imgui_bundle import imgui

from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.panes import NUMBERS
from shadowbench.viewer.technique_panel import tooltip

HARD = ("iou", "acne", "leak", "contact", "terminator", "edge_px", "ssim")
SOFT = ("rmse", "rmse_pen", "bleed", "false_dark", "width", "hardening", "noise")
UNITS = {"edge_px": " (px)"}
BETTER = imgui.ImVec4(0.55, 0.9, 0.55, 1.0)  # colour of the better of two scores
WORK_HELP = "in one frame, the same on every machine; cost: vertices, geometry, fragments, reads and rays together"
TIMES_HELP = "when the masks were drawn last; at rest they are not drawn again"
GRAPH_HEIGHT = 36.0  # pixels

Row = tuple[str, str, Sequence[str], Sequence[bool]]  # name, help, a text for each spec, and whether it is the better


def better(values: Sequence[float | None], direction: str) -> list[bool]:
    """Which of the scores of A and B is the better one; neither if they are shown as the same number."""
    known = [round(value, 5) for value in values if value is not None]
    if len(known) < max(len(values), 2):
        return [False] * len(values)
    aim = {"higher": max(known), "lower": min(known), "near 0": 0.0, "near 1": 1.0}[direction]
    errors = [abs(value - aim) for value in known]
    return [error == min(errors) < max(errors) for error in errors]


def scores_panel(viewer: Viewer) -> None:
    """The scores of A and B, grey while they are of another view or of other masks."""
    known = [viewer.judge.scores.get(spec.full_text) for spec in viewer.state.specs]
    soft = any(is_soft(one) for one in known if one is not None)
    rows: list[Row] = []
    for metric in (METRICS[name] for name in (*(SOFT if soft else ()), *HARD)):
        if metric.suits(soft):
            values = [one.get(metric.name) if one is not None else None for one in known]
            best = better(values, metric.better) if viewer.fresh else [False] * len(values)
            texts = ["–" if value is None else f"{value:.5f}" for value in values]
            name = f"{metric.label or metric.name}{UNITS.get(metric.name, '')}"
            rows.append((name, f"{metric.help} Better: {metric.better}.", texts, best))
    _table("score", viewer, rows, grey=not viewer.fresh)
    imgui.text_wrapped(status(viewer))


def _table(title: str, viewer: Viewer, rows: Sequence[Row], grey: bool) -> None:
    """A table with a column for each of A and B, in grey if it is not of what is shown."""
    color = imgui.Col_.text_disabled if grey else imgui.Col_.text
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(color))
    sources = "AB"[: len(viewer.state.specs)]
    if imgui.begin_table(title, len(sources) + 1, imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.row_bg):
        for name in (title, *sources):
            imgui.table_setup_column(name)
        imgui.table_headers_row()
        for name, help, texts, best in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(name)
            tooltip(help)
            for text, is_best in zip(texts, best, strict=True):
                imgui.table_next_column()
                imgui.text_colored(BETTER, text) if is_best else imgui.text_unformatted(text)
        imgui.end_table()
    imgui.pop_style_color()


def status(viewer: Viewer) -> str:
    """One line: moving, tracing, what the scores are of, or why there are none."""
    drawn, size, judge = viewer.drawn, viewer.state.size, viewer.judge
    if viewer.moving and drawn is not None and drawn.size < size:
        return f"{size}² drawn at {drawn.size}² while moving: a software renderer"
    if viewer.moving:
        return "moving: scores follow at rest"
    if viewer.broken:
        return "nothing is drawn, and nothing scored"
    if not viewer.fresh:
        failed = viewer.judged and judge.failure
        return f"not scored: {judge.failure}" if failed else "tracing the truth of this view …"
    masks = zip("AB", viewer.state.specs, viewer.mask_failures(), strict=False)
    without = [f"; {one} has no mask: {why}" for one, spec, why in masks if spec.full_text not in judge.scores]
    return f"scored at {size}² against the full truth{''.join(without)}"


def times_panel(viewer: Viewer) -> None:
    """Milliseconds of each pass with a short history, and the counts of work."""
    specs = viewer.state.specs
    passes = [mask.passes.ms for mask in viewer.drawn.masks] if viewer.drawn else []
    times = [{**ms, "frame": sum(ms.values())} if ms else {} for ms in (*passes, {}, {})][: len(specs)]
    works = [viewer.work.get(spec, {}) for spec in specs]
    _table("ms", viewer, _rows(times, "{:.2f}", TIMES_HELP), grey=False)
    _graphs(viewer)
    if viewer.device.software:
        imgui.text_disabled("of a software renderer: no GPU's times")
    _table("work", viewer, _rows(works, "{:,}", WORK_HELP), grey=not viewer.judged)
    imgui.text_unformatted(f"{viewer.drawing.bytes / 2**20:.1f} MiB of maps, masks and buffers")


def _graphs(viewer: Viewer) -> None:
    """The last times of each pass of A and B."""
    size = (imgui.get_content_region_avail().x, GRAPH_HEIGHT)
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        frames = [frame[index] for frame in viewer.pass_ms if index < len(frame)]
        for name in frames[-1] if frames else ():
            values = np.array([ms.get(name, 0.0) for ms in frames], dtype=np.float32)
            imgui.plot_lines(f"##{source} {name}", values, 0, f"{source} {name}", 0.0, 1.2 * values.max(), size)


def _rows(columns: Sequence[Mapping[str, float]], form: str, help: str) -> list[Row]:
    """A line for each name that a column has."""
    names = dict.fromkeys(name for column in columns for name in column)
    texts = {name: [form.format(one[name]) if name in one else "–" for one in columns] for name in names}
    return [(name, help, texts[name], [False] * len(columns)) for name in names]


def map_panel(viewer: Viewer) -> None:
    """The shadow map of A or B."""
    viewer.shows_map = True
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        if imgui.radio_button(f"map of {source}", viewer.map_of == index):
            viewer.map_of = index
        imgui.same_line()
    imgui.new_line()
    imgui.text_disabled("linear depth: near is dark")
    picture = viewer.map_picture
    if picture is None:
        imgui.push_text_wrap_pos(0.0)
        imgui.text_disabled("no map: the technique has none, or it is drawn at rest")
        imgui.pop_text_wrap_pos()
        return
    width = max(imgui.get_content_region_avail().x, 64.0)
    imgui.image(NUMBERS["map"], (width, width * picture.height / picture.width), (0, 1), (1, 0))
