"""The tour of docs/how-to/view.md, driven by real events of a mouse and a keyboard: xdotool on a display.

The window runs in the main thread, the tour in another, which finds widgets where they were drawn last.
What it saves: python tests/viewer/tour.py FOLDER
The pictures of that page: python tests/viewer/tour.py FOLDER docs/pictures/view
"""

import json
import os
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import imgui
from PIL import Image, ImageGrab

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.viewer.state import Origin, ViewerState
from shadowbench.viewer.window import ViewerWindow

PATIENCE = 60.0  # seconds
AWAY = (700, 850)  # a place of the pointer where the window has nothing to say
ITEM = "item "  # begins the name of an item of a list: a widget may have the same label
WIDGETS = ("button", "small_button", "slider_float", "begin_combo", "selectable")
PANE = (420, 230, 980, 640)

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


class Hands:
    """The hands of a user on a window."""

    def __init__(self, window: ViewerWindow, pictures: Path | None) -> None:
        self.window, self.viewer, self.pictures = window, window.viewer, pictures

    def until(self, what: str, holds: Callable[[], object]) -> None:
        """Wait until something holds."""
        end = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < end, f"waited for: {what}; message: {self.viewer.message!r}"
            time.sleep(0.02)

    def place(self, label: str, panel: str = "") -> tuple[float, float]:
        """The middle of a widget's frame, once it is drawn."""
        self.until(f"{panel} {label}", lambda: time.monotonic() - drawn.get((panel, label), (0.0,) * 5)[4] < 3.0)
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

    def drag(self, start: tuple[float, float], end: tuple[float, float], button: int = 1, steps: int = 8) -> None:
        xdotool("mousemove", round(start[0]), round(start[1]), "sleep", 0.3, "mousedown", button, "sleep", 0.3)
        for step in range(1, steps + 1):
            x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
            xdotool("mousemove", round(x), round(y), "sleep", 0.1)
        xdotool("sleep", 0.3, "mouseup", button)

    def scored(self) -> None:
        """Wait until all that is shown is scored."""
        viewer = self.viewer

        def is_scored() -> bool:  # the other thread may not have drawn the latest state yet
            texts = {spec.full_text for spec in viewer.state.specs}
            return not viewer.moving and viewer.fresh and texts <= viewer.judge.scores.keys()

        self.until("scores", is_scored)

    def score(self, metric: str, index: int = 0) -> Any:
        """A score of A or B."""
        return self.viewer.judge.scores[self.viewer.state.specs[index].full_text][metric]

    def picture(self, name: str, box: tuple[int, int, int, int] | None = None) -> None:
        """Save what the display shows, or a box of it, if pictures are wanted."""
        if self.pictures is not None:
            xdotool("mousemove", *AWAY)
            time.sleep(1.0)
            shown = ImageGrab.grab(box, xdisplay=os.environ["DISPLAY"])
            shown.quantize(256, Image.Quantize.MAXCOVERAGE).save(self.pictures / f"{name}.png", optimize=True)


def tour(hands: Hands) -> None:
    """What the page says, step by step; then notes and masks of what is shown are saved."""
    viewer, canvas = hands.viewer, hands.window.canvas
    hands.scored()
    assert hands.score("iou", 1) > 0.999

    sun, pane = viewer.state.light, canvas.panes[0]
    x, y = pane.x + pane.width / 3, pane.y + pane.height / 2
    xdotool("keydown", "shift")
    hands.drag((x, y), (x + 90, y + 20), button=3)
    xdotool("keyup", "shift")
    hands.until("the light to move", lambda: viewer.state.light != sun)
    hands.scored()

    hands.choose("bias", "none", "A", lambda: viewer.state.specs[0].text == "shadow-map:bias=none")
    hands.scored()
    assert hands.score("acne") > 0.01
    hands.picture("acne", PANE)
    hands.choose("##show", "error", "", lambda: viewer.state.overlay == "error")
    hands.scored()
    hands.picture("error", PANE)

    hands.choose("bias", "slope", "A", lambda: viewer.state.specs[0].params.bias.name == "slope")
    hands.scored()
    assert hands.score("acne") < 0.01
    for size in (512, 256):
        hands.click("½##size", "A")
        hands.until(f"a map of {size}", lambda size=size: viewer.state.specs[0].map_size == size)
        hands.scored()

    hands.choose("##show", "picture", "", lambda: viewer.state.overlay == "picture")
    hands.choose("##layout", "side by side", "", lambda: len(canvas.panes) == 3)
    hands.scored()
    hands.choose("##layout", "wipe", "", lambda: len(canvas.panes) == 1)
    pane = canvas.panes[0]
    y = pane.y + 0.8 * pane.height
    hands.drag((pane.x + pane.width / 2, y), (pane.x + 0.7 * pane.width, y))
    hands.until("the line to move", lambda: 0.65 < viewer.state.wipe < 0.75)
    hands.picture("window")

    camera = viewer.state.camera
    hands.drag((pane.x + 0.3 * pane.width, y), (pane.x + 0.3 * pane.width + 60, y))
    hands.until("the camera to move", lambda: viewer.state.camera != camera)
    hands.click("save")
    hands.until("a state file", lambda: "view.toml: saved" in viewer.message)
    hands.scored()

    hands.choose("##sequence", "pan", "", lambda: viewer.state.sequence == "pan")
    hands.scored()
    xdotool("key", "space")
    hands.until("three frames", lambda: viewer.state.frame > 2)
    xdotool("key", "space")
    hands.until("a pause", lambda: not viewer.playing)
    hands.scored()
    frame = viewer.state.frame
    assert hands.score("flicker") > hands.score("flicker", 1)
    xdotool("key", "Right")
    hands.until("a step", lambda: viewer.state.frame == frame + 1)
    xdotool("key", "Left")
    hands.until("a step back", lambda: viewer.state.frame == frame)
    hands.choose("##sequence", "none", "", lambda: not viewer.state.sequence)
    hands.scored()

    notes = [{"spec": spec.text, "scores": dict(viewer.judge.scores[spec.full_text])} for spec in viewer.state.specs]
    Path("notes.json").write_text(json.dumps(notes))
    step, masks = viewer.step, list[np.ndarray]()

    def read_back() -> None:  # by the thread that owns the context
        step()
        masks[:] = [viewer.drawn.visibility(mask) for mask in viewer.drawn.masks] if viewer.drawn else []

    viewer.step = read_back  # type: ignore[method-assign]
    xdotool("mousemove", *AWAY)
    hands.until("the masks to be read", lambda: len(masks) == 2)
    np.save("masks.npy", np.array(masks))


def main(folder: str, *pictures: str) -> None:
    where = Path(pictures[0]).resolve() if pictures else None
    os.chdir(folder)
    scene, known = load_scene("sphere-and-torus"), techniques()
    specs = tuple(parse_spec(text, known) for text in ("shadow-map", "shadow-volume"))
    state = ViewerState(scene, scene.cameras[0], scene.lights[0], specs, origin=Origin("sphere-and-torus"))
    record_widgets()
    window, failures = ViewerWindow(state, known), list[str]()

    def run() -> None:
        try:
            tour(Hands(window, where))
        except BaseException:
            failures.append(traceback.format_exc())
        finally:
            window.window.is_closing = True

    thread = threading.Thread(target=run)
    thread.start()
    window.run()
    thread.join()
    assert not failures, failures[0]


if __name__ == "__main__":
    main(*sys.argv[1:])
