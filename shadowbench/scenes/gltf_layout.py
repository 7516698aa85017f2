"""A glTF's JSON, with the names of the specification: the fields that are read, types, indices and sizes checked."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, AliasChoices, AliasPath, Field, model_validator

from shadowbench.scenes.geometry import MOST_TRIANGLES
from shadowbench.scenes.gltf_fields import (
    LISTS,
    AccessorIndex,
    Count,
    JsonObject,
    NodeIndex,
    Number,
    Three,
    ViewIndex,
    index_into,
)
from shadowbench.scenes.gltf_motion import MOST_MORPHED, Animation, Skin
from shadowbench.scenes.gltf_storage import MOST_ZEROS, Accessor, Buffer, BufferView, check_sizes
from shadowbench.scenes.tables import MOST_COPIES, MOST_NAMED

_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
DRACO = ("extensions", "KHR_draco_mesh_compression")


def _unit_quaternion(rotation: list[float]) -> list[float]:
    if not any(rotation):
        raise ValueError("found four zeros; allowed: a unit quaternion")
    return rotation


class _Scene(JsonObject):
    nodes: list[NodeIndex] = []


class NodeTable(JsonObject):
    """A node; with visible, light, instances of KHR_node_visibility, KHR_lights_punctual, EXT_mesh_gpu_instancing."""

    name: str | None = None
    mesh: Annotated[Count, index_into("meshes")] | None = None
    camera: Annotated[Count, index_into("cameras")] | None = None
    skin: Annotated[Count, index_into("skins")] | None = None
    weights: list[Number] | None = None
    children: list[NodeIndex] = []
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    rotation: Annotated[list[Number], Field(min_length=4, max_length=4), AfterValidator(_unit_quaternion)] = [
        0,
        0,
        0,
        1,
    ]
    scale: Three = [1, 1, 1]
    translation: Three = [0, 0, 0]
    visible: bool = Field(True, strict=True, validation_alias=AliasPath("extensions", "KHR_node_visibility", "visible"))
    light: Annotated[Count, index_into("lights")] | None = Field(
        None, validation_alias=AliasPath("extensions", "KHR_lights_punctual", "light")
    )
    instances: dict[str, AccessorIndex] = Field(
        {}, validation_alias=AliasPath("extensions", "EXT_mesh_gpu_instancing", "attributes")
    )
    extensions: dict[str, Any] = {}


class Primitive(JsonObject):
    """A primitive of a mesh. mode: points, lines, loop, strip of lines, triangles, strip and fan of triangles.

    draco, draco_ids: bufferView of KHR_draco_mesh_compression, and the Draco ids of attributes by name.
    """

    attributes: dict[str, AccessorIndex]
    indices: AccessorIndex | None = None
    mode: Literal[0, 1, 2, 3, 4, 5, 6] = 4
    material: Annotated[Count, index_into("materials")] | None = None
    targets: list[dict[str, AccessorIndex]] = []
    draco: ViewIndex | None = Field(None, validation_alias=AliasPath(*DRACO, "bufferView"))
    draco_ids: dict[str, Annotated[Count, Field(lt=2**32)]] = Field(
        {}, validation_alias=AliasPath(*DRACO, "attributes")
    )


class _Mesh(JsonObject):
    name: str | None = None
    weights: list[Number] = []
    primitives: list[Primitive]


class TextureTransform(JsonObject):
    """KHR_texture_transform."""

    offset: Annotated[list[Number], Field(min_length=2, max_length=2)] = [0, 0]
    rotation: Number = 0
    scale: Annotated[list[Number], Field(min_length=2, max_length=2)] = [1, 1]
    texCoord: Count | None = None


class TextureInfo(JsonObject):
    """A texture, and where on a surface it lies."""

    index: Annotated[Count, index_into("textures")]
    texCoord: Count = 0
    transform: TextureTransform = Field(
        TextureTransform(), validation_alias=AliasPath("extensions", "KHR_texture_transform")
    )


class _Colors(JsonObject):
    """The base or diffuse colour of a material's workflow."""

    color: Annotated[list[Number], Field(min_length=3, max_length=4)] | None = Field(
        None, validation_alias=AliasChoices("baseColorFactor", "diffuseFactor")
    )
    texture: TextureInfo | None = Field(None, validation_alias=AliasChoices("baseColorTexture", "diffuseTexture"))


class Material(JsonObject):
    """A material, as far as it says where a surface is opaque, and its colour."""

    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alphaCutoff: Annotated[Number, Field(ge=0)] = 0.5
    metallic: _Colors = Field(_Colors(), validation_alias="pbrMetallicRoughness")
    glossy: _Colors | None = Field(None, validation_alias=AliasPath("extensions", _GLOSSY))
    extensions: dict[str, Any] = {}

    @property
    def color(self) -> list[float] | None:
        """The factor of its base colour; of a material with both workflows from the extension, as it demands."""
        return (self.glossy or self.metallic).color

    @property
    def texture(self) -> TextureInfo | None:
        """The texture of the same workflow, which may lack it."""
        return (self.glossy or self.metallic).texture

    @property
    def transmits(self) -> bool:
        """Whether light passes through it, as through glass."""
        return "KHR_materials_transmission" in self.extensions


