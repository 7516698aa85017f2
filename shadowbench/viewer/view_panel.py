"""What is shown: its choice above the pictures, its meaning below them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from imgui_bundle import imgui

from shadowbench.viewer.app import Viewer
from shadowbench.viewer.state import Layout, Overlay, Source, ViewerState
from shadowbench.viewer.technique_panel import choice

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
