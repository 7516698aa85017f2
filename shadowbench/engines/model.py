"""A view as binary glTF: meshes with their colours, camera and light."""

from typing import Any

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb

from shadowbench.scenes.model import Light, Scene, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

Json = dict[str, Any]


def glb_of(view: View) -> bytes:
    """Bytes of a .glb with the view's meshes in float32, its camera and its light (KHR_lights_punctual).

    The light has no size there, and a disc or rectangle is a spot of WIDEST_CONE. Materials have the mesh's linear base
    colour and are double-sided. A mesh that casts or receives no shadow has `casts` or `receives` in its node's
    `extras`, since glTF cannot express it. If the scene is farther from the origin than it is large, nodes are
    translated to its centre, so that float32 vertices keep their precision.
    """
    scene = view.scene
    origin = _origin(scene)
    shapes = {
        f"mesh {index}": trimesh.Trimesh(mesh.vertices - origin, mesh.faces, process=False)
        for index, mesh in enumerate(scene.meshes)
    }

    def complete(tree: Json) -> None:
        """Add what trimesh does not write; its meshes are in the order of `shapes`."""
        colors = list(dict.fromkeys(mesh.color for mesh in scene.meshes))
        tree["materials"] = [_material(color) for color in colors]
        for mesh, written in zip(scene.meshes, tree["meshes"], strict=True):
            written["name"] = mesh.name
            written["primitives"][0]["material"] = colors.index(mesh.color)
        near, far = view.near_far
        lens = {"yfov": view.camera.fov_y, "aspectRatio": 1.0, "znear": near, "zfar": far}
        tree["cameras"] = [{"name": view.camera.name, "type": "perspective", "perspective": lens}]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [_lamp(view.light)]}}
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        tree["nodes"] = [*_mesh_nodes(scene, origin), _camera_node(view), _light_node(view.light)]
        tree["scenes"] = [{"name": scene.name, "nodes": list(range(len(tree["nodes"])))}]

    loaded = trimesh.Scene()
    for name, shape in shapes.items():
        loaded.add_geometry(shape, geom_name=name)
    written: bytes = export_glb(loaded, include_normals=False, tree_postprocessor=complete)  # type: ignore[no-untyped-call]
    return written


def _origin(scene: Scene) -> Floats:
    """(3,) point that float32 vertices are relative to."""
    low, high = scene.geometry.bounds
    center: Floats = (low + high) / 2
    return center if np.linalg.norm(center) > np.linalg.norm(high - low) else np.zeros(3)


def _material(color: tuple[float, float, float]) -> Json:
    surface = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    return {"pbrMetallicRoughness": surface, "doubleSided": True}


def _lamp(light: Light) -> Json:
    lamp: Json = {"name": light.name, "type": light.hard_kind, "color": [1.0, 1.0, 1.0], "intensity": 1.0}
    if light.frustum_angle is not None:
        # No falloff: glTF requires the inner cone to be smaller than the outer one.
        lamp["spot"] = {
            "innerConeAngle": light.frustum_angle / 2 * (1 - 1e-6),
            "outerConeAngle": light.frustum_angle / 2,
        }
    return lamp


def _mesh_nodes(scene: Scene, origin: Floats) -> list[Json]:
    nodes: list[Json] = []
    for index, mesh in enumerate(scene.meshes):
        node: Json = {"name": mesh.name, "mesh": index}
        if origin.any():
            node["translation"] = origin.tolist()
        lacking = {key: value for key, value in (("casts", mesh.casts), ("receives", mesh.receives)) if not value}
        if lacking:
            node["extras"] = lacking
        nodes.append(node)
    return nodes


def _camera_node(view: View) -> Json:
    camera = view.camera
    return {"name": camera.name, "camera": 0, "matrix": _columns(camera.basis(), camera.position)}


def _light_node(light: Light) -> Json:
    # Both kinds of light that have a direction shine along their node's −z.
    turn = np.eye(3) if light.kind == "point" else perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
    extension = {"KHR_lights_punctual": {"light": 0}}
    return {"name": light.name, "extensions": extension, "matrix": _columns(turn, light.position)}


def _columns(basis: Floats, position: tuple[float, float, float]) -> list[float]:
    """A pose as a glTF matrix: 16 numbers in column-major order. `basis` has the axes as rows."""
    matrix = np.eye(4)
    matrix[:3, :3] = basis  # the transpose of the transform, so that ravel is column-major
    matrix[3, :3] = position
    return [float(value) for value in matrix.ravel()]