class _Texture(JsonObject):
    """A texture; `webp`: the image of EXT_texture_webp, `source` that of core glTF, one or both or none."""

    sampler: Annotated[Count, index_into("samplers")] | None = None
    source: Annotated[Count, index_into("images")] | None = None
    webp: Annotated[Count, index_into("images")] | None = Field(
        None, validation_alias=AliasPath("extensions", "EXT_texture_webp", "source")
    )
    extensions: dict[str, Any] = {}

    @property
    def image(self) -> int | None:
        return self.source if self.webp is None else self.webp


class _Sampler(JsonObject):
    magFilter: Literal[9728, 9729] = 9729
    wrapS: Literal[33071, 33648, 10497] = 10497
    wrapT: Literal[33071, 33648, 10497] = 10497


class _Image(JsonObject):
    uri: str | None = None
    bufferView: ViewIndex | None = None


class _Camera(JsonObject):
    name: str | None = None
    type: Literal["perspective", "orthographic"]
    yfov: Number = Field(0.0, lt=math.pi, validation_alias=AliasPath("perspective", "yfov"))
    znear: Number = Field(0.0, validation_alias=AliasPath("perspective", "znear"))
    zfar: Number | None = Field(None, validation_alias=AliasPath("perspective", "zfar"))


class _Light(JsonObject):
    name: str | None = None
    type: Literal["directional", "point", "spot"]
    outerConeAngle: Number = Field(math.pi / 4, validation_alias=AliasPath("spot", "outerConeAngle"))
    range: Number | None = None
    intensity: Number | None = None


class Layout(JsonObject):
    """The JSON of a glTF file."""

    version: str = Field(strict=True, pattern=r"^2\.", validation_alias=AliasPath("asset", "version"))
    scene: Annotated[Count, index_into("scenes")] | None = None
    scenes: list[_Scene] | None = None
    nodes: Annotated[list[NodeTable], Field(max_length=MOST_COPIES)] = []
    meshes: list[_Mesh] = []
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []
    buffers: list[Buffer] = []
    materials: list[Material] = []
    textures: list[_Texture] = []
    samplers: list[_Sampler] = []
    images: list[_Image] = []
    cameras: list[_Camera] = []
    lights: list[_Light] = Field([], validation_alias=LISTS["lights"])
    animations: list[Animation] = []
    skins: list[Skin] = []
    extensionsUsed: list[str] = []
    extensionsRequired: list[str] = []
    extensions: dict[str, Any] = {}

    @property
    def primitives(self) -> list[Primitive]:
        """The primitives of all meshes."""
        return [primitive for mesh in self.meshes for primitive in mesh.primitives]

    @model_validator(mode="after")
    def _sizes_fit(self) -> Self:
        check_sizes(self.buffers, self.bufferViews, self.accessors)
        packed = {index for one in self.primitives if one.draco for index in (*one.attributes.values(), one.indices)}
        empty = [one for k, one in enumerate(self.accessors) if one.dense is None and k not in packed]
        if (zeros := sum(one.count * one.row[1] for one in empty)) > MOST_ZEROS:
            raise ValueError(f"its accessors without a bufferView have {zeros} numbers; allowed are {MOST_ZEROS}")
        for what, held in (("cameras", [n.camera for n in self.nodes]), ("lights", [n.light for n in self.nodes])):
            if (count := len(held) - held.count(None)) > MOST_NAMED:
                raise ValueError(f"its nodes hold {count} {what}; allowed are at most {MOST_NAMED}")
        return self

    @model_validator(mode="after")
    def _not_too_many_triangles(self) -> Self:
        """Sharing of bufferViews and meshes allows many in a small file."""
        counts = [sum(self._corners(primitive) for primitive in mesh.primitives) for mesh in self.meshes]
        corners = copies = 0
        for node in self.nodes:
            if node.mesh is not None:
                corners += counts[node.mesh] * self.instance_count(node)
                copies += max(len(self.meshes[node.mesh].primitives), 1) * self.instance_count(node)
        corners = max(corners, sum(counts))
        if corners > 3 * MOST_TRIANGLES:
            raise ValueError(f"its nodes draw {corners} vertices; allowed are {3 * MOST_TRIANGLES}, three a triangle")
        if copies > MOST_COPIES:
            raise ValueError(f"its nodes draw {copies} primitives; allowed are at most {MOST_COPIES}")
        morphed = sum(self._morphed(node.mesh) for node in self.nodes if node.mesh is not None)
        if morphed > MOST_MORPHED:
            raise ValueError(f"its morph targets move {morphed} vertices; allowed are at most {MOST_MORPHED}")
        return self

    def instance_count(self, node: NodeTable) -> int:
        """How often a node draws its mesh. Raises ValueError if the attributes of its instances differ in length."""
        counts = {self.accessors[index].count for index in node.instances.values()} or {1}
        if len(counts) > 1:
            raise ValueError(f"EXT_mesh_gpu_instancing: attributes of {min(counts)} and {max(counts)} elements differ")
        return counts.pop()

    def _morphed(self, mesh: int) -> int:
        """Number of displacements of a mesh's vertices."""
        return sum(len(each.targets) * self._corners(each) for each in self.meshes[mesh].primitives)

    def _corners(self, primitive: Primitive) -> int:
        """Lower bound on the number of vertices that a primitive draws."""
        used = [primitive.attributes.get("POSITION"), primitive.indices]
        return max((self.accessors[index].count for index in used if index is not None), default=0)
