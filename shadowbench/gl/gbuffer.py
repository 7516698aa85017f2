"""A scene's triangles on the device, and the G-buffer: what a camera sees of them, input of every resolve pass."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pyglm import glm

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import SHADERS, Drawable, Program, Sampling, State, Textures, compose, fullscreen, link
from shadowbench.scenes.cutouts import CutoutFaces, PackedCutouts
from shadowbench.scenes.model import Camera, View
from shadowbench.scenes.triangles import Faces, Geometry
from shadowbench.scenes.vectors import Floats

_Value = TypeVar("_Value", bound=np.generic)
TRIANGLE_ROW = 2048  # triangles whose values are side by side in a texture
_CUTOUT_ROW = 16384  # words of cut-outs that are: the width that OpenGL 4.1 guarantees
CUTOUTS = {"CUTOUTS": "1"}
"""Define with which shaders cut out."""
_CORNER = np.dtype([("position", "f4", 3), ("cutout_place", "f4", 2), ("cutout_face", "i4", 2)])


def triangle_texels(values: NDArray[_Value], row: int = TRIANGLE_ROW) -> NDArray[_Value]:
    """(height, row, …) texels of (F, …) per-triangle values for `triangle.glsl`, padded with zeros."""
    texels = np.zeros((-(-len(values) // row) * row, *values.shape[1:]), dtype=values.dtype)
    texels[: len(values)] = values
    return texels.reshape(-1, row, *values.shape[1:])


def _rgba(xyz: NDArray[np.float64], w: NDArray[np.bool_] | float) -> NDArray[np.float32]:
    return triangle_texels(np.column_stack([xyz, np.broadcast_to(w, len(xyz))]).astype(np.float32))


class _Triangles(NamedTuple):
    """Some of a scene's triangles: indices of all and of the opaque ones with their number; corners of the cut-out."""

    whole: tuple[moderngl.Buffer, int]
    opaque: tuple[moderngl.Buffer, int]
    corners: moderngl.Buffer | None


