"""The window: GLFW through moderngl-window, its events, the layout of panels and panes, and what the mouse does."""

import math
import re
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import glfw
import imgui_bundle
import moderngl
from imgui_bundle import imgui
from moderngl_window.context.glfw.window import Window as GlfwWindow
from moderngl_window.integrations.imgui_bundle import ModernglWindowRenderer

from shadowbench.errors import InputError
from shadowbench.gl.device import device_of
from shadowbench.options import ViewSize
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer import camera, controls
from shadowbench.viewer.drawing import Viewer
from shadowbench.viewer.judge import Judge
from shadowbench.viewer.state import Source, ViewerState

SIZE = (1400, 860)
LEFT, RIGHT = 310.0, 340.0  # pixels
LABELS = 104.0  # pixels at the right of widgets
FONT = 15.0
AFTER_EVENT_S = 0.4  # frames are drawn for so long after an event
POLL_S = 0.01  # between looks for an answer
REACH = 12.0  # pixels, from the wipe's line, that count as on it
GAP = 6.0  # pixels between panes
TURN = math.pi  # by which a drag over a whole pane turns
ZOOM = 1.12  # by a step of the wheel
NUMBERS = {name: 1_000_001 + number for number, name in enumerate(get_args(Source))}
"""By which the interface names the pictures, whose textures are drawn after it was laid out."""
_WHITE, _DIMMED = 0xFFFFFFFF, 0xFF737373  # ABGR
_BUTTONS = (
    imgui.ButtonFlags_.mouse_button_left
    | imgui.ButtonFlags_.mouse_button_right
    | imgui.ButtonFlags_.mouse_button_middle
)
_PLAIN = re.compile(r"^\(\d+\) b['\"](.*)['\"]$")  # the text in a GLFWError
_NO_DISPLAY = (
    "no window can be opened here ({}): `shadowbench render` draws without one; "
    "xvfb-run -s '-screen 0 1400x860x24' shadowbench view … opens one on a virtual display"
)

Gesture = Literal["orbit", "pan", "look", "wipe", "light"]


@dataclass
class Pane:
    """A rectangle of the window in which pictures are shown, from its top left corner."""

    x: float
    y: float
    width: float
    height: float


def panes(x: float, y: float, width: float, height: float, count: int, size: ViewSize) -> list[Pane]:
    """The largest equal rectangles of the shape of a view that fit side by side into a rectangle."""
    scale = max(min((width - GAP * (count - 1)) / count / size.width, height / size.height), 16.0 / min(size))
    wide, high = scale * size.width, scale * size.height
    return [Pane(x + index * (wide + GAP), y, wide, high) for index in range(count)]


