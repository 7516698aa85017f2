"""The panels: scene, light, what is shown, what is saved, a technique's parameters, and scores."""

import math
import shlex
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from imgui_bundle import imgui
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.maps.biases import NoBias, Sum
from shadowbench.options import ViewSize
from shadowbench.plugin.base import Subject, Technique
from shadowbench.plugin.params import Component, SubjectParams, allowed, parse_value
from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, format_value, parse_spec, spec_of
from shadowbench.scenes.assumed import sun_direction
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import SUN_RADIUS, Light, LightShape
from shadowbench.scenes.sequences import BUILT_IN
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Vec3, vec3
from shadowbench.scores.metrics import METRICS, is_soft
from shadowbench.scores.motion import MOTION
from shadowbench.strict import Strict, explain
from shadowbench.studies.artefacts import Artefact, artefacts
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer.camera import sun_angles, with_kind
from shadowbench.viewer.drawing import Viewer
from shadowbench.viewer.state import Layout, Origin, Overlay, Source, holds_state, read_state, save_state

WIDTH = 100.0  # of a list above the pictures, in pixels
SIZES = [ViewSize.of(one) for one in (128, 256, 512, 768, 1024, 2048, "640x360", "1280x720", "1920x1080")]
HINTS = "drag: orbit;  Shift + drag: pan;  right drag: look;  Shift + right drag: light;  wheel: zoom"
OVERLAY_HELP: Mapping[Overlay, str] = {
    "picture": "the shaded picture alone",
    "error": "false shadow is orange, false light blue, dark facets of smooth surfaces purple; the root of soft errors",
    "mask": "the visibility that is scored: lit is white, shadow black",
}
HARD = ("iou", "acne", "leak", "contact", "terminator", "edge_px", "ssim")
SOFT = ("rmse", "rmse_pen", "bleed", "false_dark", "width", "hardening", "noise")
DIGITS = 6  # that a slider keeps: its numbers are float32
INT32 = 2**30  # numbers of this magnitude or more are texts: sliders take 32 bits, and no limits near them
SUM = "+"  # the name of the sum of two biases
DEFAULT, CUSTOM = "default", "custom"  # beside the names of presets
STILL = "none"  # beside the names of sequences
KEYS = imgui.Key.space, imgui.Key.left_arrow, imgui.Key.right_arrow
Model = TypeVar("Model", bound=Strict)


def choice(label: str, value: Any, names: Collection[Any], help: str = "") -> Any:
    """A combo box; the value that was chosen. names: as a mapping, with the help of each."""
    helps = names if isinstance(names, Mapping) else {}
    if imgui.begin_combo(label, str(value), imgui.ComboFlags_.height_largest):
        for name in names:
            if imgui.selectable(str(name), name == value)[0]:
                value = name
            tooltip(helps.get(name, ""))
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        imgui.end_combo()
    tooltip("\n".join(filter(None, (help, helps.get(value)))))
    return value


def slider(label: str, value: float, low: float | None, high: float | None, form: str = "%.6g", log: int = 0) -> float:
    """A slider, or without limits a number that is dragged; the value itself unless it was edited."""
    flags = imgui.SliderFlags_.always_clamp | log
    least, most = -LARGEST if low is None else low, min(LARGEST if high is None else high, LARGEST)
    if low is not None and high is not None:
        changed, new = imgui.slider_float(label, value, least, most, form, flags)
    else:
        changed, new = imgui.drag_float(label, value, max(abs(value), 1e-3) / 100, least, most, form, flags)
    return float(f"{new:.{DIGITS}g}") if changed and math.isfinite(new) else value  # "nan" can be typed


def tooltip(text: str) -> None:
    """What the last item says when the pointer rests on it."""
    if text and imgui.begin_item_tooltip():
        imgui.push_text_wrap_pos(360)
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def files_panel(viewer: Viewer, name: str) -> str:
    """Buttons that open and save a file; its name after this frame's edits."""
    if imgui.button("open"):
        viewer.attempt(lambda: open_file(viewer, Path(name)))
    tooltip("a scene, a mesh file or a saved state; or drop one onto the window")
    imgui.same_line()
    if imgui.button("save"):
        viewer.attempt(lambda: save(viewer, Path(name)))
    tooltip("scene, camera, light, techniques and layout, as a scene file for every command")
    imgui.same_line()
    return str(imgui.input_text("##name", name)[1])


