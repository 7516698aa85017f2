"""Export of a view for another renderer: `scene.glb`, `view.json`, and the truth as an example mask."""

import base64
import json
import math
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb

from shadowbench.files import make_folder, png_of, replace_file
from shadowbench.geometry.convex import caster_and_receiver_faces, caster_and_receiver_vertices
from shadowbench.geometry.lights import light_space, window
from shadowbench.geometry.topology import is_closed
from shadowbench.options import FIRST, SceneOptions
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.model import Camera, Light, Mesh, View
from shadowbench.scenes.triangles import bounds_of
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit
from shadowbench.scores.masks import write_mask
from shadowbench.truths.trace import Truth

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Sides

SCHEMA = 1
_ROW = re.compile(r"\[[^][{}]*\]")  # a list of numbers, which is written on one line
MODEL, DESCRIPTION, EXAMPLE = "scene.glb", "view.json", "truth.png"

PADDING = 2.0  # texels beside the casters and receivers, for an engine's filter
MARGIN = 1e-3  # share of the distances, against rounding

_WRAPS: dict[Wrap, int] = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_NEAREST = 9728

Json = dict[str, Any]


def export_view(
    view: View,
    truth: Truth,
    folder: Path,
    scene_name: str,
    *,
    sides: "Sides" = "double",
    options: SceneOptions = FIRST,
) -> list[Path]:
    """Write a view's files into a folder, and return their paths.

    scene_name: its argument on the command line; options: how it was read; sides: as of `glb_of`.
    """
    make_folder(folder)
    model, description, example = (folder / name for name in (MODEL, DESCRIPTION, EXAMPLE))
    with replace_file(model) as temporary:
        temporary.write_bytes(glb_of(view, sides=sides))
    with replace_file(description) as temporary:
        text = json.dumps(describe(view, scene_name, sides, options), indent=2, ensure_ascii=False, allow_nan=False)
        temporary.write_text(_ROW.sub(lambda row: " ".join(row[0].split()), text) + "\n", encoding="utf-8")
    write_mask(example, truth.visibility)
    return [model, description, example]


def inexpressible_in_gltf(view: View) -> list[str]:
    """One line for each mesh that casts or receives no shadow, and for a light's size."""
    lines, light = [], view.light
    if light.kind != light.hard_kind:
        spot = f"a spot of {math.degrees(light.frustum_angle or 0.0):.0f}° in {MODEL}"
        lines.append(f"light {light.name!r} is a {light.kind}, which glTF cannot say: {spot}; see {DESCRIPTION}")
    elif light.soft:
        lines.append(f"light {light.name!r} has a size, which glTF cannot say: see {DESCRIPTION}")
    for mesh in view.scene.meshes:
        if lacking := [name.removesuffix("s") for name in _lacking(mesh)]:
            lines.append(f"{mesh.name} is to {' and '.join(lacking)} no shadow, which glTF cannot say: see view.json")
    return lines


def _lacking(mesh: Mesh) -> dict[str, bool]:
    """`casts` and `receives`, where a mesh does not."""
    return {name: False for name in ("casts", "receives") if not getattr(mesh, name)}


