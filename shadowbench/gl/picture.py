"""The shaded picture (Blinn-Phong): for people to look at, never scored."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.data import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer, download
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.program import Drawable, Sampling, link
from shadowbench.gl.shaders import compose
from shadowbench.scenes.model import View


def shade(
    device: Device, geometry: DeviceGeometry, surface: GBuffer, view: View, visibility: moderngl.Texture
) -> NDArray[np.float32]:
    """(N, N, 3) float32 linear colour in [0, 1], row 0 at the top: ambient + visibility · (diffuse + specular)."""
    roots = [data_folder("shaders")]
    program = link(device, compose("fullscreen.vert", roots), compose("picture/shade.frag", roots))
    xyz, w = view.light.homogeneous
    program.set(
        light=(*xyz, w),
        eye=view.camera.position,
        cone_axis=view.light.direction,
        cos_half_angle=view.light.cos_half_angle,
    )
    color = device.context.texture((view.size, view.size), 4, dtype="f4")
    target = device.context.framebuffer([color])
    triangle = Drawable(program, device.context.vertex_array(program.linked, []), count=3)
    inputs = {
        **surface.inputs,
        "surface_triangle": (surface.triangle, Sampling()),
        "colors": (geometry.colors, Sampling()),
        "visibility": (visibility, Sampling()),
    }
    triangle.draw(target, inputs)
    picture = download(color)[..., :3].astype(np.float32)
    device.free((triangle.vertices, target, color, program.linked))
    return np.clip(picture, 0.0, 1.0)
