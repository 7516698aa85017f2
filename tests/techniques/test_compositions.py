"""Every combination of shader components compiles, links and draws; under `make test-slow` with OpenGL 4.1 too.

Choices that a shader's text depends on, by an include slot or a define, are crossed; the others are tried alone.
"""

import re
from collections.abc import Iterator
from itertools import combinations_with_replacement, product
from typing import Any, Literal, get_args, get_origin

import pytest

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.plugin.params import Component
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Light, view_of

KNOWN = techniques()
SHADERS = "\n".join(file.read_text(encoding="utf-8") for file in data_folder("shaders").rglob("*.*"))
LIGHTS = {
    "directional": Light("sun", "directional", (0.5, -1.0, -0.3)),
    "spot": Light("spot", "spot", (1.7, -3.0, -1.5), (-1.7, 3.2, 1.3), 1.0),
    "point": Light("lamp", "point", position=(-1.0, 2.2, 0.8)),
}
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
    for chosen in product(*crossed.values()):
        yield ",".join(f"{name}={value}" for name, value in zip(crossed, chosen, strict=True))
    for name in fields.keys() - crossed.keys():
        yield from (f"{name}={value}" for value in fields[name])
    if "bias" in fields:
        yield from (f"bias={one}+{other}" for one, other in combinations_with_replacement(fields["bias"], 2))


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda technique: technique.name)
def test_every_combination_of_components_compiles(technique, builtin, studio, build, device) -> None:
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