def open_file(viewer: Viewer, file: Path) -> str:
    """Show a scene file, a mesh file or a saved state; returns what was assumed about it. Raises InputError."""
    if holds_state(file):
        viewer.change(read_state(file, viewer.techniques))
    else:
        viewer.open_scene(Origin(str(file)))
    return "; ".join([f"{file} is shown", *viewer.state.scene.notes])


def save(viewer: Viewer, file: Path) -> str:
    """Save what is shown as a scene file; returns how it is shown again. Raises InputError, as `save_state` does."""
    viewer.change(save_state(viewer.state, file))
    return f"{file}: saved; shadowbench view {shlex.quote(str(file))}, or as the scene of any command"


def scene_panel(viewer: Viewer) -> None:
    """Choice of scene, artefact, camera and size."""
    state = viewer.state
    source = "" if state.origin is None else state.origin.source
    shown = Path(source).name or state.scene.name
    name = choice("scene", shown, builtin_names(), f"{source}\na built-in scene; others by `open`".strip())
    if name != shown:
        viewer.attempt(lambda: viewer.open_scene(Origin(name)))
        return
    _artefact_choice(viewer)
    state = viewer.state
    cameras = {camera.name: camera for camera in state.scene.cameras}
    name = choice("camera", state.camera.name, list(cameras))
    if name != state.camera.name or imgui.button("reset camera"):
        viewer.change(replace(state, camera=cameras.get(name, state.scene.cameras[0])))
    size = choice("image", state.size, SIZES, "pixels of the image that is scored, along a side of a square")
    viewer.change(replace(viewer.state, size=size))


def _artefact_choice(viewer: Viewer) -> None:
    """Choice of an artefact of the gallery."""
    origin = viewer.state.origin
    file = None if origin is None else origin.file.resolve()
    shown = next((artefact.name for artefact in artefacts() if artefact.file.resolve() == file), "artefact")
    helps = {artefact.name: f"{artefact.chapter}. {artefact.see}\n{artefact.question}" for artefact in artefacts()}
    imgui.set_next_item_width(-1)  # names are long: there is no label beside them
    name = choice("##artefact", shown, helps, "artefacts of the gallery: A shows one, B is its cure")
    for artefact in artefacts() if name != shown else ():
        if artefact.name == name:
            viewer.attempt(partial(show_artefact, viewer, artefact))


def show_artefact(viewer: Viewer, artefact: Artefact) -> str:
    """Show an artefact's scene with the broken setting as A and the cured one as B."""
    specs = tuple(parse_spec(text, viewer.techniques) for text in (artefact.broken, artefact.cured))
    viewer.open_scene(Origin(str(artefact.file)), specs)
    return artefact.see.strip()


def light_panel(viewer: Viewer) -> None:
    """Choice of light, its kind, place and size."""
    state = viewer.state
    lights = {light.name: light for light in state.scene.lights}
    name = choice("light", state.light.name, list(lights))
    if name != state.light.name or imgui.button("reset light"):
        viewer.change(replace(state, light=lights.get(name, state.scene.lights[0])))
        return
    kind = choice("kind", state.light.kind, get_args(LightShape))
    viewer.change(replace(state, light=edited_light(with_kind(state.light, kind, state.scene))))


def edited_light(light: Light) -> Light:
    """The light after this frame's edits."""
    if light.kind == "directional":
        before = sun_angles(light)
        azimuth = _degrees("azimuth", before[0], -180, 180, "from north (−z) clockwise as seen from above")
        elevation = _degrees("elevation", before[1], -89, 89, "above the horizon")
        sun = f"{math.degrees(SUN_RADIUS):.2f}°"
        radius = _degrees("radius", light.radius, 0, 45, f"angular radius: 0 for hard shadows; the sun's is {sun}")
        moved = (azimuth, elevation) != before
        return replace(light, radius=radius, direction=sun_direction(azimuth, elevation) if moved else light.direction)
    light = replace(light, position=_vector("position", light.position, "x, y and z in metres; y is up"))
    if light.kind != "point":
        direction = _vector("direction", light.direction, "in which it shines; of any length")
        light = replace(light, direction=direction if any(direction) else light.direction)
    if light.kind == "spot":
        light = replace(light, angle=_degrees("cone", light.angle, 1, 170, "full angle of the cone"))
    if light.kind == "rectangle":
        width, height = (_metres(name, side) for name, side in zip(("width", "height"), light.size, strict=True))
        return replace(light, size=(width, height) if min(width, height) > 0 else (0.0, 0.0))
    return replace(light, radius=_metres("radius", light.radius))


