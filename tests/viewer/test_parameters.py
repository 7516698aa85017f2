"""Each widget does something: moved to another legal value, its parameter changes the mask, or it is known why not."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import chain
from typing import Any

import pytest
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.viewer.controls import SUM, choices_of, limits, name_of, with_inner, with_value
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state import ViewerState

pytestmark = pytest.mark.slow

KNOWN = techniques()
SIZE = 96
SCENES = (
    "sphere-and-torus", "spot-lamp", "room-with-lamp", "sphere-and-torus, soft", "room-with-lamp, soft", "deep-street",
    "inside-volume", "spot-lamp, flagged", "tree", "docs/gallery/terminator.toml",
)  # fmt: skip
LARGEST = 4096  # texels of a map: larger ones only take longer

UNCHANGED = {
    "by geometry shader or one by one, the maps are the same bits": ("cascades:layers", "cube-map:layers"),
    "casters are skipped that cannot shadow any receiver": ("cascades:cull", "cube-map:cull", "shadow-map:cull"),
    "rays decide where the map is not certain": ("hybrid:fit", "hybrid:size"),
    "rays give the same answer on the CPU and in a shader": ("hybrid:rest", "ray-traced:where"),
    "the same volume, counted in another way": ("shadow-volume:faces", "shadow-volume:counter", "shadow-volume:cull"),
    "without it there is no mask to compare with": ("shadow-volume:cutouts", "soft-volume:cutouts"),
}
"""Parameters that change no mask, by the reason: they change the way to it, and its cost."""

NEEDED = {
    "cascades:stable": "box=sphere",
    "cascades:depth_clamp": "box=tight",
    "cascades:z_mult": "depth_clamp=false,box=tight",
    "shadow-map:reversed": "bias=polygon-offset(0,100000)",
    "shadow-map:far_rule": "fit=fixed(far=3)",
    "shadow-map:filter=pcss:light": "filter=pcss(variant=godot)",
    "cascades:split=shares": "count=4",
    "cascades:split=ends": "count=4",
}
"""Other parameters that a parameter needs to have a meaning, as a spec."""


def hosted() -> dict[str, list[tuple[str, ...]]]:
    """Each parameter, by where it is: in a technique, or in a component of a technique that has it."""
    hosts = {technique.name: [(key,) for key in technique.Params.model_fields] for technique in own_techniques()}
    for family in Component.__subclasses__():
        key = family.__name__.lower()
        for name, component in family.table.items():
            host = "cascades" if key == "split" else "cube-map" if name == "pcf-20" else "shadow-map"
            hosts[f"{host}:{key}={name}"] = [(key, inner) for inner in component.model_fields]
    return {host: paths for host, paths in hosts.items() if paths}


def others(info: FieldInfo, value: Any) -> list[Any]:
    """Other values that a panel offers."""
    choices = [True, False] if isinstance(value, bool) else [*choices_of(info, value)]
    if choices:
        return [choice for choice in choices if choice not in (name_of(value), SUM)]
    low, high = (1e6 * sign if limit is None else limit for limit, sign in zip(limits(info), (-1, 1), strict=True))
    values = [value * 8, value / 8, value * 64, value / 64, low, high / 100, 1, 0.1, 10]
    if isinstance(value, int):
        values, high = [int(value) for value in values], min(high, LARGEST)
    return [value for value in dict.fromkeys(values) if low <= value <= high]


def variants(spec: Spec, path: tuple[str, ...]) -> Iterator[Spec]:
    """The spec with other values of one parameter, as a panel makes them."""
    key, *inner = path
    model: Any = getattr(spec.params, key) if inner else spec.params
    for value in others(type(model).model_fields[path[-1]], getattr(model, path[-1])):
        with suppress(InputError):  # not allowed beside the others
            changed = with_value(model, path[-1], value)
            yield replace(spec, params=with_inner(spec.params, key, changed) if inner else changed)


@cache
def state_of(name: str) -> ViewerState:
    name, _, kind = name.partition(", ")
    scene = load_scene(name)
    light = scene.lights[0]
    if kind == "flagged":
        scene = replace(scene, meshes=(replace(scene.meshes[0], planar=True), *scene.meshes[1:]))
    if kind == "soft":
        light = replace(light, radius=0.03 if light.kind == "directional" else 0.2)
    return ViewerState(scene, scene.cameras[0], light, (), SIZE)


@pytest.fixture(scope="module")
def drawing(only_device: Device) -> Iterator[Drawing]:
    drawing = Drawing(only_device)
    yield drawing
    drawing.release()


@cache
def mask_of(drawing: Drawing, scene: str, spec: Spec) -> bytes | None:
    """A spec's mask; None if it does not support the view."""
    drawn = drawing.draw(replace(state_of(scene), specs=(spec,)), SIZE)
    (mask,) = drawn.masks
    pixels = None if mask.failure else drawn.visibility(mask).tobytes()
    assert not mask.failure or mask.failure.startswith("unsupported"), mask.failure
    drawn.frame.surface.release()
    drawing.keep_only((), ())
    return pixels


def changes_a_mask(drawing: Drawing, spec: Spec, path: tuple[str, ...]) -> bool:
    for scene in SCENES:
        before = mask_of(drawing, scene, spec)
        masks = (mask_of(drawing, scene, variant) for variant in variants(spec, path))
        if before is not None and any(mask not in (None, before) for mask in masks):
            return True
    return False


@pytest.mark.parametrize("host", hosted())
def test_a_parameter_changes_the_mask_or_it_is_known_why_not(device: Device, drawing: Drawing, host: str) -> None:
    name, _, component = host.partition(":")
    size = ["size=128"] * ("size" in KNOWN[name].Params.model_fields)
    for path in hosted()[host]:
        title = f"{host}:{path[-1]}"
        parts = [component] * (title not in NEEDED) + size + [NEEDED.get(title) or NEEDED.get(host) or ""]
        items = ",".join(filter(None, parts))
        spec = parse_spec(f"{name}:{items}" if items else name, KNOWN)
        assert changes_a_mask(drawing, spec, path) == (title not in chain(*UNCHANGED.values())), title
