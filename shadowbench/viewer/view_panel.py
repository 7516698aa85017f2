"""The panels of what is shown, and of what can be taken along: spec, picture, study entry, state."""

import shlex
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import glfw
import numpy as np
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.files import check_outputs
from shadowbench.gl.gbuffer import download
from shadowbench.measure.pictures import write_picture
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.state import Layout, Overlay, Source
from shadowbench.viewer.state_files import adopted, append_to_study, save_state
from shadowbench.viewer.technique_panel import choice, tooltip

WIDTH = 100.0  # of a list, in pixels
HINTS = "drag: orbit;  Shift + drag: pan;  right drag: look;  wheel: zoom;  WASD, QE: walk;  yellow dot: light"
LAYOUT_HELP: Mapping[Layout, str] = {
    "one": "one picture",
    "wipe": "two pictures, with a line between them to drag",
    "side by side": "A, B and the truth",
}
SOURCE_HELP: Mapping[Source, str] = {
    "A": "the first technique",
    "B": "the second technique",
    "truth": "ray-traced shadows of this view",
}
OVERLAY_HELP: Mapping[Overlay, str] = {
    "picture": "the shaded picture alone",
    "error": "false shadow is orange, false light blue; of soft shadows the root of the error; dark facets of smooth "
    "surfaces, which the truth has too, purple",
    "mask": "the visibility that is scored: lit is white, shadow black",
    "normals": "geometric normals: x is red, y green, z blue",
    "N·L": "cosine of normal and direction to the light: 1 is white, 0 black; surfaces that face away are dark red",
    "texels": "texels of the shadow map where they fall, those outside it grey; paler where they are smaller than "
    "1.5 pixels; only of techniques with a map",
    "blockers": "distance along the light's ray to the nearest caster: near is blue, the farthest yellow",
    "tint": "the technique's own colours, such as one per cascade; few techniques have them",
}


def view_panel(viewer: Viewer) -> None:
    """Choice of layout, pictures and overlay."""
    state = viewer.state
    chosen = {"layout": _choice("layout", state.layout, LAYOUT_HELP)}
    if state.layout != "side by side":
        chosen["left"] = _choice("left" if state.layout == "wipe" else "of", state.left, SOURCE_HELP)
    if state.layout == "wipe":
        chosen["right"] = _choice("right", state.right, SOURCE_HELP)
    chosen["overlay"] = _choice("show", state.overlay, OVERLAY_HELP)
    imgui.new_line()
    viewer.change(replace(state, **chosen))


def below(viewer: Viewer, frame_ms: float) -> list[str]:
    """The lines below the pictures: the meaning of the colours, and a message or what the mouse does."""
    overlay = viewer.state.overlay
    legend = [] if overlay == "picture" else [f"{overlay}: {OVERLAY_HELP[overlay]}"]
    return [*legend, viewer.broken or viewer.message or f"{frame_ms:.0f} ms a frame;  {HINTS}"]


def _choice(label: str, name: str, names: Mapping[Any, str]) -> Any:
    """A list with its label before it, in a line of its own if there is no room beside the last."""
    if imgui.get_content_region_avail().x < imgui.calc_text_size(label).x + WIDTH + 8:
        imgui.new_line()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(label)
    imgui.same_line()
    imgui.set_next_item_width(WIDTH)
    chosen = choice(f"##{label}", name, names)
    imgui.same_line(0.0, 14.0)
    return chosen


def file_panel(viewer: Viewer) -> None:
    """Buttons that copy or write."""
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        text = viewer.state.specs[index].text
        if imgui.button(f"copy spec of {source}"):
            glfw.set_clipboard_string(None, text)  # type: ignore[arg-type]  # a window is deprecated
            viewer.message = f"copied: {text}"
        tooltip(f"for --technique of any command: {text}")
        imgui.same_line()
        if imgui.button(f"append {source} to study"):
            viewer.attempt(partial(_append, viewer, viewer.names["study file"], index))
        tooltip("adds the technique, and the scene as its file has it: save the state first to study this very view")
    _name(viewer, "study file")
    for name, save, help in SAVED:
        if imgui.button(f"save {name}"):
            viewer.attempt(partial(save, viewer, Path(viewer.names[name])))
        tooltip(help)
        imgui.same_line()
        _name(viewer, name)
    imgui.text_disabled("in the folder where shadowbench was started")


def _name(viewer: Viewer, what: str) -> None:
    viewer.names[what] = imgui.input_text(what, viewer.names[what])[1]


def _append(viewer: Viewer, file: str, index: int) -> str:
    append_to_study(Path(file), viewer.state, index, viewer.techniques)
    return f"{file}: appended {viewer.state.specs[index].text}; shadowbench run --study {file}"


def _save_picture(viewer: Viewer, file: Path) -> str:
    """Write the panes that are shown side by side, or as a wipe shows them; of a truth only that of this view."""
    check_outputs(".png", file)
    state, side = viewer.state, viewer.drawn.size if viewer.drawn else 0
    shown = [viewer.pictures.get(one) for one in state.sources if one != "truth" or viewer.judge.traced(state)]
    images = [download(one, "u1")[..., :3] for one in shown if one is not None and one.width == side]
    if viewer.broken or not images:
        raise InputError(f"{file}: nothing is drawn{'' if viewer.broken else ' yet'}")
    if state.layout == "wipe" and len(images) == 2:
        cut = round(state.wipe * side)
        images = [images[0][:, :cut], images[1][:, cut:]]
    write_picture(file, np.ascontiguousarray(np.hstack(images)).astype(np.uint8))
    return f"{file}: saved"


def _save_state(viewer: Viewer, file: Path) -> str:
    save_state(viewer.state, file)
    viewer.change(adopted(viewer.state, file))
    return f"{file}: saved; shadowbench view --state {shlex.quote(str(file))}, or as the scene of any command"


SAVED = (
    ("picture", _save_picture, "what is shown, as PNG"),
    ("state", _save_state, "scene, camera, light, techniques and layout: a scene file for --state and every command"),
)