def _degrees(label: str, radians: float, low: float, high: float, help: str) -> float:
    degrees = math.degrees(radians)
    new = slider(label, degrees, low, high, "%.2f°")
    tooltip(help)
    return math.radians(new) if new != degrees else radians


def _metres(label: str, value: float) -> float:
    value = max(slider(label, value, 0.0, None), 0.0)
    tooltip("metres: 0 for hard shadows; drag, or Ctrl+click to type")
    return value


def _vector(label: str, values: Vec3, help: str) -> Vec3:
    changed, new = imgui.drag_float3(label, list(values), max(map(abs, values)) / 200 + 1e-4, 0.0, 0.0, "%.4g")
    tooltip(f"{help}; drag, or Ctrl+click to type")
    valid = changed and all(abs(value) <= LARGEST for value in new[:3])  # "nan" and "inf" can be typed
    return vec3([float(f"{value:.{DIGITS}g}") for value in new[:3]]) if valid else values


def view_panel(viewer: Viewer) -> None:
    """Choice of layout, pictures and overlay."""
    state = viewer.state
    chosen = {"layout": _inline_choice("layout", state.layout, get_args(Layout))}
    if state.layout == "wipe":
        chosen["left"] = _inline_choice("left", state.left, get_args(Source))
        chosen["right"] = _inline_choice("right", state.right, get_args(Source))
    chosen["overlay"] = _inline_choice("show", state.overlay, OVERLAY_HELP)
    viewer.change(replace(state, **chosen))
    _sequence_choice(viewer)


def _sequence_choice(viewer: Viewer) -> None:
    """Choice of a sequence and its frame, and whether it plays."""
    state = viewer.state
    motions = {motion.name: motion.about for motion in (*state.scene.motions, *BUILT_IN.values())}
    name = _inline_choice("sequence", state.sequence or STILL, {STILL: "the view alone"} | motions)
    if name != (state.sequence or STILL):
        viewer.attempt(lambda: viewer.show_sequence("" if name == STILL else name))
    elif state.sequence and not viewer.broken:
        last, typing = len(state.frames) - 1, imgui.get_io().want_text_input
        space, left, right = (not typing and imgui.is_key_pressed(key) for key in KEYS)
        if imgui.button("pause" if viewer.playing else "play") or space:
            viewer.playing = not viewer.playing
        imgui.same_line()
        imgui.set_next_item_width(WIDTH)
        frame = imgui.slider_int("##frame", state.frame, 0, last, "frame %d", imgui.SliderFlags_.always_clamp)[1]
        tooltip("space plays and pauses; ← and → step")
        if frame != state.frame or left or right:
            viewer.playing = False
            viewer.to_frame(frame + right - left)
        return
    imgui.new_line()


def _inline_choice(label: str, name: str, names: Collection[str]) -> Any:
    """A list with its label before it."""
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(label)
    imgui.same_line()
    imgui.set_next_item_width(WIDTH)
    chosen = choice(f"##{label}", name, names)
    imgui.same_line(0.0, 14.0)
    return chosen


def lines_below(viewer: Viewer, frame_ms: float) -> list[str]:
    """The lines below the pictures: the meaning of the colours, and a message or what the mouse does."""
    overlay = viewer.state.overlay
    legend = [] if overlay == "picture" else [f"{overlay}: {OVERLAY_HELP[overlay]}"]
    return [*legend, viewer.broken or viewer.message or f"{frame_ms:.0f} ms a frame;  {HINTS}"]


def scores_panel(viewer: Viewer) -> None:
    """The scores of A and B, grey while they are of another view or of other masks."""
    scores = [viewer.judge.scores.get(spec.full_text, {}) for spec in viewer.state.specs]
    soft = any(is_soft(values) for values in scores if values)
    color = imgui.Col_.text if viewer.fresh else imgui.Col_.text_disabled
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(color))
    flags = imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.row_bg
    if imgui.begin_table("scores", len(scores) + 1, flags):
        for title in ("score", *"AB"[: len(scores)]):
            imgui.table_setup_column(title)
        imgui.table_headers_row()
        moving = [MOTION["flicker"]] if viewer.state.sequence else []
        for metric in (*moving, *(METRICS[name] for name in (*(SOFT if soft else ()), *HARD))):
            if not metric.suits(soft):
                continue
            imgui.table_next_column()
            imgui.text_unformatted(metric.label or metric.name)
            tooltip(f"{metric.help} Better: {metric.better}.")
            for value in (each.get(metric.name) for each in scores):
                imgui.table_next_column()
                imgui.text_unformatted("–" if value is None else f"{value:.5f}")
        imgui.end_table()
    imgui.pop_style_color()
    imgui.text_wrapped(status(viewer))


