"""The contract of every registered technique, whatever it computes: masks, memory, passes and shader components."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations_with_replacement, product
from typing import Any, Literal, get_args, get_origin

import moderngl
import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.program import Drawable
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Camera, Light, View, view_of
from tests.samples import pairs

KNOWN = techniques()
SHADERS = "\n".join(file.read_text(encoding="utf-8") for file in data_folder("shaders").rglob("*.*"))
SIZE = 96

LIGHTS = {
    "directional": Light("sun", "directional", (0.5, -1.0, -0.3)),
    "spot": Light("spot", "spot", (1.7, -3.0, -1.5), (-1.7, 3.2, 1.3), 1.0),
    "point": Light("point", "point", position=(-1.0, 2.2, 0.8)),
}
SIZED = LIGHTS | {
    "soft directional": replace(LIGHTS["directional"], radius=0.05),
    "soft spot": replace(LIGHTS["spot"], radius=0.2),
    "soft point": replace(LIGHTS["point"], radius=0.2),
    "disc": replace(LIGHTS["spot"], kind="disc", radius=0.3),
    "rectangle": replace(LIGHTS["spot"], kind="rectangle", size=(0.6, 0.3)),
}
ALL = sorted(KNOWN)
ANSWERED = [(name, kind) for name in ALL for kind in sorted(KNOWN[name].lights)]
IN_TURN = [(name, sorted(KNOWN[name].lights)[turn % len(KNOWN[name].lights)]) for turn, name in enumerate(ALL)]
PRESETS = [("shadow-map:preset=godot", "directional"), ("cube-map:preset=course", "point")]
# Each pose moves the camera, the light, or both; the third looks from inside a shadow, up at the light.
CAMERAS = [
    ((2.0, 2.6, 3.7), (0.1, 0.45, -0.45)),
    ((-2.4, 0.8, 2.0), (0.4, 0.3, 0.0)),
    ((0.6, 0.05, -0.9), (-0.5, 1.0, 0.5)),
    ((2.0, 2.6, 3.7), (0.1, 0.45, -0.45)),
]


def moved(light: Light, pose: int) -> Light:
    turn = np.array([0.2, 0.1, -0.1]) * pose
    return replace(
        light,
        direction=tuple((np.asarray(light.direction) + turn).tolist()),
        position=tuple((np.asarray(light.position) + turn).tolist()),
    )


@pytest.fixture
def poses(builtin):
    """Views of one scene under one kind of light: camera and light move from each to the next."""

    def make(kind: str, size: int = SIZE) -> list[View]:
        scene = builtin("spot-lamp").scene
        return [
            view_of(scene, Camera("camera", eye, target, 0.9), moved(SIZED[kind], pose), size)
            for pose, (eye, target) in enumerate(CAMERAS)
        ]

    return make


@pytest.mark.parametrize("spec", ALL)
def test_lights_of_declared_kinds_are_answered_and_the_others_declined_in_words(spec, device, poses) -> None:
    """A disc and a rectangle are drawn as spots."""
    parsed = parse_spec(spec, KNOWN)
    for kind in SIZED:
        view = poses(kind)[0]
        reason = parsed.technique.declines(parsed.params, view, device)
        if view.light.hard_kind in parsed.technique.lights:
            assert reason is None
        else:
            assert reason is not None and f"{view.light.kind} light" in reason and "\n" not in reason


def assert_lit_where_nothing_receives(mask: np.ndarray, shot) -> None:
    """What does not face the light's centre, or is behind it, is lit."""
    assert mask.shape == (SIZE, SIZE) and np.isfinite(mask).all() and mask.min() >= 0 and mask.max() <= 1
    light, w = shot.view.light.homogeneous
    cosine = np.einsum("ijk,ijk->ij", shot.normal[..., :3], np.asarray(light) - w * shot.position[..., :3])
    away = (shot.triangle < 0) | (cosine < -1e-6)
    assert away.any() and (mask[away] == 1).all()


@pytest.mark.parametrize(
    ("spec", "kind"), [*ANSWERED, *(pytest.param(*preset, marks=pytest.mark.slow) for preset in PRESETS)]
)
def test_a_moved_camera_and_light_draw_what_a_fresh_build_draws(spec, kind, poses, studio, build) -> None:
    shots = [studio.shot(view) for view in poses(kind)]
    once = build(spec, shots[0])
    masks = []
    for shot in shots:
        masks.append(once.draw(shot))
        assert_lit_where_nothing_receives(masks[-1], shot)
        fresh = build(spec, shot)
        assert np.array_equal(masks[-1], fresh.draw(shot))
        fresh.stage.release()
    if spec != "unshadowed":
        assert (masks[0] < 0.5).sum() > 50 and not np.array_equal(masks[0], masks[3]), "the same camera, another light"
    for _ in range(2):
        assert np.array_equal(once.draw(shots[0]), masks[0]), "back where it began, and drawn twice"


