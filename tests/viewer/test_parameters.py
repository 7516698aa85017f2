"""Each widget does something: moved to another legal value, its parameter changes the mask, or it is known why not."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.plugin.template import write_technique
from shadowbench.scenes.library import load_scene
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.technique_panel import SUM, choices_of, limits, name_of, with_inner, with_params, with_value

pytestmark = pytest.mark.slow

SIZE = 96
SCENES = (
    "sphere-and-torus",
    "spot-lamp",
    "room-with-lamp",
    "sphere-and-torus, soft",
    "room-with-lamp, soft",
    "deep-street",
    "inside-volume",
    "spot-lamp, flagged",
    "tree",
    str(Path(__file__).parents[2] / "docs" / "gallery" / "terminator.toml"),  # smooth
)
LARGEST = 4096  # texels of a map: larger ones only take longer

UNCHANGED = {
    "cascades:layers": "by geometry shader or one by one, the maps are the same bits",
    "cascades:cull": "only casters are skipped that cannot shadow any receiver",
    "cube-map:layers": "as cascades:layers",
    "cube-map:cull": "as cascades:cull",
    "hybrid:fit": "the map decides only where it is certain, and rays elsewhere: any map gives the same mask",
    "hybrid:size": "as hybrid:fit",
    "hybrid:rest": "rays give the same answer on the CPU and in a shader",
    "ray-traced:where": "as hybrid:rest",
    "shadow-map:cull": "as cascades:cull",
    "shadow-volume:faces": "silhouettes bound the same volume as all triangles",
    "shadow-volume:counter": "stencil and colour count alike",
    "shadow-volume:cull": "as cascades:cull",
    "shadow-volume:cutouts": "draws what is unsupported without it, where there is no mask to compare with",
    "soft-volume:cutouts": "as shadow-volume:cutouts",
}
"""Why a parameter changes no mask: it changes the way to it, and its cost."""

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


def hosted() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Each parameter: of each technique, and of each component in a technique that has it."""
    for technique in own_techniques():
        yield from ((technique.name, (key,)) for key in technique.Params.model_fields)
    for family in Component.__subclasses__():
        key = family.__name__.lower()
        for name, component in family.table.items():
            host = "cascades" if key == "split" else "cube-map" if name == "pcf-20" else "shadow-map"
            yield from ((f"{host}:{key}={name}", (key, inner)) for inner in component.model_fields)


def others(info: FieldInfo, value: Any) -> list[Any]:
    """Other values that a panel offers."""
    if isinstance(value, bool):
        return [not value]
    choices = choices_of(info, value)
    if choices:
        return [one for one in choices if one not in (name_of(value), SUM)]
    low, high = (1e6 * sign if limit is None else limit for limit, sign in zip(limits(info), (-1, 1), strict=True))
    values = [value * 8, value / 8, value * 64, value / 64, low, high / 100, 1, 0.1, 10]
    if isinstance(value, int):
        values, high = [int(value) for value in values], min(high, LARGEST)
    return [one for one in dict.fromkeys(values) if low <= one <= high and one != value]


class Masks:
    """Masks of specs in small views."""

    def __init__(self, device: Device) -> None:
        self.drawing = Drawing(device)
        self.mask = cache(self._mask)

    def _mask(self, scene: str, spec: Spec) -> bytes | None:
        """A spec's mask; None if it does not support the view."""
        drawn = self.drawing.draw(replace(self._state(scene), specs=(spec,)), SIZE)
        (mask,) = drawn.masks
        found = None if mask.failure else self.drawing.visibility(drawn, mask).tobytes()
        assert not mask.failure or mask.failure.startswith("unsupported"), mask.failure
        drawn.release()
        self.drawing.keep_only((), ())
        return found

    @staticmethod
    @cache
    def _state(name: str) -> ViewerState:
        name, _, kind = name.partition(", ")
        scene = load_scene(name)
        light = scene.lights[0]
        if kind == "flagged":
            scene = replace(scene, meshes=(replace(scene.meshes[0], planar=True), *scene.meshes[1:]))
        if kind == "soft":
            light = replace(light, radius=0.03 if light.kind == "directional" else 0.2)
        return ViewerState(scene, scene.cameras[0], light, (), SIZE)


@pytest.fixture(scope="module")
def masks(only_device: Device) -> Iterator[Masks]:
    masks = Masks(only_device)
    yield masks
    masks.drawing.reload()


def variants(spec: Spec, path: tuple[str, ...]) -> Iterator[Spec]:
    """The spec with other values of one parameter, as a panel makes them."""
    key, *inner = path
    model: Any = getattr(spec.params, key) if inner else spec.params
    for value in others(type(model).model_fields[path[-1]], getattr(model, path[-1])):
        try:
            changed = with_value(model, path[-1], value)
            yield with_params(spec, with_inner(spec.params, key, changed) if inner else changed)
        except InputError:  # not allowed beside the others
            continue


def changes_a_mask(masks: Masks, spec: Spec, path: tuple[str, ...]) -> bool:
    for scene in SCENES:
        before = masks.mask(scene, spec)
        if before is not None and any(masks.mask(scene, one) not in (None, before) for one in variants(spec, path)):
            return True
    return False


@pytest.mark.parametrize(("technique", "path"), [*hosted()], ids=str)
def test_a_parameter_changes_the_mask_or_it_is_known_why_not(
    device: Device, masks: Masks, technique: str, path: tuple[str, ...]
) -> None:
    known, name = techniques(), technique.partition(":")[0]
    title = f"{technique}:{path[-1]}"
    parts = [technique.partition(":")[2]] * (title not in NEEDED)
    parts += ["size=128"] * ("size" in known[name].Params.model_fields)
    parts += [NEEDED.get(title) or NEEDED.get(technique) or ""]
    items = ",".join(filter(None, parts))
    spec = parse_spec(f"{name}:{items}" if items else name, known)
    assert changes_a_mask(masks, spec, path) == (title not in UNCHANGED), UNCHANGED.get(title, "changes nothing")


def test_what_changes_nothing_is_still_there() -> None:
    assert set(UNCHANGED) <= {f"{technique}:{path[-1]}" for technique, path in hosted()}


def test_a_plug_ins_parameters_change_the_mask(device: Device, masks: Masks, tmp_path: Path) -> None:
    file = write_technique("my-shadows", tmp_path)
    spec = parse_spec("my-shadows:size=128", techniques([file]))
    for key in type(spec.params).model_fields:
        assert changes_a_mask(masks, spec, (key,)), key
