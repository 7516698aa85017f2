"""Depth and stencil render targets of a chosen format, whose precision is verified with the driver.

moderngl supports neither these formats nor depth arrays, so depth textures are created by raw calls.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device, moderngl

DepthFormat = Literal["d16", "d24", "d32f"]
Layers = Literal["array", "cube"]
Kind = Literal["2d", Layers]

# internal format, type of the (absent) data, bits, spacing of stored values near 1
_FORMATS: dict[DepthFormat, tuple[int, int, int, float]] = {
    "d16": (0x81A5, 0x1403, 16, 2.0**-16),
    "d24": (0x81A6, 0x1405, 24, 2.0**-24),
    "d32f": (0x8CAC, 0x1406, 32, 2.0**-24),
}
_TEXTURE_2D, _FIRST_FACE = 0x0DE1, 0x8515
_BINDINGS: dict[Kind, int] = {"2d": _TEXTURE_2D, "array": 0x8C1A, "cube": 0x8513}
_PROXIES: dict[Kind, int] = {"2d": 0x8064, "array": 0x8C1B, "cube": 0x851B}
_DEPTH_COMPONENT, _DEPTH_SIZE, _TEXTURE_WIDTH, _FLOAT = 0x1902, 0x884A, 0x1000, 0x1406
_DEPTH_STENCIL, _DEPTH24_STENCIL8, _UNSIGNED_INT_24_8, _STENCIL_SIZE = 0x84F9, 0x88F0, 0x84FA, 0x88F1
_FRAMEBUFFER, _DEPTH_ATTACHMENT, _DEPTH_STENCIL_ATTACHMENT, _STENCIL_BUFFER = 0x8D40, 0x8D00, 0x821A, 0x0400
_FIRST_COLOR_ATTACHMENT = 0x8CE0
FACES = 6
Color = moderngl.Texture | moderngl.TextureArray | moderngl.TextureCube


@dataclass(frozen=True, eq=False)
class DepthTexture:
    """A square depth texture: one layer, an array of layers, or the faces +X −X +Y −Y +Z −Z of a cube."""

    device: Device
    glo: int
    kind: Kind
    size: int
    layers: int

    def use(self, location: int = 0) -> None:
        """Bind to a texture unit; same interface as moderngl's textures."""
        self.device.raw("glActiveTexture", 0x84C0 + location)
        self.device.raw("glBindTexture", _BINDINGS[self.kind], self.glo)

    def read(self) -> NDArray[np.float32]:
        """(layers, size, size) stored depths; row 0 is at the bottom (OpenGL order), for a cube's faces at the top."""
        depths = np.empty((self.layers, self.size, self.size), dtype=np.float32)
        self.use()
        for target, image in zip(_image_targets(self.kind), depths if self.kind == "cube" else [depths], strict=True):
            self.device.raw("glGetTexImage", target, 0, _DEPTH_COMPONENT, _FLOAT, image.ctypes.data_as(ctypes.c_void_p))
        return depths

    def release(self) -> None:
        """Free the texture."""
        self.device.raw("glDeleteTextures", 1, ctypes.byref(ctypes.c_uint(self.glo)))


@dataclass(frozen=True, eq=False)
class DepthTarget:
    """A depth texture and its framebuffers: `target` of all layers, `layer_targets` of each, none for a 2-D texture.

    step: spacing of stored values near 1.
    """

    texture: DepthTexture
    target: moderngl.Framebuffer
    layer_targets: tuple[moderngl.Framebuffer, ...]
    step: float

    def release(self) -> None:
        """Free the texture and its framebuffers."""
        for framebuffer in (self.target, *self.layer_targets):
            framebuffer.release()
        self.texture.release()


def _image_targets(kind: Kind) -> Sequence[int]:
    """What OpenGL addresses the images of a texture by."""
    return range(_FIRST_FACE, _FIRST_FACE + FACES) if kind == "cube" else [_BINDINGS[kind]]


def framebuffer_of(depth: DepthTexture, colors: Sequence[Color] = (), layer: int | None = None) -> moderngl.Framebuffer:
    """A framebuffer of a depth texture, or of one of its layers, and of colour textures of its kind and size."""
    device, side = depth.device, depth.size
    # moderngl creates no framebuffer without an attachment or with attachments of different sizes, and clears no depth
    # if a framebuffer was created without a depth attachment.
    placeholder = device.context.depth_renderbuffer((side, side) if colors else (1, 1))
    framebuffer = _with_colors(device, colors, depth.kind, [layer] * len(colors), placeholder)
    placeholder.release()
    framebuffer.viewport = (0, 0, side, side)
    _attach(device, framebuffer, _DEPTH_ATTACHMENT, depth.glo, depth.kind, layer)
    return framebuffer


def color_framebuffer(device: Device, colors: Sequence[Color], layers: Sequence[int]) -> moderngl.Framebuffer:
    """A framebuffer of one layer of each of some colour textures of a kind, which may be the same texture."""
    kinds: dict[type, Kind] = {moderngl.TextureArray: "array", moderngl.TextureCube: "cube"}
    return _with_colors(device, colors, kinds.get(type(colors[0]), "2d"), layers)


def _with_colors(
    device: Device,
    colors: Sequence[Color],
    kind: Kind,
    layers: Sequence[int | None],
    depth: moderngl.Renderbuffer | None = None,
) -> moderngl.Framebuffer:
    """A framebuffer of colour textures; moderngl attaches neither cubes nor single layers itself."""
    placeholders = [device.context.renderbuffer(one.size[:2], one.components, dtype=one.dtype) for one in colors]
    framebuffer = device.context.framebuffer(placeholders, depth)
    for number, (color, placeholder, layer) in enumerate(zip(colors, placeholders, layers, strict=True)):
        _attach(device, framebuffer, _FIRST_COLOR_ATTACHMENT + number, color.glo, kind, layer)
        placeholder.release()
    return framebuffer