@pytest.mark.parametrize(("spec", "kind"), IN_TURN)
def test_every_phase_too_draws_what_a_fresh_build_draws(spec, kind, poses, studio, build) -> None:
    view = poses(kind)[0]
    shot = studio.shot(view)
    once = build(spec, shot)
    plain = once.draw(shot)
    shifted = once.draw(shot, phase=3)
    assert np.array_equal(shifted, build(spec, shot).draw(shot, phase=3))
    assert np.array_equal(shifted, plain) == (not once.technique.phased)


@pytest.mark.parametrize(("spec", "kind"), IN_TURN)
def test_receive_and_cast_flags_are_respected(spec, kind, studio, build, shape, looking) -> None:
    silent = [shape("plane", 6.0, receives=False), shape("box", 1.0, (0.0, 0.5, 0.0), receives=False)]
    idle = [shape("plane", 6.0, casts=False), shape("sphere", 1.0, (0, 1, 0), casts=False)]
    from_below = looking([shape("plane", 6.0)], LIGHTS[kind], SIZE, eye=(1.0, -3.0, 1.0))
    for view in (looking(silent, LIGHTS[kind], SIZE), looking(idle, LIGHTS[kind], SIZE), from_below):
        shot = studio.shot(view)
        assert (shot.triangle >= 0).any() and (build(spec, shot).draw(shot) == 1).all()
    for casts in (True, False):
        ghost = [shape("plane", 6.0), shape("box", 1.0, (0.0, 0.5, 0.0), casts=casts, receives=False)]
        shot = studio.shot(looking(ghost, moved(LIGHTS[kind], 1), SIZE))
        shadowed = (build(spec, shot).draw(shot) < 0.5).sum()
        assert shadowed > 200 if casts and spec != "unshadowed" else shadowed == 0


@pytest.mark.parametrize(("spec", "kind"), IN_TURN)
def test_a_light_along_up_or_from_below_shadows_what_a_ray_says(spec, kind, studio, build, shape, looking):
    """Straight above a sphere its shadow is below it; straight below, above it."""
    planes = [shape("plane", [4.0, 1.0, 4.0], (0.0, y, 0.0), casts=False) for y in (-1.5, 1.5)]
    for sign, place in ((-1.0, 2.9), (1.0, -2.9)):
        light = Light(kind, kind, (0.0, sign, 0.0), (0.0, place, 0.0), 1.0)
        view = looking([*planes, shape("sphere", 1.0)], light, SIZE, (0.6, sign * 0.7, 3.5), (0.0, sign * 1.2, 0.0), 60)
        shot = studio.shot(view)
        shadow = build(spec, shot).draw(shot) < 0.5
        if spec == "unshadowed":
            assert not shadow.any()
            continue
        on_plane = (shot.triangle >= 0) & (shot.triangle < 4)
        x, _, z = np.moveaxis(shot.position[..., :3] / shot.placement.scale + shot.placement.center, -1, 0)
        # The sphere's outline is its radius for the sun, the tangent cone's for a lamp 4.4 m away.
        radius = 0.5 if kind == "directional" else 4.4 * np.tan(np.arcsin(0.5 / 2.9))
        distance = np.hypot(x, z)
        assert shadow[on_plane & (distance < radius * 0.93)].all()
        assert not shadow[on_plane & (distance > radius * 1.07)].any()
        assert (on_plane & (distance < radius * 0.93)).sum() > 50


COUNTED = [
    *(case for case in IN_TURN if not KNOWN[case[0]].catalogue.soft_only),
    *product(["light-samples:of=shadow-map(fit=scene)", "soft-volume"], ["soft spot"]),
    *product(["shadow-map:filter=msm(bits=16)", "cube-map:filter=evsm(mips=true)"], ["spot"]),
    ("shadow-map:filter=evsm,bias=two-planes,update=needed,history=confidence", "directional"),
    *product(["cascades:filter=evsm(mips=true)", "hybrid:fit=visible", "shadow-volume:compare=depth"], ["directional"]),
]


@pytest.mark.parametrize(("spec", "kind"), COUNTED)
def test_bytes_are_those_of_the_textures_and_buffers_that_opengl_lists_and_are_freed(
    spec, kind, device, studio, build, poses
) -> None:
    view = poses(kind)[0]
    shot = studio.shot(replace(view, scene=replace(view.scene, lights=(view.light,))))
    build(spec, shot).stage.release()  # makes what all cells of a scene share

    before = sizes_of(device)
    one = build(spec, shot)
    one.draw(shot)
    made = {name: size for name, size in sizes_of(device).items() if name not in before}
    assert one.stage.bytes == sum(made.values())
    one.stage.release()
    assert one.stage.bytes == 0 and not made.keys() & sizes_of(device).keys()


EXTENTS = 0x1000, 0x1001, 0x8071  # width, height, depth
COMPONENTS = 0x805C, 0x805D, 0x805E, 0x805F, 0x884A, 0x88F1  # bits of red to alpha, depth, stencil


