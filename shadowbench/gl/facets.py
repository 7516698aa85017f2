"""What triangles hide from the light although the smooth surface that they stand for faces it."""

from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer
from shadowbench.gl.geometry import SMOOTH
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, link
from shadowbench.gl.shaders import SHADERS, compose
from shadowbench.scenes.model import View


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
