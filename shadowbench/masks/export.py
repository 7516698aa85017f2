"""Export of a view, or of a sequence, for another renderer: `scene.glb`, `view.json`, and truths as example masks."""

import base64
import json
import math
import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh.exchange.gltf import export_glb

from shadowbench.errors import InputError
from shadowbench.files import make_folder, png_of, replace_file
from shadowbench.geometry.convex import caster_and_receiver_faces, caster_and_receiver_vertices
from shadowbench.geometry.lights import light_space, window
from shadowbench.geometry.topology import is_closed
from shadowbench.masks.inputs import PICTURE
from shadowbench.options import FIRST, SceneOptions, ViewSize
from shadowbench.scenes.cutouts import Cutout, Wrap
from shadowbench.scenes.model import Camera, Light, Mesh, View
from shadowbench.scenes.sequences import frames_of, motions_of
from shadowbench.scenes.triangles import bounds_of
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

if TYPE_CHECKING:
    from shadowbench.plugin.engine import Sides

SCHEMA = 1
_ROW = re.compile(r"\[[^][{}]*\]")  # a list of numbers, which is written on one line
MODEL, DESCRIPTION, EXAMPLE, EXAMPLES = "scene.glb", "view.json", "truth.png", "truth"
RIGID = 1e-6  # share of a mesh's size by which it may differ from the same one moved

PADDING = 2.0  # texels beside the casters and receivers, for an engine's filter
MARGIN = 1e-3  # share of the distances, against rounding

_WRAPS: dict[Wrap, int] = {"clamp": 33071, "mirror": 33648, "repeat": 10497}
_NEAREST, _FLOAT = 9728, 5126

Json = dict[str, Any]


class Clip(NamedTuple):
    """A sequence: its name, seconds from frame to frame, and the frames."""

    name: str
    interval: float
    frames: tuple[View, ...]


def exported_sequence(folder: Path) -> tuple[str, int, ViewSize]:
    """Name, number of frames and size of an exported sequence whose pictures are in a folder. Raises InputError."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        described = json.loads((folder.absolute().parent / DESCRIPTION).read_text(encoding="utf-8"))
        return described["sequence"]["name"], len(described["sequence"]["frames"]), ViewSize(**described["image"])
    raise InputError(f"{folder}: is not in a folder that `export --sequence` wrote; allowed: pictures of frames there")


def clip_of(view: View, name: str, frames: int | None = None) -> Clip:
    """A sequence of a view; frames: how many, by default all. Raises InputError."""
    motion, *others = motions_of(view.scene, [name])
    if others:
        raise InputError(f"--sequence: found {name!r}; allowed: one, such as {motion.name}")
    return Clip(name, motion.seconds / (motion.frames - 1), frames_of(view, motion, frames))


def export_view(
    view: View,
    folder: Path,
    scene_name: str,
    *,
    sides: "Sides" = "double",
    options: SceneOptions = FIRST,
    clip: Clip | None = None,
) -> list[Path]:
    """Write a view, or the sequence that begins with it, into a folder; the paths of its model and description.

    scene_name: its argument on the command line; options: how it was read; sides: as of `glb_of`. Raises InputError for
    a sequence in which a mesh changes its shape.
    """
    make_folder(folder)
    model, description = folder / MODEL, folder / DESCRIPTION
    with replace_file(model) as temporary:
        temporary.write_bytes(glb_of(view, sides=sides, clip=clip))
    with replace_file(description) as temporary:
        described = describe(view, scene_name, sides, options, clip)
        text = json.dumps(described, indent=2, ensure_ascii=False, allow_nan=False)
        temporary.write_text(_ROW.sub(lambda row: " ".join(row[0].split()), text) + "\n", encoding="utf-8")
    return [model, description]


def inexpressible_in_gltf(view: View, clip: Clip | None = None) -> list[str]:
    """One line for each mesh that casts or receives no shadow, for a light's size, and for a camera that zooms."""
    lines, light = [], view.light
    if clip and any(not np.array_equal(frame.projection, clip.frames[0].projection) for frame in clip.frames):
        lines.append(f"sequence {clip.name} changes the field of view, which glTF cannot say: see {DESCRIPTION}")
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


