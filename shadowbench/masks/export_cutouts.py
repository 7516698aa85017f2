"""Cut-outs in an exported glTF: materials with alphaMode MASK, textures of alpha, and what they need by corner."""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from shadowbench.files import png_of
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.model import Mesh

Json = dict[str, Any]
_NAMES = {"_PLACE": "TEXCOORD_0", "_ALPHA": "COLOR_0"}  # of attributes as trimesh writes them, in glTF
_WRAPS: dict[Wrap, int] = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_NEAREST, _LINEAR = 9728, 9729


def corner_attributes(mesh: Mesh) -> dict[str, Any]:
    """Texture coordinates and vertex alphas of a cut-out mesh by corner, in turn, for `name_attributes`."""
    if mesh.cutout is None:
        return {}
    found: dict[str, Any] = {} if mesh.coordinates is None else {"_PLACE": mesh.coordinates.reshape(-1, 2)}
    if mesh.alpha is not None:
        found["_ALPHA"] = np.insert(np.ones((mesh.alpha.size, 3), np.float32), 3, mesh.alpha.ravel(), axis=1)
    return found


def name_attributes(attributes: Json) -> None:
    """Give attributes their names in glTF, as trimesh writes only its own without an underscore."""
    for name in [name for name in attributes if name in _NAMES]:
        attributes[_NAMES[name]] = attributes.pop(name)


def add_masks(tree: Json, cutouts: Sequence[Cutout | None]) -> None:
    """Add to the materials of a glTF, in the order of `cutouts`, what cuts them out."""
    for material, cutout in zip(tree["materials"], cutouts, strict=True):
        if cutout is None:
            continue
        material |= {"alphaMode": "MASK", "alphaCutoff": cutout.cutoff}
        surface = material["pbrMetallicRoughness"]
        surface["baseColorFactor"][3] = cutout.factor
        number = len(tree.setdefault("textures", []))
        surface["baseColorTexture"] = {"index": number}
        tree["textures"].append({"sampler": number, "source": number})
        image = np.full((*cutout.alpha.shape, 4), 255, dtype=np.uint8)
        image[..., 3] = cutout.alpha
        uri = "data:image/png;base64," + base64.b64encode(png_of(image)).decode()
        tree.setdefault("images", []).append({"uri": uri, "mimeType": "image/png"})
        level = _NEAREST if cutout.nearest else _LINEAR  # for the base level alone, without mip maps
        wraps = {"wrapS": _WRAPS[cutout.wrap[0]], "wrapT": _WRAPS[cutout.wrap[1]]}
        tree.setdefault("samplers", []).append({"magFilter": level, "minFilter": level, **wraps})