class DeviceGeometry:
    """A scene's buffers and per-triangle textures, uploaded once.

    Techniques draw `casters`, the G-buffer draws `all_faces`: a program with `cut` draws the cut-out triangles by that,
    any other draws them whole. By triangle (`texel_of` in `triangle.glsl`): normals, w = 1 for triangles that receive
    shadows; colors; smooth, textures of `gbuffer/smooth.glsl`, empty if all surfaces are flat. cutouts: textures of
    `cutout.glsl`; empty if nothing is cut out. geometry: what was uploaded. defines: of shaders that read these, SMOOTH
    among them if a surface is smooth.
    """

    def __init__(self, device: Device, geometry: Geometry) -> None:
        self.geometry, self._device, context, faces = geometry, device, device.context, geometry.faces
        self.defines = {"TRIANGLE_ROW": str(TRIANGLE_ROW), "CUTOUT_ROW": str(_CUTOUT_ROW)}
        self._vertices = context.buffer(geometry.vertices.astype(np.float32).tobytes())
        self._buffers = [self._vertices]
        textures = {} if geometry.cutouts is None else _cutout_textures(device, geometry.cutouts.packed)
        self.cutouts: Textures = {name: (texture, Sampling()) for name, texture in textures.items()}
        # Cut-out ones without area, so that the others keep their `gl_PrimitiveID`.
        opaque = np.where(geometry.is_cut_out[:, np.newaxis], 0, faces) if self.cutouts else faces
        self._all = self._upload(faces, opaque, geometry.cutouts)
        self._casters = self._all
        if geometry.caster_faces is not faces or self.cutouts:
            opaque = faces[geometry.casts & ~geometry.is_cut_out]
            self._casters = self._upload(geometry.caster_faces, opaque, geometry.caster_cutouts)
        self.normals = self._texels(_rgba(geometry.normals, geometry.receives))
        self.colors = self._texels(_rgba(geometry.colors, 1.0))
        self._textures = [*textures.values(), self.normals, self.colors]
        self.smooth: Textures = {}
        if geometry.smooth:
            self.defines["SMOOTH"] = "1"
            corners = np.zeros((len(faces), 3, 2, 4), dtype=np.float32)
            corners[:, :, 0, :3] = geometry.vertices[faces]
            corners[:, :, 1, :3] = geometry.shading_normals
            texels = triangle_texels(corners.reshape(-1, 6, 4))
            self._textures.append(self._texels(texels.reshape(len(texels), -1, 4)))
            self.smooth = {"corners": (self._textures[-1], Sampling())}

    def _texels(self, texels: NDArray[np.float32]) -> moderngl.Texture:
        height, width, _ = texels.shape
        return self._device.context.texture((width, height), 4, texels.tobytes(), dtype="f4")

    def _upload(self, faces: Faces, opaque: Faces, cutouts: CutoutFaces | None) -> _Triangles:
        whole = self._indices(faces)
        if cutouts is None:
            return _Triangles(whole, whole, None)
        corners = np.empty((len(cutouts.faces), 3), dtype=_CORNER)
        corners["position"] = self.geometry.vertices[faces[cutouts.faces]]
        corners["cutout_place"] = cutouts.places
        corners["cutout_face"] = np.stack([cutouts.number, cutouts.faces], axis=1)[:, np.newaxis]
        return _Triangles(whole, self._indices(opaque), self._buffer(corners))

    def _indices(self, faces: Faces) -> tuple[moderngl.Buffer, int]:
        # A buffer cannot be empty.
        return self._buffer(faces.astype(np.uint32)) if len(faces) else self._vertices, faces.size

    def _buffer(self, values: NDArray[np.generic]) -> moderngl.Buffer:
        self._buffers.append(self._device.context.buffer(values.tobytes()))
        return self._buffers[-1]

    def all_faces(self, program: Program) -> Drawable:
        """All triangles; `gl_PrimitiveID` is the index of an opaque triangle."""
        return self._triangles(program, self._all)

    def casters(self, program: Program) -> Drawable:
        """The caster triangles."""
        return self._triangles(program, self._casters)

    def _triangles(self, program: Program, triangles: _Triangles) -> Drawable:
        if program.cut is None or triangles.corners is None:
            return self._indexed(program, *triangles.whole)
        content = [(triangles.corners, "3f 2f 2i", *(_CORNER.names or ()))]
        # Of attributes that the shaders read.
        vertices = self._device.context.vertex_array(program.cut.linked, content, skip_errors=True)
        cut = Drawable(program.cut, vertices, textures=self.cutouts)
        return replace(self._indexed(program, *triangles.opaque), cut=cut)

    def indexed(self, program: Program, indices: moderngl.Buffer, mode: int) -> Drawable:
        """The scene's vertices with other indices (uint32) and primitives."""
        return replace(self._indexed(program, indices, -1), mode=mode)

    def _indexed(self, program: Program, indices: moderngl.Buffer, count: int) -> Drawable:
        vertices = self._device.context.vertex_array(program.linked, [(self._vertices, "3f", "position")], indices)
        return Drawable(program, vertices, count=count)

    def release(self) -> None:
        """Free the buffers and textures."""
        self._device.free((*self._buffers, *self._textures))


