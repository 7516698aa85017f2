"""Materials of a glTF: what its primitives are cut out by.

Not by `doubleSided`: here all triangles are seen, cast and receive from both sides.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.gltf_accessors import Data
from shadowbench.scenes.gltf_bytes import TrianglePrimitive, read_uri
from shadowbench.scenes.gltf_layout import Material, TextureInfo
from shadowbench.scenes.images import read_image

BLEND_CUTOFF = 0.5
_NEAREST = 9728  # GL_NEAREST
_WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}  # GL_CLAMP_TO_EDGE, GL_MIRRORED_REPEAT, …
_OPAQUE = np.full((1, 1), 255, dtype=np.uint8)


class Cut(NamedTuple):
    """What cuts a primitive out: by corner of its (F, 3) faces, float32 texture coordinates and vertex alphas."""

    cutout: Cutout
    coordinates: NDArray[np.float32] | None
    alpha: NDArray[np.float32] | None


class Materials:
    """The materials of a file. path: of the file, whose folder holds its images.

    notes: on what was simplified, when all primitives have been asked for.
    """

    def __init__(self, data: Data, path: Path) -> None:
        self._data, self._path = data, path
        self._cutouts: dict[int, Cutout] = {}
        self._images: dict[int, NDArray[np.uint8]] = {}
        self._blended: set[int] = set()
        self._left_out = 0
        self._unread: set[str] = set()

    def cut(self, primitive: TrianglePrimitive) -> Cut | None:
        """What cuts a primitive out, None if it is opaque everywhere. Raises InputError for an image that is not read.

        Its vertex indices must be valid.
        """
        number = primitive.primitive.material
        material = None if number is None else self._data.layout.materials[number]
        if number is None or material is None or material.alphaMode == "OPAQUE":
            return None
        if material.alphaMode == "BLEND":
            self._blended.add(number)
        if number not in self._cutouts:
            self._cutouts[number] = self._cutout(material)
        cutout, alpha = self._cutouts[number], self._alpha(primitive)
        least = 1.0 if alpha is None else float(alpha.min(initial=1.0))
        if int(cutout.alpha.min()) * least >= cutout.least:
            return None
        return Cut(cutout, self._coordinates(primitive, material.texture), alpha)

    def clear(self, cut: Cut) -> bool:
        """Whether what is cut out is opaque nowhere; counted for `notes`."""
        most = 1.0 if cut.alpha is None else float(cut.alpha.max(initial=0.0))
        clear = int(cut.cutout.alpha.max()) * most < cut.cutout.least
        self._left_out += clear
        return clear

    @property
    def notes(self) -> list[str]:
        """A line for each simplification."""
        where, found = self._data.where, []
        if self._blended:
            found.append(f"{len(self._blended)} blended material(s) cut out where alpha is below {BLEND_CUTOFF:g}")
        if self._left_out:
            found.append(f"{self._left_out} primitive(s) left out whose alpha is below the cutoff everywhere")
        found += [f"{kind}: alpha not read, taken as 1" for kind in sorted(self._unread)]
        return [f"{where}: {line}" for line in found]

    def _cutout(self, material: Material) -> Cutout:
        cutoff = BLEND_CUTOFF if material.alphaMode == "BLEND" else material.alphaCutoff
        factor = 1.0 if material.color is None or len(material.color) < 4 else min(max(material.color[3], 0.0), 1.0)
        cutout = Cutout(_OPAQUE, factor, cutoff)
        info = material.texture
        if info is None:
            return cutout
        texture = self._data.layout.textures[info.index]
        if (image := texture.image) is None:
            self._unread.add(" or ".join(sorted(texture.extensions)) or "a texture without an image")
            return cutout
        sampler = None if texture.sampler is None else self._data.layout.samplers[texture.sampler]
        wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
        if sampler is not None:
            wrap = _WRAPS[sampler.wrapS], _WRAPS[sampler.wrapT]
        nearest = sampler is not None and sampler.magFilter == _NEAREST
        return replace(cutout, alpha=self._alphas(image), nearest=nearest, wrap=wrap)

    def _alphas(self, number: int) -> NDArray[np.uint8]:
        """(H, W) alphas of an image, read once."""
        if number not in self._images:
            image, where = self._data.layout.images[number], f"{self._data.where}: images {number + 1}"
            if image.bufferView is not None:
                view = self._data.layout.bufferViews[image.bufferView]
                content = self._data.buffers[view.buffer][view.byteOffset : view.end]
            elif image.uri is not None:
                content = read_uri(image.uri, self._path, where)
            else:
                raise InputError(f"{where}: found neither uri nor bufferView; one is needed")
            self._images[number] = np.ascontiguousarray(read_image(content, where)[..., 3])
        return self._images[number]

    @staticmethod
    def _alpha(primitive: TrianglePrimitive) -> NDArray[np.float32] | None:
        """(F, 3) vertex alphas; None if the vertices have no colour, or one without alpha."""
        colors = primitive.floats("COLOR_0", "VEC3", "VEC4")
        if colors is None or colors.shape[1] < 4:
            return None
        return primitive.by_corner(np.clip(colors[:, 3], 0.0, 1.0))

    @staticmethod
    def _coordinates(primitive: TrianglePrimitive, info: TextureInfo | None) -> NDArray[np.float32] | None:
        """(F, 3, 2) texture coordinates after KHR_texture_transform; None without a texture."""
        if info is None:
            return None
        moved = info.transform
        number = info.texCoord if moved.texCoord is None else moved.texCoord
        coordinates = primitive.floats(f"TEXCOORD_{number}", "VEC2")
        if coordinates is None:
            return None
        cosine, sine = math.cos(moved.rotation), math.sin(moved.rotation)
        # Counter-clockwise as seen, with v downwards.
        coordinates = coordinates * moved.scale @ np.array([[cosine, -sine], [sine, cosine]]) + moved.offset
        return primitive.by_corner(coordinates)
