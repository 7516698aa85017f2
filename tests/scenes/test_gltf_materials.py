"""What glTF materials cut out, and their colours."""

import base64
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.scenes.cutouts import cut_out
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import GREY, Mesh
from tests.scenes.conftest import refused

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
PLACES = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)  # v downwards
RANDOM = np.random.default_rng(1).integers(0, 256, (4, 8, 4), dtype=np.uint8)
Written = Callable[..., Path]


def image_of(texels: np.ndarray, kind: str = "PNG") -> dict[str, str]:
    stream = io.BytesIO()
    Image.fromarray(texels).save(stream, kind)
    return {"uri": f"data:image/{kind.lower()};base64," + base64.b64encode(stream.getvalue()).decode()}


@pytest.fixture
def card(tmp_path: Path) -> Written:
    """Writes a square whose corners have texture coordinates and whatever colours are given; keywords add parts."""

    def write(material: dict[str, Any], colors: np.ndarray | None = None, **parts: Any) -> Path:
        arrays = {"POSITION": CORNERS, "TEXCOORD_0": PLACES, "TEXCOORD_1": 2 * PLACES}
        if colors is not None:
            arrays["COLOR_0"] = colors.astype(np.float32)
        faces = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32)
        blobs = [array.tobytes() for array in (*arrays.values(), faces)]
        starts = np.cumsum([0, *map(len, blobs)]).tolist()
        kinds = {2: "VEC2", 3: "VEC3", 4: "VEC4"}
        document = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{
                "attributes": {name: number for number, name in enumerate(arrays)},
                "indices": len(arrays),
                "material": 0,
            }]}],
            "materials": [material],
            "textures": [{"source": 0}],
            "images": [image_of(RANDOM)],
            "buffers": [{"byteLength": starts[-1], "uri": "data:application/octet-stream;base64,"
                         + base64.b64encode(b"".join(blobs)).decode()}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": start, "byteLength": len(blob)}
                for start, blob in zip(starts, blobs, strict=False)
            ],
            "accessors": [
                *({"bufferView": number, "componentType": 5126, "count": len(array), "type": kinds[array.shape[1]]}
                  for number, array in enumerate(arrays.values())),
                {"bufferView": len(arrays), "componentType": 5125, "count": 6, "type": "SCALAR"},
            ],
            **parts,
        }  # fmt: skip
        path = tmp_path / "card.gltf"
        path.write_text(json.dumps(document))
        return path

    return write


def masked(texture: dict[str, Any] | None = None, factor: float = 1.0, **more: Any) -> dict[str, Any]:
    base: dict[str, Any] = {"baseColorFactor": [1, 1, 1, factor]}
    base |= {} if texture is None else {"baseColorTexture": texture}
    return {"alphaMode": "MASK", "pbrMetallicRoughness": base, **more}


def only_mesh(path: Path) -> Mesh:
    (mesh,) = read_meshes(path).meshes
    return mesh


def coordinates_at(mesh: Mesh) -> dict[tuple[float, ...], tuple[float, ...]]:
    """Texture coordinates by position."""
    assert mesh.coordinates is not None
    pairs = zip(mesh.vertices[mesh.faces].reshape(-1, 3), mesh.coordinates.reshape(-1, 2), strict=True)
    return {tuple(map(float, at)): tuple(map(float, place)) for at, place in pairs}


def test_a_mask_is_the_alpha_of_its_texture(card: Written) -> None:
    cutout = only_mesh(card(masked({"index": 0}, alphaCutoff=0.25))).cutout
    assert cutout is not None and cutout.wrap == ("repeat", "repeat")
    assert np.array_equal(cutout.words, cut_out(RANDOM[..., 3], cutoff=0.25).words)


def test_the_sampler_says_what_is_between_texels_and_outside(card: Written) -> None:
    sampler = {"magFilter": 9728, "minFilter": 9729, "wrapS": 33071, "wrapT": 33648}
    path = card(masked({"index": 0}), textures=[{"source": 0, "sampler": 0}], samplers=[sampler])
    cutout = only_mesh(path).cutout
    assert cutout is not None and cutout.wrap == ("clamp", "mirror")
    assert np.array_equal(cutout.bits, RANDOM[..., 3] > 127)


