"""glTF: meshes, cameras and lights along the node tree, and notes on unsupported features.

Not read by trimesh, because it gives instances random names, keeps only one camera, and drops the children of a
camera's node.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.contents import BY_DEFAULT, Chosen, Contents, target_of, unique_name
from shadowbench.scenes.geometry import Triangles, triangles_of
from shadowbench.scenes.gltf_accessors import Data
from shadowbench.scenes.gltf_animation import pose_at
from shadowbench.scenes.gltf_bytes import TRIANGLES, read_buffers, read_json, read_primitives
from shadowbench.scenes.gltf_instances import instance_matrices
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.scenes.gltf_materials import Materials
from shadowbench.scenes.gltf_nodes import Node, scene_nodes
from shadowbench.scenes.gltf_pose import Posed, Poser, corner_normals
from shadowbench.scenes.looks import Look
from shadowbench.scenes.model import WIDEST_CONE, Camera, Light, Mesh
from shadowbench.scenes.normals import Singles
from shadowbench.scenes.tables import NARROWEST
from shadowbench.scenes.vectors import Floats, unit, vec3
from shadowbench.strict import validated

HONOURED = re.compile(
    r"KHR_draco_mesh_compression|KHR_mesh_quantization|KHR_mesh_primitive_restart"
    r"|(EXT|KHR)_meshopt_compression|EXT_mesh_gpu_instancing|KHR_lights_punctual|KHR_node_visibility"
    r"|(KHR|EXT|MSFT)_texture_\w+|KHR_materials_(?!variants)\w+|KHR_xmp\w*|EXT_lights_image_based|FB_ngon_encoding"
)
"""Extensions that are supported, or do not affect the geometry."""


class Source(NamedTuple):
    """A primitive: its triangles as a node's matrix moves them, None where all nodes deform it; and its material.

    normals: of the triangles, None if it is flat; posed: by number of a node that deforms it.
    """

    triangles: Triangles | None
    normals: Singles | None
    posed: dict[int, Posed]
    look: Look


def read_gltf(path: Path, where: str, chosen: Chosen = BY_DEFAULT) -> Contents:
    """The contents of a .gltf or .glb as chosen, in the order of its nodes.

    Raises InputError or ValueError for invalid ones.
    """
    document, chunk = read_json(path)
    layout = validated(Layout, document, where, context=document)
    for extension in layout.extensionsRequired:
        if not HONOURED.fullmatch(extension):
            raise InputError(
                f"{where}: extensionsRequired: {extension!r:.60} is not supported; save the file without it"
            )
    if layout.primitives and all(each.mode < TRIANGLES for each in layout.primitives):
        kind = "Gaussian splats" if "KHR_gaussian_splatting" in layout.extensionsUsed else "points or lines"
        found = f"holds {len(layout.primitives)} primitive(s) of {kind}, and no triangles"
        raise InputError(f"{where}: {found}; at least one is needed")
    data = read_buffers(layout, chunk, path, where)
    pose, pose_notes = pose_at(data, chosen)
    nodes = scene_nodes(layout, pose)
    poser, materials = Poser(data, pose, nodes), Materials(data, path, chosen.coordinates)
    sources: list[list[Source]] = [[] for _ in layout.meshes]
    for each in read_primitives(data):
        posed = poser.posed(each)
        still = triangles_of(each.positions, each.faces, where) if poser.stands(each, posed) else None
        if (look := materials.look(each)) is not None:
            normals = None if still is None else corner_normals(each, each.floats("NORMAL", "VEC3"))
            sources[each.mesh].append(Source(still, normals, posed, look))
    instances = _instances(data, nodes, sources)
    cameras, lights, notes = _cameras(layout, nodes, where), _lights(layout, nodes, where), _notes(layout, nodes, where)
    notes += materials.notes + pose_notes + poser.notes
    notes += cameras[1] + lights[1]
    return Contents(instances, cameras[0], lights[0], notes)


def _instances(data: Data, nodes: list[Node], sources: list[list[Source]]) -> list[tuple[Mesh, Floats]]:
    """The primitives of visible nodes, as often as they are drawn, each with its matrix. sources: by mesh."""
    layout = data.layout
    instances: list[tuple[Mesh, Floats]] = []
    hidden = 0
    for node in nodes:
        if node.data.mesh is None:
            continue
        rows = sources[node.data.mesh]
        if not node.visible:
            hidden += sum(len(source.triangles.faces) for source in rows if source.triangles)
            continue
        name = node.data.name or layout.meshes[node.data.mesh].name or "mesh"
        copies = instance_matrices(data, node.data)
        for k, source in enumerate(rows, 1):
            shape = source.triangles, node.matrix, source.normals
            triangles, matrix, normals = source.posed.get(node.number, shape)
            assert triangles is not None  # as some node does not deform it
            title = name if len(rows) == 1 else f"{name} {k}"
            for number, copy in enumerate(copies, 1):
                once = title if len(copies) == 1 else f"{title} {number}"
                mesh = Mesh(once, *triangles, normals=normals, **source.look._asdict())
                instances.append((mesh, matrix @ copy))
    if hidden and not any(len(mesh.faces) for mesh, _ in instances):
        raise InputError(f"{data.where}: all {hidden} triangles belong to hidden nodes; at least one must be visible")
    return instances


def _cameras(layout: Layout, nodes: list[Node], where: str) -> tuple[list[Camera], list[str]]:
    """The perspective cameras of the scene, and a note if it has orthographic ones."""
    cameras: list[Camera] = []
    orthographic = 0
    for node in nodes:
        if node.data.camera is None:
            continue
        data = layout.cameras[node.data.camera]
        if data.type == "orthographic":
            orthographic += 1
            continue
        if data.yfov < (least := math.radians(NARROWEST)):
            raise InputError(f"{where}: camera: perspective: yfov is {data.yfov:g} rad; allowed: from {least:.3g}")
        if not 0.0 < data.znear < (math.inf if data.zfar is None else data.zfar):
            found = f"znear is {data.znear:g} and zfar {data.zfar}"
            raise InputError(f"{where}: camera: perspective: {found}; allowed: 0 < znear < zfar")
        position, forward = _pose(node, where, "camera")
        name = unique_name(node.data.name or data.name, "camera", {camera.name for camera in cameras})
        up, target = vec3(unit(node.matrix[:3, 1])), target_of(position, forward)
        cameras.append(Camera(name, vec3(position), target, data.yfov, up, data.znear, data.zfar))
    left_out = f"{where}: {orthographic} orthographic camera(s) left out: cameras here are perspective"
    return cameras, [left_out] if orthographic else []


def _lights(layout: Layout, nodes: list[Node], where: str) -> tuple[list[Light], list[str]]:
    """The lights on visible nodes, and a note for each ignored property."""
    lights: list[Light] = []
    notes = []
    for node in nodes:
        if node.data.light is None or not node.visible:
            continue
        data = layout.lights[node.data.light]
        name = unique_name(node.data.name or data.name, "light", {light.name for light in lights})
        position, direction = (vec3(values) for values in _pose(node, where, "light"))
        light_where = f"{where}: light {name}"
        if data.type == "directional":
            lights.append(Light(name, "directional", direction))
        elif data.type == "point":
            lights.append(Light(name, "point", position=position))
        else:
            angle, widest = 2 * data.outerConeAngle, math.radians(WIDEST_CONE)
            if not 0.0 < angle <= math.pi + 1e-6:
                raise InputError(f"{light_where}: outerConeAngle {angle / 2:g}; allowed: above 0, to pi/2")
            if angle > widest:
                notes.append(f"{light_where}: cone of {math.degrees(angle):.4g}° taken as {WIDEST_CONE:g}°")
            lights.append(Light(name, "spot", direction, position, min(angle, widest)))
        if data.range is not None and data.type != "directional":
            notes.append(f"{light_where}: range {data.range:g} m ignored: it reaches everywhere")
        if data.intensity == 0.0:
            notes.append(f"{light_where}: intensity 0 ignored: it shines and casts shadows")
    return lights, notes


def _pose(node: Node, where: str, what: str) -> tuple[Floats, Floats]:
    """(3,) position of a node, and (3,) unit vector along its −z axis."""
    if not np.isfinite(node.matrix).all() or not node.matrix[:3, 2].any() or not node.matrix[:3, 1].any():
        raise InputError(f"{where}: {what}: its node's transform is singular, so that it has no direction")
    return node.matrix[:3, 3], unit(-node.matrix[:3, 2])


def _notes(layout: Layout, nodes: list[Node], where: str) -> list[str]:
    """A note for each kind of feature that is ignored or simplified."""
    hidden = [node.data for node in nodes if not node.visible]
    primitives = layout.primitives
    used = {each.material for each in primitives}
    found = [
        ([node.mesh is not None for node in hidden], "mesh(es) of hidden nodes left out"),
        ([node.light is not None for node in hidden], "light(s) of hidden nodes left out"),
        (
            [one.transmits for k, one in enumerate(layout.materials) if k in used],
            "transmissive material(s) drawn opaque",
        ),
        (
            [each.mode < TRIANGLES for each in primitives],
            "primitive(s) of points or lines left out: they have no surface",
        ),
    ]
    return [f"{where}: {sum(which)} {line}" for which, line in found if any(which)] + _ignored(layout, where)


def _ignored(layout: Layout, where: str) -> list[str]:
    """A note on the extensions that change what is seen and are not read, if there are any."""
    names = {*layout.extensionsUsed, *layout.extensions}.union(*(node.extensions for node in layout.nodes))
    found = sorted(name for name in names if not HONOURED.fullmatch(name))
    shown = ", ".join(f"{name:.40}" for name in found[:5]) + ", ..." * (len(found) > 5)
    return [f"{where}: drawn as if the file did not use {shown}"] if found else []