class Canvas:
    """Shows the panes and turns drags into changes of the state."""

    def __init__(self, viewer: Viewer) -> None:
        self.viewer = viewer
        self.gesture: Gesture = "orbit"
        self.panes: list[Pane] = []
        self._last = (0.0, 0.0)

    def draw(self) -> None:
        """Show the panes in the rest of the window, and handle the mouse in them."""
        state, origin, room = self.viewer.state, imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        sources, is_wipe = state.sources, state.layout == "wipe"
        count = 1 if is_wipe else len(sources)
        self.panes = panes(origin.x, origin.y, room.x, room.y, count, state.size)
        for index, pane in enumerate(self.panes):
            imgui.set_cursor_screen_pos((pane.x, pane.y))
            imgui.invisible_button(f"pane {index}", (pane.width, pane.height), _BUTTONS)
            if imgui.is_item_hovered():
                wheel = imgui.get_io().mouse_wheel
                zoomed = replace(state, camera=camera.zoomed(state.camera, ZOOM**-wheel))
                self.viewer.change(zoomed if wheel else state)
            if imgui.is_item_activated():
                self._begin(pane)
            if imgui.is_item_active():
                self._drag(pane)
        if is_wipe:
            (pane,), share = self.panes, self.viewer.state.wipe
            self._show(pane, sources[0], 0.0, share)
            self._show(pane, sources[1], share, 1.0)
            x = pane.x + share * pane.width
            imgui.get_window_draw_list().add_line((x, pane.y), (x, pane.y + pane.height), _WHITE, 2.0)
            return
        for pane, source in zip(self.panes, sources, strict=True):
            self._show(pane, source, 0.0, 1.0)

    def _show(self, pane: Pane, source: Source, start: float, end: float) -> None:
        """Show a part of a source's picture, between two shares of its width."""
        draw_list, viewer = imgui.get_window_draw_list(), self.viewer
        left, right, bottom = pane.x + start * pane.width, pane.x + end * pane.width, pane.y + pane.height
        draw_list.add_rect_filled((left, pane.y), (right, bottom), 0xFF303030)
        failure = viewer.broken or dict(zip("AB", viewer.failures, strict=False)).get(source, "")
        is_old = source == "truth" and viewer.outruns_truth
        if source in viewer.pictures:
            color = _DIMMED if failure or is_old else _WHITE
            draw_list.add_image(NUMBERS[source], (left, pane.y), (right, bottom), (start, 1), (end, 0), color)
        self._write(left, pane.y, right - left, label(viewer, source))
        if failure:
            self._write(left, pane.y + 24, right - left, failure)

    def _write(self, x: float, y: float, width: float, text: str) -> None:
        """Text on a dark ground, wrapped to a width."""
        if width < 40:
            return
        size = imgui.calc_text_size(text, wrap_width=width - 12)
        draw_list = imgui.get_window_draw_list()
        draw_list.add_rect_filled((x + 4, y + 4), (x + 10 + size.x, y + 8 + size.y), 0xC0000000)
        draw_list.add_text(imgui.get_font(), imgui.get_font_size(), (x + 7, y + 6), _WHITE, text, None, width - 12)

    def _begin(self, pane: Pane) -> None:
        """What a press begins, by what lies under it and by the button."""
        mouse, state = imgui.get_mouse_pos(), self.viewer.state
        self._last = (mouse.x, mouse.y)
        if imgui.is_mouse_down(imgui.MouseButton_.right):
            self.gesture = "light" if imgui.get_io().key_shift else "look"
        elif imgui.is_mouse_down(imgui.MouseButton_.middle) or imgui.get_io().key_shift:
            self.gesture = "pan"
        elif state.layout == "wipe" and abs(mouse.x - pane.x - state.wipe * pane.width) <= REACH:
            self.gesture = "wipe"
        else:
            self.gesture = "orbit"

    def _drag(self, pane: Pane) -> None:
        mouse, state = imgui.get_mouse_pos(), self.viewer.state
        x, y = (mouse.x - self._last[0]) / pane.height, (mouse.y - self._last[1]) / pane.height
        if (x, y) == (0, 0):
            return
        self._last = (mouse.x, mouse.y)
        match self.gesture:
            case "orbit":
                state = replace(state, camera=camera.orbited(state.camera, -x * TURN, y * TURN))
            case "look":
                state = replace(state, camera=camera.looked(state.camera, -x, -y))
            case "pan":
                state = replace(state, camera=camera.panned(state.camera, 2 * x, -2 * y))
            case "wipe":
                state = replace(state, wipe=min(max((mouse.x - pane.x) / pane.width, 0.0), 1.0))
            case "light":
                state = replace(state, light=camera.dragged(state.light, state.camera, 2 * x, -2 * y))
        self.viewer.change(state)


def label(viewer: Viewer, source: Source) -> str:
    """What a pane shows, and whether its truth is of another view."""
    state = viewer.state
    if source == "truth":
        text, missing = "truth", "of an earlier view" if source in viewer.pictures else "tracing"
    else:
        index = "AB".index(source)
        if index == len(state.specs):
            return "B: none: add B"
        text = f"{source}: {state.specs[index].text.replace(':', ': ').replace(',', ', ')}"  # lines break at spaces
        if state.overlay != "error":
            return text
        missing = "error follows the truth"
    return f"{text} ({missing})" if viewer.outruns_truth else text


