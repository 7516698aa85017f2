"""A scene's triangles on the device: a vertex buffer, and index buffers of all faces and of the casters."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, Program
from shadowbench.scenes.geometry import Geometry

_Value = TypeVar("_Value", bound=np.generic)
TRIANGLE_ROW = 2048  # triangles whose values are side by side in a texture
TRIANGLE_DEFINES = {"TRIANGLE_ROW": str(TRIANGLE_ROW)}  # defines of `triangle.glsl`


def triangle_texels(values: NDArray[_Value]) -> NDArray[_Value]:
    """(height, TRIANGLE_ROW, …) texels of (F, …) per-triangle values for `triangle.glsl`, padded with zeros."""
    texels = np.zeros((-(-len(values) // TRIANGLE_ROW) * TRIANGLE_ROW, *values.shape[1:]), dtype=values.dtype)
    texels[: len(values)] = values
    return texels.reshape(-1, TRIANGLE_ROW, *values.shape[1:])


def _rgba(xyz: NDArray[np.float64], w: NDArray[np.bool_] | float) -> NDArray[np.float32]:
    return triangle_texels(np.column_stack([xyz, np.broadcast_to(w, len(xyz))]).astype(np.float32))


class DeviceGeometry:
    """A scene's buffers and per-triangle textures, uploaded once.

    Techniques draw `casters`, the G-buffer draws `all_faces`. `normals` and `colors` are textures addressed by triangle
    (`texel_of` in `triangle.glsl`); w of a normal is 1 for triangles that receive shadows.
    """

    def __init__(self, device: Device, geometry: Geometry) -> None:
        self._device, context = device, device.context
        self._vertices = context.buffer(geometry.vertices.astype(np.float32).tobytes())
        self._faces = context.buffer(geometry.faces.astype(np.uint32).tobytes())
        casters = geometry.caster_faces
        self.caster_count = len(casters)
        whole = self.caster_count in (0, len(geometry.faces))
        self._casters = self._faces if whole else context.buffer(casters.astype(np.uint32).tobytes())
        self.normals, self.colors = (
            context.texture((TRIANGLE_ROW, len(texels)), 4, texels.tobytes(), dtype="f4")
            for texels in (_rgba(geometry.normals, geometry.receives), _rgba(geometry.colors, 1.0))
        )

    def recolor(self, colors: NDArray[np.float64]) -> None:
        """Give the triangles other colours, (F, 3) linear RGB."""
        self.colors.write(_rgba(colors, 1.0))

    def all_faces(self, program: Program) -> Drawable:
        """All triangles; `gl_PrimitiveID` is the triangle's index."""
        return self._drawable(program, self._faces)

    def casters(self, program: Program) -> Drawable:
        """The caster triangles."""
        return self._drawable(program, self._casters, count=-1 if self.caster_count else 0)

    def indexed(self, program: Program, indices: moderngl.Buffer, mode: int) -> Drawable:
        """The scene's vertices with other indices (uint32) and primitives."""
        return self._drawable(program, indices, mode=mode)

    def _drawable(
        self, program: Program, faces: moderngl.Buffer, mode: int = moderngl.TRIANGLES, count: int = -1
    ) -> Drawable:
        vertices = program.device.context.vertex_array(program.linked, [(self._vertices, "3f", "position")], faces)
        return Drawable(program, vertices, mode, count)

    def release(self) -> None:
        """Free the buffers and textures."""
        buffers = {self._vertices, self._faces, self._casters}
        self._device.free((*buffers, self.normals, self.colors))
