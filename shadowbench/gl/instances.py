"""Instances on the device: the vertices of each in float32, moved in float64, and the indices of sources."""

import ctypes
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import TooLarge
from shadowbench.gl.device import Device
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, Program
from shadowbench.scenes.geometry import Geometry
from shadowbench.scenes.instanced import InstancedGeometry

INSTANCED = {"INSTANCED": "1"}
"""Define with which the G-buffer's shaders draw instances."""
_UNSIGNED_INT = 0x1405
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DrawnInstances:
    """Some of a scene's instances in turn, (K,) each.

    ends: (K + 1,) where the indices of each begin and the last ones end, if they are counted in turn; begin: where they
    do in the index buffer; vertex: the first vertex of each; triangle: its first triangle in the scene.
    """

    ends: Indices
    begin: Indices
    vertex: Indices
    triangle: Indices

    def draw(self, drawable: Drawable, first: int, count: int) -> None:
        """See `Instances`."""
        program, last = drawable.program, first + count
        for k in range(int(np.searchsorted(self.ends, first, side="right")) - 1, len(self.begin)):
            start, end = max(first, int(self.ends[k])), min(last, int(self.ends[k + 1]))
            if start >= end:
                break
            if program.has("first_triangle"):
                program.set(first_triangle=int(self.triangle[k]) + (start - int(self.ends[k])) // 3)
            place = ctypes.c_void_p(4 * (int(self.begin[k]) + start - int(self.ends[k])))
            raw = program.device.raw
            raw("glUseProgram", program.linked.glo)
            raw("glBindVertexArray", drawable.vertices.glo)
            raw("glDrawElementsBaseVertex", drawable.mode, end - start, _UNSIGNED_INT, place, int(self.vertex[k]))
            program.device.draws += 1


class InstancedDeviceGeometry(DeviceGeometry):
    """As `DeviceGeometry`, of instances."""

    def __init__(self, device: Device, geometry: InstancedGeometry) -> None:
        self.geometry, self._device, self.cutouts, self.triangles = geometry, device, {}, None
        vertex = np.cumsum([0, *(len(mesh.points) for mesh in geometry.meshes)])
        self._vertices = device.context.buffer(reserve=12 * int(vertex[-1]))
        for first, mesh in zip(vertex, geometry.meshes, strict=False):
            self._vertices.write(mesh.vertices.astype(np.float32).tobytes(), offset=12 * int(first))
        self._sources = device.context.buffer(np.concatenate([mesh.faces for mesh in geometry.sources]).tobytes())
        self._buffers, self._textures = [self._vertices, self._sources], []
        self._parts = np.diff(geometry.first), geometry.offset, vertex[:-1], geometry.first[:-1]

    def all_faces(self, program: Program) -> Drawable:
        """All triangles, with the index of an instance's first as the uniform `first_triangle`."""
        return self._instances(program, np.ones(len(self._parts[0]), dtype=bool))

    def casters(self, program: Program) -> Drawable:
        """The caster triangles."""
        assert isinstance(self.geometry, InstancedGeometry)
        return self._instances(program, self.geometry.mesh_casts)

    def indexed(self, program: Program, indices: moderngl.Buffer, mode: int) -> Drawable:
        """Raises TooLarge."""
        raise TooLarge("the scene's triangles are instances, which have no list of vertices")

    def _instances(self, program: Program, chosen: NDArray[np.bool_]) -> Drawable:
        counts, offset, vertex, triangle = (values[chosen] for values in self._parts)
        ends = 3 * np.cumsum([0, *counts])
        drawable = self._indexed(program, self._sources, int(ends[-1]))
        return replace(drawable, instances=DrawnInstances(ends, 3 * offset, vertex, triangle))


def device_geometry(device: Device, geometry: Geometry) -> DeviceGeometry:
    """A scene's triangles, uploaded."""
    if isinstance(geometry, InstancedGeometry):
        return InstancedDeviceGeometry(device, geometry)
    return DeviceGeometry(device, geometry)