def status(viewer: Viewer) -> str:
    """One line: moving, tracing, what the scores are of, or why there are none."""
    drawn, size, judge = viewer.drawn, viewer.state.size, viewer.judge
    if viewer.moving and drawn is not None and drawn.size < size:
        return f"{size} drawn at {drawn.size} while moving: a software renderer"
    if viewer.moving:
        return "moving: scores follow at rest"
    if viewer.broken:
        return "nothing is drawn, and nothing scored"
    if not viewer.fresh:
        failed = viewer.judged and judge.failure
        return f"not scored: {judge.failure}" if failed else "tracing the truth of this view …"
    masks = zip("AB", viewer.state.specs, viewer.failures, strict=False)
    without = [f"; {name} has no mask: {why}" for name, spec, why in masks if spec.full_text not in judge.scores]
    return f"scored at {size} against the full truth{''.join(without)}"


def techniques_panel(viewer: Viewer) -> None:
    """The techniques A and B with all their parameters."""
    for index, source in enumerate("AB"[: len(viewer.state.specs)]):
        imgui.push_id(source)
        if imgui.collapsing_header(source, imgui.TreeNodeFlags_.default_open):
            try:
                spec = edited_spec(viewer.state.specs[index], viewer.techniques)
                viewer.change(viewer.state.with_spec(index, spec))
            except InputError as error:
                viewer.message = str(error)
        imgui.pop_id()
    specs = viewer.state.specs
    if imgui.button("add B" if len(specs) == 1 else "remove B"):
        viewer.change(replace(viewer.state, specs=specs * 2 if len(specs) == 1 else specs[:1]))


def edited_spec(spec: Spec, techniques: Techniques) -> Spec:
    """The spec after this frame's edits. Raises InputError for a value that is not allowed."""
    name = choice("technique", spec.technique.name, {name: first_line(techniques[name]) for name in sorted(techniques)})
    if name != spec.technique.name:
        return spec_of(techniques[name], (), name)
    if type(spec.params).model_fields:
        named, now = presets(spec.technique), preset_of(spec)
        helps = {name: preset.text.partition(":")[2].replace(",", ", ") for name, preset in named.items()}
        chosen = choice("preset", now, helps, "all parameters at once")
        if chosen not in (now, CUSTOM):
            return named[chosen]
    params = _edited(spec.params)
    return spec if params is spec.params else replace(spec, params=params)


def _edited(model: Model) -> Model:
    """Parameters after this frame's edits; the same object if there were none."""
    for key, info in type(model).model_fields.items():
        value = getattr(model, key)
        shown = name_of(value)
        new = _input(key, info, shown, choices_of(info, value))
        if new != shown:
            return with_value(model, key, new)
        inner = value.params if isinstance(value, Spec) else value
        if isinstance(inner, SubjectParams | Component) and type(inner).model_fields:
            imgui.indent()
            imgui.push_id(key)
            changed = _edited(inner)
            imgui.pop_id()
            imgui.unindent()
            if changed is not inner:
                return with_inner(model, key, changed)
    return model


def name_of(value: Any) -> Any:
    """What is shown of a value: of a component or a spec its name."""
    if isinstance(value, Component):
        return SUM if isinstance(value, Sum) else value.name
    return value.technique.name if isinstance(value, Spec) else value


def choices_of(info: FieldInfo, value: Any) -> Mapping[Any, str]:
    """What a parameter is chosen from: components, techniques or words, each with its help; empty if it is entered."""
    if isinstance(value, Component):
        family = type(value).family()
        names = {name: first_line(component) for name, component in family.table.items()}
        return names | ({SUM: "two that act together"} if issubclass(Sum, family) else {})
    if isinstance(value, Spec):
        return {each.name: first_line(each) for each in own_techniques() if not each.catalogue.soft_only}
    return dict.fromkeys(get_args(info.annotation), "") if get_origin(info.annotation) is Literal else {}