def sizes_of(device: Device) -> dict[tuple[str, int], int]:
    """Bytes of all textures and buffers of the context, by kind and name."""
    ask, value_of = device.raw, device.raw.integer
    newest = device.context.texture((1, 1), 1), device.context.buffer(reserve=4)
    last, sizes = max(one.glo for one in newest), {}
    for one in newest:
        one.release()
    for name in range(1, last):
        if ask("glIsBuffer", name) & 1:
            sizes["glIsBuffer", name] = value_of("glGetNamedBufferParameteriv", name, 0x8764)
        if ask("glIsTexture", name) & 1:
            faces = 6 if value_of("glGetTextureParameteriv", name, 0x1006) == 0x8513 else 1
            bits = 0
            for level in range(12):  # up to 2048 texels
                width, height, depth = (value_of("glGetTextureLevelParameteriv", name, level, one) for one in EXTENTS)
                texel = sum(value_of("glGetTextureLevelParameteriv", name, level, one) for one in COMPONENTS)
                bits += faces * width * height * depth * texel
            sizes["glIsTexture", name] = bits // 8
    return sizes


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        *IN_TURN,
        ("shadow-map:fit=scene", "directional"),
        ("shadow-map:fit=fixed", "spot"),
        ("shadow-volume:compare=depth", "point"),
        ("shadow-volume:faces=triangle", "directional"),
    ],
)
def test_passes_that_change_with_the_light_are_not_redrawn_for_another_camera(
    spec: str, kind: str, studio, build, poses, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With these passes disabled, a moved camera still gives the mask of a fresh build."""
    views = poses(kind)
    first, second = studio.shot(views[0]), studio.shot(replace(views[1], light=views[0].light))
    expected = build(spec, second).draw(second)
    one = build(spec, first)
    one.draw(first)
    kept = False

    @contextmanager
    def timed(name: str, changes: str = "frame") -> Iterator[None]:
        nonlocal kept
        kept = changes == "light"
        yield
        kept = False

    draw, clear = Drawable.draw, moderngl.Framebuffer.clear
    monkeypatch.setattr(one.clock, "timed", timed)
    monkeypatch.setattr(Drawable, "draw", lambda *args, **more: None if kept else draw(*args, **more))
    monkeypatch.setattr(moderngl.Framebuffer, "clear", lambda *args, **more: None if kept else clear(*args, **more))
    assert np.array_equal(one.draw(second), expected)


DRAWN = 7  # one in so many compositions is drawn too, as the driver compiles its shaders anew
MORE = {"bias": ["receiver-plane(gradient=derivative)"], "filter": ["pcf(taps=5)"]}


def values(name: str, annotation: Any) -> list[str]:
    """Allowed values of a parameter; empty for numbers."""
    if annotation is bool:
        return ["false", "true"]
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    if isinstance(annotation, type) and issubclass(annotation, Component):
        return [row for row in annotation.table if row != "+"] + MORE.get(name, [])
    return []


def shapes_a_text(name: str) -> bool:
    return f"<{name}>" in SHADERS or re.search(rf"\b{name.upper()}(_|\b)", SHADERS) is not None


def compositions(technique: Any) -> Iterator[str]:
    """Specs, including invalid ones."""
    fields = {name: values(name, info.annotation) for name, info in technique.Params.model_fields.items()}
    fields = {name: several for name, several in fields.items() if several}
    crossed = {name: several for name, several in fields.items() if shapes_a_text(name)}
    for chosen in pairs(*crossed.values()):
        yield ",".join(f"{name}={value}" for name, value in zip(crossed, chosen, strict=True))
    for name in fields.keys() - crossed.keys():
        yield from (f"{name}={value}" for value in fields[name])
    if technique.name == "shadow-map":  # the text is the same in the others
        yield from (f"bias={one}+{other}" for one, other in combinations_with_replacement(fields["bias"], 2))


@pytest.mark.slow
@pytest.mark.parametrize("technique", own_techniques(), ids=lambda technique: technique.name)
def test_every_pair_of_components_compiles(technique, builtin, studio, build, device) -> None:
    """Under each kind of light in turn."""
    scene = builtin("cube-on-plane").scene
    lights = [light for kind, light in LIGHTS.items() if kind in technique.lights]
    shots = [studio.shot(view_of(scene, scene.cameras[0], light, 16)) for light in lights]
    size = "size=16," if "size" in technique.Params.model_fields else ""
    for number, items in enumerate(compositions(technique)):
        try:
            spec = parse_spec(f"{technique.name}:{size}{items}".rstrip(",:"), KNOWN)
        except InputError:
            continue
        shot = shots[number % len(shots)]
        if technique.declines(spec.params, shot.view, device) is None:
            one = build(spec.text, shot)
            if number % DRAWN == 0:
                mask = one.draw(shot)
                assert mask.min() >= 0 and mask.max() <= 1 and (mask[shot.triangle < 0] == 1).all(), spec.text
            one.stage.release()
