"""Checks of a glTF document: indices, sizes, and numbers of parts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_layout import DTYPES, NUMBERS, Accessor, Layout, Primitive
from shadowbench.scenes.tables import MOST_NAMED
from shadowbench.scenes.triangles import MOST_TRIANGLES
from shadowbench.strict import explain


def checked_layout(document: dict[str, Any], where: str) -> Layout:
    """The validated JSON. Raises InputError for a wrong type, an index out of range, or a size beyond its buffer."""
    try:
        layout = Layout.model_validate(document)
    except ValidationError as error:
        raise explain(where, error) from error
    if not layout.asset.version.startswith("2."):
        raise InputError(f"{where}: asset.version is {layout.asset.version!r:.20}; allowed: 2.x")
    _check_nodes(layout, where)
    _check_meshes(layout, where)
    for number, view in enumerate(layout.bufferViews):
        _check_index(view.buffer, layout.buffers, f"{where}: bufferViews[{number}].buffer")
        size, end = layout.buffers[view.buffer].byteLength, view.byteOffset + view.byteLength
        if end > size:
            raise InputError(f"{where}: bufferViews[{number}]: ends at byte {end} of a buffer of {size}")
    for number, accessor in enumerate(layout.accessors):
        _check_accessor(accessor, layout, f"{where}: accessors[{number}]")
    _check_triangles(layout, where)
    return layout


def _check_nodes(layout: Layout, where: str) -> None:
    """Scenes, nodes and what these hold."""
    if layout.scenes is not None:
        _check_index(layout.scene or 0, layout.scenes, f"{where}: scene")
    for root in layout.scenes or []:
        for child in root.nodes:
            _check_index(child, layout.nodes, f"{where}: scenes: nodes")
    lights = layout.extensions.KHR_lights_punctual
    shining = [node.extensions.KHR_lights_punctual for node in layout.nodes]
    for number, (node, light) in enumerate(zip(layout.nodes, shining, strict=True)):
        entry = f"{where}: nodes[{number}]"
        _check_index(node.mesh, layout.meshes, f"{entry}.mesh")
        _check_index(node.camera, layout.cameras, f"{entry}.camera")
        for child in node.children:
            _check_index(child, layout.nodes, f"{entry}.children")
        _check_index(light.light if light else None, lights.lights if lights else [], f"{entry}: light")
    for what, held in (("cameras", [node.camera for node in layout.nodes]), ("lights", shining)):
        if (count := len(held) - held.count(None)) > MOST_NAMED:
            raise InputError(f"{where}: its nodes hold {count} {what}; allowed are at most {MOST_NAMED}")
    for number, camera in enumerate(layout.cameras):
        if camera.type == "perspective" and camera.perspective is None:
            raise InputError(f"{where}: cameras[{number}].perspective: found none; it must be given")


def _check_meshes(layout: Layout, where: str) -> None:
    for number, mesh in enumerate(layout.meshes):
        for primitive in mesh.primitives:
            entry = f"{where}: meshes[{number}]: primitive"
            for name, index in primitive.attributes.items():
                _check_index(index, layout.accessors, f"{entry}: {name:.40}")
            _check_index(primitive.indices, layout.accessors, f"{entry}: indices")
            _check_index(primitive.material, layout.materials, f"{entry}: material")
            if (draco := primitive.extensions.KHR_draco_mesh_compression) is not None:
                _check_index(draco.bufferView, layout.bufferViews, f"{entry}: KHR_draco_mesh_compression")


def _check_index(index: int | None, parts: Sequence[object], where: str) -> None:
    if index is not None and index >= len(parts):
        allowed = f"0 to {len(parts) - 1}" if parts else "none, as there are none"
        raise InputError(f"{where}: found {index}; allowed: {allowed}")


def _check_accessor(accessor: Accessor, layout: Layout, where: str) -> None:
    if accessor.bufferView is None:
        return  # zeros by the specification, or filled by an extension's decoder
    _check_index(accessor.bufferView, layout.bufferViews, f"{where}.bufferView")
    view = layout.bufferViews[accessor.bufferView]
    row = np.dtype(DTYPES[accessor.componentType]).itemsize * NUMBERS[accessor.type]
    end = accessor.byteOffset + (accessor.count and (accessor.count - 1) * (view.byteStride or row) + row)
    if end > view.byteLength:
        raise InputError(f"{where}: {accessor.count} elements end at byte {end} of a bufferView of {view.byteLength}")


def _check_triangles(layout: Layout, where: str) -> None:
    """Raise InputError for too many triangles, which sharing of bufferViews and meshes allows in a small file."""
    counts = [sum(_corners(primitive, layout) for primitive in mesh.primitives) for mesh in layout.meshes]
    drawn = sum(counts[node.mesh] for node in layout.nodes if node.mesh is not None)
    corners = max(sum(counts), drawn)
    if corners > 3 * MOST_TRIANGLES:
        raise InputError(f"{where}: its meshes have {corners} vertices; allowed are at most {3 * MOST_TRIANGLES}")


def _corners(primitive: Primitive, layout: Layout) -> int:
    """Lower bound on the number of vertices that a primitive draws."""
    used = [primitive.attributes.get("POSITION"), primitive.indices]
    return max((layout.accessors[index].count for index in used if index is not None), default=0)
