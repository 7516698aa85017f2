"""The panels of scene, camera, light and shading."""

import math
from dataclasses import fields, replace

from imgui_bundle import imgui

from shadowbench.gl.picture import Shading
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Light, Vec3, vec3
from shadowbench.scenes.triangles import LARGEST
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.lights import KINDS, PATHS, azimuth_elevation, sun_at, with_kind
from shadowbench.viewer.state import Origin, materials
from shadowbench.viewer.technique_panel import choice, number, tooltip

_LARGEST = {"ambient": 4.0, "diffuse": 4.0, "specular": 2.0, "shininess": 256.0}
_LEAST_SHININESS = 1.0
_SIZES = (128, 256, 512, 768, 1024, 2048)
_MOST_MATERIALS = 40


def scene_panel(viewer: Viewer) -> None:
    """Choice of scene, camera, size; undo and redo."""
    state = viewer.state
    source = state.scene.name if state.origin is None else state.origin.source
    name = choice("scene", source, builtin_names(), "a built-in scene; others by the command line")
    if name != source:
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
    help = "a directional light's map is orthographic, a spot's is a perspective"
    kind = choice("kind", state.light.kind, KINDS, help)
    light = with_kind(state.light, kind, state.scene)
    light = _edited(light)
    if light != state.light:
        viewer.change(replace(state, light=light), "light panel")
    travel = viewer.travel
    path = choice("travel", travel.path, PATHS, "a day: from east to west; a circle: about the vertical axis")
    if path != travel.path:
        travel.path, travel.turns = path, 0.0
    if path != "rest":
        travel.per_minute = number("turns a minute", travel.per_minute, 0.1, 60.0, decades=True)


def _edited(light: Light) -> Light:
    if light.kind == "directional":
        azimuth, elevation = azimuth_elevation(light)
        to = [_angle("azimuth", azimuth, -180, 180), _angle("elevation", elevation, -89, 89)]
        if to != [azimuth, elevation]:
            light = replace(light, direction=sun_at(*to))
        return replace(light, radius=_angle("radius", light.radius, 0, 45, "of the sun as seen from the ground; 0.27°"))
    light = replace(light, position=_vector("position", light.position))
    if light.kind != "point":
        direction = _vector("direction", light.direction)
        light = replace(light, direction=direction if any(direction) else light.direction)
    if light.kind == "spot":
        light = replace(light, angle=_angle("cone", light.angle, 1, 170, "full angle of the cone"))
    if light.kind == "rectangle":
        width, height = (max(number(name, side, 0.0, None), 0.0) for name, side in zip("wh", light.size, strict=True))
        return replace(light, size=(width, height) if min(width, height) > 0 else (0.0, 0.0))
    return replace(light, radius=max(number("radius", light.radius, 0.0, None), 0.0))


def shading_panel(viewer: Viewer) -> None:
    """Coefficients and colours of the picture, which no score depends on."""
    state = viewer.state
    shadows = imgui.checkbox("shadows", state.shadows)[1]
    shading = state.shading
    for field in fields(Shading):
        value = getattr(shading, field.name)
        if isinstance(value, tuple):
            value = _color(field.name.replace("_", " "), value)
        else:
            least = _LEAST_SHININESS if field.name == "shininess" else 0.0
            value = number(field.name, value, least, _LARGEST[field.name])
        shading = replace(shading, **{field.name: value})
    changed = replace(state, shading=shading, shadows=shadows)
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


def _angle(label: str, radians: float, low: float, high: float, help: str = "degrees") -> float:
    degrees = math.degrees(radians)
    changed, new = imgui.slider_float(label, degrees, low, high, "%.2f°", imgui.SliderFlags_.always_clamp)
    tooltip(help)
    return math.radians(round(new, 3)) if changed and math.isfinite(new) else radians


def _vector(label: str, values: Vec3) -> Vec3:
    changed, new = imgui.drag_float3(label, list(values), max(map(abs, values)) / 200 + 1e-4, 0.0, 0.0, "%.4g")
    allowed = changed and all(abs(value) <= LARGEST for value in new[:3])  # "nan" and "inf" can be typed
    return vec3([float(f"{value:.6g}") for value in new[:3]]) if allowed else values
