"""A glTF's JSON, with the names of the specification: the fields that are read, types, indices and sizes checked."""

import math
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import (
    AfterValidator,
    AliasChoices,
    AliasPath,
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    model_validator,
)

from shadowbench.scenes.scene_tables import MOST_COPIES, NARROWEST
from shadowbench.scenes.triangles import MOST_TRIANGLES

LISTS = {"lights": AliasPath("extensions", "KHR_lights_punctual", "lights")}
"""Lists of extensions."""

Count = Annotated[int, Field(ge=0, le=2**53, strict=True)]
Number = Annotated[float, Field(strict=True)]
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]


def index_into(part: str) -> AfterValidator:
    """Checks an index into a list of the file's top level."""

    def check(index: int, info: ValidationInfo) -> int:
        document: dict[str, Any] = info.context or {}
        parts = LISTS[part].search_dict_for_path(document) if part in LISTS else document.get(part)
        count = len(parts) if isinstance(parts, list | dict) else 0
        if index >= count:
            raise ValueError(f"found {index}; allowed: {f'0 to {count - 1}' if count else 'none, as there are none'}")
        return index

    return AfterValidator(check)


AccessorIndex = Annotated[Count, index_into("accessors")]
NodeIndex = Annotated[Count, index_into("nodes")]
ViewIndex = Annotated[Count, index_into("bufferViews")]


class JsonObject(BaseModel):
    """A table whose unknown fields are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # by componentType
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}  # of components, by type
MOST_DECOMPRESSED = 2 << 30
"""Limit on the bytes of a file's compressed bufferViews, once decompressed."""
MOST_ZEROS = 1 << 26
"""Limit on the numbers of a file's accessors without a bufferView, which are zero but for the sparse ones."""
BufferIndex = Annotated[Count, index_into("buffers")]


class Range(NamedTuple):
    """The elements of an accessor that lie in a bufferView: their number, type and place."""

    bufferView: int
    byteOffset: int
    length: int
    dtype: np.dtype[Any]
    numbers: int


class _SparseIndices(JsonObject):
    bufferView: ViewIndex
    byteOffset: Count = 0
    componentType: Literal[5121, 5123, 5125]


class _SparseValues(JsonObject):
    bufferView: ViewIndex
    byteOffset: Count = 0


class _Sparse(JsonObject):
    count: Count
    indices: _SparseIndices
    values: _SparseValues


class Accessor(JsonObject):
    """`count` elements in a bufferView, of which `sparse` replaces some."""

    bufferView: ViewIndex | None = None
    byteOffset: Count = 0
    count: Count
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = Field(False, strict=True)
    sparse: _Sparse | None = None

    @property
    def row(self) -> tuple[np.dtype[Any], int]:
        """Type and number of an element's components."""
        return np.dtype(DTYPES[self.componentType]), NUMBERS[self.type]

    @property
    def dense(self) -> Range | None:
        """All elements, None if they are zero."""
        return None if self.bufferView is None else Range(self.bufferView, self.byteOffset, self.count, *self.row)

    @property
    def replaced(self) -> tuple[Range, Range] | None:
        """Indices and values of the elements that `sparse` replaces."""
        if self.sparse is None:
            return None
        (count, at, to), (dtype, numbers) = dict(self.sparse).values(), self.row
        indices = Range(at.bufferView, at.byteOffset, count, np.dtype(DTYPES[at.componentType]), 1)
        return indices, Range(to.bufferView, to.byteOffset, count, dtype, numbers)


class _Compressed(JsonObject):
    """A bufferView's elements as EXT_meshopt_compression and KHR_meshopt_compression store it.

    The second has more of the same stream: vertex codec 1, and the filter COLOR.
    """

    buffer: BufferIndex
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Count
    count: Count
    mode: str
    filter: str = "NONE"

    @property
    def end(self) -> int:
        return self.byteOffset + self.byteLength


class BufferView(JsonObject):
    """Bytes of a buffer. compressed: what decompresses to them, by an extension."""

    buffer: BufferIndex
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=252, strict=True)] | None = None
    compressed: _Compressed | None = Field(
        None,
        validation_alias=AliasChoices(
            AliasPath("extensions", "EXT_meshopt_compression"), AliasPath("extensions", "KHR_meshopt_compression")
        ),
    )

    @property
    def end(self) -> int:
        """Byte of the buffer at which it ends."""
        return self.byteOffset + self.byteLength


class Buffer(JsonObject):
    """Bytes of a file or of the JSON."""

    uri: str | None = None
    byteLength: Count


