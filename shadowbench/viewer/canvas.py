"""The panes of the window, the light's handles over them, and what the mouse does there."""

import math
import re
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from imgui_bundle import imgui

from shadowbench.plugin.spec import Spec
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.lights import Handle, dome_radius, dragged, handles, is_far
from shadowbench.viewer.navigation import looked, orbited, panned, projected, zoomed
from shadowbench.viewer.panes import NEEDS_TRUTH, NUMBERS
from shadowbench.viewer.state import Source
from shadowbench.viewer.technique_panel import CUSTOM, DEFAULT, preset_of

REACH = 12.0  # pixels, from a handle or the wipe's line, that count as on it
GAP = 6.0  # pixels between panes
TURN = math.pi  # by which a drag over a whole pane turns
ZOOM = 1.12  # by a step of the wheel
_YELLOW, _DARK, _WHITE, _DIMMED = 0xFF33DDFF, 0xFF202020, 0xFFFFFFFF, 0xFF737373  # ABGR
_CORNERS = 48  # of the horizon's circle
_BUTTONS = imgui.ButtonFlags_
_ALL_BUTTONS = _BUTTONS.mouse_button_left | _BUTTONS.mouse_button_right | _BUTTONS.mouse_button_middle

Gesture = Literal["", "orbit", "pan", "look", "wipe", "light", "aim"]


@dataclass
class Pane:
    """A square of the window in which pictures are shown, from its top left corner."""

    x: float
    y: float
    side: float

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Place in the window as one in the picture."""
        return 2 * (x - self.x) / self.side - 1, 1 - 2 * (y - self.y) / self.side

    def point(self, place: tuple[float, float]) -> tuple[float, float]:
        """Place in the picture as one in the window, moved to the pane's border if outside."""
        x, y = (min(max(value, -0.98), 0.98) for value in place)
        return self.x + (x + 1) / 2 * self.side, self.y + (1 - y) / 2 * self.side


