"""Cut-outs in an exported glTF: materials with alphaMode MASK, and their bitmaps as textures, sampled nearest."""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from shadowbench.files import png_of
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.model import Mesh

_WRAPS: dict[Wrap, int] = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_NEAREST = 9728


def corner_attributes(mesh: Mesh) -> dict[str, Any]:
    """Texture coordinates of a cut-out mesh by corner, in turn, as trimesh writes attributes: with an underscore."""
    if mesh.cutout is None or mesh.places is None:
        return {}
    return {"_PLACE": (mesh.places.reshape(-1, 2) / mesh.cutout.size).astype(np.float32)}


def add_masks(tree: dict[str, Any], cutouts: Sequence[Cutout | None]) -> None:
    """Add to the materials of a glTF, in the order of `cutouts`, what cuts them out, and name its coordinates."""
    for material, cutout in zip(tree["materials"], cutouts, strict=True):
        if cutout is None:
            continue
        number = len(tree.setdefault("textures", []))
        material |= {"alphaMode": "MASK", "alphaCutoff": 0.5}
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": number}
        tree["textures"].append({"sampler": number, "source": number})
        image = np.full((*cutout.bits.shape, 4), 255, dtype=np.uint8)
        image[..., 3] *= cutout.bits
        uri = "data:image/png;base64," + base64.b64encode(png_of(image)).decode()
        tree.setdefault("images", []).append({"uri": uri, "mimeType": "image/png"})
        wraps = {"wrapS": _WRAPS[cutout.wrap[0]], "wrapT": _WRAPS[cutout.wrap[1]]}
        tree.setdefault("samplers", []).append({"magFilter": _NEAREST, "minFilter": _NEAREST, **wraps})
    for mesh in tree["meshes"]:
        attributes = mesh["primitives"][0]["attributes"]
        if "_PLACE" in attributes:
            attributes["TEXCOORD_0"] = attributes.pop("_PLACE")