def _attach(
    device: Device, framebuffer: moderngl.Framebuffer, attachment: int, glo: int, kind: Kind, layer: int | None
) -> None:
    """Attach a texture, layered if it has several layers, or one of its layers, to a framebuffer."""
    framebuffer.use()
    device.raw("glBindFramebuffer", _FRAMEBUFFER, framebuffer.glo)
    if layer is None or kind == "2d":
        device.raw("glFramebufferTexture", _FRAMEBUFFER, attachment, glo, 0)
    elif kind == "cube":  # glFramebufferTextureLayer takes no cube maps in OpenGL 4.1
        device.raw("glFramebufferTexture2D", _FRAMEBUFFER, attachment, _FIRST_FACE + layer, glo, 0)
    else:
        device.raw("glFramebufferTextureLayer", _FRAMEBUFFER, attachment, glo, 0, layer)


def depth_target(device: Device, size: int, depth: DepthFormat, kind: Kind = "2d", layers: int = 1) -> DepthTarget:
    """A depth target of size × size layers, six for a cube. Raises RuntimeError if the driver's precision differs."""
    _, _, bits, step = _FORMATS[depth]
    layers = FACES if kind == "cube" else layers
    name = ctypes.c_uint()
    device.raw("glGenTextures", 1, ctypes.byref(name))
    texture = DepthTexture(device, name.value, kind, size, layers)
    texture.use()
    for image_target in _image_targets(kind):
        _specify(device, image_target, kind, size, layers, depth)
    what = f"a {depth} target of {size}²" if kind == "2d" else f"{layers} layers of {size}² in {depth}"
    _check(device, _image_targets(kind)[0], _DEPTH_SIZE, bits, what)
    whole = framebuffer_of(texture)
    layer_targets = tuple(framebuffer_of(texture, layer=layer) for layer in range(0 if kind == "2d" else layers))
    device.check(what)
    return DepthTarget(texture, whole, layer_targets, step)


def map_bytes(size: int, depth: DepthFormat, kind: Kind = "2d", layers: int = 1) -> int:
    """Device memory of a `depth_target`."""
    _, _, bits, _ = _FORMATS[depth]
    return (FACES if kind == "cube" else layers) * size * size * (bits // 8)


def unsupported_map(device: Device, size: int, depth: DepthFormat, kind: Kind = "2d", layers: int = 1) -> str | None:
    """Why the driver does not support such a map; None if it does. Uses proxy textures, which allocate nothing."""
    _specify(device, _PROXIES[kind], kind, size, layers, depth)
    width = device.raw.integer("glGetTexLevelParameteriv", _PROXIES[kind], 0, _TEXTURE_WIDTH)
    what = {"2d": "a map", "array": f"{layers} maps", "cube": "a cube"}[kind]
    return None if width == size else f"the driver refuses {what} of {size}² texels in {depth}"


def _specify(device: Device, target: int, kind: Kind, size: int, layers: int, depth: DepthFormat) -> None:
    """Specify an uninitialised image of the bound texture, or of a proxy."""
    internal, data, _, _ = _FORMATS[depth]
    call, sides = ("glTexImage3D", (size, size, layers)) if kind == "array" else ("glTexImage2D", (size, size))
    device.raw(call, target, 0, internal, *sides, 0, _DEPTH_COMPONENT, data, None)


@dataclass(frozen=True, eq=False)
class StencilTarget:
    """A framebuffer of colour textures with a depth-stencil buffer. `bits`: of the stencil."""

    bits: ClassVar[int] = 8
    device: Device
    depth: moderngl.Texture
    target: moderngl.Framebuffer

    def clear_stencil(self) -> None:
        """Clear the stencil, which moderngl's clear leaves unchanged."""
        self.target.use()
        self.device.raw("glClear", _STENCIL_BUFFER)

    def release(self) -> None:
        """Free the framebuffer and its depth buffer, but not the colour textures."""
        self.target.release()
        self.depth.release()


def stencil_target(device: Device, size: tuple[int, int], *colors: moderngl.Texture) -> StencilTarget:
    """A target with 24 bits of depth and 8 of stencil. Raises RuntimeError if the driver's precision differs."""
    depth, raw, (width, height) = device.context.depth_texture(size), device.raw, size
    raw("glBindTexture", _TEXTURE_2D, depth.glo)
    texels = (_DEPTH_STENCIL, _UNSIGNED_INT_24_8, None)
    raw("glTexImage2D", _TEXTURE_2D, 0, _DEPTH24_STENCIL8, width, height, 0, *texels)
    for query, bits in ((_DEPTH_SIZE, 24), (_STENCIL_SIZE, StencilTarget.bits)):
        _check(device, _TEXTURE_2D, query, bits, f"depth and stencil of {width}×{height}")
    target = device.context.framebuffer(list(colors), depth)
    _attach(device, target, _DEPTH_STENCIL_ATTACHMENT, depth.glo, "2d", None)
    device.check("a stencil attachment")
    return StencilTarget(device, depth, target)


def _check(device: Device, target: int, query: int, bits: int, name: str) -> None:
    given = device.raw.integer("glGetTexLevelParameteriv", target, 0, query)
    device.check(name)
    if given != bits:
        raise RuntimeError(f"asked the driver for {bits} bits in {name}, got {given}")
