"""A glTF's JSON as models: only what is used here, by the names of the glTF 2.0 specification."""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from shadowbench.scenes.tables import MOST_COPIES

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy's name of a number, by componentType."""
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers of an element, by type."""

Count = Annotated[int, Field(ge=0, le=2**53, strict=True)]
Number = Annotated[float, Field(strict=True)]


class JsonObject(BaseModel):
    """An object of the JSON; what it has beyond its fields is somebody else's."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class Asset(JsonObject):
    """Whose version decides how to read the rest."""

    version: str = Field(strict=True)


class SceneTable(JsonObject):
    """A scene: its root nodes."""

    nodes: list[Count] = []


class LightIndex(JsonObject):
    """A node's light."""

    light: Count


class Visibility(JsonObject):
    """Whether a node and what hangs on it are to be seen."""

    visible: bool = Field(True, strict=True)


class NodeExtensions(JsonObject):
    """Of a node; others are kept to be named."""

    model_config = ConfigDict(extra="allow")

    KHR_node_visibility: Visibility | None = None
    KHR_lights_punctual: LightIndex | None = None


class NodeTable(JsonObject):
    """A node: where it is, what it holds, what hangs on it."""

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
    def _turns(cls, rotation: list[float]) -> list[float]:
        if not any(rotation):
            raise ValueError("found four zeros; allowed: a unit quaternion")
        return rotation


class Draco(JsonObject):
    """A compressed primitive: where its bytes are, and which of its attributes is what."""

    bufferView: Count
    attributes: dict[str, Count]


class PrimitiveExtensions(JsonObject):
    """Of a primitive."""

    KHR_draco_mesh_compression: Draco | None = None


class Primitive(JsonObject):
    """Accessors by attribute, and of the indices."""

    attributes: dict[str, Count]
    indices: Count | None = None
    mode: Count = 4
    material: Count | None = None
    targets: list[Any] | None = None
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class MeshTable(JsonObject):
    """A mesh: one primitive or more."""

    name: str | None = None
    primitives: list[Primitive]


class Accessor(JsonObject):
    """`count` elements in a bufferView."""

    bufferView: Count | None = None
    byteOffset: Count = 0
    count: Count
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = Field(False, strict=True)
    sparse: dict[str, Any] | None = None


class BufferView(JsonObject):
    """A stretch of a buffer; `byteStride` from one element to the next, where they do not follow each other."""

    buffer: Count
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=252, strict=True)] | None = None


class Buffer(JsonObject):
    """Bytes: a file, a data URI, or without `uri` the second chunk of a .glb."""

    uri: str | None = None
    byteLength: Count


class MetallicRoughness(JsonObject):
    """The colour of a material."""

    baseColorFactor: Annotated[list[Number], Field(min_length=3, max_length=4)] | None = None


class Material(JsonObject):
    """A material."""

    alphaMode: str = "OPAQUE"
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    extensions: dict[str, Any] = {}


class Perspective(JsonObject):
    """A perspective camera."""

    yfov: Number
    znear: Number
    zfar: Number | None = None


class CameraTable(JsonObject):
    """A camera of either type."""

    name: str | None = None
    type: str = Field(strict=True)
    perspective: Perspective | None = None


class SpotCone(JsonObject):
    """Of a spot."""

    outerConeAngle: Number = math.pi / 4


class LightTable(JsonObject):
    """A KHR_lights_punctual light."""

    name: str | None = None
    type: str = Field(strict=True)
    spot: SpotCone = SpotCone()
    range: Number | None = None
    intensity: Number | None = None


class Lights(JsonObject):
    """The lights of the file."""

    lights: list[LightTable]


class Extensions(JsonObject):
    """Of the file; others are kept to be named."""

    model_config = ConfigDict(extra="allow")

    KHR_lights_punctual: Lights | None = None


class Layout(JsonObject):
    """A whole file."""

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
