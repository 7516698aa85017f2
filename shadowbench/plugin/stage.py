"""The stage: the scene and device that a technique builds its GL resources from. It owns and releases them."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import Unsupported
from shadowbench.files import data_folder
from shadowbench.gl import targets
from shadowbench.gl.device import Device, Releasable, moderngl
from shadowbench.gl.gbuffer import CUTOUTS, DeviceGeometry
from shadowbench.gl.program import Drawable, Program, Textures, compose, link
from shadowbench.gl.targets import FACES, Color, DepthFormat, DepthTarget, DepthTexture, Kind, StencilTarget
from shadowbench.options import ViewSize
from shadowbench.plugin.params import Component, SubjectParams, components_of, in_metres
from shadowbench.scenes.model import Placement, Scene

Resource = TypeVar("Resource", bound=Releasable)
T = TypeVar("T")
MAP_DEFINES = {
    "LAYERS": "1",
    "ARRAY": "0",
    "PARALLEL": "0",
    "REVERSED": "0",
    "MIPMAPPED": "0",
    "GRADIENTS": "0",
    "CONTENTS": "0",
    "CUBE": "0",
}
"""Defines of `map.glsl`: of one map of a sun or a spot."""
_COMPONENT_BYTES = {"f1": 1, "f2": 2, "f4": 4, "i4": 4, "u4": 4, "nu2": 2}


@dataclass(frozen=True)
class ShaderText:
    """One shader of a program: name (`1-depth.frag`), complete source, and the uniforms set from parameters."""

    name: str
    text: str
    uniforms: Mapping[str, float]


@dataclass(eq=False)
class Memory:
    """What a cell remembers from frame to frame, also when it is built again for geometry that moved.

    values: by name, as made by `Stage.remembered`; bytes: device memory of their textures and buffers.
    """

    values: dict[str, Any] = field(default_factory=dict)
    resources: list[Releasable] = field(default_factory=list)
    bytes: int = 0


class Stage:
    """The scene (local coordinates), device and image size, and factories of programs, textures and targets.

    bytes: device memory of its textures and buffers; texts: the shader sources of its programs; shaders: folder of the
    technique's own shader files, searched before the shared ones, as are those of plug-ins' biases and filters. room:
    most bytes; Unsupported is raised before more are allocated. memory: of a build for earlier geometry.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        size: ViewSize,
        geometry: DeviceGeometry,
        placement: Placement,
        shaders: Path | None = None,
        room: int = sys.maxsize,
        memory: Memory | None = None,
    ) -> None:
        self.scene, self.device, self.size, self.placement = scene, device, size, placement
        self.memory = memory or Memory()
        self.bytes, self.room = self.memory.bytes, room
        self.texts: list[ShaderText] = []
        self._geometry = geometry
        self._programs = 0
        self._roots = [*([shaders] if shaders else []), data_folder("shaders")]
        self._resources: list[Releasable] = []

    def program(
        self,
        vertex: Path | str,
        fragment: Path | str,
        geometry: Path | str | None = None,
        *,
        params: SubjectParams | None = None,
        defines: Mapping[str, int | str] = {},
        includes: Mapping[str, str] = {},
    ) -> Program:
        """A linked program from shader files or inline sources, with the technique's parameters.

        Ints, bools and choices of `params` become #defines (SIZE 1024, REVERSED 0, WRAP_BORDER 1), floats uniforms
        (`bias_max`), with lengths in metres converted to local coordinates. A choice also names a file to include
        (`#include "select/<select>.glsl"`). The shader file of the chosen bias, filter, fit or split replaces `#include
        <parameter>` (`#include <bias>`), and its own parameters follow the same rules (FILTER_TAPS 3). Uniforms:
        `metre`, the length of one metre in local coordinates; `subpixel`, a step of the rasteriser's grid in pixels.
        defines: further #defines, besides MAP_DEFINES and that of the stage, VERT, GEOM or FRAG; includes: further
        files, by name (`projection`: matrix).
        """
        names, slots, uniforms = _shader_values(params, self.placement)
        plugins = [file.parent for component in components_of(params) for file in component.plugin_files()]
        roots = [*self._roots[:-1], *plugins, self._roots[-1]]
        names = {
            **MAP_DEFINES,
            **self._geometry.defines,
            **names,
            **{key: str(value) for key, value in defines.items()},
        }
        slots = {"projection": "matrix", **slots, **includes}
        uniforms |= {"metre": self.placement.length(1.0), "subpixel": 2.0**-self.device.subpixel_bits}
        stages = {"vert": vertex, "frag": fragment} | ({"geom": geometry} if geometry is not None else {})

        def linked(more: Mapping[str, str]) -> tuple[dict[str, str], Program]:
            texts: dict[str, str] = {
                stage: compose(source, roots, {**names, **more, stage.upper(): "1"}, slots)
                for stage, source in stages.items()
            }
            program = link(self.device, *texts.values())
            self._resources.append(program.linked)
            return texts, program

        texts, program = linked({})
        if self.cutouts and not CUTOUTS.keys() & names and any("CUTOUTS" in text for text in texts.values()):
            _, program.cut = linked(CUTOUTS)
        used = {name: value for name, value in uniforms.items() if program.has(name)}
        program.set(**used)
        self._programs += 1
        for stage, text in texts.items():
            stem = "inline" if "\n" in str(stages[stage]) else Path(stages[stage]).stem
            self.texts.append(ShaderText(f"{self._programs}-{stem}.{stage}", str(text), used))
        return program

    def remembered(self, name: str, make: Callable[[], T]) -> T:
        """What `make` returns, or what it returned when the cell was built for the geometry of an earlier frame.

        So a technique declares what it keeps from frame to frame: textures, targets, or any object of its own. What is
        in it is void in a frame of index 0.
        """
        memory, own, before = self.memory, self._resources, self.bytes
        if name not in memory.values:
            self._resources = memory.resources
            try:
                memory.values[name] = make()
            finally:
                self._resources = own
                memory.bytes += self.bytes - before
        value: T = memory.values[name]
        return value

    def texture(self, size: tuple[int, int] | None = None, components: int = 1, dtype: str = "f4") -> moderngl.Texture:
        """A colour texture, by default of the image's size."""
        texture = self.map_texture(size or self.size, "2d", 1, components, dtype)
        assert isinstance(texture, moderngl.Texture)
        return texture

    def map_texture(
        self, size: tuple[int, int], kind: Kind, layers: int, components: int, dtype: str, mips: bool = False
    ) -> Color:
        """A colour texture of a kind of map: one, an array of `layers`, or the six faces of a cube.

        mips: `build_mipmaps` will be called, whose levels count too.
        """
        context, (width, height) = self.device.context, size
        levels = max(size).bit_length() if mips else 1
        texels = sum(max(width >> level, 1) * max(height >> level, 1) for level in range(levels))
        needed = {"2d": 1, "cube": FACES, "array": layers}[kind] * texels * components * _COMPONENT_BYTES[dtype]
        create: dict[Kind, Callable[[], Color]] = {
            "2d": lambda: context.texture(size, components, dtype=dtype),
            "cube": lambda: context.texture_cube(size, components, dtype=dtype),
            "array": lambda: context.texture_array((*size, layers), components, dtype=dtype),
        }
        return self._allocated(needed, create[kind])

    def target(
        self,
        *textures: Color,
        depth: moderngl.Texture | DepthTexture | None = None,
        layer: int | Sequence[int] | None = None,
    ) -> moderngl.Framebuffer:
        """A framebuffer with colour textures and optionally a depth texture, such as that of a `depth_target`.

        layer: of a map with several, the one that is drawn into, or without depth one for each texture, which may be
        given several times; all by default, by `gl_Layer`.
        """
        if isinstance(layer, Sequence):
            framebuffer = targets.color_framebuffer(self.device, textures, layer)
        elif isinstance(depth, DepthTexture):
            framebuffer = targets.framebuffer_of(depth, textures, layer)
        elif layer is not None:
            framebuffer = targets.color_framebuffer(self.device, textures[:1], [layer])
        else:
            framebuffer = self.device.context.framebuffer(list(textures), depth)
        self._resources.append(framebuffer)
        return framebuffer

    def depth_target(self, size: int, depth: DepthFormat, kind: Kind = "2d", layers: int = 1) -> DepthTarget:
        """A square depth map to draw into and read: one, an array of `layers`, or the six faces of a cube."""
        needed = targets.map_bytes(size, depth, kind, layers)
        return self._allocated(needed, lambda: targets.depth_target(self.device, size, depth, kind, layers))

    def stencil_target(self, *textures: moderngl.Texture) -> StencilTarget:
        """A framebuffer of the image's size with colour textures and a depth-stencil buffer."""
        width, height = self.size
        return self._allocated(4 * width * height, lambda: targets.stencil_target(self.device, self.size, *textures))

    def buffer(self, values: NDArray[np.generic]) -> moderngl.Buffer:
        """A buffer with these values."""
        create = self.device.context.buffer
        return self._allocated(values.nbytes, lambda: create(np.ascontiguousarray(values).tobytes()))

    @property
    def cutouts(self) -> Textures:
        """Textures of `cutout.glsl`; empty if nothing is cut out."""
        return self._geometry.cutouts

    def casters(self, program: Program) -> Drawable:
        """The scene's caster triangles, with `in vec3 position`; cut out if the shaders include `cutout.glsl`."""
        return self._drawable(self._geometry.casters(program))

    def surfaces(self, program: Program) -> Drawable:
        """All triangles of the scene; `gl_PrimitiveID` is an opaque triangle's index in the G-buffer."""
        return self._drawable(self._geometry.all_faces(program))

    def indexed(self, program: Program, indices: NDArray[np.integer], mode: int = moderngl.TRIANGLES) -> Drawable:
        """The scene's vertices with other indices, as triangles or other primitives."""
        if indices.size == 0:  # a buffer cannot be empty
            return self._drawable(replace(self._geometry.all_faces(program), mode=mode, count=0, cut=None))
        buffer = self.buffer(indices.astype(np.uint32))
        return self._drawable(self._geometry.indexed(program, buffer, mode))

    def drawable(
        self,
        program: Program,
        attributes: Mapping[str, NDArray[np.generic]],
        mode: int = moderngl.TRIANGLES,
        indices: NDArray[np.integer] | None = None,
    ) -> Drawable:
        """Custom vertices. attributes: by name, each (N, k) float32 or int32, one row per vertex; indices: of them."""
        content = [
            (self.buffer(values), f"{values[0].size}{'i' if values.dtype.kind == 'i' else 'f'}", name)
            for name, values in attributes.items()
        ]
        order = None if indices is None else self.buffer(indices.astype(np.uint32))
        return self._drawable(Drawable(program, self.device.context.vertex_array(program.linked, content, order), mode))

    def stream(self, program: Program, attributes: Mapping[str, int]) -> Callable[[NDArray[np.float32]], Drawable]:
        """A function that uploads (N, k) float32 vertices, which may change each frame, and returns their drawable.

        attributes: number of components of each, in the order of the vertices' columns. All drawables share one buffer
        and draw the vertices of the last upload.
        """
        widths = " ".join(f"{width}f" for width in attributes.values())
        buffer = self.buffer(np.zeros(sum(attributes.values()), dtype=np.float32))
        vertices = self.device.context.vertex_array(program.linked, [(buffer, widths, *attributes)])
        drawable = self._drawable(Drawable(program, vertices))

        def upload(rows: NDArray[np.float32]) -> Drawable:
            if rows.size:  # a buffer cannot be empty
                self.bytes += rows.nbytes - buffer.size
                buffer.orphan(rows.nbytes)
                buffer.write(np.ascontiguousarray(rows))
            return replace(drawable, count=len(rows))

        return upload

    def fullscreen(self, program: Program) -> Drawable:
        """One triangle that covers the target, for a program with the vertex shader `fullscreen.vert`."""
        return self._drawable(Drawable(program, self.device.context.vertex_array(program.linked, []), count=3))

    def _drawable(self, drawable: Drawable) -> Drawable:
        self._resources += [one.vertices for one in (drawable, drawable.cut) if one is not None]
        return drawable

    def _allocated(self, size: int, create: Callable[[], Resource]) -> Resource:
        """A resource of `size` bytes, which the stage owns. Raises Unsupported if there is no room for it."""
        if self.bytes + size > self.room:
            raise Unsupported(
                f"takes {(self.bytes + size) / 2**30:.2g} GiB or more; a cell may take {self.room / 2**30:.3g} GiB"
            )
        resource = create()
        self._resources.append(resource)
        self.bytes += size
        return resource

    def release(self, but_memory: bool = False) -> None:
        """Release all resources of the stage, but_memory: without what it remembers."""
        self.device.free(reversed(self._resources))
        self._resources.clear()
        if not but_memory:
            self.device.free(reversed(self.memory.resources))
            self.memory.resources.clear()
            self.memory.values.clear()
            self.memory.bytes = 0
        self.bytes = self.memory.bytes


def _shader_values(
    params: SubjectParams | None, placement: Placement
) -> tuple[dict[str, str], dict[str, str], dict[str, float]]:
    """(defines, include slots, uniforms) of parameters, including those of components."""
    defines: dict[str, str] = {}
    slots: dict[str, str] = {}
    uniforms: dict[str, float] = {}

    def add(params: SubjectParams | Component, prefix: str) -> None:
        for key, info in type(params).model_fields.items():
            name, value = prefix + key, getattr(params, key)
            if isinstance(value, Component):
                slots.update({name: value.shader} if value.shader else {})
                add(value, f"{name}_")  # `bias_max`
            elif isinstance(value, bool | int):
                defines[name.upper()] = str(int(value))
            elif isinstance(value, float):
                uniforms[name] = placement.length(value) if in_metres(info) else value
            else:
                defines[f"{name}_{value}".upper().replace("-", "_")] = "1"
                slots[name] = str(value)

    if params is not None:
        add(params, "")
    return defines, slots, uniforms
