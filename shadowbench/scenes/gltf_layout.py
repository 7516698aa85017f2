"""A glTF's JSON, with the names of the specification: the fields used here, their types, indices and sizes checked."""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from shadowbench.scenes.tables import MOST_COPIES

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # by componentType
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}  # of components, by type

Count = Annotated[int, Field(ge=0, le=2**53, strict=True)]
Number = Annotated[float, Field(strict=True)]


class JsonObject(BaseModel):
    """Base class of the JSON's objects; unknown fields are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class Asset(JsonObject):
    """The asset object, with the glTF version."""

    version: str = Field(strict=True)


class SceneTable(JsonObject):
    """A scene, with its root nodes."""

    nodes: list[Count] = []


class LightIndex(JsonObject):
    """KHR_lights_punctual of a node: index of its light."""

    light: Count


class Visibility(JsonObject):
    """KHR_node_visibility of a node: whether it and its descendants are visible."""

    visible: bool = Field(True, strict=True)


class NodeExtensions(JsonObject):
    """Extensions of a node; the names of unknown ones are kept for notes."""

    model_config = ConfigDict(extra="allow")

    KHR_node_visibility: Visibility | None = None
    KHR_lights_punctual: LightIndex | None = None


class NodeTable(JsonObject):
    """A node: its transform, mesh, camera, skin and children."""

    name: str | None = None
    mesh: Count | None = None
    camera: Count | None = None
    skin: Any = None
    children: list[Count] = []
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    rotation: Annotated[list[Number], Field(min_length=4, max_length=4)] = [0, 0, 0, 1]
    scale: Annotated[list[Number], Field(min_length=3, max_length=3)] = [1, 1, 1]
    translation: Annotated[list[Number], Field(min_length=3, max_length=3)] = [0, 0, 0]
    extensions: NodeExtensions = NodeExtensions()

    @field_validator("rotation")
    @classmethod
    def _not_zero(cls, rotation: list[float]) -> list[float]:
        if not any(rotation):
            raise ValueError("found four zeros; allowed: a unit quaternion")
        return rotation


class Draco(JsonObject):
    """KHR_draco_mesh_compression of a primitive: its compressed bytes, and the Draco ids of its attributes."""

    bufferView: Count
    attributes: dict[str, Count]


class PrimitiveExtensions(JsonObject):
    """Extensions of a primitive."""

    KHR_draco_mesh_compression: Draco | None = None


class Primitive(JsonObject):
    """A primitive: accessors of its attributes and indices."""

    attributes: dict[str, Count]
    indices: Count | None = None
    mode: Count = 4
    material: Count | None = None
    targets: list[Any] | None = None
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class MeshTable(JsonObject):
    """A mesh: a list of primitives."""

    name: str | None = None
    primitives: list[Primitive]


class Accessor(JsonObject):
    """An accessor: `count` elements in a bufferView."""

    bufferView: Count | None = None
    byteOffset: Count = 0
    count: Count
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = Field(False, strict=True)
    sparse: dict[str, Any] | None = None


class BufferView(JsonObject):
    """A range of a buffer. `byteStride`: distance of successive elements, None if tightly packed."""

    buffer: Count
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=252, strict=True)] | None = None


class Buffer(JsonObject):
    """A buffer: a file, a data URI, or without `uri` the binary chunk of a .glb."""

    uri: str | None = None
    byteLength: Count


class MetallicRoughness(JsonObject):
    """The base colour of a material."""

    baseColorFactor: Annotated[list[Number], Field(min_length=3, max_length=4)] | None = None


class Material(JsonObject):
    """A material."""

    alphaMode: str = "OPAQUE"
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    extensions: dict[str, Any] = {}


class Perspective(JsonObject):
    """The parameters of a perspective camera."""

    yfov: Number
    znear: Number
    zfar: Number | None = None


class CameraTable(JsonObject):
    """A perspective or orthographic camera."""

    name: str | None = None
    type: str = Field(strict=True)
    perspective: Perspective | None = None


class SpotCone(JsonObject):
    """The cone of a spot light."""

    outerConeAngle: Number = math.pi / 4


class LightTable(JsonObject):
    """A KHR_lights_punctual light."""

    name: str | None = None
    type: str = Field(strict=True)
    spot: SpotCone = SpotCone()
    range: Number | None = None
    intensity: Number | None = None


class Lights(JsonObject):
    """KHR_lights_punctual of the file: its lights."""

    lights: list[LightTable]


class Extensions(JsonObject):
    """Extensions of the file; the names of unknown ones are kept for notes."""

    model_config = ConfigDict(extra="allow")

    KHR_lights_punctual: Lights | None = None


class Layout(JsonObject):
    """The JSON of a glTF file."""

    asset: Asset
    scene: Count | None = None
    scenes: list[SceneTable] | None = None
    nodes: Annotated[list[NodeTable], Field(max_length=MOST_COPIES)] = []
    meshes: list[MeshTable] = []
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []
    buffers: list[Buffer] = []
    materials: list[Material] = []
    cameras: list[CameraTable] = []
    animations: list[Any] = []
    extensionsUsed: list[str] = []
    extensionsRequired: list[str] = []
    extensions: Extensions = Extensions()
