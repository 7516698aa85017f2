"""glTF: the node tree, cameras and lights, and notes on unsupported features.

Not read by trimesh, because it gives instances random names, keeps only one camera, and drops the children of a
camera's node.
"""

import json
import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_layout import Layout, NodeTable
from shadowbench.scenes.model import WIDEST_CONE, Camera, Light
from shadowbench.scenes.tables import LONGEST_NAME, NARROWEST, name_from
from shadowbench.scenes.vectors import Floats, unit, vec3

# Extensions that are supported, or do not affect the geometry.
HONOURED = re.compile(
    r"KHR_draco_mesh_compression|KHR_mesh_quantization|KHR_lights_punctual|KHR_node_visibility"
    r"|(KHR|EXT|MSFT)_texture_\w+|KHR_materials_\w+|KHR_xmp\w*|EXT_lights_image_based"
)
WITH_OWN_NOTE = {"EXT_mesh_gpu_instancing"}
"""Unsupported extensions with a note of their own in `notes_on`."""
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
LINES = (1, 2, 3)
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class Node(NamedTuple):
    """A node of the default scene: its table, its (4, 4) float64 node-to-world matrix, and its visibility."""

    data: NodeTable
    matrix: Floats
    visible: bool


def read_json(path: Path) -> tuple[dict[str, Any], bytes | None]:
    """The JSON of a .gltf or .glb, and the binary chunk of a .glb or None. Raises ValueError for other files."""
    data, chunk = path.read_bytes(), None
    if path.suffix.lower() == ".glb":
        if len(data) < 20 or data[:4] != b"glTF":
            raise ValueError("not a GLB: the first four bytes are not glTF")
        version, length, end, kind = struct.unpack("<IIII", data[4:20])
        end += 20
        if version != 2:
            raise ValueError(f"glTF version {version}; allowed: 2")
        if length > len(data) or kind != JSON_CHUNK or end > len(data):
            raise ValueError(f"cut short: {len(data)} bytes of {length}")
        if end + 8 <= len(data):
            size, kind = struct.unpack("<II", data[end : end + 8])
            if kind == BINARY_CHUNK:
                chunk = data[end + 8 : end + 8 + size]
        data = data[20:end]
    document = json.loads(data)
    if not isinstance(document, dict):
        raise ValueError("the JSON is not an object")
    return document, chunk


def nodes_of(layout: Layout) -> Iterator[Node]:
    """Every node of the default scene, parents before children, in the order of the file."""
    nodes = layout.nodes
    if layout.scenes is not None:
        roots = layout.scenes[layout.scene or 0].nodes
    else:
        children = {child for node in nodes for child in node.children}
        roots = [index for index in range(len(nodes)) if index not in children]
    waiting = [(index, np.eye(4), True) for index in reversed(roots)]
    seen: set[int] = set()
    while waiting:
        index, parent, visible = waiting.pop()
        if index in seen or not 0 <= index < len(nodes):
            raise ValueError(f"node {index} is missing, has two parents or is its own ancestor")
        seen.add(index)
        node = nodes[index]
        matrix = parent @ _local_matrix(node)
        # KHR_node_visibility hides the meshes and lights of a node and its descendants, but not cameras.
        visibility = node.extensions.KHR_node_visibility
        visible = visible and (visibility is None or visibility.visible)
        waiting.extend((child, matrix, visible) for child in reversed(node.children))
        yield Node(node, matrix, visible)


def _local_matrix(node: NodeTable) -> Floats:
    from scipy.spatial.transform import Rotation  # the import takes 0.3 s

    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(node.rotation).as_matrix() * node.scale
    matrix[:3, 3] = node.translation
    return matrix


def cameras_of(layout: Layout, where: str) -> tuple[list[Camera], list[str]]:
    """The perspective cameras of the scene, and a note if it has orthographic ones.

    Raises InputError for an invalid field of view, near or far plane or direction.
    """
    cameras: list[Camera] = []
    orthographic = 0
    for node in nodes_of(layout):
        if node.data.camera is None:
            continue
        data = layout.cameras[node.data.camera]
        if data.type != "perspective" or data.perspective is None:
            orthographic += 1
            continue
        fov, near, far = data.perspective.yfov, data.perspective.znear, data.perspective.zfar
        if not math.radians(NARROWEST) <= fov < math.pi:
            raise InputError(
                f"{where}: camera: yfov is {fov:g} rad; allowed: {math.radians(NARROWEST):.3g} to below pi"
            )
        if not 0.0 < near < (math.inf if far is None else far):
            raise InputError(f"{where}: camera: znear is {near:g} and zfar {far}; allowed: 0 < znear < zfar")
        position, forward = _pose(node, where, "camera")
        name = _unique(node.data.name or data.name, "camera", {camera.name for camera in cameras})
        # The distance of the target scales with the position's coordinates, so that rounding keeps the direction.
        reach = max(1.0, float(np.linalg.norm(position)))
        cameras.append(
            Camera(
                name=name,
                position=vec3(position),
                target=vec3(position + forward * reach),
                fov_y=fov,
                up=vec3(unit(node.matrix[:3, 1])),
                near=near,
                far=far,
            )
        )
    left_out = f"{where}: {orthographic} orthographic camera(s) left out: cameras here are perspective"
    return cameras, [left_out] if orthographic else []


