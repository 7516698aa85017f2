"""Drives the window by real events of a mouse and a keyboard: xdotool on a virtual display.

The window runs in the main thread; the script of a test in another, which finds widgets where they were drawn last.
"""

import os
import subprocess
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from imgui_bundle import imgui
from PIL import Image, ImageGrab

PATIENCE = 60.0  # seconds
AWAY = (700, 850)  # a place of the pointer where the window has nothing to say
ITEM = "item "  # begins the name of an item of a list: a widget may have the same label
WIDGETS = (
    "button", "small_button", "checkbox", "slider_float", "slider_int", "drag_float", "begin_combo", "selectable",
    "collapsing_header", "input_text", "radio_button",
)  # fmt: skip

drawn: dict[tuple[str, str], tuple[float, float, float, float, float]] = {}
"""Rectangles of the widgets and when they were drawn, by the id around them and their label."""


def record_widgets() -> None:
    """Note where each widget is drawn from now on."""
    ids: list[str] = []
    push, pop = imgui.push_id, imgui.pop_id
    imgui.push_id = lambda name: (ids.append(str(name)), push(name))[1]
    imgui.pop_id = lambda: (ids.pop(), pop())[1]

    def recorded(make: Callable[..., Any], prefix: str) -> Callable[..., Any]:
        def call(label: str, *arguments: Any, **options: Any) -> Any:
            result = make(label, *arguments, **options)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            drawn[ids[0] if ids else "", prefix + label] = (low.x, low.y, high.x, high.y, time.monotonic())
            return result

        return call

    for name in WIDGETS:
        setattr(imgui, name, recorded(getattr(imgui, name), ITEM if name == "selectable" else ""))


def xdotool(*arguments: object) -> None:
    subprocess.run(["xdotool", *map(str, arguments)], check=True)


class Driver:
    """The hands of a test on a window."""

    def __init__(self, window: Any, pictures: Path | None = None) -> None:
        self.window, self.viewer, self.pictures = window, window.viewer, pictures
        self.failure = ""

    def until(self, what: str, holds: Callable[[], object]) -> None:
        """Wait until something holds."""
        end = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < end, f"waited for: {what}; message: {self.viewer.message!r}"
            time.sleep(0.02)

    def place(self, label: str, panel: str = "") -> tuple[float, float]:
        """The middle of a widget's frame, once it is drawn."""

        def found() -> bool:
            place = drawn.get((panel, label))
            return place is not None and time.monotonic() - place[4] < 3.0

        self.until(f"{panel} {label}", found)
        left, top, right, bottom, _ = drawn[panel, label]
        return (left + min(right, left + 60)) / 2, (top + bottom) / 2

    def click(self, label: str, panel: str = "") -> None:
        x, y = self.place(label, panel)
        xdotool("mousemove", round(x), round(y), "sleep", 0.2, "click", 1)

    def choose(self, label: str, item: str, panel: str, chosen: Callable[[], object]) -> None:
        """Choose an item of a combo box. An opened list is moved to its place in a later frame: look, and try again."""
        item, end = ITEM + item, time.monotonic() + PATIENCE
        while not chosen():
            assert time.monotonic() < end, f"waited for: {label} {item}; message: {self.viewer.message!r}"
            seen = drawn.get((panel, item), (0.0,) * 5)
            if time.monotonic() - seen[4] > 1.5:
                self.click(label, panel)
            time.sleep(0.5)
            now = drawn.get((panel, item), (0.0,) * 5)
            if now[:4] == seen[:4] and now[4] > seen[4]:  # it is drawn, and where it was
                self.click(item, panel)
                time.sleep(1.0)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        xdotool("mousemove", round(start[0]), round(start[1]), "sleep", 0.3, "mousedown", 1, "sleep", 0.3)
        for step in range(1, steps + 1):
            x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
            xdotool("mousemove", round(x), round(y), "sleep", 0.1)
        xdotool("sleep", 0.3, "mouseup", 1)

    def slide(self, label: str, panel: str, share: float) -> None:
        """Drag a slider to a share of its frame, which ends before its label."""
        start = self.place(label, panel)
        left, _, right, _, _ = drawn[panel, label]
        self.drag(start, (left + share * (right - 8 * len(label) - left), start[1]))

    def scored(self) -> None:
        """Wait until all that is shown is scored."""
        viewer = self.viewer

        def is_scored() -> bool:
            texts = {spec.full_text for spec in viewer.state.specs}
            return not viewer.moving and viewer.fresh and texts <= viewer.judge.scores.keys()

        self.until("scores", is_scored)

    def light(self) -> tuple[float, float]:
        """Where the light's handle is drawn."""
        canvas = self.window.canvas
        return canvas.panes[0].point(canvas._places()["light"])

    def score(self, metric: str, index: int = 0) -> float:
        """A score of A or B."""
        return self.viewer.judge.scores[self.viewer.state.specs[index].full_text][metric]

    def picture(self, name: str, box: tuple[int, int, int, int] | None = None) -> None:
        """Save what the display shows, or a box of it, if pictures are wanted."""
        if self.pictures is not None:
            xdotool("mousemove", *AWAY)
            time.sleep(1.0)
            shown = ImageGrab.grab(box, xdisplay=os.environ["DISPLAY"])
            shown.quantize(256, Image.Quantize.MAXCOVERAGE).save(self.pictures / f"{name}.png", optimize=True)


def drive(
    state: Any,
    techniques: Mapping[str, Any],
    script: Callable[[Driver], None],
    pictures: Path | None = None,
    plugins: Sequence[Path] = (),
) -> None:
    """Open the window, run a script on it and close it. Raises AssertionError with what failed in the script."""
    record_widgets()
    from shadowbench.viewer.window import ViewerWindow

    window = ViewerWindow(state, techniques, plugins)
    driver = Driver(window, pictures)

    def run() -> None:
        try:
            script(driver)
        except BaseException:
            driver.failure = traceback.format_exc()
        finally:
            window.window.is_closing = True

    thread = threading.Thread(target=run)
    thread.start()
    window.run()
    thread.join()
    assert not driver.failure, driver.failure