def check_sizes(buffers: list[Buffer], views: list[BufferView], accessors: list[Accessor]) -> None:
    """Raises ValueError for what lies outside its buffer or bufferView, or decompresses to too much."""
    for k, view in enumerate(views, 1):
        for source in (view, view.compressed):
            if source is not None and source.end > (size := buffers[source.buffer].byteLength):
                raise ValueError(f"bufferViews {k}: ends at byte {source.end} of a buffer of {size}")
        if (packed := view.compressed) is not None and packed.count * packed.byteStride != view.byteLength:
            found = f"{packed.count} elements of {packed.byteStride} bytes are compressed"
            raise ValueError(f"bufferViews {k}: {found} in a bufferView of {view.byteLength}")
    total = sum(view.byteLength for view in views if view.compressed is not None)
    if total > MOST_DECOMPRESSED:
        raise ValueError(f"its bufferViews decompress to {total} bytes; allowed are at most {MOST_DECOMPRESSED}")
    for k, accessor in enumerate(accessors, 1):
        for part in (accessor.dense, *(accessor.replaced or ())):
            if part is not None:
                _check_range(part, views[part.bufferView], f"accessors {k}")


def _check_range(part: Range, view: BufferView, where: str) -> None:
    row = part.dtype.itemsize * part.numbers
    if view.byteStride is not None and view.byteStride < row and part.length > 1:
        raise ValueError(f"{where}: elements of {row} bytes overlap at a byteStride of {view.byteStride}")
    end = part.byteOffset + (part.length and (part.length - 1) * (view.byteStride or row) + row)
    if end > view.byteLength:
        raise ValueError(f"{where}: {part.length} elements end at byte {end} of a bufferView of {view.byteLength}")


class Skin(JsonObject):
    """Nodes that are joints, and an accessor of the matrices from a mesh to each of them; None: identities."""

    joints: Annotated[list[NodeIndex], Field(min_length=1)]
    inverseBindMatrices: AccessorIndex | None = None


class Sampler(JsonObject):
    """Accessors of the times of keys, in seconds, and of their values."""

    input: AccessorIndex
    output: AccessorIndex
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class _Target(JsonObject):
    """What of a node is set; path: translation, rotation, scale, weights, or what an extension defines."""

    node: NodeIndex | None = None
    path: str


class Channel(JsonObject):
    """Index of the sampler that sets a target."""

    sampler: Count
    target: _Target


class Animation(JsonObject):
    """A clip."""

    name: str | None = None
    channels: list[Channel]
    samplers: list[Sampler]

    @model_validator(mode="after")
    def _samplers_exist(self) -> Self:
        for k, channel in enumerate(self.channels, 1):
            if channel.sampler >= len(self.samplers):
                raise ValueError(f"channels {k}: found sampler {channel.sampler} of {len(self.samplers)}, from 0")
        return self


_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
DRACO = ("extensions", "KHR_draco_mesh_compression")


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
    rotation: Annotated[list[Number], Field(min_length=4, max_length=4)] = [0, 0, 0, 1]
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


class _Perspective(JsonObject):
    aspectRatio: Number | None = Field(None, gt=0.0)
    yfov: Number = Field(ge=math.radians(NARROWEST), lt=math.pi)
    znear: Number = Field(gt=0.0)
    zfar: Number | None = Field(None, gt=0.0)


class _Orthographic(JsonObject):
    xmag: Number = Field(gt=0.0)
    ymag: Number = Field(gt=0.0)
    znear: Number = Field(ge=0.0)
    zfar: Number = Field(gt=0.0)


class _Camera(JsonObject):
    name: str | None = None
    perspective: _Perspective | None = None
    orthographic: _Orthographic | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.perspective is None) == (self.orthographic is None):
            raise ValueError("needs either perspective or orthographic")
        return self


class _Light(JsonObject):
    name: str | None = None
    type: Literal["directional", "point", "spot"]
    outerConeAngle: Number = Field(
        math.pi / 4, gt=0.0, le=math.pi / 2 + 1e-6, validation_alias=AliasPath("spot", "outerConeAngle")
    )
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
        return self

    @model_validator(mode="after")
    def _not_too_many_triangles(self) -> Self:
        """Sharing of bufferViews and meshes allows many in a small file."""
        counts = [sum(self._corners(primitive) for primitive in mesh.primitives) for mesh in self.meshes]
        users = [(node.mesh, self.instance_count(node)) for node in self.nodes if node.mesh is not None]
        corners = max(sum(counts), sum(counts[mesh] * count for mesh, count in users))
        copies = sum(max(len(self.meshes[mesh].primitives), 1) * count for mesh, count in users)
        if corners > 3 * MOST_TRIANGLES:
            raise ValueError(f"its nodes draw {corners} vertices; allowed are {3 * MOST_TRIANGLES}, three a triangle")
        if copies > MOST_COPIES:
            raise ValueError(f"its nodes draw {copies} primitives; allowed are at most {MOST_COPIES}")
        return self

    def instance_count(self, node: NodeTable) -> int:
        """How often a node draws its mesh. Raises ValueError if the attributes of its instances differ in length."""
        counts = {self.accessors[index].count for index in node.instances.values()} or {1}
        if len(counts) > 1:
            raise ValueError(f"EXT_mesh_gpu_instancing: attributes of {min(counts)} and {max(counts)} elements differ")
        return counts.pop()

    def _corners(self, primitive: Primitive) -> int:
        """Lower bound on the number of vertices that a primitive draws."""
        used = [primitive.attributes.get("POSITION"), primitive.indices]
        return max((self.accessors[index].count for index in used if index is not None), default=0)