def _cutout_textures(device: Device, packed: PackedCutouts) -> dict[str, moderngl.Texture]:
    table, words = triangle_texels(packed.table), triangle_texels(packed.words, _CUTOUT_ROW)
    create = device.context.texture
    return {
        "cutout_table": create((TRIANGLE_ROW, len(table)), 4, table.tobytes(), dtype="i4"),
        "cutout_words": create(words.shape[::-1], 1, words.tobytes(), dtype="u4"),
    }


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Textures of a view's size, row 0 at the bottom (OpenGL order).

    position: RGBA32F, local xyz, w = 1 where a surface is visible. normal: RGBA32F, geometric, towards the camera,
    w = 1 for triangles that receive shadows. triangle: R32I, index of the triangle in the scene, −1 for none.
    depth: view depth divided by that of the far plane. smooth: in place of position and normal, those of the smooth
    surface that a triangle stands for (`gbuffer/smooth.glsl`); None if all are flat.
    """

    position: moderngl.Texture
    normal: moderngl.Texture
    triangle: moderngl.Texture
    depth: moderngl.Texture
    target: moderngl.Framebuffer
    device: Device
    smooth: tuple[moderngl.Texture, moderngl.Texture] | None = None

    @property
    def lifted(self) -> "GBuffer":
        """The smooth surfaces in place of the triangles."""
        return self if self.smooth is None else replace(self, position=self.smooth[0], normal=self.smooth[1])

    @property
    def inputs(self) -> dict[str, tuple[moderngl.Texture, Sampling]]:
        """Inputs of `receiver.glsl` and `shading_normal.glsl`, and `surface_depth`, the depth."""
        textures = {"position": self.position, "normal": self.normal, "depth": self.depth}
        if self.smooth is not None:
            textures["shading_normal"] = self.smooth[1]
        return {f"surface_{name}": (texture, Sampling()) for name, texture in textures.items()}

    def triangles(self) -> NDArray[np.int32]:
        """(height, width) int32 indices of triangles in the scene, −1 for none, row 0 at the top."""
        return download(self.triangle, "i4")[..., 0].astype(np.int32)

    def before(self, now: Geometry, then: Geometry) -> NDArray[np.float32]:
        """(H, W, 3) where the surface at each pixel was then, row 0 at the bottom, as motion vectors say."""
        triangle, places = self.triangles()[::-1], np.array(download(self.position)[::-1, :, :3], np.float64)
        at = np.nonzero((triangle >= 0) & (now.vertices != then.vertices)[now.faces].any(axis=(1, 2))[triangle])
        own = triangle[at]
        places[at] += np.einsum("nk,nki->ni", now.weights(own, places[at]), then.corners(own) - now.corners(own))
        return places.astype(np.float32)

    def release(self) -> None:
        """Free the textures."""
        textures = self.position, self.normal, self.triangle, self.depth, *(self.smooth or ())
        self.device.free((self.target, *textures))


def download(texture: moderngl.Texture, dtype: str = "f4") -> NDArray[np.generic]:
    """(height, width, components) array of a texture, row 0 at the top."""
    width, height = texture.size
    values = np.frombuffer(texture.read(alignment=1), dtype=dtype).reshape(height, width, texture.components)
    return values[::-1]


def _world_to_camera(camera: Camera) -> Floats:
    _, up, back = camera.basis()
    position = glm.dvec3(*camera.position)  # glm rounds a tuple to float32
    return np.array(glm.lookAt(position, position - glm.dvec3(*back), glm.dvec3(*up)))


def world_to_depth(camera: Camera) -> tuple[float, ...]:
    """(a, b, c, d) of the view depth a·x + b·y + c·z + d of a point."""
    return tuple((-_world_to_camera(camera)[2]).tolist())


def view_projection(view: View) -> Floats:
    """(4, 4) float64 world-to-clip matrix of a view's camera, for column vectors."""
    world_to_clip: Floats = view.projection @ _world_to_camera(view.camera)
    return world_to_clip


class GBufferPass:
    """Draws G-buffers of any view of one geometry."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self.device, self.geometry = device, geometry
        self.program = self._link(geometry.defines)
        if geometry.cutouts:
            self.program.cut = self._link(geometry.defines | CUTOUTS)
        self.drawable = geometry.all_faces(self.program)

    def _link(self, defines: Mapping[str, str]) -> Program:
        stages = (
            compose(f"gbuffer/gbuffer.{stage}", SHADERS, {**defines, stage.upper(): "1"}) for stage in ("vert", "frag")
        )
        return link(self.device, *stages)

    def draw(self, view: View) -> GBuffer:
        """The G-buffer of a view, which is in the same coordinates as the uploaded geometry."""
        context, size = self.device.context, view.size
        position, normal = (context.texture(size, 4, dtype="f4") for _ in range(2))
        triangle = context.texture(size, 1, dtype="i4")
        depth = context.depth_texture(size)
        smooth = None
        if self.geometry.smooth:
            smooth = context.texture(size, 4, dtype="f4"), context.texture(size, 4, dtype="f4")
        target = context.framebuffer([position, normal, triangle, *(smooth or ())], depth)
        target.clear(depth=1.0)
        triangle.write(np.full(size.shape, -1, dtype=np.int32).tobytes())  # moderngl's clear writes floats
        far = view.near_far[1]
        to_clip, to_depth = view_projection(view), world_to_depth(view.camera)
        self.program.set(world_to_clip=to_clip, world_to_depth=to_depth, far=far, eye=view.camera.eye)
        textures = {"normals": (self.geometry.normals, Sampling()), **self.geometry.smooth}
        self.drawable.draw(target, textures, State(depth_test="<"))
        self.device.check("the G-buffer")
        return GBuffer(position, normal, triangle, depth, target, self.device, smooth)

    def release(self) -> None:
        """Free the programs and their vertex arrays."""
        self.drawable.release()


class FacetPass:
    """Darkens masks of scenes with smooth surfaces: see `facets.frag`."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self._device = device
        self._drawable = fullscreen(device, "facets.frag", geometry.defines)

    def draw(self, visibility: moderngl.Texture, surface: GBuffer, view: View) -> None:
        """Write 0 into a mask, where it is to be."""
        target = self._device.context.framebuffer([visibility])
        xyz, w = view.light.homogeneous
        self._drawable.program.set(light=(*xyz, w))
        self._drawable.draw(target, surface.inputs)
        self._device.free((target,))

    def release(self) -> None:
        """Free the program."""
        self._drawable.release()
