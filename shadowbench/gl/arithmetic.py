"""How a driver calculates: software renderers compile for the processor that they find, and do not name it."""

import hashlib

from shadowbench.gl.device import Device
from shadowbench.gl.program import Drawable, State, link
from shadowbench.gl.shaders import SHADERS, compose

_SIDE = 16  # pixels


def arithmetic(device: Device) -> str:
    """Digest of the bits of a small image: equal where a driver rounds and approximates equally."""
    vertex, fragment = (compose(f"arithmetic/probe.{stage}", SHADERS) for stage in ("vert", "frag"))
    program = link(device, vertex, fragment)
    image = device.context.texture((_SIDE, _SIDE), 4, dtype="f4")
    target = device.context.framebuffer([image])
    vertices = device.context.vertex_array(program.linked, [])
    Drawable(program, vertices, count=3).draw(target, {}, State())
    digest = hashlib.sha256(image.read()).hexdigest()[:8]
    device.free((vertices, target, image, program.linked))
    return digest
