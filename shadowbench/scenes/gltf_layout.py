"""The layout of a glTF's JSON, checked before anything is read by it: types, indices, and sizes against its buffers.

Only what is used here is looked at; the names are those of the glTF 2.0 specification.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from shadowbench.errors import InputError
from shadowbench.scenes.tables import MOST_COPIES, MOST_NAMED
from shadowbench.scenes.triangles import MOST_TRIANGLES
from shadowbench.strict import explain

BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of a number, by componentType."""
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers of an element, by type."""

Count = Annotated[int, Field(ge=0, le=2**53, strict=True)]
Number = Annotated[float, Field(strict=True)]


class Part(BaseModel):
    """An object of the JSON; what it has beyond its fields is somebody else's."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class Asset(Part):
    """Whose version decides how to read the rest."""

    version: str = Field(strict=True)


class Root(Part):
    """A scene: its root nodes."""

    nodes: list[Count] = []


class LightReference(Part):
    """A node's light."""

    light: Count


class Visibility(Part):
    """Whether a node and what hangs on it are to be seen."""

    visible: bool = Field(True, strict=True)


class NodeExtensions(Part):
    """Of a node; others are kept to be named."""

    model_config = ConfigDict(extra="allow")

    KHR_node_visibility: Visibility | None = None
    KHR_lights_punctual: LightReference | None = None


class NodeTable(Part):
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


class Draco(Part):
    """A compressed primitive: where its bytes are, and which of its attributes is what."""

    bufferView: Count
    attributes: dict[str, Count]


class PrimitiveExtensions(Part):
    """Of a primitive."""

    KHR_draco_mesh_compression: Draco | None = None


class Primitive(Part):
    """Accessors by attribute, and of the indices."""

    attributes: dict[str, Count]
    indices: Count | None = None
    mode: Count = 4
    material: Count | None = None
    targets: list[Any] | None = None
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class MeshTable(Part):
    """A mesh: one primitive or more."""

    name: str | None = None
    primitives: list[Primitive]


class Accessor(Part):
    """`count` elements in a bufferView."""

    bufferView: Count | None = None
    byteOffset: Count = 0
    count: Count
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = Field(False, strict=True)
    sparse: dict[str, Any] | None = None


class BufferView(Part):
    """A stretch of a buffer; `byteStride` from one element to the next, where they do not follow each other."""

    buffer: Count
    byteOffset: Count = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=1, le=252, strict=True)] | None = None


class Buffer(Part):
    """Bytes: a file, a data URI, or without `uri` the second chunk of a .glb."""

    uri: str | None = None
    byteLength: Count


class Surface(Part):
    """The colour of a material."""

    baseColorFactor: Annotated[list[Number], Field(min_length=3, max_length=4)] | None = None


class Material(Part):
    """A material."""

    alphaMode: str = "OPAQUE"
    pbrMetallicRoughness: Surface = Surface()
    extensions: dict[str, Any] = {}


class Lens(Part):
    """A perspective camera."""

    yfov: Number
    znear: Number
    zfar: Number | None = None


class CameraTable(Part):
    """A camera of either type."""

    name: str | None = None
    type: str = Field(strict=True)
    perspective: Lens | None = None


class Cone(Part):
    """Of a spot."""

    outerConeAngle: Number = math.pi / 4


class LightTable(Part):
    """A KHR_lights_punctual light."""

    name: str | None = None
    type: str = Field(strict=True)
    spot: Cone = Cone()
    range: Number | None = None
    intensity: Number | None = None


class Lights(Part):
    """The lights of the file."""

    lights: list[LightTable]


class Extensions(Part):
    """Of the file; others are kept to be named."""

    model_config = ConfigDict(extra="allow")

    KHR_lights_punctual: Lights | None = None


class Layout(Part):
    """A whole file."""

    asset: Asset
    scene: Count | None = None
    scenes: list[Root] | None = None
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