def view_matrix(camera: Camera) -> Floats:
    """(4, 4) float64 world-to-camera matrix for column vectors; the camera looks along its −z."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.basis()
    matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(camera.position)
    return matrix


def nearest_depth(view: View) -> float:
    """Depth of the nearest surface in the picture, in metres along the camera's axis, at least that of the near plane.

    The near plane of a camera within the scene's bounds is at far/10⁴, where a depth buffer of 24 bits is coarse: a
    shadow volume that is tested against it ends millimetres beside the shadow.
    """
    camera, (near, far) = view.camera, view.near_far
    right, up, back = camera.basis()
    position, aspect = np.asarray(camera.position), view.size.aspect
    vertices, faces = view.scene.geometry.vertices, view.scene.geometry.faces
    for normal, scale in ((right, aspect), (-right, aspect), (up, 1.0), (-up, 1.0)):
        cut = trimesh.intersections.slice_faces_plane(  # type: ignore[no-untyped-call]
            vertices, faces, normal - scale * camera.slope * back, position - scale * camera.height / 2 * normal
        )
        vertices, faces = cut[:2]
    depths = (vertices[np.unique(faces)] - position) @ -back
    return max(near, float(depths.min(initial=far)))


def describe(view: View, scene_name: str, sides: "Sides" = "double", options: SceneOptions = FIRST) -> Json:
    """Contents of `view.json`: conventions that glTF leaves open, camera, light, meshes and the format of masks."""
    camera, (near, far) = view.camera, view.near_far
    low, high = bounds_of(caster_and_receiver_vertices(view.scene.geometry)).tolist()
    read = [scene_name, "MASK.png", *options.arguments()]
    score = ["shadowbench", "score", *read, "--view", camera.name, "--light", view.light.name]
    return {
        "schema": SCHEMA,
        "scene": view.scene.name,
        "model": MODEL,
        "conventions": {
            "world": "metres, right-handed, y up",
            "matrices": "nested lists, one list a row; they multiply a column vector from the left: "
            "clip = projection · view · (x, y, z, 1)",
            "clip_space": "OpenGL: −w ≤ x, y, z ≤ w, x right, y up, z away",
            "pixels": "row 0 at the top; pixel (row, column) is sampled at its centre: "
            "clip x / w = (2 column + 1) / width − 1, clip y / w = 1 − (2 row + 1) / height",
            "angles": "degrees",
        },
        "image": view.size._asdict(),
        "camera": {
            "name": camera.name,
            "position": list(camera.position),
            "target": list(camera.target),
            "up": camera.basis()[1].tolist(),
            "kind": "perspective" if camera.converging else "orthographic",
            "fov_y": math.degrees(camera.fov_y) or None,
            "height": camera.height or None,
            "near": near,
            "far": far,
            "nearest": nearest_depth(view),
            "view": view_matrix(camera).tolist(),
            "projection": view.projection.tolist(),
        },
        "light": {**describe_light(view.light), "box": light_box(view)},
        "bounds": {"low": low, "high": high},
        "sides": sides,
        "meshes": [
            {
                "name": mesh.name,
                "color": list(mesh.color),
                "triangles": len(mesh.faces),
                "casts": mesh.casts,
                "receives": mesh.receives,
                "closed": is_closed(mesh),
            }
            for mesh in view.scene.meshes
        ],
        "mask": {
            "example": EXAMPLE,
            "format": "grey PNG, 8 or 16 bit, linear (no sRGB curve): full where the light is seen, 0 in shadow, "
            "full where no surface faces camera and light",
            "score": shlex.join(score),
        },
        "assumptions": [*view.scene.notes, *inexpressible_in_gltf(view)],
    }


def describe_light(light: Light) -> dict[str, Any]:
    """Light in `view.json`; null for fields that its kind lacks.

    direction: unit vector in which the light travels, or a disc's or rectangle's normal; radius: of a sun in degrees as
    seen from the ground, else in metres; size: width and height of a rectangle in metres; up: unit vector along its
    height.
    """
    directional, rectangle = light.kind == "directional", light.kind == "rectangle"
    return {
        "name": light.name,
        "kind": light.kind,
        "direction": None if light.kind == "point" else unit(light.direction).tolist(),
        "position": None if directional else list(light.position),
        "cone": math.degrees(light.angle) if light.kind == "spot" else None,
        "radius": None if rectangle else math.degrees(light.radius) if directional else light.radius,
        "size": list(light.size) if rectangle else None,
        "up": perpendicular_basis(-unit(light.direction), light.up)[1].tolist() if rectangle else None,
    }


def light_box(view: View, size: int | None = None, phase: tuple[float, float] = (0, 0)) -> Json:
    """The box of all casters and receivers, in metres, as `view.json` and `draw` of an engine have it.

    Of a directional light an orthographic camera: its position, in the middle of the near plane, at depth 0; its
    target, in the middle of the far plane; up; width, height and depth. For a map of size² texels it is padded, and
    shifted by a phase in texels. Of other lights the distances near and far, for a spot along its axis, within its
    cone.
    """
    if view.light.kind != "directional":
        near, far = _distances(view)
        return {"near": near, "far": far}
    space = light_space(view.light)
    tight = space.box(caster_and_receiver_vertices(view.scene.geometry))
    # As a map of one texel the box has no padding across, and a margin in depth.
    box = window(tight, space, size or 1, PADDING if size else MARGIN, phase)
    middle, (width, height, depth) = (box.low + box.high) / 2, (box.high - box.low).tolist()
    right, up, back = space.basis
    across = middle[0] * right + middle[1] * up
    return {
        "position": (across - box.low[2] * back).tolist(),
        "target": (across - box.high[2] * back).tolist(),
        "up": up.tolist(),
        "width": width,
        "height": height,
        "depth": depth,
    }


def _distances(view: View) -> tuple[float, float]:
    """Least and largest distance of casters and receivers from a light; for a spot along its axis, within its cone."""
    light, geometry = view.light, view.scene.geometry
    points = caster_and_receiver_vertices(geometry) - light.position
    triangles = geometry.vertices[caster_and_receiver_faces(geometry)]
    origins = np.broadcast_to(light.position, (len(triangles), 3))
    closest = trimesh.triangles.closest_point(triangles, origins)  # type: ignore[no-untyped-call]
    near = float(np.linalg.norm(closest - origins, axis=1).min())
    far = float(np.linalg.norm(points, axis=1).max())
    if light.frustum_angle is not None:
        depths = points @ -light_space(light).basis[2]
        if depths.max() > 0.0:  # else all is behind the spot
            near, far = max(near * np.cos(light.frustum_angle / 2), depths.min()), float(depths.max())
    near, far = min(near, far) * (1 - MARGIN), far * (1 + MARGIN)
    return float(max(near, far / 1e4)), far


def glb_of(view: View, *, sides: "Sides" = "double") -> bytes:
    """Bytes of a .glb with the view's meshes in float32, its camera and its light (KHR_lights_punctual).

    Each triangle has vertices of its own, with its normal. sides: which of the white materials are double-sided, those
    of meshes that are not closed, or all. The light has no size there, and a disc or rectangle is a spot of
    WIDEST_CONE. A mesh that casts or receives no shadow has `casts` or `receives` in its node's `extras`, since glTF
    cannot express it. If the scene is farther from the origin than it is large, nodes are translated to its centre, so
    that float32 vertices keep their precision.
    """
    scene, camera, light = view.scene, view.camera, view.light
    low, high = scene.geometry.bounds
    materials = [(sides == "double" or not is_closed(mesh), mesh.cutout) for mesh in scene.meshes]
    center = (low + high) / 2
    origin = center if np.linalg.norm(center) > np.linalg.norm(high - low) else np.zeros(3)

    def complete(tree: Json) -> None:
        """Add what trimesh does not write; its meshes are in the order of the scene's."""
        distinct = list(dict.fromkeys(materials))
        surface = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
        tree["materials"] = [
            {"pbrMetallicRoughness": dict(surface), "doubleSided": double_sided} for double_sided, _ in distinct
        ]
        _add_masks(tree, [cutout for _, cutout in distinct])
        for mesh, material, written in zip(scene.meshes, materials, tree["meshes"], strict=True):
            written["name"] = mesh.name
            written["primitives"][0]["material"] = distinct.index(material)
        near, far = view.near_far
        kind = "perspective" if camera.converging else "orthographic"
        lens = (
            {"yfov": camera.fov_y, "aspectRatio": view.size.aspect}
            if camera.converging
            else {"xmag": view.size.aspect * camera.height / 2, "ymag": camera.height / 2}
        )
        tree["cameras"] = [{"name": camera.name, "type": kind, kind: {**lens, "znear": near, "zfar": far}}]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [_lamp(light)]}}
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        # Both kinds of light that have a direction shine along their node's −z.
        turn = np.eye(3) if light.kind == "point" else perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
        punctual = {"KHR_lights_punctual": {"light": 0}}
        tree["nodes"] = [
            *(_mesh_node(index, mesh, origin) for index, mesh in enumerate(scene.meshes)),
            {"name": camera.name, "camera": 0, "matrix": _columns(camera.basis(), camera.position)},
            {"name": light.name, "extensions": punctual, "matrix": _columns(turn, light.position)},
        ]
        tree["scenes"] = [{"name": scene.name, "nodes": list(range(len(tree["nodes"])))}]

    loaded = trimesh.Scene()
    normals = np.split(scene.geometry.normals, np.cumsum([len(mesh.faces) for mesh in scene.meshes[:-1]]))
    for index, (mesh, flat) in enumerate(zip(scene.meshes, normals, strict=True)):
        corners = (mesh.vertices - origin)[mesh.faces.ravel()]
        faces = np.arange(len(corners)).reshape(-1, 3)
        shape = trimesh.Trimesh(
            corners,
            faces,
            vertex_normals=np.repeat(flat, 3, axis=0),
            vertex_attributes=_corner_attributes(mesh),
            process=False,
        )
        loaded.add_geometry(shape, geom_name=f"mesh {index}")
    written: bytes = export_glb(loaded, include_normals=True, tree_postprocessor=complete)  # type: ignore[no-untyped-call]
    return written


