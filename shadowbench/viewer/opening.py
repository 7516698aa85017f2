"""Scenes that the window opens: by a dialog of the desktop, or dropped onto it."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from imgui_bundle import imgui, portable_file_dialogs

from shadowbench.scenes.meshes import MESH_SUFFIXES
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.state import Origin
from shadowbench.viewer.state_files import holds_state, read_state
from shadowbench.viewer.technique_panel import tooltip

_ON_LINUX = ("zenity", "kdialog", "matedialog", "qarma")
"""Programs of desktops of which one shows the dialog; Windows and macOS have their own."""
_KINDS = ["scenes", " ".join(f"*{suffix}" for suffix in (".toml", *MESH_SUFFIXES)), "all files", "*"]


def open_file(viewer: Viewer, file: Path) -> str:
    """Show a scene file, a mesh file or a saved state; returns what was assumed about it. Raises InputError."""
    if holds_state(file):
        viewer.change(read_state(file, viewer.techniques))
    else:
        viewer.open_scene(Origin(str(file)))
    return "; ".join([f"{file} is shown", *viewer.state.scene.notes])


class Opener:
    """The button that asks for a file, while its dialog is open too, and files that are dropped."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._dialog: Any = None

    def button(self) -> None:
        """The button, and what was chosen in its dialog."""
        if imgui.button("open…") and self._dialog is None:
            self._viewer.attempt(self._ask)
        tooltip("a scene, a mesh file or a saved state; or drop one onto the window")
        if self._dialog is not None and self._dialog.ready(0):
            chosen, self._dialog = self._dialog.result(), None
            self.dropped(chosen)

    def dropped(self, files: Sequence[str]) -> None:
        """Open the first of some files, if there is one."""
        if files:
            self._viewer.attempt(lambda: open_file(self._viewer, Path(files[0])))

    def _ask(self) -> str | None:
        if sys.platform == "linux" and not any(map(shutil.which, _ON_LINUX)):
            return f"no file dialog is installed ({', '.join(_ON_LINUX)}); drop the file onto the window"
        self._dialog = portable_file_dialogs.open_file("Open a scene", "", _KINDS)
        return None
