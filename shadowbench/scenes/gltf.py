"""glTF: meshes with their materials, cameras and lights along the node tree, and notes on unsupported features.

Not read by trimesh, because it gives instances random names, keeps only one camera, and drops the children of a
camera's node.
"""

import math
import re
from pathlib import Path

import numpy as np

from shadowbench.errors import InputError
from shadowbench.scenes.cutouts import Alphas, Cutout, Single, Wrap, cut_out
from shadowbench.scenes.file_contents import (
    BLEND_CUTOFF,
    BY_DEFAULT,
    OPAQUE,
    Chosen,
    Contents,
    Look,
    target_of,
    unique_name,
)
from shadowbench.scenes.gltf_layout import Layout, Material, NodeTable, TextureInfo, TextureTransform
from shadowbench.scenes.gltf_pose import Node, Posed, Poser, pose_at, scene_nodes
from shadowbench.scenes.gltf_storage import (
    TRIANGLES,
    Data,
    TrianglePrimitive,
    floats_of,
    read_buffers,
    read_json,
    read_primitives,
    read_uri,
)
from shadowbench.scenes.images import read_image
from shadowbench.scenes.model import GREY, WIDEST_CONE, Camera, Light, Mesh
from shadowbench.scenes.vectors import Floats, unit, vec3
from shadowbench.strict import validated

_NEAREST = 9728  # GL_NEAREST
_WRAPS: dict[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}  # GL_CLAMP_TO_EDGE, GL_MIRRORED_REPEAT, …


class Materials:
    """The materials of a file. path: of the file, whose folder holds its images.

    coordinates: whether texture coordinates are read even if no material needs them; notes: on what was simplified,
    when all primitives have been asked for.
    """

    def __init__(self, data: Data, path: Path, coordinates: bool = False) -> None:
        self._data, self._path, self._all_coordinates = data, path, coordinates
        self._cutouts: dict[tuple[int, float], Cutout] = {}
        self._masks: dict[int, Alphas] = {}
        self._blended: set[int] = set()
        self._left_out = self._fading = 0
        self._lines: set[str] = set()

    def look(self, primitive: TrianglePrimitive) -> Look | None:
        """What a primitive looks like, None if it is opaque nowhere. Raises InputError for an alpha that is not read.

        Its vertex indices must be valid.
        """
        number = primitive.primitive.material
        material = self._data.layout.materials[number] if number is not None else Material()
        alpha, tints = self._of_vertices(primitive)
        cutout = None if number is None or material.alphaMode == "OPAQUE" else self._cutout(number, material, alpha)
        if cutout is not None and cutout.share == 0.0:
            self._left_out += 1
            return None
        if cutout is not None and cutout.share == 1.0:
            cutout = None
        needed = self._all_coordinates or (cutout is not None and material.texture is not None)
        coordinates = self._coordinates(primitive, material.texture) if needed else None
        places = None if cutout is None or coordinates is None else cutout.places(coordinates)
        color = vec3(np.clip((material.color or GREY)[:3], 0.0, 1.0))
        return Look(color, cutout, coordinates, places, tints)

    @property
    def notes(self) -> list[str]:
        """A line for each simplification."""
        lines = [
            (len(self._blended), f"blended material(s) cut out where alpha is below {BLEND_CUTOFF:g}"),
            (self._left_out, "primitive(s) left out whose alpha is below the cutoff everywhere"),
            (self._fading, "primitive(s) whose vertices differ in alpha cut out by the largest"),
        ]
        return [f"{self._data.where}: {count} {line}" for count, line in lines if count] + sorted(self._lines)

    def _cutout(self, number: int, material: Material, vertex_alpha: Single | None) -> Cutout:
        """How a primitive is cut out."""
        if material.alphaMode == "BLEND":
            self._blended.add(number)
        cutoff = BLEND_CUTOFF if material.alphaMode == "BLEND" else material.alphaCutoff
        factor = 1.0 if material.color is None or len(material.color) < 4 else min(max(material.color[3], 0.0), 1.0)
        if vertex_alpha is not None and vertex_alpha.size:
            factor *= float(vertex_alpha.max())
            self._fading += bool(vertex_alpha.min() < vertex_alpha.max())
        if (number, factor) not in self._cutouts:
            self._cutouts[number, factor] = cut_out(self._mask(material), factor, cutoff, *self._sampling(material))
        return self._cutouts[number, factor]

    def _mask(self, material: Material) -> Alphas:
        """The alphas of a material's texture, decoded once; opaque without one, with a note if it is not read."""
        if material.texture is None:
            return OPAQUE
        texture = self._data.layout.textures[material.texture.index]
        if texture.image is None:
            kind = " or ".join(sorted(texture.extensions)) or "a texture without an image"
            self._lines.add(f"{self._data.where}: {kind}: alpha not read, taken as 1")
            return OPAQUE
        if texture.image not in self._masks:
            where = f"{self._data.where}: images {texture.image + 1}"
            texels = read_image(self._content(texture.image, where), where)
            self._masks[texture.image] = np.ascontiguousarray(texels[..., 3])
        return self._masks[texture.image]

    def _sampling(self, material: Material) -> tuple[bool, tuple[Wrap, Wrap]]:
        """Whether a material's texture is magnified to its nearest texel, and its wraps."""
        number = None if material.texture is None else self._data.layout.textures[material.texture.index].sampler
        if number is None:
            return False, ("repeat", "repeat")
        sampler = self._data.layout.samplers[number]
        return sampler.magFilter == _NEAREST, (_WRAPS[sampler.wrapS], _WRAPS[sampler.wrapT])

    def _content(self, number: int, where: str) -> bytes:
        """The bytes of an image. Raises InputError."""
        image = self._data.layout.images[number]
        if image.bufferView is not None:
            view = self._data.layout.bufferViews[image.bufferView]
            return self._data.buffers[view.buffer][view.byteOffset : view.end]
        if image.uri is None:
            raise InputError(f"{where}: found neither uri nor bufferView; one is needed")
        return read_uri(image.uri, self._path, where)

    @staticmethod
    def _of_vertices(primitive: TrianglePrimitive) -> tuple[Single | None, Single | None]:
        """(F, 3) vertex alphas, None without any; (F, 3) mean colours of the vertices, None if they have no colour."""
        colors = primitive.floats("COLOR_0", "VEC3", "VEC4")
        if colors is None:
            return None, None
        at_corners = primitive.by_corner(np.clip(colors, 0.0, 1.0))
        return at_corners[..., 3] if colors.shape[1] == 4 else None, at_corners[..., :3].mean(axis=1)

    @staticmethod
    def _coordinates(primitive: TrianglePrimitive, info: TextureInfo | None) -> Single | None:
        """(F, 3, 2) texture coordinates of a texture after its KHR_texture_transform; None if there are none."""
        moved = TextureTransform() if info is None else info.transform
        number = moved.texCoord if moved.texCoord is not None or info is None else info.texCoord
        coordinates = primitive.floats(f"TEXCOORD_{number or 0}", "VEC2")
        if coordinates is None:
            return None
        cosine, sine = math.cos(moved.rotation), math.sin(moved.rotation)
        # Counter-clockwise as seen, with v downwards.
        coordinates = coordinates * moved.scale @ np.array([[cosine, -sine], [sine, cosine]]) + moved.offset
        return primitive.by_corner(coordinates)