def test_a_texture_is_scaled_then_turned_counter_clockwise_then_moved(card: Written) -> None:
    moved = {"offset": [0.25, 0.5], "rotation": np.pi / 2, "scale": [2, 3], "texCoord": 0}
    info = {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": moved}}
    found = coordinates_at(only_mesh(card(masked(info))))
    assert found[1, 0, 0] == pytest.approx((0.25 + 3, 0.5 - 2), abs=1e-6)  # u points up after the turn, v right
    assert found[0, 1, 0] == (0.25, 0.5)


def test_factor_and_vertex_alpha_count_and_of_different_ones_the_largest(card: Written) -> None:
    for alphas, noted in ((np.full(4, 0.75), 0), (np.array([0.0, 0.25, 0.75, 0.5]), 1)):
        path = card(masked({"index": 0}, factor=0.5, alphaCutoff=0.25), np.column_stack([np.ones((4, 3)), alphas]))
        scene = read_meshes(path)
        cutout = scene.meshes[0].cutout
        assert cutout is not None and np.array_equal(cutout.words, cut_out(RANDOM[..., 3], 0.375, 0.25).words)
        assert sum("1 primitive(s) whose vertices differ in alpha" in note for note in scene.notes) == noted


def test_what_is_opaque_everywhere_is_not_cut_out(card: Written) -> None:
    for material, image in (
        (masked({"index": 0}), RANDOM[..., :3].copy()),
        (masked(), RANDOM),
        (masked({"index": 0}, alphaCutoff=0.0), RANDOM),
        ({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, RANDOM),
    ):
        path = card(material, images=[image_of(image)])
        assert only_mesh(path).cutout is None
        assert not any("opaque" in note for note in read_meshes(path).notes)


def test_a_blended_material_is_cut_out_at_one_half_and_told(card: Written) -> None:
    contents = read_meshes(card({**masked({"index": 0}), "alphaMode": "BLEND", "alphaCutoff": 0.9}))
    cutout = contents.meshes[0].cutout
    assert cutout is not None and np.array_equal(cutout.words, cut_out(RANDOM[..., 3]).words)
    assert sum("1 blended material(s) cut out where alpha is below 0.5" in note for note in contents.notes) == 1


def test_what_is_opaque_nowhere_is_left_out(card: Written) -> None:
    refused(card({**masked(factor=0.2), "alphaMode": "BLEND"}), "card.gltf", "no triangles")


def test_a_material_of_both_workflows_is_that_of_the_extension(card: Written) -> None:
    """KHR_materials_pbrSpecularGlossiness: the core properties are a fallback for who does not read it."""
    for glossy, color, alpha in (
        ({"diffuseFactor": [0.1, 0.2, 0.3, 1], "diffuseTexture": {"index": 0}}, (0.1, 0.2, 0.3), RANDOM[..., 3]),
        ({"diffuseTexture": {"index": 0}}, GREY, RANDOM[..., 3]),
        ({"diffuseFactor": [0.1, 0.2, 0.3, 1]}, (0.1, 0.2, 0.3), None),
        ({}, GREY, None),
    ):
        both = masked({"index": 1}, factor=0.75, extensions={"KHR_materials_pbrSpecularGlossiness": glossy})
        images = [image_of(RANDOM), image_of(RANDOM[::-1])]
        mesh = only_mesh(card(both, images=images, textures=[{"source": 0}, {"source": 1}]))
        assert mesh.color == pytest.approx(color)
        assert (mesh.cutout is None) == (alpha is None)
        assert mesh.cutout is None or np.array_equal(mesh.cutout.words, cut_out(RANDOM[..., 3]).words)


def test_an_image_that_cannot_be_read_is_one_line(card: Written) -> None:
    for parts, words in (
        ({"images": [{"uri": "data:image/png;base64,iVBORw0KGgo="}]}, ["images 1", "not an image"]),
        ({"images": [{"uri": "missing.png"}]}, ["images 1", "missing.png"]),
        ({"images": [{}]}, ["images 1", "uri"]),
        ({"textures": [{"source": 3}]}, ["textures", "3"]),
        ({"textures": []}, ["materials 1", "there are none"]),
    ):
        refused(card(masked({"index": 0}), **parts), "card.gltf", *words)


def test_vertex_colours_are_those_of_triangles_in_the_mean(card: Written) -> None:
    colors = np.array([[0.0, 0.3, 0.6], [0.3, 0.3, 0.6], [0.6, 0.3, 0.6], [0.9, 0.9, 0.9]])
    path = card({"pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.5, 0.5, 1.0]}}, colors)
    scene = read_meshes(path)
    assert scene.geometry.colors == pytest.approx(np.array([[0.3, 0.15, 0.3], [0.5, 0.25, 0.35]]), abs=1e-6)