def squares(x: float, y: float, width: float, height: float, count: int) -> list[Pane]:
    """The largest equal squares, in rows of equal length, that fit into a rectangle."""

    def side(columns: int) -> float:
        rows = -(-count // columns)
        return min((width - GAP * (columns - 1)) / columns, (height - GAP * (rows - 1)) / rows)

    columns = max(range(1, count + 1), key=side)
    pane = max(side(columns), 16.0)
    step = pane + GAP
    return [Pane(x + index % columns * step, y + index // columns * step, pane) for index in range(count)]


class Canvas:
    """Shows the panes and turns drags into changes of the state."""

    def __init__(self, viewer: Viewer) -> None:
        self.viewer = viewer
        self.gesture: Gesture = ""
        self.panes: list[Pane] = []
        self._far = False
        self._last = (0.0, 0.0)

    def draw(self) -> None:
        """Show the panes in the rest of the window, and handle the mouse in them."""
        state, origin, room = self.viewer.state, imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        sources = state.sources
        count = len(sources) if state.layout == "side by side" else 1
        self.panes = squares(origin.x, origin.y, room.x, room.y, count)
        for index, pane in enumerate(self.panes):
            imgui.set_cursor_screen_pos((pane.x, pane.y))
            imgui.invisible_button(f"pane {index}", (pane.side, pane.side), _ALL_BUTTONS)
            if imgui.is_item_hovered():
                self._wheel()
            if imgui.is_item_activated():
                self._begin(pane)
            if imgui.is_item_active():
                self._drag(pane)
            if imgui.is_item_deactivated():
                self.gesture = ""
                self.viewer.rest()
        if state.layout == "wipe":
            self._show_wipe(self.panes[0], *sources)
        for pane, source in zip(self.panes, sources, strict=False):
            if state.layout != "wipe":
                self._show(pane, source, 0.0, 1.0)
            self._show_handles(pane)

    def _show(self, pane: Pane, source: Source, start: float, end: float) -> None:
        """Show a part of a source's picture, between two shares of its width."""
        draw_list, viewer = imgui.get_window_draw_list(), self.viewer
        left, right, bottom = pane.x + start * pane.side, pane.x + end * pane.side, pane.y + pane.side
        draw_list.add_rect_filled((left, pane.y), (right, bottom), 0xFF303030)
        failure = viewer.broken or dict(zip("AB", viewer.mask_failures(), strict=False)).get(source, "")
        dimmed = bool(failure) or (source == "truth" and viewer.judge.traced(viewer.state) is None)
        if source in viewer.pictures:
            color = _DIMMED if dimmed else _WHITE
            draw_list.add_image(NUMBERS[source], (left, pane.y), (right, bottom), (start, 1), (end, 0), color)
        self._write(left, pane.y, right - left, label(viewer, source))
        if failure:
            self._write(left, pane.y + 24, right - left, failure)

    def _show_wipe(self, pane: Pane, left: Source, right: Source) -> None:
        share = self.viewer.state.wipe
        self._show(pane, left, 0.0, share)
        self._show(pane, right, share, 1.0)
        x = pane.x + share * pane.side
        imgui.get_window_draw_list().add_line((x, pane.y), (x, pane.y + pane.side), _WHITE, 2.0)

    def _write(self, x: float, y: float, width: float, text: str) -> None:
        """Text on a dark ground, wrapped to a width."""
        if width < 40:
            return
        size = imgui.calc_text_size(text, wrap_width=width - 12)
        draw_list = imgui.get_window_draw_list()
        draw_list.add_rect_filled((x + 4, y + 4), (x + 10 + size.x, y + 8 + size.y), 0xC0000000)
        draw_list.add_text(imgui.get_font(), imgui.get_font_size(), (x + 7, y + 6), _WHITE, text, None, width - 12)

    def _show_handles(self, pane: Pane) -> None:
        """The light's handles; of a sun also its dome's horizon."""
        state, draw_list = self.viewer.state, imgui.get_window_draw_list()
        places = {handle: pane.point(place) for handle, place in self._places().items()}
        if state.light.kind == "directional":
            angles = np.linspace(0, 2 * math.pi, _CORNERS, endpoint=False)
            around = np.column_stack([np.cos(angles), np.zeros(_CORNERS), np.sin(angles)])
            corners = state.camera.target + dome_radius(state.camera) * around
            circle = [imgui.ImVec2(*pane.point(projected(state.camera, corner)[:2])) for corner in corners]
            draw_list.add_polyline(circle, 0x50FFFFFF, imgui.ImDrawFlags_.closed, 1.0)
        if "aim" in places:
            draw_list.add_line(places["light"], places["aim"], _YELLOW, 1.5)
            draw_list.add_circle(places["aim"], 6, _YELLOW, 0, 2.0)
        draw_list.add_circle_filled(places["light"], 7, _YELLOW)
        draw_list.add_circle(places["light"], 7, _DARK, 0, 1.5)

    def _places(self) -> dict[Handle, tuple[float, float]]:
        """The places of the light's handles in the picture; of one behind the camera, at its border."""
        state, found = self.viewer.state, {}
        for handle, point in handles(state.light, state.camera).items():
            x, y, depth = projected(state.camera, point)
            found[handle] = (x, y) if depth > 0 else (math.copysign(2.0, -x), math.copysign(2.0, -y))
        return found

    def _begin(self, pane: Pane) -> None:
        """What a press begins, by what lies under it and by the button."""
        mouse, state = imgui.get_mouse_pos(), self.viewer.state
        self._last = (mouse.x, mouse.y)
        handle = self._handle_at(pane, self._last)
        if imgui.is_mouse_down(imgui.MouseButton_.right):
            self.gesture = "look"
        elif imgui.is_mouse_down(imgui.MouseButton_.middle) or imgui.get_io().key_shift:
            self.gesture = "pan"
        elif handle is not None:
            self.gesture, self._far = handle, is_far(state.light, state.camera)
        elif state.layout == "wipe" and abs(mouse.x - pane.x - state.wipe * pane.side) <= REACH:
            self.gesture = "wipe"
        else:
            self.gesture = "orbit"

    def _handle_at(self, pane: Pane, mouse: tuple[float, float]) -> Handle | None:
        """The nearest handle of the light within reach; of several in one place, such as a corner, the light's own."""
        away = {handle: math.dist(pane.point(place), mouse) for handle, place in self._places().items()}
        nearest = min(away, key=lambda handle: away[handle])
        return nearest if away[nearest] <= REACH else None

    def _drag(self, pane: Pane) -> None:
        mouse, state = imgui.get_mouse_pos(), self.viewer.state
        x, y = (mouse.x - self._last[0]) / pane.side, (mouse.y - self._last[1]) / pane.side
        if (x, y) == (0, 0):
            return
        self._last = (mouse.x, mouse.y)
        match self.gesture:
            case "orbit":
                changed = replace(state, camera=orbited(state.camera, -x * TURN, y * TURN))
            case "look":
                changed = replace(state, camera=looked(state.camera, -x, -y))
            case "pan":
                changed = replace(state, camera=panned(state.camera, 2 * x, -2 * y))
            case "wipe":
                changed = replace(state, wipe=min(max((mouse.x - pane.x) / pane.side, 0.0), 1.0))
            case "light" | "aim":
                place = pane.place(mouse.x, mouse.y)
                changed = replace(state, light=dragged(state.light, state.camera, self.gesture, place, self._far))
            case _:
                return
        self.viewer.change(changed, f"drag {self.gesture}")

    def _wheel(self) -> None:
        wheel, state = imgui.get_io().mouse_wheel, self.viewer.state
        if wheel:
            self.viewer.change(replace(state, camera=zoomed(state.camera, ZOOM**-wheel)), "zoom")


def label(viewer: Viewer, source: Source) -> str:
    """What a pane shows; of which truth, if it shows one that is not the full one of this view."""
    state, traced = viewer.state, viewer.judge.traced(viewer.state)
    if source == "truth":
        text, missing = "truth", "of an earlier view" if source in viewer.pictures else "tracing"
    else:
        index = "AB".index(source)
        text = f"{source}: {_caption(state.specs[index]) if index < len(state.specs) else 'none: add B'}"
        if state.overlay not in NEEDS_TRUTH:
            return text
        missing = f"{state.overlay} follows the truth"
    if traced is None:
        return f"{text} ({missing})"
    return text if traced.final else f"{text} (coarse truth)"


def _caption(spec: Spec) -> str:
    """A spec by the name of its preset, if it is one, with spaces where lines may break."""
    preset = preset_of(spec)
    text = spec.text if preset in (DEFAULT, CUSTOM) else f"{spec.technique.name}:preset={preset}"
    return re.sub(r"([:,])", r"\1 ", text)