TYPES = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


def instance_matrices(data: Data, node: NodeTable) -> Floats:
    """(N, 4, 4) float64 matrices from each instance of a node's mesh to the node; the identity for one without."""
    from scipy.spatial.transform import Rotation  # the import takes 0.3 s

    if not node.instances:
        return np.eye(4)[None]
    attributes = {
        name: floats_of(data, node.instances[name], kind) for name, kind in TYPES.items() if name in node.instances
    }
    matrices = np.tile(np.eye(4), (data.layout.instance_count(node), 1, 1))
    if "ROTATION" in attributes:
        matrices[:, :3, :3] = Rotation.from_quat(attributes["ROTATION"]).as_matrix()
    matrices[:, :3, :3] *= attributes.get("SCALE", np.ones((1, 3)))[:, None, :]
    matrices[:, :3, 3] = attributes.get("TRANSLATION", 0.0)
    return matrices


HONOURED = re.compile(
    r"KHR_draco_mesh_compression|KHR_mesh_quantization|KHR_mesh_primitive_restart"
    r"|(EXT|KHR)_meshopt_compression|EXT_mesh_gpu_instancing|KHR_lights_punctual|KHR_node_visibility"
    r"|(KHR|EXT|MSFT)_texture_\w+|KHR_materials_(?!variants)\w+|KHR_xmp\w*|EXT_lights_image_based|FB_ngon_encoding"
)
"""Extensions that are supported, or do not affect the geometry."""


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
    data = read_buffers(layout, chunk, path, where)
    pose, pose_notes = pose_at(data, chosen)
    nodes = scene_nodes(layout, pose)
    poser, materials = Poser(data, pose, nodes), Materials(data, path, chosen.coordinates)
    shapes: dict[int, list[tuple[Posed, Look]]] = {node.number: [] for node in nodes}
    for primitive in read_primitives(data):
        posed = poser.posed(primitive)
        if posed and (look := materials.look(primitive)) is not None:
            for number, shape in posed.items():
                shapes[number].append((shape, look))
    instances = []
    for node in nodes:
        own = shapes[node.number]
        if node.data.mesh is None or not own:
            continue
        name = node.data.name or layout.meshes[node.data.mesh].name or "mesh"
        copies = instance_matrices(data, node.data)
        for k, (shape, look) in enumerate(own, 1):
            title = name if len(own) == 1 else f"{name} {k}"
            for number, copy in enumerate(copies, 1):
                once = title if len(copies) == 1 else f"{title} {number}"
                mesh = Mesh(once, *shape.triangles, normals=shape.normals, **look._asdict())
                instances.append((mesh, shape.matrix @ copy))
    (cameras, camera_notes), (lights, light_notes) = _cameras(layout, nodes, where), _lights(layout, nodes, where)
    notes = [*_notes(layout, nodes, where), *materials.notes, *pose_notes, *poser.notes, *camera_notes, *light_notes]
    return Contents(instances, cameras, lights, notes)


