"""The panels of what is shown, and of what can be taken along: spec, picture, study entry, state."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.files import check_outputs
from shadowbench.gl.gbuffer import download
from shadowbench.measure.pictures import write_picture
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.state import Layout, Overlay, Source, ViewerState
from shadowbench.viewer.state_files import adopted, append_to_study, save_state
from shadowbench.viewer.technique_panel import choice, tooltip

WIDTH = 100.0  # of a list, in pixels
HINTS = (
    "drag: orbit",
    "Shift + drag: pan",
    "right drag: look",
    "wheel: zoom",
    "WASD, QE: walk",
    "yellow dot: light",
)
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
    "error": "false shadow is orange, false light blue; of soft shadows the root of the error",
    "mask": "the visibility that is scored: lit is white, shadow black",
    "normals": "geometric normals: x is red, y green, z blue",
    "N·L": "cosine of normal and direction to the light: 1 is white, 0 black; surfaces that face away are dark red",
    "texels": "texels of the shadow map where they fall, those outside it grey; paler where they are smaller than "
    "1.5 pixels; only of techniques with a map",
    "blockers": "distance along the light's ray to the nearest caster: near is blue, the farthest yellow",
    "tint": "the technique's own colours, such as one per cascade; few techniques have them",
}
Name = TypeVar("Name", Layout, Source, Overlay)


def view_panel(viewer: Viewer) -> None:
    """Choice of layout, pictures and overlay."""
    state = viewer.state
    layout = _choice("layout", state.layout, LAYOUT_HELP)
    left, right = state.left, state.right
    if state.layout != "side by side":
        left = _choice("left" if state.layout == "wipe" else "of", left, SOURCE_HELP)
    if state.layout == "wipe":
        right = _choice("right", right, SOURCE_HELP)
    overlay = _choice("show", state.overlay, OVERLAY_HELP)
    imgui.new_line()
    viewer.change(replace(state, layout=layout, left=left, right=right, overlay=overlay))


def below(viewer: Viewer, frame_ms: float) -> list[str]:
    """The lines below the pictures: the meaning of the colours, and a message or what the mouse does."""
    state: ViewerState = viewer.state
    legend = [] if state.overlay == "picture" else [f"{state.overlay}: {OVERLAY_HELP[state.overlay]}"]
    message = viewer.broken or viewer.message
    return [*legend, message or ";  ".join((f"{frame_ms:.0f} ms a frame", *HINTS))]


def _choice(label: str, name: Name, names: Mapping[Name, str]) -> Name:
    """A list with its label before it, in a line of its own if there is no room beside the last."""
    if imgui.get_content_region_avail().x < imgui.calc_text_size(label).x + WIDTH + 8:
        imgui.new_line()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(label)
    imgui.same_line()
    imgui.set_next_item_width(WIDTH)
    chosen: Name = choice(f"##{label}", name, names)
    imgui.same_line(0.0, 14.0)
    return chosen


@dataclass
class FileNames:
    """The names that the panel's fields hold."""

    study: str = "view-study.toml"
    picture: str = "view.png"
    state: str = "view.toml"


def file_panel(viewer: Viewer, names: FileNames, copy: Callable[[str], None]) -> None:
    """Buttons that copy or write. copy: puts a text on the clipboard."""
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        text = viewer.state.specs[index].text
        if imgui.button(f"copy spec of {source}"):
            copy(text)
            viewer.message = f"copied: {text}"
        tooltip(f"for --technique of any command: {text}")
        imgui.same_line()
        if imgui.button(f"append {source} to study"):
            viewer.attempt(partial(_append, viewer, names.study, index))
        tooltip("adds the technique, and the scene as its file has it: save the state first to study this very view")
    names.study = imgui.input_text("study file", names.study)[1]
    for what, save, meaning in _SAVED:
        name = getattr(names, what)
        if imgui.button(f"save {what}"):
            viewer.attempt(partial(save, viewer, Path(name)))
        tooltip(meaning)
        imgui.same_line()
        setattr(names, what, imgui.input_text(what, name)[1])
    imgui.text_disabled("in the folder where shadowbench was started")


def _append(viewer: Viewer, file: str, index: int) -> str:
    append_to_study(Path(file), viewer.state, index, viewer.techniques)
    return f"{file}: appended {viewer.state.specs[index].text}; shadowbench run --study {file}"


def _save_picture(viewer: Viewer, file: Path) -> str:
    """Write the panes that are shown side by side, or as a wipe shows them; of a truth only that of this view."""
    check_outputs(".png", file)
    state, side = viewer.state, viewer.drawn.size if viewer.drawn else 0
    shown = [one for one in state.sources if one != "truth" or viewer.judge.has_traced(state)]
    pictures = [viewer.pictures[one] for one in shown if one in viewer.pictures]
    images = [download(one, "u1")[..., :3] for one in pictures if one.width == side]
    if viewer.broken or not images:
        raise InputError(f"{file}: nothing is drawn{'' if viewer.broken else ' yet'}")
    if state.layout == "wipe" and len(images) == 2:
        cut = round(state.wipe * images[0].shape[1])
        images = [images[0][:, :cut], images[1][:, cut:]]
    write_picture(file, np.ascontiguousarray(np.hstack(images)).astype(np.uint8))
    return f"{file}: saved"


def _save_state(viewer: Viewer, file: Path) -> str:
    save_state(viewer.state, file)
    viewer.change(adopted(viewer.state, file))
    return f"{file}: saved; shadowbench view --state {shlex.quote(str(file))}, or as the scene of any command"


_SAVED = (
    ("picture", _save_picture, "what is shown, as PNG"),
    (
        "state",
        _save_state,
        "scene, camera, light, techniques and layout: a scene file, for --state and for every command",
    ),
)
