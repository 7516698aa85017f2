"""A scene's triangles on the device: vertices and indices, corners of cut-out triangles, and per-triangle textures."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Drawable, Program, Sampling, Textures
from shadowbench.scenes.cutouts import CutoutFaces, PackedCutouts
from shadowbench.scenes.triangles import Faces, Geometry

_Value = TypeVar("_Value", bound=np.generic)
TRIANGLE_ROW = 2048  # triangles whose values are side by side in a texture
_CUTOUT_ROW = 16384  # words of cut-outs that are: the width that OpenGL 4.1 guarantees
TRIANGLE_DEFINES = {"TRIANGLE_ROW": str(TRIANGLE_ROW), "CUTOUT_ROW": str(_CUTOUT_ROW)}
"""Defines of `triangle.glsl` and `cutout.glsl`."""
CUTOUTS = {"CUTOUTS": "1"}
"""Define with which shaders cut out."""
SMOOTH = {"SMOOTH": "1"}
"""Define with which shaders know the smooth surface, in scenes that have one."""
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
    `cutout.glsl`; empty if nothing is cut out. geometry: what was uploaded.
    """

    def __init__(self, device: Device, geometry: Geometry) -> None:
        self.geometry, self._device, context, faces = geometry, device, device.context, geometry.faces
        self._vertices = context.buffer(geometry.vertices.astype(np.float32).tobytes())
        self._buffers = [self._vertices]
        textures = {} if geometry.cutouts is None else _cutout_textures(device, geometry.cutouts.packed)
        self.cutouts: Textures = {name: (texture, Sampling()) for name, texture in textures.items()}
        # Cut-out ones without area, so that the others keep their `gl_PrimitiveID`.
        opaque = np.where(geometry.is_cut_out[:, np.newaxis], 0, faces) if self.cutouts else faces
        self._all = self._upload(geometry, faces, opaque, geometry.cutouts)
        self._casters = self._all
        if geometry.caster_faces is not faces or self.cutouts:
            opaque = faces[geometry.casts & ~geometry.is_cut_out]
            self._casters = self._upload(geometry, geometry.caster_faces, opaque, geometry.caster_cutouts)
        self.normals = self._texels(_rgba(geometry.normals, geometry.receives))
        self.colors = self._texels(_rgba(geometry.colors, 1.0))
        self._textures = [*textures.values(), self.normals, self.colors]
        self.smooth: Textures = {}
        if geometry.smooth:
            corners = triangle_texels(_smooth_corners(geometry))
            self._textures.append(self._texels(corners.reshape(len(corners), -1, 4)))
            self.smooth = {"corners": (self._textures[-1], Sampling())}

    def _texels(self, texels: NDArray[np.float32]) -> moderngl.Texture:
        height, width, _ = texels.shape
        return self._device.context.texture((width, height), 4, texels.tobytes(), dtype="f4")

    @property
    def smooth_defines(self) -> Mapping[str, str]:
        """SMOOTH if a surface is smooth."""
        return SMOOTH if self.geometry.smooth else {}

    def _upload(self, geometry: Geometry, faces: Faces, opaque: Faces, cutouts: CutoutFaces | None) -> _Triangles:
        """Triangles, those of them that are opaque, and those that are cut out."""
        whole = self._indices(faces)
        if cutouts is None:
            return _Triangles(whole, whole, None)
        corners = self._buffer(_corners(geometry.vertices[faces[cutouts.faces]], cutouts))
        return _Triangles(whole, self._indices(opaque), corners)

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


def _smooth_corners(geometry: Geometry) -> NDArray[np.float32]:
    """(F, 6, 4) position and normal of each corner of the triangles."""
    corners = np.zeros((len(geometry.faces), 3, 2, 4), dtype=np.float32)
    corners[:, :, 0, :3] = geometry.vertices[geometry.faces]
    corners[:, :, 1, :3] = geometry.shading_normals
    return corners.reshape(-1, 6, 4)


def _corners(positions: NDArray[np.float64], cutouts: CutoutFaces) -> NDArray[np.void]:
    """(K, 3) corners of cut-out triangles at (K, 3, 3) positions."""
    corners = np.empty(positions.shape[:2], dtype=_CORNER)
    corners["position"] = positions
    corners["cutout_place"] = cutouts.places
    corners["cutout_face"] = np.stack([cutouts.number, cutouts.faces], axis=1)[:, np.newaxis]
    return corners


def _cutout_textures(device: Device, packed: PackedCutouts) -> dict[str, moderngl.Texture]:
    """Textures of `cutout.glsl`."""
    table, words = triangle_texels(packed.table), triangle_texels(packed.words, _CUTOUT_ROW)
    create = device.context.texture
    return {
        "cutout_table": create((TRIANGLE_ROW, len(table)), 4, table.tobytes(), dtype="i4"),
        "cutout_words": create(words.shape[::-1], 1, words.tobytes(), dtype="u4"),
    }