class Renderer(ModernglWindowRenderer):
    """Dear ImGui's events and drawing. Queued events: a press and its release between two frames make a click."""

    def __init__(self, window: GlfwWindow, heard: Callable[[], None]) -> None:
        """heard: called for each event."""
        super().__init__(window)  # type: ignore[no-untyped-call]
        self._heard = heard
        window.mouse_position_event_func = window.mouse_drag_event_func = self._moved
        window.mouse_press_event_func = lambda _x, _y, button: self._button(button, True)
        window.mouse_release_event_func = lambda _x, _y, button: self._button(button, False)
        window.mouse_scroll_event_func = self._scrolled
        window.unicode_char_entered_func = self.unicode_char_entered
        window.resize_func = self.resize

    def show(self, pictures: Mapping[Source, moderngl.Texture]) -> None:
        """Draw the interface with these pictures, by their names in NUMBERS."""
        font: Any = self._font_texture
        shown = {NUMBERS[source]: picture for source, picture in pictures.items()}
        self._textures = {font.glo: font, **dict.fromkeys(NUMBERS.values(), font), **shown}
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
    """The window of `shadowbench view`. Raises InputError without a display."""

    def __init__(self, state: ViewerState, techniques: Techniques) -> None:
        self.window = _open("shadowbench view")
        self.judge = Judge()
        self.viewer = Viewer(device_of(self.window.ctx), state, techniques, self.judge)
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        _load_font(io)
        self.renderer = Renderer(self.window, self._heard)
        self.window.key_event_func = self._key
        self._file = "view.toml"
        glfw.set_drop_callback(self.window._window, self._dropped)
        self.canvas = Canvas(self.viewer)
        self.frame_ms, self._started = 0.0, time.perf_counter()
        self._quiet_from = 0.0  # time from which on frames without a change need not be drawn

    def run(self) -> None:
        """Show the window until it is closed."""
        try:
            while not self.window.is_closing:
                self.frame()
                # For an event, or an answer of the process that traces.
                while self.viewer.waiting and not self.window.is_closing and self._quiet_from < time.perf_counter():
                    glfw.wait_events_timeout(POLL_S)
        finally:
            self.judge.stop()
            self.viewer.release()
            self.renderer.shutdown()  # type: ignore[no-untyped-call]
            imgui.destroy_context()
            self.window.destroy()

    def frame(self) -> None:
        """One frame: bring the pictures up to date, draw the interface, take events."""
        start = time.perf_counter()
        io = imgui.get_io()
        io.delta_time, self._started = max(start - self._started, 1e-4), start
        # Not the modifiers of key events, which on X11 are those from before the event.
        io.add_key_event(imgui.Key.mod_shift, self._held(glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT))
        io.add_key_event(imgui.Key.mod_ctrl, self._held(glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL))
        imgui.new_frame()
        self._layout()
        imgui.render()
        self.viewer.step()  # after the input: what it changed is seen in this very frame
        self.window.use()
        self.window.ctx.clear(0.1, 0.1, 0.1)
        self.renderer.show(self.viewer.pictures)
        self.window.swap_buffers()
        self.frame_ms = (time.perf_counter() - start) * 1e3

    def _layout(self) -> None:
        width, height = self.window.size
        flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
        columns = (
            ("left", 0, LEFT, self._left),
            ("middle", LEFT, width - LEFT - RIGHT, self._middle),
            ("right", width - RIGHT, RIGHT, self._right),
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
        self._file = controls.files_panel(self.viewer, self._file)
        for title, panel in (("Scene", controls.scene_panel), ("Light", controls.light_panel)):
            if imgui.collapsing_header(title, imgui.TreeNodeFlags_.default_open):
                panel(self.viewer)

    def _middle(self) -> None:
        controls.view_panel(self.viewer)
        lines, room = controls.lines_below(self.viewer, self.frame_ms), imgui.get_content_region_avail()
        height = sum(imgui.calc_text_size(line, wrap_width=room.x).y + 4 for line in lines)
        imgui.begin_child("panes", (room.x, max(room.y - height - 8, 64)))
        self.canvas.draw()
        imgui.end_child()
        for line in lines:
            imgui.text_wrapped(line)

    def _right(self) -> None:
        controls.scores_panel(self.viewer)
        controls.techniques_panel(self.viewer)

    def _heard(self) -> None:
        self._quiet_from = time.perf_counter() + AFTER_EVENT_S

    def _dropped(self, _window: Any, files: Any, *_: Any) -> None:
        self._heard()
        self.viewer.attempt(lambda: controls.open_file(self.viewer, Path(files[0])))

    def _held(self, *keys: int) -> bool:
        return any(glfw.get_key(self.window._window, key) == glfw.PRESS for key in keys)

    def _key(self, key: int, action: int, modifiers: Any) -> None:
        self._heard()
        self.renderer.key_event(key, action, modifiers)  # type: ignore[no-untyped-call]


def _open(title: str) -> GlfwWindow:
    """A window with an OpenGL 4.1 context. Raises InputError without a display."""
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
