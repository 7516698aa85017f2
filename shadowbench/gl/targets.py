"""Depth targets of a chosen format, checked with the driver."""

import ctypes
from dataclasses import dataclass
from typing import Literal

import moderngl

from shadowbench.gl.device import Device

DepthFormat = Literal["d16", "d24", "d32f"]

# internal format, type of the (absent) data, bits, step of stored values near 1
_FORMATS: dict[DepthFormat, tuple[int, int, int, float]] = {
    "d16": (0x81A5, 0x1403, 16, 2.0**-16),
    "d24": (0x81A6, 0x1405, 24, 2.0**-24),
    "d32f": (0x8CAC, 0x1406, 32, 2.0**-24),
}
_TEXTURE_2D, _DEPTH_COMPONENT, _DEPTH_SIZE = 0x0DE1, 0x1902, 0x884A


@dataclass(frozen=True, eq=False)
class DepthTarget:
    """A square depth texture that can be drawn into and read; `step` is the spacing of its values near 1."""

    texture: moderngl.Texture
    target: moderngl.Framebuffer
    step: float
    bytes: int

    def release(self) -> None:
        """Free the texture."""
        self.target.release()
        self.texture.release()


def depth_target(device: Device, size: int, depth: DepthFormat) -> DepthTarget:
    """A size × size target; raises RuntimeError when the driver gives another precision than asked for."""
    internal, kind, bits, step = _FORMATS[depth]
    texture = device.context.depth_texture((size, size))
    raw = device.raw
    raw("glBindTexture", _TEXTURE_2D, texture.glo)
    raw("glTexImage2D", _TEXTURE_2D, 0, internal, size, size, 0, _DEPTH_COMPONENT, kind, None)
    given = ctypes.c_int()
    raw("glGetTexLevelParameteriv", _TEXTURE_2D, 0, _DEPTH_SIZE, ctypes.byref(given))
    device.check(f"a {depth} target of {size}²")
    if given.value != bits:
        raise RuntimeError(f"asked the driver for a {bits}-bit depth map, got {given.value} bits")
    texture.compare_func = ""
    return DepthTarget(texture, device.context.framebuffer(depth_attachment=texture), step, size * size * (bits // 8))
