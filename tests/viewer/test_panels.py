"""What the panels say, and the light's handles under the pointer, without a window."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any, get_args

import pytest

from shadowbench.gl.picture import Shading
from shadowbench.scenes.model import Camera, Light, LightShape
from shadowbench.viewer.canvas import Canvas, Pane
from shadowbench.viewer.lights import LightPath
from shadowbench.viewer.result_panels import better
from shadowbench.viewer.scene_panels import KIND_HELP, PATH_HELP, SHADING_LABELS
from shadowbench.viewer.state import OVERLAYS
from shadowbench.viewer.view_panel import OVERLAY_HELP

PANE = Pane(0.0, 0.0, 400.0)
CAMERA = Camera("camera", (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 0.8)


@pytest.mark.parametrize(
    ("values", "direction", "expected"),
    [
        ([0.9, 0.8], "higher", [True, False]),
        ([0.9, 0.8], "lower", [False, True]),
        ([-0.1, 0.2], "near 0", [True, False]),
        ([0.7, 1.1], "near 1", [False, True]),
        ([0.9, 0.9000001], "higher", [False, False]),  # the same number as it is shown
        ([0.9, None], "higher", [False, False]),
        ([0.9], "higher", [False]),
    ],
)
def test_the_better_score_is_marked(values: list[float | None], direction: str, expected: list[bool]) -> None:
    assert better(values, direction) == expected


def test_every_overlay_kind_of_light_and_colour_of_the_shading_is_explained() -> None:
    assert tuple(OVERLAY_HELP) == OVERLAYS and set(KIND_HELP) == set(get_args(LightShape))
    assert set(PATH_HELP) == set(get_args(LightPath))
    assert list(SHADING_LABELS) == [one.name for one in fields(Shading) if isinstance(one.default, tuple)]
    assert all((*OVERLAY_HELP.values(), *KIND_HELP.values(), *SHADING_LABELS.values()))


def test_a_button_is_pressed_where_the_last_motion_ended() -> None:
    """GLFW's place of a press is the pointer's when the event is read, which after a slow frame is another."""
    pytest.importorskip("glfw")
    from shadowbench.viewer.window import Renderer

    heard: list[tuple[str, tuple[object, ...]]] = []
    io = SimpleNamespace(
        add_mouse_pos_event=lambda *at: heard.append(("at", at)),
        add_mouse_button_event=lambda *what: heard.append(("button", what)),
    )
    window, renderer = SimpleNamespace(), Renderer.__new__(Renderer)
    renderer.io, renderer._heard = io, lambda: None
    renderer.listen(window)
    window.mouse_position_event_func(10, 20, 0, 0)
    window.mouse_press_event_func(70, 80, 1)
    assert heard == [("at", (10, 20)), ("button", (0, True))]


@pytest.mark.parametrize(
    ("direction", "place", "expected"),
    [
        ((-1.0, 1.0, 0.0), (-1.0, 1.0), "light"),  # outside the picture it is taken before its aim in the same corner
        ((50.0, -50.0, 0.0), (0.0, 0.0), "aim"),  # of a light that shines on the camera's target
        ((50.0, -50.0, 0.0), (0.5, 0.5), None),
    ],
)
def test_a_handle_is_taken_where_it_is_shown(direction: Any, place: tuple[float, float], expected: str | None) -> None:
    lamp = Light("lamp", "spot", direction=direction, position=(-50.0, 50.0, 0.0), angle=1.0)
    viewer: Any = SimpleNamespace(state=SimpleNamespace(light=lamp, camera=CAMERA))
    assert Canvas(viewer)._handle_at(PANE, PANE.point(place)) == expected
