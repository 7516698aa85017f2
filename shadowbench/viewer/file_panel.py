"""The panel of what can be taken along: spec, picture, study entry, state."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from shadowbench.errors import InputError
from shadowbench.files import check_outputs
from shadowbench.gl.gbuffer import download
from shadowbench.measure.pictures import write_picture
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.state_files import adopted, append_to_study, save_state
from shadowbench.viewer.technique_panel import tooltip


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
