"""The window: GLFW through moderngl-window, its events, and the layout of panels and panes."""

import re
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import glfw
import imgui_bundle
import moderngl
from imgui_bundle import imgui
from moderngl_window.context.glfw.window import Window as GlfwWindow
from moderngl_window.integrations.imgui_bundle import ModernglWindowRenderer

from shadowbench.errors import InputError
from shadowbench.gl.device import before_context, device_of
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.canvas import Canvas
from shadowbench.viewer.crash_reporter import crash_reporter
from shadowbench.viewer.navigation import distance, walked
from shadowbench.viewer.opening import Opener
from shadowbench.viewer.panes import NUMBERS
from shadowbench.viewer.result_panels import map_panel, scores_panel, times_panel
from shadowbench.viewer.scene_panels import light_panel, scene_panel, shading_panel
from shadowbench.viewer.state import Source, ViewerState
from shadowbench.viewer.technique_panel import edited_spec
from shadowbench.viewer.truth import TruthTask
from shadowbench.viewer.view_panel import below, file_panel, view_panel

SIZE = (1400, 860)
LEFT, RIGHT = 310.0, 340.0  # pixels
LABELS = 104.0  # pixels at the right of widgets
RIGHT_SHARE = 0.33  # of a narrow window, whose picture needs the room
FONT = 15.0
IDLE_S, AFTER_EVENT_S = 0.5, 0.4  # longest time between frames at rest; frames are drawn for so long after an event
POLL_S = 0.01  # between looks for an answer
STEP = 0.25  # of the distance to the target that walking covers in a second
PANELS = (
    ("Scene", scene_panel, imgui.TreeNodeFlags_.default_open),
    ("Light", light_panel, imgui.TreeNodeFlags_.default_open),
    ("Copy and save", file_panel, imgui.TreeNodeFlags_.default_open),
    ("Shading", shading_panel, 0),
    ("Shadow map", map_panel, 0),
    ("Times and work", times_panel, 0),
)
_PLAIN = re.compile(r"^\(\d+\) b['\"](.*)['\"]$")  # the text in a GLFWError
_NO_DISPLAY = (
    "no window can be opened here ({}): `shadowbench render` draws without one; "
    "xvfb-run -s '-screen 0 1400x860x24' shadowbench view … opens one on a virtual display"
)


class Renderer(ModernglWindowRenderer):
    """Dear ImGui's events and drawing. Queued events: a press and its release between two frames make a click."""

    def __init__(self, window: GlfwWindow, heard: Callable[[], None]) -> None:
        """heard: called for each event."""
        super().__init__(window)  # type: ignore[no-untyped-call]
        self._heard = heard
        self.listen(window)

    def listen(self, window: GlfwWindow) -> None:
        """Take the window's events."""
        window.mouse_position_event_func = window.mouse_drag_event_func = self._moved
        window.mouse_press_event_func = lambda _x, _y, button: self._button(button, True)
        window.mouse_release_event_func = lambda _x, _y, button: self._button(button, False)
        window.mouse_scroll_event_func = self._scrolled
        window.unicode_char_entered_func = self.unicode_char_entered
        window.resize_func = self.resize

    def show(self, pictures: Mapping[Source, moderngl.Texture], map_picture: moderngl.Texture | None) -> None:
        """Draw the interface with these pictures, by their names in NUMBERS."""
        font: Any = self._font_texture
        shown = {NUMBERS[name]: picture for name, picture in pictures.items()}
        self._textures = {font.glo: font, **dict.fromkeys(NUMBERS.values(), font), **shown}
        self._textures[NUMBERS["map"]] = map_picture or font
        self.ctx.clear_samplers()
        self.render(imgui.get_draw_data())

    def _scrolled(self, x: float, y: float) -> None:
        self._heard()
        self.io.add_mouse_wheel_event(x, y)

    def _moved(self, x: int, y: int, *_: int) -> None:
        self._heard()
        self.io.add_mouse_pos_event(x, y)

    def _button(self, button: int, down: bool) -> None:
        # At the place of the last motion: that of a button's event is where the pointer is by now, after a slow frame.
        self._heard()
        self.io.add_mouse_button_event(button - 1, down)  # left, right and middle, in the order of both libraries