def _input(key: str, info: FieldInfo, value: Any, choices: Mapping[Any, str]) -> Any:
    """Draw the widget of a parameter and return its value."""
    help = " ".join(filter(None, (info.description or key, f"({allowed(info)})" if allowed(info) else "")))
    if choices:
        return choice(key, value, choices, help)
    log = imgui.SliderFlags_.logarithmic if isinstance(value, int | float) and _spans_decades(info, value) else 0
    if isinstance(value, bool):
        value = imgui.checkbox(key, value)[1]
    elif isinstance(value, int) and abs(value) < INT32:
        return _whole(key, info, value, help, log)
    elif isinstance(value, float) and abs(value) < INT32:
        value = slider(key, value, *limits(info), log=log)
    else:  # every type without a widget of its own: as in a spec
        changed, text = imgui.input_text(key, format_value(value), imgui.InputTextFlags_.enter_returns_true)
        value = parse_value(text) if changed else value
    tooltip(help)
    return value


def _whole(key: str, info: FieldInfo, value: int, help: str, log: int) -> int:
    """A number of the limits, or one that is dragged; of one that spans decades also buttons for half and double."""
    low, high = limits(info)
    least = max(int(-INT32 if low is None else low), 1 - INT32)
    most = min(int(INT32 if high is None else high), INT32 - 1)
    flags = imgui.SliderFlags_.always_clamp | log
    if low is None or high is None:
        value = int(imgui.drag_int(key, value, 0.1, least, most, "%d", flags)[1])
    else:
        value = int(imgui.slider_int(key, value, least, most, "%d", flags)[1])
    tooltip(help)
    for text, factor in (("½", 0.5), ("×2", 2.0)) if log else ():
        imgui.same_line()
        if imgui.small_button(f"{text}##{key}"):
            value = min(max(int(value * factor), least), most)
    return value


def _spans_decades(info: FieldInfo, value: float) -> bool:
    """Whether a number's range, or the place of its default in it, asks for a logarithmic slider."""
    low, high = limits(info)
    default = info.default if isinstance(info.default, int | float) else value
    return low is not None and high is not None and (high - low > 100 or abs(default) < high / 50)


def limits(info: FieldInfo) -> tuple[float | None, float | None]:
    """The limits that a number may reach, None if there is none: of an open one, a millionth of it inside."""
    ends: dict[str, float] = {}
    for constraint in info.metadata:
        for name, end, inside in (("ge", "low", 0.0), ("gt", "low", 1e-6), ("le", "high", 0.0), ("lt", "high", -1e-6)):
            limit = getattr(constraint, name, None)
            if limit is not None:
                ends[end] = limit + (abs(limit) or 1.0) * inside
    return ends.get("low"), ends.get("high")


def with_value(model: Model, key: str, value: Any) -> Model:
    """A copy of parameters with another value from a widget. Raises InputError for one that is not allowed.

    value: of a component or a spec its name, which gives it its defaults; a sum begins with the bias that was there.
    """
    if value == SUM:
        old = getattr(model, key)
        value = old if isinstance(old, Sum) else Sum(first=old, second=NoBias())
    try:
        return type(model)(**dict(model) | {key: value})
    except ValidationError as error:
        raise explain(f"{key}={format_value(value)}", error) from None


def with_inner(model: Model, key: str, inner: Any) -> Model:
    """A copy of parameters with other parameters of the component or the spec that one of them is."""
    old = getattr(model, key)
    return with_value(model, key, replace(old, params=inner) if isinstance(old, Spec) else inner)


@cache
def presets(technique: type[Technique]) -> Mapping[str, Spec]:
    """A technique's defaults, as the preset DEFAULT unless a parameter has none, and its presets."""
    named = {}
    for name in (DEFAULT, *technique.presets):
        with suppress(InputError):  # a parameter that must be given
            named[name] = spec_of(technique, (() if name == DEFAULT else (("preset", name),)), technique.name)
    return named


def preset_of(spec: Spec) -> str:
    """The preset whose parameters a spec has; CUSTOM if there is none."""
    return next((name for name, preset in presets(spec.technique).items() if preset.params == spec.params), CUSTOM)


def first_line(subject: type[Subject | Component]) -> str:
    """The first line of a docstring; empty if there is none."""
    return (subject.__doc__ or "").partition("\n")[0]
