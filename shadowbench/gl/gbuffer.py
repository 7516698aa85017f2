"""The G-buffer: positions, normals and triangle indices of the visible surfaces, input of every resolve pass."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pyglm import glm

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.geometry import CUTOUTS, SMOOTH, TRIANGLE_DEFINES, DeviceGeometry
from shadowbench.gl.program import SHADERS, Drawable, Program, Sampling, State, compose, link
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Textures of one view, size × size, row 0 at the bottom (OpenGL order).

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
        """(size, size) int32 indices of triangles in the scene, −1 for none, row 0 at the top."""
        return download(self.triangle, "i4")[..., 0].astype(np.int32)

    def release(self) -> None:
        """Free the textures."""
        textures = self.position, self.normal, self.triangle, self.depth, *(self.smooth or ())
        self.device.free((self.target, *textures))


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
        self.program = self._link(defines)
        if geometry.cutouts:
            self.program.cut = self._link(defines | CUTOUTS)
        self.drawable = geometry.all_faces(self.program)

    def _link(self, defines: Mapping[str, str]) -> Program:
        return link(self.device, *(compose(f"gbuffer/gbuffer.{stage}", SHADERS, defines) for stage in ("vert", "frag")))

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
        self.program.set(world_to_clip=view_projection(view), far=far, eye=view.camera.position)
        textures = {"normals": (self.geometry.normals, Sampling()), **self.geometry.smooth}
        self.drawable.draw(target, textures, State(depth_test="<"))
        self.device.check("the G-buffer")
        return GBuffer(position, normal, triangle, depth, target, self.device, smooth)

    def release(self) -> None:
        """Free the programs and their vertex arrays."""
        drawables = filter(None, (self.drawable, self.drawable.cut))
        self.device.free(part for one in drawables for part in (one.vertices, one.program.linked))


class FacetPass:
    """Darkens masks of scenes with smooth surfaces: see `facets.frag`."""

    def __init__(self, device: Device) -> None:
        self._device = device
        program = link(device, compose("fullscreen.vert", SHADERS), compose("facets.frag", SHADERS, SMOOTH))
        self._drawable = Drawable(program, device.context.vertex_array(program.linked, []), count=3)

    def draw(self, visibility: moderngl.Texture, surface: GBuffer, view: View) -> None:
        """Write 0 into a mask, where it is to be."""
        target = self._device.context.framebuffer([visibility])
        xyz, w = view.light.homogeneous
        self._drawable.program.set(light=(*xyz, w))
        self._drawable.draw(target, surface.inputs)
        self._device.free((target,))

    def release(self) -> None:
        """Free the program."""
        self._device.free((self._drawable.vertices, self._drawable.program.linked))