def lights_of(layout: Layout, where: str) -> tuple[list[Light], list[str]]:
    """The KHR_lights_punctual lights on visible nodes (KHR_node_visibility), and a note for each ignored property."""
    lights: list[Light] = []
    notes = []
    extension = layout.extensions.KHR_lights_punctual
    for node in nodes_of(layout):
        light_index = node.data.extensions.KHR_lights_punctual
        if light_index is None or extension is None or not node.visible:
            continue
        data = extension.lights[light_index.light]
        kind = data.type
        name = _unique(node.data.name or data.name, "light", {light.name for light in lights})
        position, direction = _pose(node, where, "light")
        if kind == "directional":
            lights.append(Light(name, "directional", direction=vec3(direction)))
        elif kind == "point":
            lights.append(Light(name, "point", position=vec3(position)))
        elif kind == "spot":
            angle = 2 * data.spot.outerConeAngle
            if not 0.0 < angle <= math.pi + 1e-6:
                raise InputError(f"{where}: light {name}: outerConeAngle {angle / 2:g}; allowed: above 0, to pi/2")
            if angle > math.radians(WIDEST_CONE):
                notes.append(f"{where}: light {name}: cone of {math.degrees(angle):.4g}° taken as {WIDEST_CONE:g}°")
                angle = math.radians(WIDEST_CONE)
            lights.append(Light(name, "spot", direction=vec3(direction), position=vec3(position), angle=angle))
        else:
            raise InputError(f"{where}: light {name}: type {kind!r:.40}; allowed: directional, point, spot")
        if data.range is not None and kind != "directional":
            notes.append(f"{where}: light {name}: range {data.range:g} m ignored: it reaches everywhere")
        if data.intensity == 0.0:
            notes.append(f"{where}: light {name}: intensity 0 ignored: it shines and casts shadows")
    return lights, notes


def _pose(node: Node, where: str, what: str) -> tuple[Floats, Floats]:
    """(3,) position of a node, and (3,) unit vector along its −z axis."""
    if not np.isfinite(node.matrix).all() or not node.matrix[:3, 2].any() or not node.matrix[:3, 1].any():
        raise InputError(f"{where}: {what}: its node's transform is singular, so that it has no direction")
    return node.matrix[:3, 3], unit(-node.matrix[:3, 2])


def _unique(name: object, default: str, taken: set[str]) -> str:
    """A valid name for a scene file, with a number appended if it is taken."""
    plain = (name_from(str(name or "")) or default)[:LONGEST_NAME]
    number = 2
    candidate = plain
    while candidate in taken:
        candidate, number = f"{plain[: LONGEST_NAME - len(f'-{number}')]}-{number}", number + 1
    return candidate


def check_supported(layout: Layout, where: str) -> None:
    """Raise InputError for features without which the geometry would be wrong."""
    for extension in layout.extensionsRequired:
        if not HONOURED.fullmatch(extension):
            raise InputError(
                f"{where}: extensionsRequired: {extension!r:.60} is not supported; save the file without it"
            )
    for mesh in layout.meshes:
        for primitive in mesh.primitives:
            mode, mesh_where = primitive.mode, f"{where}: mesh {mesh.name or ''!r}"
            if mode not in (POINTS, *LINES, TRIANGLES, STRIP):
                found = "a triangle fan" if mode == FAN else f"mode {mode}"
                raise InputError(f"{mesh_where}: {found}; allowed: triangles and strips")
            used = [primitive.attributes.get("POSITION"), primitive.indices]
            if any(layout.accessors[index].sparse is not None for index in used if index is not None):
                raise InputError(f"{mesh_where}: sparse accessors are not supported")


def notes_on(layout: Layout, where: str) -> list[str]:
    """A note for each kind of feature that is ignored or simplified."""
    primitives = [primitive for mesh in layout.meshes for primitive in mesh.primitives]
    used = [layout.materials[index] for index in {p.material for p in primitives if p.material is not None}]
    see_through = sum(
        material.alphaMode != "OPAQUE" or "KHR_materials_transmission" in material.extensions for material in used
    )
    morphed = sum(primitive.targets is not None for primitive in primitives)
    lines = sum(primitive.mode in (POINTS, *LINES) for primitive in primitives)
    by_node = [node.extensions.model_fields_set for node in layout.nodes]
    invisible = [node.data for node in nodes_of(layout) if not node.visible]
    found = [
        (sum(node.mesh is not None for node in invisible), "mesh(es) of hidden nodes left out"),
        (sum(map(_shines, invisible)), "light(s) of hidden nodes left out"),
        (see_through, "see-through material(s) drawn opaque"),
        (len(layout.animations), "animation(s) drawn still, as the nodes stand"),
        (sum(node.skin is not None for node in layout.nodes), "skinned mesh(es) drawn still, undeformed"),
        (morphed, "morphed primitive(s) drawn still, in their base shape"),
        (lines, "primitive(s) of points or lines left out: they have no surface"),
        (sum("EXT_mesh_gpu_instancing" in names for names in by_node), "GPU-instanced node(s) drawn once"),
    ]
    names = {*layout.extensionsUsed, *layout.extensions.model_fields_set}.union(*by_node)
    return [*(f"{where}: {count} {line}" for count, line in found if count), *_ignored(names, where)]


def _shines(node: NodeTable) -> bool:
    return node.extensions.KHR_lights_punctual is not None


def _ignored(extensions: set[str], where: str) -> list[str]:
    """A note on the extensions that change what is seen and are not read, if there are any."""
    found = sorted(name for name in extensions if not HONOURED.fullmatch(name) and name not in WITH_OWN_NOTE)
    names = ", ".join(f"{name:.40}" for name in found[:5]) + ", ..." * (len(found) > 5)
    return [f"{where}: drawn as if the file did not use {names}"] if found else []
