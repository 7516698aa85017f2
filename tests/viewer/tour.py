"""The tour of docs/how-to/view.md, step by step; each step's docstring is its line there.

Run on a display, with the folder for what it saves: python tests/viewer/tour.py FOLDER
The pictures of that page: python tests/viewer/tour.py FOLDER docs/pictures/view
"""

import json
import os
import sys
from pathlib import Path

import glfw
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from driver import Driver, drive, xdotool  # type: ignore[import-not-found]

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.viewer.state import Origin, ViewerState

NOTES: dict[str, object] = {}


def open_(d: Driver) -> None:
    """Open a scene with two techniques. A moment later each has its scores against the truth of this very view."""
    d.scored()
    assert d.score("iou", 1) > 0.999


def drag_the_light(d: Driver) -> None:
    """Drag the yellow handle: the sun moves on its dome. The old scores are grey until motion rests."""
    before, (x, y) = d.viewer.state.light, d.light()
    d.drag((x, y), (x + 90, y - 40))
    d.until("the light to move", lambda: d.viewer.state.light != before)
    d.scored()
    assert d.light() != (x, y)


def add_acne(d: Driver) -> None:
    """Choose **bias** *none* for A: acne, and its score says how much."""
    d.choose("bias", "none", "A", lambda: d.viewer.state.specs[0].text == "shadow-map:bias=none")
    d.scored()
    assert d.score("acne") > 0.01


def show_the_error(d: Driver) -> None:
    """Choose **layout** *one* and **show** *error*: false shadow is orange, false light blue."""
    d.choose("##layout", "one", "", lambda: d.viewer.state.layout == "one")
    d.choose("##show", "error", "", lambda: d.viewer.state.overlay == "error")


def cure_acne(d: Driver) -> None:
    """Choose **bias** *slope*, and drag its **min**: acne goes, and light leaks where casters touch the ground."""
    d.choose("bias", "slope", "A", lambda: d.viewer.state.specs[0].params.bias.name == "slope")
    d.slide("min", "A", 0.8)
    d.until("another bias", lambda: d.viewer.state.specs[0].params.bias.min > 0.01)
    d.scored()
    assert d.score("acne") < 0.01 < d.score("contact")


def halve_the_map(d: Driver) -> None:
    """Press **½** twice beside **size**, and choose **show** *texels*: the map's texels where they fall."""
    for size in (512, 256):
        d.click("½##size", "A")
        d.until(f"a map of {size}", lambda size=size: d.viewer.state.specs[0].map_size == size)
    d.choose("##show", "texels", "", lambda: d.viewer.state.overlay == "texels")
    d.scored()


def open_the_map(d: Driver) -> None:
    """Open **Shadow map** and **Times and work**: the map itself, the last times of passes, and the counts of work."""
    d.click("Times and work")
    d.click("Shadow map")
    d.until("the map", lambda: d.viewer.map_picture is not None)


def wipe(d: Driver) -> None:
    """Choose **show** *picture* and **layout** *wipe*, and drag the line between A and the truth."""
    d.choose("##show", "picture", "", lambda: d.viewer.state.overlay == "picture")
    d.choose("##layout", "wipe", "", lambda: d.viewer.state.layout == "wipe")
    pane = d.window.canvas.panes[0]
    y = pane.y + 0.8 * pane.side
    d.drag((pane.x + pane.side / 2, y), (pane.x + 0.7 * pane.side, y))
    d.until("the line to move", lambda: 0.65 < d.viewer.state.wipe < 0.75)


def orbit(d: Driver) -> None:
    """Drag the picture to orbit, and walk by W A S D. Ctrl+Z takes back one after the other."""
    pane, start = d.window.canvas.panes[0], d.viewer.state.camera
    x, y = pane.x + 0.3 * pane.side, pane.y + 0.8 * pane.side
    d.drag((x, y), (x + 60, y))
    d.until("the camera to move", lambda: d.viewer.state.camera != start)
    d.scored()
    orbited = d.viewer.state.camera
    xdotool("keydown", "w", "sleep", 1, "keyup", "w")
    d.until("the camera to walk", lambda: d.viewer.state.camera.target != orbited.target)
    d.scored()
    for camera in (orbited, start):
        xdotool("key", "ctrl+z")
        d.until("the camera to be back", lambda camera=camera: d.viewer.state.camera == camera)
    d.scored()


def take_along(d: Driver) -> None:
    """Press **copy spec of A** and **save state**: the line for the command line, and a scene for every command."""
    d.click("copy spec of A")
    text = d.viewer.state.specs[0].text
    d.until("the spec on the clipboard", lambda: d.viewer.message == f"copied: {text}")
    NOTES["copied"] = glfw.get_clipboard_string(None).decode()
    d.click("save state")
    d.until("a state file", lambda: "view.toml: saved" in d.viewer.message)
    d.scored()


STEPS = (
    open_, drag_the_light, add_acne, show_the_error, cure_acne, halve_the_map, open_the_map, wipe, orbit, take_along,
)  # fmt: skip

PANE = (420, 230, 980, 640)
PICTURES = {
    add_acne: ("acne", PANE),
    show_the_error: ("error", PANE),
    halve_the_map: ("texels", PANE),
    wipe: ("window", None),
}


def tour(d: Driver) -> None:
    for step in STEPS:
        step(d)
        if step in PICTURES:
            d.picture(*PICTURES[step])
    viewer = d.viewer
    NOTES["specs"] = [spec.text for spec in viewer.state.specs]
    NOTES["scores"] = [dict(viewer.judge.scores[spec.full_text]) for spec in viewer.state.specs]
    d.until("the masks", lambda: viewer.drawn is not None and viewer.drawn.size == viewer.state.size)
    # Read back by the thread that owns the context.
    masks: list[np.ndarray] = []
    step = viewer.step

    def read_back() -> None:
        step()
        masks[:] = [viewer.drawing.visibility(viewer.drawn, mask) for mask in viewer.drawn.masks]

    viewer.step = read_back
    d.until("the masks to be read", lambda: len(masks) == 2)
    np.save("masks.npy", np.array(masks))
    Path("notes.json").write_text(json.dumps(NOTES))


if __name__ == "__main__":
    pictures = Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
    os.chdir(sys.argv[1])
    known = techniques()
    scene = load_scene("sphere-and-torus")
    specs = tuple(parse_spec(text, known) for text in ("shadow-map", "shadow-volume"))
    state = ViewerState(scene, scene.cameras[0], scene.lights[0], specs, origin=Origin("sphere-and-torus"))
    drive(state, known, tour, pictures)
