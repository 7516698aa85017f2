"""Variants of materials by name."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.scenes.contents import Chosen
from shadowbench.scenes.library import load_scene
from tests.scenes.conftest import refused

Gltf = Callable[..., Path]


@pytest.fixture
def shoe(gltf_file: Gltf) -> Callable[..., Path]:
    """Writes a mesh that is red, blue by its variant `sea`, and cut away by `gone`; `sky` names other primitives."""

    def write(**parts: Any) -> Path:
        mappings = [{"material": 1, "variants": [0]}, {"material": 2, "variants": [2]}]
        return gltf_file(
            primitive={"material": 0, "extensions": {"KHR_materials_variants": {"mappings": mappings}}},
            materials=[
                {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}},
                {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}},
                {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 0]}, "alphaMode": "MASK"},
            ],
            extensions={"KHR_materials_variants": {"variants": [{"name": n} for n in ("sea", "sky", "gone")]}},
            **parts,
        )

    return write


@pytest.mark.parametrize(("variant", "color"), [(None, (1, 0, 0)), ("sea", (0, 0, 1)), ("sky", (1, 0, 0))])
def test_a_variant_replaces_the_materials_that_it_names(
    shoe: Callable[..., Path], variant: str | None, color: tuple[int, int, int]
) -> None:
    scene = load_scene(shoe(), chosen=Chosen(variant=variant))
    assert scene.meshes[0].color == color
    taken = "the file's own materials" if variant is None else f"variant {variant!r}"
    assert f"model.gltf: {taken} taken; variant chooses of sea, sky, gone" in scene.notes


def test_a_variant_also_decides_what_is_opaque(shoe: Callable[..., Path]) -> None:
    refused(shoe(), "no triangles", chosen=Chosen(variant="gone"))


def test_a_scene_file_names_the_variant_of_each_mesh(shoe: Callable[..., Path], tmp_path: Path) -> None:
    shoe()
    text = '[[mesh]]\nfile = "model.gltf"\nvariant = "sea"\n[[mesh]]\nfile = "model.gltf"\ntranslate = [2, 0, 0]\n'
    (tmp_path / "shoes.toml").write_text(text)
    assert [mesh.color for mesh in load_scene(tmp_path / "shoes.toml").meshes] == [(0, 0, 1), (1, 0, 0)]


def test_an_unknown_variant_is_one_line_with_those_allowed(shoe: Callable[..., Path], gltf_file: Gltf) -> None:
    refused(shoe(), "variant: found 'see'; did you mean 'sea'? allowed: sea, sky, gone", chosen=Chosen(variant="see"))
    refused(
        gltf_file("plain.gltf"),
        "variant: found 'sea'; allowed: no variant, as the file has none",
        chosen=Chosen(variant="sea"),
    )
    refused("cube-on-plane", "--variant", "no glTF", chosen=Chosen(variant="sea"))
    wrong = {"KHR_materials_variants": {"mappings": [{"material": 0, "variants": [7]}]}}
    refused(gltf_file(primitive={"extensions": wrong}, materials=[{}]), "found 7; allowed: none")