def _cameras(layout: Layout, nodes: list[Node], where: str) -> tuple[list[Camera], list[str]]:
    """The cameras of the scene, and a note for each that is not of a square picture."""
    cameras: list[Camera] = []
    notes = []
    for node in nodes:
        if node.data.camera is None:
            continue
        camera = layout.cameras[node.data.camera]
        position, forward = _pose(node)
        name = unique_name(node.data.name or camera.name, "camera", {camera.name for camera in cameras})
        up, target = vec3(unit(node.matrix[:3, 1])), target_of(position, forward)
        pose = name, vec3(position), target
        if (lens := camera.perspective) is not None:
            cameras.append(Camera(*pose, lens.yfov, up, lens.znear, lens.zfar))
            aspect = lens.aspectRatio or 1.0
        elif (box := camera.orthographic) is not None:
            cameras.append(Camera(*pose, 0.0, up, box.znear or None, box.zfar, height=2 * box.ymag))
            aspect = box.xmag / box.ymag
        if not math.isclose(aspect, 1.0, rel_tol=1e-6):
            made_for = f"made for pictures {aspect:.4g} times as wide as high"
            notes.append(f"{where}: camera {name}: {made_for}; --view-size sets the shape")
    return cameras, notes


def _lights(layout: Layout, nodes: list[Node], where: str) -> tuple[list[Light], list[str]]:
    """The lights on visible nodes, and a note for each ignored property."""
    lights: list[Light] = []
    notes = []
    for node in nodes:
        if node.data.light is None or not node.visible:
            continue
        data = layout.lights[node.data.light]
        name = unique_name(node.data.name or data.name, "light", {light.name for light in lights})
        position, direction = (vec3(values) for values in _pose(node))
        light_where = f"{where}: light {name}"
        if data.type == "directional":
            lights.append(Light(name, "directional", direction))
        elif data.type == "point":
            lights.append(Light(name, "point", position=position))
        else:
            angle, widest = 2 * data.outerConeAngle, math.radians(WIDEST_CONE)
            if angle > widest:
                notes.append(f"{light_where}: cone of {math.degrees(angle):.4g}° taken as {WIDEST_CONE:g}°")
            lights.append(Light(name, "spot", direction, position, min(angle, widest)))
        if data.range is not None and data.type != "directional":
            notes.append(f"{light_where}: range {data.range:g} m ignored: it reaches everywhere")
        if data.intensity == 0.0:
            notes.append(f"{light_where}: intensity 0 ignored: it shines and casts shadows")
    return lights, notes


def _pose(node: Node) -> tuple[Floats, Floats]:
    """(3,) position of a node, and (3,) unit vector along its −z axis."""
    return node.matrix[:3, 3], unit(-node.matrix[:3, 2])


def _notes(layout: Layout, nodes: list[Node], where: str) -> list[str]:
    """A note for each kind of feature that is ignored or simplified."""
    hidden = [node.data for node in nodes if not node.visible]
    primitives = layout.primitives
    used = {each.material for each in primitives}
    lines = [
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
    return [f"{where}: {sum(which)} {line}" for which, line in lines if any(which)] + _ignored(layout, where)


def _ignored(layout: Layout, where: str) -> list[str]:
    """A note on the extensions that change what is seen and are not read, if there are any."""
    names = {*layout.extensionsUsed, *layout.extensions}.union(*(node.extensions for node in layout.nodes))
    ignored = sorted(name for name in names if not HONOURED.fullmatch(name))
    shown = ", ".join(f"{name:.40}" for name in ignored[:5]) + ", ..." * (len(ignored) > 5)
    return [f"{where}: drawn as if the file did not use {shown}"] if ignored else []
