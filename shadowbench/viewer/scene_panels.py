"""The panels of scene, camera, light and shading."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

from imgui_bundle import imgui

from shadowbench.gl.picture import Shading
from shadowbench.scenes.geometry import LARGEST
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import SUN_RADIUS, Light, LightShape
from shadowbench.scenes.vectors import Vec3, vec3
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.lights import Path as LightPath
from shadowbench.viewer.lights import azimuth_elevation, sun_at, with_kind
from shadowbench.viewer.state import Origin, materials
from shadowbench.viewer.technique_panel import choice, number, tooltip

KIND_HELP: Mapping[LightShape, str] = {
    "directional": "a sun: its shadow map is orthographic",
    "spot": "a lamp with a cone: its shadow map is a perspective",
    "point": "a lamp to all sides: its shadow map is a cube",
    "disc": "a disc that shines to one side: soft shadows",
    "rectangle": "a rectangle that shines to one side: soft shadows",
}
PATH_HELP: Mapping[LightPath, str] = {
    "rest": "the light stays where it is",
    "day": "from east (+x) to west, then anew",
    "circle": "about the vertical axis",
}
SHADING_LABELS = {
    "light_color": "light",
    "sky": "ambient from above",
    "ground": "ambient from below",
    "horizon": "background, horizon",
    "zenith": "background, zenith",
}
_SUN = f"{math.degrees(SUN_RADIUS):.2f}°"
_LARGEST = {"ambient": 4.0, "diffuse": 4.0, "specular": 2.0, "shininess": 256.0}
_LEAST_SHININESS = 1.0
_SIZES = (128, 256, 512, 768, 1024, 2048)
_MOST_MATERIALS = 40


def scene_panel(viewer: Viewer) -> None:
    """Choice of scene, camera, size; undo and redo."""
    state = viewer.state
    source = "" if state.origin is None else state.origin.source
    shown = Path(source).name or state.scene.name
    name = choice("scene", shown, builtin_names(), f"{source}\na built-in scene; others by the command line".strip())
    if name != shown:
        viewer.attempt(lambda: viewer.open_scene(Origin(name)))
        return
    camera = choice("camera", state.camera.name, [one.name for one in state.scene.cameras])
    if camera != state.camera.name or imgui.button("reset camera"):
        chosen = next((one for one in state.scene.cameras if one.name == camera), state.scene.cameras[0])
        viewer.change(replace(state, camera=chosen))
    imgui.same_line()
    if imgui.button("undo"):
        viewer.undo()
    imgui.same_line()
    if imgui.button("redo"):
        viewer.redo()
    size = choice("image", viewer.state.size, _SIZES, "pixels along a side of the image that is scored")
    viewer.change(replace(viewer.state, size=size))


def light_panel(viewer: Viewer) -> None:
    """Choice of light, its kind, place and size, and its travel."""
    state = viewer.state
    name = choice("light", state.light.name, [one.name for one in state.scene.lights])
    if name != state.light.name:
        viewer.change(replace(state, light=next(one for one in state.scene.lights if one.name == name)))
        return
    kind = choice("kind", state.light.kind, KIND_HELP)
    light = with_kind(state.light, kind, state.scene)
    light = _edited(light)
    if light != state.light:
        viewer.change(replace(state, light=light), "light panel")
    travel = viewer.travel
    path = choice("travel", travel.path, PATH_HELP)
    if path != travel.path:
        travel.path, travel.turns = path, 0.0
    if path != "rest":
        travel.per_minute = number("turns a minute", travel.per_minute, 0.1, 60.0, decades=True)
    if imgui.button("reset light"):
        travel.path = "rest"
        own = next((one for one in state.scene.lights if one.name == state.light.name), state.scene.lights[0])
        viewer.change(replace(viewer.state, light=own))


def _edited(light: Light) -> Light:
    if light.kind == "directional":
        azimuth, elevation = azimuth_elevation(light)
        to = [
            _angle("azimuth", azimuth, -180, 180, "of the sun, about the vertical axis from +x towards −z"),
            _angle("elevation", elevation, -89, 89, "of the sun above the horizon"),
        ]
        if to != [azimuth, elevation]:
            light = replace(light, direction=sun_at(*to))
        return replace(
            light,
            radius=_angle("radius", light.radius, 0, 45, f"angular radius: 0 for hard shadows; the sun's is {_SUN}"),
        )
    light = replace(light, position=_vector("position", light.position, "x, y and z in metres; y is up"))
    if light.kind != "point":
        direction = _vector("direction", light.direction, "in which it shines; of any length")
        light = replace(light, direction=direction if any(direction) else light.direction)
    if light.kind == "spot":
        light = replace(light, angle=_angle("cone", light.angle, 1, 170, "full angle of the cone"))
    if light.kind == "rectangle":
        width, height = (_metres(name, side) for name, side in zip(("width", "height"), light.size, strict=True))
        return replace(light, size=(width, height) if min(width, height) > 0 else (0.0, 0.0))
    return replace(light, radius=_metres("radius", light.radius))


def shading_panel(viewer: Viewer) -> None:
    """Coefficients and colours of the picture, which no score depends on."""
    state = viewer.state
    shadows = imgui.checkbox("shadows", state.shadows)[1]
    shading = state.shading
    for field in fields(Shading):
        value = getattr(shading, field.name)
        if isinstance(value, tuple):
            value = _color(f"{SHADING_LABELS[field.name]}##{field.name}", value)
        else:
            least = _LEAST_SHININESS if field.name == "shininess" else 0.0
            value = number(field.name, value, least, _LARGEST[field.name])
        shading = replace(shading, **{field.name: value})
    changed = replace(state, shading=shading, shadows=shadows)
    imgui.text_disabled("materials")
    own, shown = materials(state.scene), dict(state.colors)
    for name, color in list(own.items())[:_MOST_MATERIALS]:
        new = _color(f"{name}##material", shown.get(name, color))
        if new != shown.get(name, color):
            changed = changed.with_color(name, new)
    viewer.change(changed, "shading")


def _color(label: str, color: Vec3) -> Vec3:
    """An editor of a linear colour, shown as sRGB."""
    flags = imgui.ColorEditFlags_.no_inputs
    changed, shown = imgui.color_edit3(label, [_srgb(channel) for channel in color], flags)
    return vec3([_linear(channel) for channel in shown[:3]]) if changed else color


def _srgb(x: float) -> float:
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def _linear(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return round(x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4, 5)


def _angle(label: str, radians: float, low: float, high: float, help: str) -> float:
    degrees = math.degrees(radians)
    changed, new = imgui.slider_float(label, degrees, low, high, "%.2f°", imgui.SliderFlags_.always_clamp)
    tooltip(help)
    return math.radians(round(new, 3)) if changed and math.isfinite(new) else radians


def _metres(label: str, value: float) -> float:
    value = max(number(label, value, 0.0, None), 0.0)
    tooltip("metres: 0 for hard shadows; drag, or Ctrl+click to type")
    return value


def _vector(label: str, values: Vec3, help: str) -> Vec3:
    changed, new = imgui.drag_float3(label, list(values), max(map(abs, values)) / 200 + 1e-4, 0.0, 0.0, "%.4g")
    tooltip(f"{help}; drag, or Ctrl+click to type")
    allowed = changed and all(abs(value) <= LARGEST for value in new[:3])  # "nan" and "inf" can be typed
    return vec3([float(f"{value:.6g}") for value in new[:3]]) if allowed else values