def nearest_depth(*views: View) -> float:
    """Depth of the nearest surface in pictures, in metres along the camera's axis, at least that of the near plane.

    The near plane of a camera within the scene's bounds is at far/10⁴, where a depth buffer of 24 bits is coarse: a
    shadow volume that is tested against it ends millimetres beside the shadow.
    """
    nearest = views[0].near_far[1]
    for view in views:
        camera = view.camera
        right, up, back = camera.basis()
        position, aspect = np.asarray(camera.position), view.size.aspect
        vertices, faces = view.scene.geometry.vertices, view.scene.geometry.faces
        for normal, scale in ((right, aspect), (-right, aspect), (up, 1.0), (-up, 1.0)):
            cut = trimesh.intersections.slice_faces_plane(  # type: ignore[no-untyped-call]
                vertices, faces, normal - scale * camera.slope * back, position - scale * camera.height / 2 * normal
            )
            vertices, faces = cut[:2]
        depths = (vertices[np.unique(faces)] - position) @ -back
        nearest = float(depths.min(initial=nearest))
    return max(views[0].near_far[0], nearest)


def describe_camera(view: View, nearest: float) -> Json:
    """Camera in `view.json`; nearest: depth of the nearest surface in the picture, or in those of all frames."""
    camera, (near, far) = view.camera, view.near_far
    return {
        "name": camera.name,
        "position": list(camera.position),
        "target": list(camera.target),
        "up": camera.basis()[1].tolist(),
        "kind": "perspective" if camera.converging else "orthographic",
        "fov_y": math.degrees(camera.fov_y) or None,
        "height": camera.height or None,
        "aspect": view.size.aspect,
        "near": near,
        "far": far,
        "nearest": nearest,
        "view": view_matrix(camera).tolist(),
        "projection": view.projection.tolist(),
    }


def describe(
    view: View, scene_name: str, sides: "Sides" = "double", options: SceneOptions = FIRST, clip: Clip | None = None
) -> Json:
    """Contents of `view.json`: conventions that glTF leaves open, camera, light, meshes and the format of masks."""
    read = [scene_name, "MASKS" if clip else "MASK.png", *options.arguments()]
    score = ["shadowbench", "score", *read, "--view", view.camera.name, "--light", view.light.name]
    frames = clip.frames if clip else (view,)
    view, nearest = frames[0], nearest_depth(*frames)
    moving: list[Json] = [
        {"camera": describe_camera(frame, nearest), "light": {**describe_light(frame.light), "box": light_box(frame)}}
        for frame in frames
    ]
    low, high = bounds_of(caster_and_receiver_vertices(view.scene.geometry)).tolist()
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
        **moving[0],
        "sequence": clip
        and {
            "name": clip.name,
            "frames": [{"time": index * clip.interval, **one} for index, one in enumerate(moving)],
        },
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
            "example": f"{EXAMPLES}/{PICTURE.format(0)}" if clip else EXAMPLE,
            "format": "grey PNG, 8 or 16 bit, linear (no sRGB curve): full where the light is seen, 0 in shadow, "
            "full where no surface faces camera and light",
            "score": shlex.join(score),
        },
        "assumptions": [*view.scene.notes, *inexpressible_in_gltf(view, clip)],
    }


def _mesh_poses(clip: Clip, origin: Floats) -> dict[int, list[Json]]:
    """Poses in each frame of the nodes of meshes that move. Raises InputError for a mesh that changes its shape."""
    poses: dict[int, list[Json]] = {}
    for index, mesh in enumerate(clip.frames[0].scene.meshes):
        moved = [frame.scene.meshes[index].vertices for frame in clip.frames]
        if all(np.array_equal(vertices, mesh.vertices) for vertices in moved):
            continue
        middle, poses[index] = mesh.vertices.mean(axis=0), []
        for vertices in moved:
            there = vertices.mean(axis=0)
            turn, misfit = Rotation.align_vectors(vertices - there, mesh.vertices - middle)
            if misfit > RIGID * np.linalg.norm(mesh.vertices - middle):
                allowed = "allowed: sequences in which meshes move as they are"
                raise InputError(f"sequence {clip.name}: {mesh.name} changes its shape; {allowed}")
            poses[index].append(_pose(turn.as_matrix(), there + turn.apply(origin - middle)))
    return poses


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


