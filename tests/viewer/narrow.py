"""The window at 900 × 600: its labels have room, and the switch of the light's projection.

Run on a display: python tests/viewer/narrow.py [FOLDER for pictures]
"""

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import driver  # type: ignore[import-not-found]
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.studies.artefacts import artefacts
from shadowbench.viewer import window
from shadowbench.viewer.state import History, Origin, ViewerState
from shadowbench.viewer.technique_panel import choices_of, with_params, with_value

LABELLED = ("slider_float", "slider_int", "drag_float", "drag_int", "drag_float3", "input_text", "begin_combo")
CUT: set[str] = set()
TOOLTIP: list[bool] = []  # while one is drawn, which wraps its lines


def watch(name: str, width: Callable[[str], float], room: Callable[[], float], at: int = 0) -> None:
    """Note texts that are wider than their room; at: the place of the text among the arguments."""
    make = getattr(imgui, name)

    def call(*arguments: Any, **options: Any) -> Any:
        shown = str(arguments[at]).partition("##")[0]
        if shown and not TOOLTIP and width(shown) > room() + 0.5:
            CUT.add(f"{name} {shown}")
        return make(*arguments, **options)

    setattr(imgui, name, call)


def text_width(text: str) -> float:
    return float(imgui.calc_text_size(text).x)


def rest() -> float:
    return float(imgui.get_content_region_avail().x)


def beside() -> float:
    return rest() - float(imgui.calc_item_width()) - float(imgui.get_style().item_inner_spacing.x)


def inside() -> float:
    return float(imgui.calc_item_width()) - imgui.get_frame_height() - 2 * imgui.get_style().frame_padding.x


def script(d: driver.Driver) -> None:
    viewer = d.viewer
    d.scored()
    time.sleep(1.0)
    d.picture("narrow")
    sun = viewer.state.light
    for name, kind in (("perspective", "spot"), ("orthographic", "directional")):
        d.click(name)
        d.until(f"a light of kind {kind}", lambda kind=kind: viewer.state.light.kind == kind)
        d.scored()
        d.picture(f"narrow-{name}")
        if kind == "spot":
            spot = viewer.state.light
    assert viewer.state.light.direction == sun.direction
    d.click("perspective")
    d.until("the spot", lambda: viewer.state.light == spot)
    viewer._draw = lambda size: False  # the interface alone
    for one in every_spec():
        viewer.change(viewer.state.with_spec(0, one))
        show(d)
    for artefact in artefacts():
        viewer.history = History(replace(viewer.state, origin=Origin(str(artefact.file))))
        show(d)
    assert not CUT, CUT


def show(d: driver.Driver) -> None:
    """Wait for a frame."""
    drawn = driver.drawn["", "Scene"][4]
    d.window._heard()
    d.until("a frame", lambda: driver.drawn["", "Scene"][4] > drawn)


def every_spec() -> list[Any]:
    """Each technique, and with each component that a parameter can be beside its other defaults."""
    found = []
    for name in sorted(KNOWN):
        spec = parse_spec(name, KNOWN)
        found.append(spec)
        for key, info in type(spec.params).model_fields.items():
            for each in choices_of(info, getattr(spec.params, key)):
                with suppress(InputError):  # such as another number of cascades for some splits
                    found.append(with_params(spec, with_value(spec.params, key, each)))
    return found


if __name__ == "__main__":
    KNOWN = techniques()
    window.SIZE = (900, 600)
    window.PANELS = tuple((title, panel, imgui.TreeNodeFlags_.default_open) for title, panel, _ in window.PANELS)
    driver.AWAY = (450, 590)
    begin, end = imgui.begin_tooltip, imgui.end_tooltip
    imgui.begin_tooltip = lambda: (TOOLTIP.append(True), begin())[1]
    imgui.end_tooltip = lambda: (TOOLTIP.clear(), end())[1]
    for name in LABELLED:
        watch(name, text_width, beside)
    watch("begin_combo", text_width, inside, at=1)
    for name in ("text_unformatted", "table_setup_column"):
        watch(name, text_width, rest)
    scene = load_scene("sphere-and-torus")
    specs = tuple(parse_spec(text, KNOWN) for text in ("shadow-map:filter=pcss", "shadow-volume"))
    state = ViewerState(scene, scene.cameras[0], scene.lights[0], specs, 128, origin=Origin("sphere-and-torus"))
    driver.drive(state, KNOWN, script, Path(sys.argv[1]) if len(sys.argv) > 1 else None)
