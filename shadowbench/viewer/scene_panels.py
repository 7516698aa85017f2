"""The panels of scene, camera, light and shading."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import imgui

from shadowbench.engines.external_mask import decode_srgb
from shadowbench.gl.picture import Shading
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import SUN_RADIUS, Light, LightKind, LightShape
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Vec3, vec3
from shadowbench.studies.artefacts import Artefact, artefacts
from shadowbench.viewer.app import Viewer
from shadowbench.viewer.lights import LightPath, azimuth_elevation, with_kind
from shadowbench.viewer.state import Origin, materials
from shadowbench.viewer.technique_panel import choice, number, tooltip

PROJECTIONS: Mapping[str, tuple[LightShape, str]] = {
    "orthographic": ("directional", "parallel rays, as of a sun: the shadow map's texels are of one size"),
    "perspective": ("spot", "rays from a place, as of a lamp with a cone: the shadow map's texels grow with distance"),
}
KIND_HELP: Mapping[LightShape, str] = {
    "directional": "a sun: its shadow map is orthographic",
    "spot": "a lamp with a cone: its shadow map is a perspective",
    "point": "a lamp to all sides: its shadow map is a cube",
    "disc": "a disc that shines to one side: soft shadows",
    "rectangle": "a rectangle that shines to one side: soft shadows",
}
SHADING_LABELS = {
    "light_color": "light",
    "sky": "ambient from above",
    "ground": "ambient from below",
    "horizon": "background, horizon",
    "zenith": "background, zenith",
}
_SHADING_LIMITS = {"ambient": (0.0, 4.0), "diffuse": (0.0, 4.0), "specular": (0.0, 2.0), "shininess": (1.0, 256.0)}
PATH_HELP: Mapping[LightPath, str] = {
    "rest": "the light stays where it is",
    "day": "from east (+x) over the south to the west, then anew",
    "circle": "about the vertical axis",
}
_SUN = f"{math.degrees(SUN_RADIUS):.2f}°"
_SPEEDS = (0.1, 60.0)  # turns a minute of a travelling light
_MOST_MATERIALS = 40
_SIZES = (128, 256, 512, 768, 1024, 2048)


def scene_panel(viewer: Viewer) -> None:
    """Choice of scene, camera, size; undo and redo."""
    state = viewer.state
    source = "" if state.origin is None else state.origin.source
    shown = Path(source).name or state.scene.name
    name = choice("scene", shown, builtin_names(), f"{source}\na built-in scene; others by `open…`".strip())
    if name != shown:
        viewer.attempt(lambda: viewer.open_scene(Origin(name)))
        return
    _artefact(viewer)
    cameras = {one.name: one for one in viewer.state.scene.cameras}
    camera = choice("camera", state.camera.name, cameras)
    if camera != state.camera.name or imgui.button("reset camera"):
        viewer.change(replace(state, camera=cameras.get(camera, state.scene.cameras[0])))
    imgui.same_line()
    if imgui.button("undo"):
        viewer.undo()
    imgui.same_line()
    if imgui.button("redo"):
        viewer.redo()
    size = choice("image", viewer.state.size, _SIZES, "pixels along a side of the image that is scored")
    viewer.change(replace(viewer.state, size=size))


def _artefact(viewer: Viewer) -> None:
    """Choice of an artefact of the gallery."""
    origin = viewer.state.origin
    file = None if origin is None else origin.file.resolve()
    shown = next((one.name for one in artefacts() if one.file.resolve() == file), "artefact")
    texts = {one.name: f"{one.chapter}. {one.see}\n{one.question}" for one in artefacts()}
    imgui.set_next_item_width(-1)  # names are long: there is no label beside them
    name = choice("##artefact", shown, texts, "artefacts of the gallery: A shows one, B is its cure")
    for one in artefacts() if name != shown else ():
        if one.name == name:
            viewer.attempt(partial(show_artefact, viewer, one))


def show_artefact(viewer: Viewer, artefact: Artefact) -> str:
    """Show an artefact's scene with the broken setting as A and the cured one as B."""
    specs = tuple(parse_spec(text, viewer.techniques) for text in (artefact.broken, artefact.cured))
    viewer.open_scene(Origin(str(artefact.file)), specs)
    return artefact.see.strip()


def light_panel(viewer: Viewer) -> None:
    """Choice of light, its kind, place and size, and its travel."""
    state = viewer.state
    lights = {one.name: one for one in state.scene.lights}
    name = choice("light", state.light.name, lights)
    if name != state.light.name:
        viewer.change(replace(state, light=lights[name]))
        return
    kind = _projection(choice("kind", state.light.kind, KIND_HELP), state.light.hard_kind)
    viewer.change(replace(state, light=_edited(with_kind(state.light, kind, state.scene))), "light panel")
    viewer.travel = choice("travel", viewer.travel, PATH_HELP)
    if viewer.travel != "rest":
        viewer.turns_a_minute = number("turns a minute", viewer.turns_a_minute, *_SPEEDS, decades=True)
    if imgui.button("reset light"):
        viewer.travel = "rest"
        viewer.change(replace(viewer.state, light=lights.get(state.light.name, state.scene.lights[0])))


def _projection(kind: LightShape, shown: LightKind) -> LightShape:
    """A switch between the projections of a light's shadow map, off for a point light's cube; the kind after it."""
    for name, (other, help) in PROJECTIONS.items():
        if imgui.radio_button(name, shown == other) and shown != other:
            kind = other
        tooltip(help)
        imgui.same_line()
    imgui.new_line()
    return kind


def _edited(light: Light) -> Light:
    if light.kind == "directional":
        return _edited_sun(light)
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


def _edited_sun(light: Light) -> Light:
    before = azimuth_elevation(light)
    azimuth = _angle("azimuth", before[0], -180, 180, "of the sun, from north (−z) clockwise as seen from above")
    elevation = _angle("elevation", before[1], -89, 89, "of the sun above the horizon")
    radius = _angle("radius", light.radius, 0, 45, f"angular radius: 0 for hard shadows; the sun's is {_SUN}")
    moved = (azimuth, elevation) != before
    return replace(light, radius=radius, direction=sun_direction(azimuth, elevation) if moved else light.direction)


def shading_panel(viewer: Viewer) -> None:
    """Coefficients and colours of the picture, which no score depends on."""
    state = viewer.state
    shadows = imgui.checkbox("shadows", state.shadows)[1]
    values: dict[str, Any] = {}
    for field in fields(Shading):
        name, value = field.name, getattr(state.shading, field.name)
        label = SHADING_LABELS.get(name)
        values[name] = _color(f"{label}##{name}", value) if label else number(name, value, *_SHADING_LIMITS[name])
    imgui.text_disabled("materials")
    colors = dict(state.colors)
    for name, own in list(materials(state.scene).items())[:_MOST_MATERIALS]:
        shown = colors.get(name, own)
        chosen = _color(f"{name}##material", shown)
        if chosen != shown:
            colors[name] = chosen
    shading = Shading(**values)
    viewer.change(replace(state, shading=shading, colors=tuple(colors.items()), shadows=shadows), "shading")


def _color(label: str, color: Vec3) -> Vec3:
    """An editor of a linear colour, shown as sRGB."""
    shown = [12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055 for x in color]
    changed, new = imgui.color_edit3(label, shown, imgui.ColorEditFlags_.no_inputs)
    return vec3(decode_srgb(np.clip(new[:3], 0, 1)).round(5)) if changed else color


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