def glb_of(view: View, *, sides: "Sides" = "double", clip: Clip | None = None) -> bytes:
    """Bytes of a .glb with the view's meshes in float32, its camera and its light (KHR_lights_punctual).

    Each triangle has vertices of its own, with its normal. sides: which of the white materials are double-sided, those
    of meshes that are not closed, or all. The light has no size there, and a disc or rectangle is a spot of
    WIDEST_CONE. A mesh that casts or receives no shadow has `casts` or `receives` in its node's `extras`, since glTF
    cannot express it. If the scene is farther from the origin than it is large, nodes are translated to its centre, so
    that float32 vertices keep their precision. clip: what an animation of the nodes plays, in place of the view.
    """
    view = clip.frames[0] if clip else view
    scene, camera, light = view.scene, view.camera, view.light
    materials = [(sides == "double" or not is_closed(mesh), mesh.cutout) for mesh in scene.meshes]
    low, high = scene.geometry.bounds
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
        punctual, (of_camera, of_light) = {"KHR_lights_punctual": {"light": 0}}, _poses(view)
        tree["nodes"] = [
            *(_mesh_node(index, mesh, origin) for index, mesh in enumerate(scene.meshes)),
            {"name": camera.name, "camera": 0, **of_camera},
            {"name": light.name, "extensions": punctual, **of_light},
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
    animate = partial(_animate, clip, origin) if clip else None
    written: bytes = export_glb(  # type: ignore[no-untyped-call]
        loaded, include_normals=True, tree_postprocessor=complete, buffer_postprocessor=animate
    )
    return written


def _animate(clip: Clip, origin: Floats, buffers: dict[str, bytes], tree: Json) -> None:
    """Add an animation of what moves to a glTF, whose nodes are those of meshes, camera and light."""
    nodes, count = _mesh_poses(clip, origin), len(clip.frames[0].scene.meshes)
    nodes |= dict(enumerate(map(list, zip(*map(_poses, clip.frames), strict=True)), count))

    def accessor(values: Any, kind: str, **bounds: Any) -> int:
        """Index of an accessor of values, which are added to the buffer."""
        array, name = np.array(values, np.float32), f"animation {len(buffers)}"
        buffers[name] = array.tobytes()
        tree["accessors"][name] = {
            "bufferView": len(buffers) - 1, "componentType": _FLOAT, "count": len(array), "type": kind, **bounds
        }  # fmt: skip
        return len(tree["accessors"]) - 1

    last = (len(clip.frames) - 1) * clip.interval
    times = accessor(np.linspace(0, last, len(clip.frames)), "SCALAR", min=[0.0], max=[float(np.float32(last))])
    animation: Json = {"name": clip.name, "channels": [], "samplers": []}
    for node, poses in nodes.items():
        for path, kind in (("translation", "VEC3"), ("rotation", "VEC4")):
            values, target = [one[path] for one in poses], {"node": node, "path": path}
            if any(value != values[0] for value in values):
                animation["channels"].append({"sampler": len(animation["samplers"]), "target": target})
                animation["samplers"].append({"input": times, "output": accessor(values, kind)})
    if animation["channels"]:
        tree["animations"] = [animation]


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


def _poses(view: View) -> tuple[Json, Json]:
    """Poses of the nodes of camera and light, which shines along its −z if it has a direction."""
    camera, light = view.camera, view.light
    turn = np.eye(3) if light.kind == "point" else perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
    return _pose(camera.basis().T, camera.position), _pose(turn.T, light.position)


def _pose(turn: Floats, place: Sequence[float] | Floats) -> Json:
    """Fields of a glTF node, of a rotation matrix and a place."""
    return {"translation": [*map(float, place)], "rotation": Rotation.from_matrix(turn).as_quat().tolist()}
