"""The G-buffer: positions, normals and triangle indices of the visible surfaces, input of every resolve pass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pyglm import glm

from shadowbench.gl.device import Device
from shadowbench.gl.geometry import CUTOUTS, TRIANGLE_DEFINES, DeviceGeometry, TriangleTextures
from shadowbench.gl.instances import INSTANCED
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, Program, Sampling, State, link
from shadowbench.gl.shaders import SHADERS, compose
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats

LOOKED_UP = {"NORMAL_AT": "0", "SMOOTH_AT": "1", "SHADING_AT": "2"}
"""Places of the outputs of `gbuffer/surface.glsl` in a pass that draws nothing else."""


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Textures of one view, size × size, row 0 at the bottom (OpenGL order).

    position: RGBA32F, local xyz, w = 1 where a surface is visible. normal: RGBA32F, geometric, towards the camera,
    w = 1 for triangles that receive shadows. triangle: R32I, index of the triangle in the textures of `by_triangle`,
    −1 for none. depth: view depth divided by that of the far plane. smooth: in place of position and normal, those of
    the smooth surface that a triangle stands for (`gbuffer/smooth.glsl`); None if all are flat. shown: of a scene of
    instances, the indices of the triangles in `by_triangle`, which are those that are visible; else None.
    """

    position: moderngl.Texture
    normal: moderngl.Texture
    triangle: moderngl.Texture
    depth: moderngl.Texture
    target: moderngl.Framebuffer
    device: Device
    by_triangle: TriangleTextures
    smooth: tuple[moderngl.Texture, moderngl.Texture] | None = None
    shown: NDArray[np.intp] | None = None

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
        """(size, size) int32 indices of triangles in the scene, −1 for none, row 0 at the top."""
        found = download(self.triangle, "i4")[..., 0].astype(np.int32)
        return found if self.shown is None else np.append(self.shown, -1)[found].astype(np.int32)

    def release(self) -> None:
        """Free the textures."""
        textures = self.position, self.normal, self.triangle, self.depth, *(self.smooth or ())
        self.device.free((self.target, *textures))
        if self.shown is not None:
            self.by_triangle.release()


def download(texture: moderngl.Texture, dtype: str = "f4") -> NDArray[np.generic]:
    """(height, width, components) array of a texture, row 0 at the top."""
    width, height = texture.size
    values = np.frombuffer(texture.read(alignment=1), dtype=dtype).reshape(height, width, texture.components)
    return values[::-1]


def view_projection(view: View) -> Floats:
    """(4, 4) float64 world-to-clip matrix of a view's camera, for column vectors."""
    camera = view.camera
    _, up, back = camera.basis()
    eye = glm.dvec3(*camera.position)  # glm rounds a tuple to float32
    world_to_camera = np.array(glm.lookAt(eye, eye - glm.dvec3(*back), glm.dvec3(*up)))
    near, far = view.near_far
    slope = float(np.tan(camera.fov_y / 2))
    projection = np.array(
        [
            [1 / slope, 0, 0, 0],
            [0, 1 / slope, 0, 0],
            [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
            [0, 0, -1, 0],
        ]
    )
    world_to_clip: Floats = projection @ world_to_camera
    return world_to_clip


class GBufferPass:
    """Draws G-buffers of any view of one geometry."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        self.device, self.geometry = device, geometry
        defines = {**TRIANGLE_DEFINES, **geometry.smooth_defines}
        self.lookup: Drawable | None = None
        if geometry.triangles is None:
            program = self._link(defines | LOOKED_UP, "fullscreen.vert", "gbuffer/lookup.frag")
            self.lookup = Drawable(program, device.context.vertex_array(program.linked, []), count=3)
            defines = defines | INSTANCED
        self.program = self._link(defines)
        if geometry.cutouts:
            self.program.cut = self._link(defines | CUTOUTS)
        self.drawable = geometry.all_faces(self.program)

    def _link(self, defines: Mapping[str, str], *files: str) -> Program:
        files = files or ("gbuffer/gbuffer.vert", "gbuffer/gbuffer.frag")
        return link(self.device, *(compose(file, SHADERS, defines) for file in files))

    def draw(self, view: View) -> GBuffer:
        """The G-buffer of a view, which is in the same coordinates as the uploaded geometry."""
        context, size = self.device.context, (view.size, view.size)
        position, normal = (context.texture(size, 4, dtype="f4") for _ in range(2))
        triangle = context.texture(size, 1, dtype="i4")
        depth = context.depth_texture(size)
        smooth = None
        if self.geometry.geometry.smooth:
            smooth = context.texture(size, 4, dtype="f4"), context.texture(size, 4, dtype="f4")
        target = context.framebuffer([position, normal, triangle, *(smooth or ())], depth)
        target.clear(depth=1.0)
        triangle.write(np.full(size, -1, dtype=np.int32).tobytes())  # moderngl's clear writes floats
        far = view.near_far[1]
        self.program.set(world_to_clip=view_projection(view), far=far)
        triangles, shown = self.geometry.triangles, None
        if triangles is not None:
            self.program.set(eye=view.camera.position)
            textures = {"normals": (triangles.normals, Sampling()), **triangles.smooth}
            self.drawable.draw(target, textures, State(depth_test="<"))
        else:
            self.drawable.draw(target, {}, State(depth_test="<"))
            triangles, shown = self._looked_up(view, position, triangle, (normal, *(smooth or ())))
        self.device.check("the G-buffer")
        return GBuffer(position, normal, triangle, depth, target, self.device, triangles, smooth, shown)

    def _looked_up(
        self, view: View, position: moderngl.Texture, triangle: moderngl.Texture, drawn: Sequence[moderngl.Texture]
    ) -> tuple[TriangleTextures, NDArray[np.intp]]:
        """Textures of the visible triangles alone, whose indices in these replace those in `triangle`; all of these.

        drawn: what depends on them, drawn now.
        """
        assert self.lookup is not None
        shown, places = np.unique(np.frombuffer(triangle.read(), dtype=np.int32), return_inverse=True)
        missed = int(shown[0] < 0)
        triangle.write((places - missed).astype(np.int32).tobytes())
        shown = shown[missed:] if missed < len(shown) else np.zeros(1, dtype=np.int32)  # a texture cannot be empty
        triangles = TriangleTextures(self.device, self.geometry.geometry.select(shown.astype(np.intp)))
        target = self.device.context.framebuffer(list(drawn))
        target.clear()
        self.lookup.program.set(eye=view.camera.position)
        textures = {"drawn_position": (position, Sampling()), "drawn_triangle": (triangle, Sampling())}
        self.lookup.draw(target, {**textures, "normals": (triangles.normals, Sampling()), **triangles.smooth})
        self.device.free((target,))
        return triangles, shown.astype(np.intp)

    def release(self) -> None:
        """Free the programs and their vertex arrays."""
        drawables = filter(None, (self.drawable, self.drawable.cut, self.lookup))
        self.device.free(part for one in drawables for part in (one.vertices, one.program.linked))