class ViewerWindow:
    """The window of `shadowbench view`."""

    def __init__(self, state: ViewerState, techniques: Techniques, plugins: Sequence[Path]) -> None:
        self.window = _open("shadowbench view")
        self.task = TruthTask()
        self.viewer = Viewer(device_of(self.window.ctx), state, techniques, self.task, plugins)
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        _load_font(io)
        self.renderer = Renderer(self.window, self._heard)
        self.window.key_event_func = self._key
        self.opener = Opener(self.viewer)
        glfw.set_drop_callback(self.window._window, self._dropped)
        self.canvas = Canvas(self.viewer)
        self.frame_ms, self._started = 0.0, time.perf_counter()
        self._quiet_from = 0.0  # time from which on frames without a change need not be drawn

    def run(self) -> None:
        """Show the window until it is closed."""
        with crash_reporter() as tell:  # plug-ins draw in this process
            self.viewer.drawing.tell = tell
            try:
                while not self.window.is_closing:
                    self.frame()
                    self._wait()
            finally:
                self.close()

    def frame(self) -> None:
        """One frame: bring the pictures up to date, draw the interface, take events."""
        start = time.perf_counter()
        io = imgui.get_io()
        io.delta_time, self._started = max(start - self._started, 1e-4), start
        # Not the modifiers of key events, which on X11 are those from before the event.
        io.add_key_event(imgui.Key.mod_shift, self._held(glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT))
        io.add_key_event(imgui.Key.mod_ctrl, self._held(glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL))
        walks = self._walk()
        imgui.new_frame()
        self._layout()
        if not (walks or imgui.is_any_item_active() or self.canvas.gesture or self.viewer.travel != "rest"):
            self.viewer.rest()
        imgui.render()
        self.viewer.step()  # after the input: what it changed is seen in this very frame
        self.window.use()
        self.window.ctx.clear(0.1, 0.1, 0.1)
        self.renderer.show(self.viewer.pictures, self.viewer.map_picture)
        self.window.swap_buffers()
        self.frame_ms = (time.perf_counter() - start) * 1e3

    def _wait(self) -> None:
        """Wait for an event, an answer of the process that traces, or until files should be looked at again."""
        until = time.perf_counter() + IDLE_S
        while self.viewer.waiting and self._quiet_from < time.perf_counter() < until:
            glfw.wait_events_timeout(POLL_S)

    def close(self) -> None:
        """Free everything and close the window."""
        self.task.stop()
        self.viewer.release()
        self.renderer.shutdown()  # type: ignore[no-untyped-call]
        imgui.destroy_context()
        self.window.destroy()

    def _layout(self) -> None:
        width, height = self.window.size
        right = min(RIGHT, RIGHT_SHARE * width)
        flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
        columns = (
            ("left", 0, LEFT, self._left),
            ("middle", LEFT, width - LEFT - right, self._middle),
            ("right", width - right, right, self._right),
        )
        for name, x, breadth, draw in columns:
            imgui.set_next_window_pos((x, 0))
            imgui.set_next_window_size((max(breadth, 64.0), height))
            imgui.begin(name, None, flags & ~imgui.WindowFlags_.no_scrollbar)
            imgui.push_item_width(-LABELS)
            draw()
            imgui.pop_item_width()
            imgui.end()

    def _left(self) -> None:
        self.viewer.shows_map = False
        self.opener.button()
        for title, panel, flags in PANELS:
            if imgui.collapsing_header(title, flags):
                panel(self.viewer)

    def _middle(self) -> None:
        view_panel(self.viewer)
        lines, room = below(self.viewer, self.frame_ms), imgui.get_content_region_avail()
        height = sum(imgui.calc_text_size(line, wrap_width=room.x).y + 4 for line in lines)
        imgui.begin_child("panes", (room.x, max(room.y - height - 8, 64)))
        self.canvas.draw()
        imgui.end_child()
        for line in lines:
            imgui.text_wrapped(line)

    def _right(self) -> None:
        viewer = self.viewer
        scores_panel(viewer)
        for index, source in enumerate("AB"[: len(viewer.state.specs)]):
            imgui.push_id(source)
            if imgui.collapsing_header(source, imgui.TreeNodeFlags_.default_open):
                try:
                    spec = edited_spec(viewer.state.specs[index], viewer.techniques)
                    viewer.change(viewer.state.with_spec(index, spec), f"spec {source}")
                except InputError as error:
                    viewer.message = str(error)
            imgui.pop_id()
        if len(viewer.state.specs) < 2:
            if imgui.button("add B"):
                viewer.change(viewer.state.with_spec(1, viewer.state.specs[0]))
        elif imgui.button("remove B"):
            viewer.change(replace(viewer.state, specs=viewer.state.specs[:1]))

    def _heard(self) -> None:
        self._quiet_from = time.perf_counter() + AFTER_EVENT_S

    def _dropped(self, _window: Any, files: Any, *_: Any) -> None:
        self._heard()
        self.opener.dropped(files)

    def _held(self, *keys: int) -> bool:
        return any(glfw.get_key(self.window._window, key) == glfw.PRESS for key in keys)

    def _key(self, key: int, action: int, modifiers: Any) -> None:
        self._heard()
        keys, io = self.window.keys, imgui.get_io()
        self.renderer.key_event(key, action, modifiers)  # type: ignore[no-untyped-call]
        if action == keys.ACTION_PRESS and modifiers.ctrl and not io.want_text_input:
            if key == keys.Z:
                self.viewer.redo() if modifiers.shift else self.viewer.undo()
            elif key == keys.Y:
                self.viewer.redo()

    def _walk(self) -> bool:
        """Move the camera by the keys that are held; whether there are any."""
        if imgui.get_io().want_text_input or imgui.get_io().key_ctrl:
            return False
        ways = ((glfw.KEY_D, glfw.KEY_A), (glfw.KEY_E, glfw.KEY_Q), (glfw.KEY_W, glfw.KEY_S))
        right, up, forward = (self._held(plus) - self._held(minus) for plus, minus in ways)
        if right or up or forward:
            camera = self.viewer.state.camera
            step = STEP * distance(camera) * min(self.frame_ms / 1e3, 0.2)
            moved = walked(camera, right * step, up * step, forward * step)
            self.viewer.change(replace(self.viewer.state, camera=moved), "walk")
        return bool(right or up or forward)


def _open(title: str) -> GlfwWindow:
    """A window with an OpenGL 4.1 context. Raises InputError without a display."""
    before_context()
    with warnings.catch_warnings(record=True) as heard:  # GLFW's errors are warnings
        warnings.simplefilter("always")
        try:
            window = GlfwWindow(title=title, size=SIZE, gl_version=(4, 1), resizable=True, vsync=True, samples=0)
        except Exception as error:  # ValueError, or moderngl's own
            reason = heard[-1].message if heard else error
            raise InputError(_NO_DISPLAY.format(_PLAIN.sub(r"\1", " ".join(str(reason).split())))) from None
    window.exit_key = None  # Escape closes a list, not the window
    return window


def _load_font(io: Any) -> None:
    """A font that has ², ≥ and θ."""
    file = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "DroidSans.ttf"
    io.fonts.add_font_from_file_ttf(
        str(file), FONT, None, [0x20, 0xFF, 0x2010, 0x2027, 0x370, 0x3FF, 0x2200, 0x22FF, 0]
    )


def show(state: ViewerState, techniques: Techniques, plugins: Sequence[Path] = ()) -> None:
    """Open the window and show it until it is closed. Raises InputError without a display."""
    ViewerWindow(state, techniques, plugins).run()
