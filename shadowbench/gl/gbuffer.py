"""The G-buffer: what the camera sees, as every technique's resolve pass reads it."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.data import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.geometry import TRIANGLE_DEFINES, DeviceGeometry
from shadowbench.gl.matrices import view_projection
from shadowbench.gl.program import Program, Sampling, State, link
from shadowbench.gl.shaders import compose
from shadowbench.scenes.model import View


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Textures of one view, size × size, row 0 at the bottom as OpenGL has it.

    position: RGBA32F, local xyz, w = 1 where something was hit. normal: RGBA32F, geometric and turned to the camera,
    w = 1 on triangles that receive. triangle: R32I, −1 for a miss. depth: view depth divided by the far plane.
    """

    position: moderngl.Texture
    normal: moderngl.Texture
    triangle: moderngl.Texture
    depth: moderngl.Texture
    target: moderngl.Framebuffer
    device: Device

    @property
    def inputs(self) -> dict[str, tuple[moderngl.Texture, Sampling]]:
        """What `receiver.glsl` reads."""
        return {"surface_position": (self.position, Sampling()), "surface_normal": (self.normal, Sampling())}

    def triangles(self) -> NDArray[np.int32]:
        """(size, size) int32, row 0 at the top."""
        return download(self.triangle, "i4")[..., 0].astype(np.int32)

    def release(self) -> None:
        """Free the textures."""
        self.device.free((self.target, self.position, self.normal, self.triangle, self.depth))


def download(texture: moderngl.Texture, dtype: str = "f4") -> NDArray[np.generic]:
    """(height, width, components) of a texture, row 0 at the top."""
    width, height = texture.size
    values = np.frombuffer(texture.read(alignment=1), dtype=dtype).reshape(height, width, texture.components)
    return values[::-1]


class GBufferPass:
    """Draws the G-buffer of any view of one geometry."""

    def __init__(self, device: Device, geometry: DeviceGeometry) -> None:
        roots = [data_folder("shaders")]
        self.device = device
        self.geometry = geometry
        self.program: Program = link(
            device, compose("gbuffer/gbuffer.vert", roots), compose("gbuffer/gbuffer.frag", roots, TRIANGLE_DEFINES)
        )
        self.drawable = geometry.all_faces(self.program)

    def draw(self, view: View) -> GBuffer:
        """The G-buffer of a view; `view` is in the coordinates of the uploaded geometry."""
        context, size = self.device.context, (view.size, view.size)
        position, normal = (context.texture(size, 4, dtype="f4") for _ in range(2))
        triangle = context.texture(size, 1, dtype="i4")
        depth = context.depth_texture(size)
        target = context.framebuffer([position, normal, triangle], depth)
        target.clear(depth=1.0)
        triangle.write(np.full(size, -1, dtype=np.int32).tobytes())  # a clear would write floats
        far = view.near_far[1]
        self.program.set(world_to_clip=view_projection(view), eye=view.camera.position, far=far)
        self.drawable.draw(target, {"normals": (self.geometry.normals, Sampling())}, State(depth_test="<"))
        self.device.check("the G-buffer")
        return GBuffer(position, normal, triangle, depth, target, self.device)

    def release(self) -> None:
        """Free the program."""
        self.device.free((self.drawable.vertices, self.program.linked))
