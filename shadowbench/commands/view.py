"""`view`: a window in which what is seen is what is scored."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shadowbench.commands import console, options
from shadowbench.errors import NOT_EVERYWHERE, InputError, how_to_install
from shadowbench.options import FIRST, ViewOptions, ViewSize, option, view_size

if TYPE_CHECKING:
    from shadowbench.viewer.window import ViewerWindow

LIBRARIES = "libx11-6 libxcursor1 libxext6 libxi6 libxinerama1 libxrandr2"


@dataclass(frozen=True)
class WindowOptions:
    """What the window shows."""

    technique: list[str] = options.technique(
        f"One or two techniques, A and B: {options.SPEC}  [shadow-map; cube-map under a point light].", default=()
    )
    state: Path | None = option("Show a state that the window saved, as a SCENE that is one does.", "FILE.toml")
    cell: str | None = option("Show a cell of a folder of `run` or `stress`, by its key.", "KEY")
    view_size: ViewSize | None = view_size()
    plugin: list[Path] = options.plugins()


@options.command(
    "\b\nFor example\n"
    "  shadowbench view sphere-and-torus -t shadow-map -t shadow-volume\n"
    "  shadowbench view --state view.toml\n"
    "  shadowbench view results/stress --cell 5be1f0"
)
def view(
    scene: Annotated[
        str | None,
        options.argument("[SCENE]", f"The scene: {options.SCENE}; with --cell the folder of a run."),
    ] = None,
    *,
    window: WindowOptions,
    quiet: options.Quiet = False,
    view: ViewOptions,
) -> None:
    """Open a window on a scene, beside its ray-traced truth.

    Move the camera and the light, turn every parameter of two techniques, and see them beside the truth of the same
    view, which is traced whenever motion rests, with their scores. Needs a display and the extra `viewer`: in a
    checkout of shadowbench, pip install '.[viewer]'.
    """
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.plugin.spec import parse_spec
    from shadowbench.scenes.opening import named
    from shadowbench.viewer.state import Origin, ViewerState, cell_state, holds_state, read_state

    _check(scene, window, view)
    show = _window()
    known = techniques_with(window.plugin)
    specs = tuple(parse_spec(text, known) for text in window.technique)
    is_plain = scene is not None and window.cell is None and replace(view, assets=None) == FIRST
    if window.state is not None or (is_plain and holds_state(Path(str(scene)))):
        state = read_state(window.state or Path(str(scene)), known, view.assets)
    elif window.cell is not None:
        state = cell_state(Path(str(scene)), window.cell, known, view.assets)
    else:
        with console.Reporter(quiet) as reporter:
            chosen = reporter.view(str(scene), window.view_size, view)
        camera = named(chosen.scene.cameras, chosen.camera.name, "view")  # its planes are the file's, not of this view
        first = parse_spec("cube-map" if chosen.light.kind == "point" else "shadow-map", known)
        state = ViewerState(chosen.scene, camera, chosen.light, (first,), chosen.size, Origin(str(scene), view))
    show(replace(state, specs=specs or state.specs, size=window.view_size or state.size), known).run()


def _check(scene: str | None, window: WindowOptions, view: ViewOptions) -> None:
    """Raises InputError for arguments that exclude each other."""
    if len(window.technique) > 2:
        raise InputError(f"--technique: found {len(window.technique)}; allowed: one or two, A and B")
    if (scene is None) == (window.state is None):
        given = "no scene" if scene is None else "SCENE and --state"
        raise InputError(f"view: found {given}; allowed: a SCENE, such as sphere-and-torus, or --state FILE.toml")
    if (window.cell is not None) != (scene is not None and Path(scene).is_dir()):
        raise InputError("view: --cell KEY is for a folder of a run, and a folder is shown by --cell KEY")
    if (window.state or window.cell) and replace(view, assets=None) != FIRST:
        raise InputError(
            "options on how a SCENE is read, such as --view or --sun, are for one; a state and a cell have their own"
        )


def _window() -> "type[ViewerWindow]":
    """The window's class. Raises InputError if what it needs is not installed."""
    try:
        from shadowbench.viewer.window import ViewerWindow
    except ModuleNotFoundError as error:
        if error.name in NOT_EVERYWHERE:
            raise
        until = " (its wheels end at Python 3.13)" if error.name == "imgui_bundle" else ""
        raise InputError(f"view needs {error.name}; {how_to_install('viewer')}{until}") from None
    except ImportError as error:  # a library of the system
        raise InputError(f"view cannot be loaded ({error}); Debian and Ubuntu: apt-get install {LIBRARIES}") from None
    return ViewerWindow