def checked_layout(document: dict[str, Any], where: str) -> Layout:
    """The layout of a document; InputError if a part is of a wrong type, or an index names what is not there."""
    try:
        layout = Layout.model_validate(document)
    except ValidationError as error:
        raise explain(where, error) from error
    if not layout.asset.version.startswith("2."):
        raise InputError(f"{where}: asset.version is {layout.asset.version!r:.20}; allowed: 2.x")
    if layout.scenes is not None:
        _check_index(layout.scene or 0, layout.scenes, f"{where}: scene")
    for root in layout.scenes or []:
        for child in root.nodes:
            _check_index(child, layout.nodes, f"{where}: scenes: nodes")
    lights = layout.extensions.KHR_lights_punctual
    for number, node in enumerate(layout.nodes):
        told = f"{where}: nodes[{number}]"
        _check_index(node.mesh, layout.meshes, f"{told}.mesh")
        _check_index(node.camera, layout.cameras, f"{told}.camera")
        for child in node.children:
            _check_index(child, layout.nodes, f"{told}.children")
        reference = node.extensions.KHR_lights_punctual
        _check_index(reference.light if reference else None, lights.lights if lights else [], f"{told}: light")
    for what, count in (
        ("cameras", sum(node.camera is not None for node in layout.nodes)),
        ("lights", sum(node.extensions.KHR_lights_punctual is not None for node in layout.nodes)),
    ):
        if count > MOST_NAMED:
            raise InputError(f"{where}: its nodes hold {count} {what}; allowed are at most {MOST_NAMED}")
    for number, camera in enumerate(layout.cameras):
        if camera.type == "perspective" and camera.perspective is None:
            raise InputError(f"{where}: cameras[{number}].perspective: found none; it must be given")
    for number, mesh in enumerate(layout.meshes):
        for primitive in mesh.primitives:
            told = f"{where}: meshes[{number}]: primitive"
            for name, index in primitive.attributes.items():
                _check_index(index, layout.accessors, f"{told}: {name:.40}")
            _check_index(primitive.indices, layout.accessors, f"{told}: indices")
            _check_index(primitive.material, layout.materials, f"{told}: material")
            draco = primitive.extensions.KHR_draco_mesh_compression
            _check_index(draco.bufferView if draco else None, layout.bufferViews, f"{told}: KHR_draco_mesh_compression")
    for number, view in enumerate(layout.bufferViews):
        _check_index(view.buffer, layout.buffers, f"{where}: bufferViews[{number}].buffer")
        size = layout.buffers[view.buffer].byteLength
        if view.byteOffset + view.byteLength > size:
            end = view.byteOffset + view.byteLength
            raise InputError(f"{where}: bufferViews[{number}]: ends at byte {end} of a buffer of {size}")
    for number, accessor in enumerate(layout.accessors):
        _check_accessor(accessor, layout, f"{where}: accessors[{number}]")
    _check_triangles(layout, where)
    return layout


def _check_index(index: int | None, parts: list[Any], where: str) -> None:
    if index is not None and index >= len(parts):
        allowed = f"0 to {len(parts) - 1}" if parts else "none, as there are none"
        raise InputError(f"{where}: found {index}; allowed: {allowed}")


def _check_accessor(accessor: Accessor, layout: Layout, where: str) -> None:
    if accessor.bufferView is None:
        return  # zeros by the specification, a decoder's result by an extension
    _check_index(accessor.bufferView, layout.bufferViews, f"{where}.bufferView")
    view = layout.bufferViews[accessor.bufferView]
    row = BYTES[accessor.componentType] * NUMBERS[accessor.type]
    end = accessor.byteOffset + (accessor.count and (accessor.count - 1) * (view.byteStride or row) + row)
    if end > view.byteLength:
        raise InputError(f"{where}: {accessor.count} elements end at byte {end} of a bufferView of {view.byteLength}")


def _check_triangles(layout: Layout, where: str) -> None:
    """Against few bytes that stand for many triangles: accessors that share a bufferView, nodes that share a mesh."""
    counts = [sum(_corners(primitive, layout) for primitive in mesh.primitives) for mesh in layout.meshes]
    drawn = sum(counts[node.mesh] for node in layout.nodes if node.mesh is not None)
    corners = max(sum(counts), drawn)
    if corners > 3 * MOST_TRIANGLES:
        raise InputError(f"{where}: its meshes have {corners} vertices; allowed are at most {3 * MOST_TRIANGLES}")


def _corners(primitive: Primitive, layout: Layout) -> int:
    """Vertices that a primitive reads, through its indices or not, at least."""
    used = [primitive.attributes.get("POSITION"), primitive.indices]
    return max((layout.accessors[index].count for index in used if index is not None), default=0)
