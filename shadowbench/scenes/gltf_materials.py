"""Materials of a glTF: what its primitives are cut out by, and their colours and textures.

Not by `doubleSided`: here all triangles are seen, cast and receive from both sides.
"""

import math
from pathlib import Path

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.cutouts import Alphas, Cutout, Single, Wrap, cut_out, cut_out_triangles
from shadowbench.scenes.gltf_accessors import Data
from shadowbench.scenes.gltf_bytes import TrianglePrimitive, read_uri
from shadowbench.scenes.gltf_layout import Material, TextureInfo, TextureTransform
from shadowbench.scenes.images import read_image
from shadowbench.scenes.looks import BLEND_CUTOFF, MOST_MASKED, OPAQUE, Look
from shadowbench.scenes.model import GREY, WHITE
from shadowbench.scenes.textures import MOST_BYTES, Texture
from shadowbench.scenes.vectors import vec3

_NEAREST = 9728  # GL_NEAREST
_WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}  # GL_CLAMP_TO_EDGE, GL_MIRRORED_REPEAT, …
_BILINEAR: tuple[bool, tuple[Wrap, Wrap]] = (False, ("repeat", "repeat"))
_NOT_DRAWN = "drawn without this texture"


class Materials:
    """The materials of a file. path: of the file, whose folder holds its images.

    coordinates: whether texture coordinates are read even if no material needs them; notes: on what was simplified,
    when all primitives have been asked for.
    """

    def __init__(self, data: Data, path: Path, coordinates: bool = False) -> None:
        self._data, self._path, self._all_coordinates = data, path, coordinates
        self._cutouts: dict[tuple[int, float], Cutout] = {}
        self._textures: dict[tuple[object, ...], Texture] = {}
        self._masks: dict[object, Alphas] = {}
        self._contents: dict[object, bytes] = {}
        self._blended: set[int] = set()
        self._left_out = 0
        self._told: set[str] = set()

    def look(self, primitive: TrianglePrimitive) -> Look | None:
        """What a primitive looks like, None if it is opaque nowhere. Raises InputError for an alpha that is not read.

        Its vertex indices must be valid.
        """
        number = primitive.primitive.material
        material = self._data.layout.materials[number] if number is not None else Material()
        texture, (alpha, tints) = self._texture(material), self._of_vertices(primitive)
        mapped = material.texture is not None and (texture is not None or material.alphaMode != "OPAQUE")
        needed = self._all_coordinates or mapped
        coordinates = self._coordinates(primitive, material.texture) if needed else None
        cutout, places = self._cutout(number, material, coordinates, alpha)
        if cutout is not None and cutout.share == 0.0:
            self._left_out += 1
            return None
        if cutout is not None and cutout.share == 1.0:
            cutout = places = None
        texture = None if coordinates is None else texture
        color = material.color or (GREY if texture is None else WHITE)
        color = vec3(np.clip(color[:3], 0.0, 1.0))
        return Look(color, cutout, texture, coordinates, places, tints)

    @property
    def notes(self) -> list[str]:
        """A line for each simplification."""
        where, found = self._data.where, []
        if self._blended:
            found.append(f"{len(self._blended)} blended material(s) cut out where alpha is below {BLEND_CUTOFF:g}")
        if self._left_out:
            found.append(f"{self._left_out} primitive(s) left out whose alpha is below the cutoff everywhere")
        return [*(f"{where}: {line}" for line in found), *sorted(self._told)]

    def _cutout(
        self, number: int | None, material: Material, coordinates: Single | None, vertex_alpha: Single | None
    ) -> tuple[Cutout | None, Single | None]:
        """How a primitive is cut out, None for not at all, and the places of its corners in that."""
        if number is None or material.alphaMode == "OPAQUE":
            return None, None
        if material.alphaMode == "BLEND":
            self._blended.add(number)
        cutoff = BLEND_CUTOFF if material.alphaMode == "BLEND" else material.alphaCutoff
        factor = 1.0 if material.color is None or len(material.color) < 4 else min(max(material.color[3], 0.0), 1.0)
        mask, sampling = OPAQUE, _BILINEAR
        if (image := self._image(material, "alpha not read, taken as 1")) is not None:
            mask, sampling = self._mask(image), self._sampling(material)
        least, most = (
            (1.0, 1.0) if vertex_alpha is None else (vertex_alpha.min(initial=1.0), vertex_alpha.max(initial=0.0))
        )
        if vertex_alpha is not None and least < most:
            return cut_out_triangles(mask, factor, cutoff, *sampling, coordinates, vertex_alpha)
        factor *= float(most)
        if (number, factor) not in self._cutouts:
            self._cutouts[number, factor] = cut_out(mask, factor, cutoff, *sampling)
        cutout = self._cutouts[number, factor]
        return cutout, None if coordinates is None else cutout.places(coordinates)

    def _texture(self, material: Material) -> Texture | None:
        """The texture of a material's base colour, made once; None, with a note, for one that cannot be read."""
        if (image := self._image(material, _NOT_DRAWN)) is None:
            return None
        where, source = f"{self._data.where}: images {image + 1}", self._source(image)
        if source not in self._contents:
            try:
                content = self._content(image)
                if sum(map(len, self._contents.values())) + len(content) > MOST_BYTES:
                    raise InputError(f"{where}: above {MOST_BYTES >> 20} MiB of images")
            except InputError as error:
                self._told.add(f"{error}: {_NOT_DRAWN}")
                return None
            self._contents[source] = content
        wrap, opaque = self._sampling(material)[1], material.alphaMode == "OPAQUE"
        texture = Texture(self._contents[source], where, wrap, opaque)
        return self._textures.setdefault((source, *wrap, opaque), texture)

    def _image(self, material: Material, lost: str) -> int | None:
        """The number of the image of a material's base colour; None without one, with a note if it is not read."""
        texture = None if material.texture is None else self._data.layout.textures[material.texture.index]
        if texture is not None and texture.image is None:
            kind = " or ".join(sorted(texture.extensions)) or "a texture without an image"
            self._told.add(f"{self._data.where}: {kind}: {lost}")
        return None if texture is None else texture.image

    def _sampling(self, material: Material) -> tuple[bool, tuple[Wrap, Wrap]]:
        """Whether a material's texture is magnified to its nearest texel, and its wraps."""
        assert material.texture is not None
        number = self._data.layout.textures[material.texture.index].sampler
        if number is None:
            return _BILINEAR
        sampler = self._data.layout.samplers[number]
        return sampler.magFilter == _NEAREST, (_WRAPS[sampler.wrapS], _WRAPS[sampler.wrapT])

    def _mask(self, number: int) -> Alphas:
        """The alphas of an image, decoded once."""
        source = self._source(number)
        if source not in self._masks:
            where = f"{self._data.where}: images {number + 1}"
            self._masks[source] = np.ascontiguousarray(read_image(self._content(number), where)[..., 3])
            if (total := sum(mask.size for mask in self._masks.values())) > MOST_MASKED:
                raise InputError(f"{where}: {total} texels of masks by now; a file may have {MOST_MASKED}")
        return self._masks[source]

    def _source(self, number: int) -> object:
        """Where the bytes of an image are, which several images may share."""
        image = self._data.layout.images[number]
        if image.bufferView is None:
            return image.uri
        view = self._data.layout.bufferViews[image.bufferView]
        return view.buffer, view.byteOffset, view.end

    def _content(self, number: int) -> bytes:
        """The bytes of an image. Raises InputError."""
        image, where = self._data.layout.images[number], f"{self._data.where}: images {number + 1}"
        if image.bufferView is not None:
            view = self._data.layout.bufferViews[image.bufferView]
            return self._data.buffers[view.buffer][view.byteOffset : view.end]
        if image.uri is None:
            raise InputError(f"{where}: found neither uri nor bufferView; one is needed")
        return read_uri(image.uri, self._path, where)

    @staticmethod
    def _of_vertices(primitive: TrianglePrimitive) -> tuple[Single | None, Single | None]:
        """(F, 3) vertex alphas, None without any; (F, 3) mean colours of the vertices, None if they have no colour."""
        colors = primitive.floats("COLOR_0", "VEC3", "VEC4")
        if colors is None:
            return None, None
        found = primitive.by_corner(np.clip(colors, 0.0, 1.0))
        return found[..., 3] if colors.shape[1] == 4 else None, found[..., :3].mean(axis=1)

    @staticmethod
    def _coordinates(primitive: TrianglePrimitive, info: TextureInfo | None) -> Single | None:
        """(F, 3, 2) texture coordinates of a texture after its KHR_texture_transform; None if there are none."""
        moved = TextureTransform() if info is None else info.transform
        number = moved.texCoord if moved.texCoord is not None or info is None else info.texCoord
        coordinates = primitive.floats(f"TEXCOORD_{number or 0}", "VEC2")
        if coordinates is None:
            return None
        cosine, sine = math.cos(moved.rotation), math.sin(moved.rotation)
        # Counter-clockwise as seen, with v downwards.
        coordinates = coordinates * moved.scale @ np.array([[cosine, -sine], [sine, cosine]]) + moved.offset
        return primitive.by_corner(coordinates)