def _corner_attributes(mesh: Mesh) -> Json:
    """Texture coordinates of a cut-out mesh by corner, in turn, as trimesh writes attributes: with an underscore."""
    if mesh.cutout is None or mesh.places is None:
        return {}
    return {"_PLACE": (mesh.places.reshape(-1, 2) / mesh.cutout.size).astype(np.float32)}


def _add_masks(tree: Json, cutouts: Sequence[Cutout | None]) -> None:
    """Add to the materials of a glTF, in the order of `cutouts`, what cuts them out, and name its coordinates."""
    for material, cutout in zip(tree["materials"], cutouts, strict=True):
        if cutout is None:
            continue
        number = len(tree.setdefault("textures", []))
        material |= {"alphaMode": "MASK", "alphaCutoff": 0.5}
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": number}
        tree["textures"].append({"sampler": number, "source": number})
        image = np.full((*cutout.bits.shape, 4), 255, dtype=np.uint8)
        image[..., 3] *= cutout.bits
        uri = "data:image/png;base64," + base64.b64encode(png_of(image)).decode()
        tree.setdefault("images", []).append({"uri": uri, "mimeType": "image/png"})
        wraps = {"wrapS": _WRAPS[cutout.wrap[0]], "wrapT": _WRAPS[cutout.wrap[1]]}
        tree.setdefault("samplers", []).append({"magFilter": _NEAREST, "minFilter": _NEAREST, **wraps})
    for mesh in tree["meshes"]:
        attributes = mesh["primitives"][0]["attributes"]
        if "_PLACE" in attributes:
            attributes["TEXCOORD_0"] = attributes.pop("_PLACE")


def _lamp(light: Light) -> Json:
    lamp: Json = {"name": light.name, "type": light.hard_kind, "color": [1.0, 1.0, 1.0], "intensity": 1.0}
    if light.frustum_angle is not None:
        half = light.frustum_angle / 2
        # No falloff: glTF requires the inner cone to be smaller than the outer one.
        lamp["spot"] = {"innerConeAngle": half * (1 - 1e-6), "outerConeAngle": half}
    return lamp


def _mesh_node(index: int, mesh: Mesh, origin: Floats) -> Json:
    node: Json = {"name": mesh.name, "mesh": index}
    if origin.any():
        node["translation"] = origin.tolist()
    if lacking := _lacking(mesh):
        node["extras"] = lacking
    return node


def _columns(basis: Floats, position: tuple[float, float, float]) -> list[float]:
    """A pose as a glTF matrix: 16 numbers in column-major order. `basis` has the axes as rows."""
    matrix = np.eye(4)
    matrix[:3, :3] = basis  # the transpose of the transform, so that ravel is column-major
    matrix[3, :3] = position
    return [float(value) for value in matrix.ravel()]
