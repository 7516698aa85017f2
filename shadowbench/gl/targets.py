"""Targets to draw depth and stencil into, of a chosen format that is checked with the driver.

moderngl knows neither the formats nor depth arrays, so textures of its own are respecified, and layered ones made raw.
"""

import ctypes
from dataclasses import dataclass
from typing import ClassVar, Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device

DepthFormat = Literal["d16", "d24", "d32f"]
Layers = Literal["array", "cube"]

# internal format, type of the (absent) data, bits, step of stored values near 1
_FORMATS: dict[DepthFormat, tuple[int, int, int, float]] = {
    "d16": (0x81A5, 0x1403, 16, 2.0**-16),
    "d24": (0x81A6, 0x1405, 24, 2.0**-24),
    "d32f": (0x8CAC, 0x1406, 32, 2.0**-24),
}
_TEXTURE_2D, _TEXTURE_2D_ARRAY, _TEXTURE_CUBE_MAP, _FIRST_FACE = 0x0DE1, 0x8C1A, 0x8513, 0x8515
_DEPTH_COMPONENT, _DEPTH_SIZE, _FLOAT = 0x1902, 0x884A, 0x1406
_DEPTH_STENCIL, _DEPTH24_STENCIL8, _UNSIGNED_INT_24_8, _STENCIL_SIZE = 0x84F9, 0x88F0, 0x84FA, 0x88F1
_PROXIES = {_TEXTURE_2D: 0x8064, _TEXTURE_2D_ARRAY: 0x8C1B, _TEXTURE_CUBE_MAP: 0x851B}
_TEXTURE_WIDTH = 0x1000
_FRAMEBUFFER, _DEPTH_ATTACHMENT, _DEPTH_STENCIL_ATTACHMENT, _STENCIL_BUFFER = 0x8D40, 0x8D00, 0x821A, 0x0400
FACES = 6


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
    _check(device, _TEXTURE_2D, _DEPTH_SIZE, bits, f"a {depth} target of {size}²")
    texture.compare_func = ""
    return DepthTarget(texture, device.context.framebuffer(depth_attachment=texture), step, size * size * (bits // 8))


def refused(
    device: Device, size: int, depth: DepthFormat, kind: Literal["2d", Layers] = "2d", layers: int = 1
) -> str | None:
    """Why the driver would refuse such a map, in words, or None. Asked of proxy textures: nothing is allocated."""
    internal, data, _, _ = _FORMATS[depth]
    binding = {"2d": _TEXTURE_2D, "array": _TEXTURE_2D_ARRAY, "cube": _TEXTURE_CUBE_MAP}[kind]
    proxy, width = _PROXIES[binding], ctypes.c_int()
    if kind == "array":
        device.raw("glTexImage3D", proxy, 0, internal, size, size, layers, 0, _DEPTH_COMPONENT, data, None)
    else:
        device.raw("glTexImage2D", proxy, 0, internal, size, size, 0, _DEPTH_COMPONENT, data, None)
    device.raw("glGetTexLevelParameteriv", proxy, 0, _TEXTURE_WIDTH, ctypes.byref(width))
    what = {"2d": "a map", "array": f"{layers} maps", "cube": "a cube"}[kind]
    return None if width.value == size else f"the driver refuses {what} of {size}² texels in {depth}"


@dataclass(frozen=True, eq=False)
class LayeredTexture:
    """A depth texture of several layers: an array, or the faces +X −X +Y −Y +Z −Z of a cube."""

    device: Device
    glo: int
    kind: Layers
    size: int
    layers: int

    @property
    def _binding(self) -> int:
        return _TEXTURE_CUBE_MAP if self.kind == "cube" else _TEXTURE_2D_ARRAY

    def use(self, location: int = 0) -> None:
        """Bind to a texture unit, as moderngl's textures do."""
        self.device.raw("glActiveTexture", 0x84C0 + location)
        self.device.raw("glBindTexture", self._binding, self.glo)

    def read(self) -> NDArray[np.float32]:
        """(layers, size, size) stored depths, row 0 of each at the bottom as OpenGL has it."""
        depths = np.empty((self.layers, self.size, self.size), dtype=np.float32)
        self.use()
        parts = list(enumerate(depths)) if self.kind == "cube" else [(0, depths)]
        for face, part in parts:
            place = _FIRST_FACE + face if self.kind == "cube" else _TEXTURE_2D_ARRAY
            self.device.raw("glGetTexImage", place, 0, _DEPTH_COMPONENT, _FLOAT, part.ctypes.data)
        return depths

    def release(self) -> None:
        """Free the texture."""
        self.device.raw("glDeleteTextures", 1, ctypes.byref(ctypes.c_uint(self.glo)))


@dataclass(frozen=True, eq=False)
class LayeredTarget:
    """A layered depth texture to draw into.

    `target` has all layers, `gl_Layer` choosing one, and clears all; `each` has one layer apiece. `step` is the spacing
    of stored values near 1.
    """

    texture: LayeredTexture
    target: moderngl.Framebuffer
    each: tuple[moderngl.Framebuffer, ...]
    step: float
    bytes: int

    def release(self) -> None:
        """Free the texture."""
        for framebuffer in (self.target, *self.each):
            framebuffer.release()
        self.texture.release()


def layered_target(device: Device, size: int, depth: DepthFormat, kind: Layers, layers: int = FACES) -> LayeredTarget:
    """Layers of size × size; raises RuntimeError when the driver gives another precision than asked for."""
    internal, data, bits, step = _FORMATS[depth]
    raw, name = device.raw, ctypes.c_uint()
    raw("glGenTextures", 1, ctypes.byref(name))
    texture = LayeredTexture(device, name.value, kind, size, layers)
    texture.use()
    if kind == "cube":
        for face in range(layers):
            image = (0, internal, size, size, 0, _DEPTH_COMPONENT, data, None)
            raw("glTexImage2D", _FIRST_FACE + face, *image)
    else:
        raw("glTexImage3D", _TEXTURE_2D_ARRAY, 0, internal, size, size, layers, 0, _DEPTH_COMPONENT, data, None)
    place = _FIRST_FACE if kind == "cube" else _TEXTURE_2D_ARRAY
    _check(device, place, _DEPTH_SIZE, bits, f"{layers} layers of {size}² in {depth}")
    whole = _framebuffer(device, size)
    raw("glFramebufferTexture", _FRAMEBUFFER, _DEPTH_ATTACHMENT, texture.glo, 0)
    each = []
    for layer in range(layers):
        each.append(_framebuffer(device, size))
        if kind == "cube":  # OpenGL 4.1 has no other way to name a face
            raw("glFramebufferTexture2D", _FRAMEBUFFER, _DEPTH_ATTACHMENT, _FIRST_FACE + layer, texture.glo, 0)
        else:
            raw("glFramebufferTextureLayer", _FRAMEBUFFER, _DEPTH_ATTACHMENT, texture.glo, 0, layer)
    device.check(f"{layers} layers of {size}² in {depth}")
    return LayeredTarget(texture, whole, tuple(each), step, layers * size * size * (bits // 8))


def _framebuffer(device: Device, size: int) -> moderngl.Framebuffer:
    """A bound depth framebuffer whose attachment is about to be replaced: moderngl needs one to know the size."""
    placeholder = device.context.depth_renderbuffer((size, size))
    framebuffer = device.context.framebuffer(depth_attachment=placeholder)
    placeholder.release()
    framebuffer.use()
    device.raw("glBindFramebuffer", _FRAMEBUFFER, framebuffer.glo)
    return framebuffer


@dataclass(frozen=True, eq=False)
class StencilTarget:
    """Colour textures with a depth and a stencil buffer of their own, which wraps at 2 to the power of `bits`."""

    bits: ClassVar[int] = 8
    device: Device
    depth: moderngl.Texture
    target: moderngl.Framebuffer
    bytes: int

    def clear_stencil(self, value: int = 0) -> None:
        """Set the stencil everywhere; clearing the framebuffer does not touch it."""
        self.target.use()
        self.device.raw("glClearStencil", value)
        self.device.raw("glClear", _STENCIL_BUFFER)

    def release(self) -> None:
        """Free the framebuffer and its depth; the colour textures are their maker's."""
        self.target.release()
        self.depth.release()


def stencil_target(device: Device, size: tuple[int, int], *colors: moderngl.Texture) -> StencilTarget:
    """24 bits of depth and 8 of stencil; raises RuntimeError when the driver gives others."""
    depth, raw = device.context.depth_texture(size), device.raw
    raw("glBindTexture", _TEXTURE_2D, depth.glo)
    width, height = size
    image = (_TEXTURE_2D, 0, _DEPTH24_STENCIL8, width, height, 0, _DEPTH_STENCIL, _UNSIGNED_INT_24_8, None)
    raw("glTexImage2D", *image)
    for what, bits in ((_DEPTH_SIZE, 24), (_STENCIL_SIZE, StencilTarget.bits)):
        _check(device, _TEXTURE_2D, what, bits, f"depth and stencil of {width}×{height}")
    target = device.context.framebuffer(list(colors), depth)
    target.use()
    raw("glFramebufferTexture2D", _FRAMEBUFFER, _DEPTH_STENCIL_ATTACHMENT, _TEXTURE_2D, depth.glo, 0)
    device.check("a stencil attachment")
    return StencilTarget(device, depth, target, width * height * 4)


def _check(device: Device, place: int, what: int, bits: int, name: str) -> None:
    given = ctypes.c_int()
    device.raw("glGetTexLevelParameteriv", place, 0, what, ctypes.byref(given))
    device.check(name)
    if given.value != bits:
        raise RuntimeError(f"asked the driver for {bits} bits in {name}, got {given.value}")
