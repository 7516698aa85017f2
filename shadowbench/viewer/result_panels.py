"""The panels of what was measured: scores, times of passes, work, and the shadow map."""

from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.panes import NUMBERS
from shadowbench.viewer.technique_panel import tooltip

HARD = ("iou", "acne", "leak", "contact", "edge_px", "ssim")
SOFT = ("rmse", "rmse_pen", "bleed", "false_dark", "width", "hardening", "noise")
UNITS = {"edge_px": " (px)"}
GRAPH_HEIGHT = 36  # pixels
BETTER = imgui.ImVec4(0.55, 0.9, 0.55, 1.0)  # colour of the better of two scores
WORK_HELP = "in one frame, the same on every machine; cost: vertices, geometry, fragments, reads and rays together"


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
    state, scores = viewer.state, viewer.scores
    specs = [spec.full_text for spec in state.specs]
    known = [scores.by_spec.get(text) for text in specs]
    soft = any(is_soft(one) for one in known if one is not None)
    names = [name for name in (*(SOFT if soft else ()), *HARD) if name in METRICS and METRICS[name].suits(soft)]
    push_grey(not viewer.fresh)
    if imgui.begin_table("scores", len(specs) + 1, imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.row_bg):
        for title in ("against the truth", *"AB"[: len(specs)]):
            imgui.table_setup_column(title)
        imgui.table_headers_row()
        for name in names:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(f"{METRICS[name].label or name}{UNITS.get(name, '')}")
            tooltip(f"{METRICS[name].help} Better: {METRICS[name].better}.")
            values = [None if one is None else one.get(name) for one in known]
            for value, best in zip(values, better(values, METRICS[name].better), strict=True):
                imgui.table_next_column()
                text = "–" if value is None else f"{value:.5f}"
                imgui.text_colored(BETTER, text) if best and viewer.fresh else imgui.text_unformatted(text)
        imgui.end_table()
    imgui.pop_style_color()
    imgui.text_wrapped(status(viewer))


def push_grey(grey: bool) -> None:
    """Text is grey, or as ever, until `imgui.pop_style_color`."""
    color = imgui.Col_.text_disabled if grey else imgui.Col_.text
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(color))


def status(viewer: Viewer) -> str:
    """One line: moving, tracing, what the scores are of, or why there are none."""
    drawn, size, judge = viewer.drawn, viewer.state.size, viewer.judge
    if viewer.moving and drawn is not None and drawn.size < size:
        return f"{size}² drawn at {drawn.size}² while moving: a software renderer"
    if viewer.moving:
        return "moving: scores follow at rest"
    if viewer.broken:
        return "nothing is drawn, and nothing scored"
    if not viewer.judged or judge.waits:
        failed = viewer.judged and judge.failure
        return f"not scored: {judge.failure}" if failed else "tracing the truth of this view …"
    texts = [spec.full_text for spec in viewer.state.specs]
    without = [source for source, text in zip("AB", texts, strict=False) if text not in judge.known]
    return f"scored at {size}² against the full truth{''.join(f'; {one} has no mask' for one in without)}"


def times_panel(viewer: Viewer) -> None:
    """Milliseconds of each pass with a short history, and the counts of work."""
    history, specs = list(viewer.pass_ms), viewer.state.specs
    last = history[-1] if history else {}
    own = {source: [ms for name, ms in last.items() if name.startswith(source)] for source in "AB"[: len(specs)]}
    imgui.text_unformatted(",  ".join(f"{source}: {f'{sum(ms):.1f} ms' if ms else '–'}" for source, ms in own.items()))
    tooltip("when the masks were drawn last; at rest they are not drawn again")
    size = (imgui.get_content_region_avail().x, GRAPH_HEIGHT)
    for name, ms in last.items():
        values = np.array([frame.get(name, 0.0) for frame in history], dtype=np.float32)
        imgui.plot_lines(f"##{name}", values, 0, f"{name}  {ms:.2f} ms", 0.0, float(values.max()) * 1.2, size)
    if viewer.device.software:
        imgui.text_disabled("of a software renderer: no GPU's times")
    push_grey(not viewer.judged)
    works = [viewer.work.get(spec, {}) for spec in specs]
    if imgui.begin_table("work", len(specs) + 1, imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.row_bg):
        for title in ("work", *"AB"[: len(specs)]):
            imgui.table_setup_column(title)
        imgui.table_headers_row()
        for name in dict.fromkeys(name for work in works for name in work):
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(name)
            tooltip(WORK_HELP)
            for work in works:
                imgui.table_next_column()
                imgui.text_unformatted(f"{work[name]:,}" if name in work else "–")
        imgui.end_table()
    imgui.pop_style_color()
    imgui.text_unformatted(f"{viewer.drawing.bytes / 2**20:.1f} MiB of maps, masks and buffers")


def map_panel(viewer: Viewer) -> None:
    """The shadow map of A or B."""
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        if imgui.radio_button(f"map of {source}", viewer.map_of == index):
            viewer.map_of = index
        imgui.same_line()
    imgui.new_line()
    imgui.text_disabled("linear depth: near is dark")
    picture = viewer.map_picture
    if picture is None:
        imgui.text_disabled("no map: the technique has none, or it is drawn at rest")
        return
    width = max(imgui.get_content_region_avail().x, 64.0)
    imgui.image(NUMBERS["map"], (width, width * picture.height / picture.width), (0, 1), (1, 0))
