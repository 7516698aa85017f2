"""Short GLSL programs, and targets to draw them into."""

from collections.abc import Callable, Iterator

import moderngl
import numpy as np
import pytest

from shadowbench.files import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.program import VERSION, Drawable, Program, State, compose, link

FULLSCREEN = "fullscreen.vert"
NEARER = State(depth_test="<=")
AT_DEPTH = """
uniform float depth;
void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, depth * 2.0 - 1.0, 1.0);
}
"""


@pytest.fixture
def program(device: Device) -> Iterator[Callable[..., Program]]:
    """A program of a fragment shader's text, over the whole target unless a vertex shader is given."""
    programs: list[Program] = []

    def make(fragment: str, vertex: str | None = None) -> Program:
        vertex = compose(FULLSCREEN, [data_folder("shaders")]) if vertex is None else f"{VERSION}\n{vertex}"
        programs.append(link(device, vertex, f"{VERSION}\n{fragment}"))
        return programs[-1]

    yield make
    device.free(one.linked for one in programs)


@pytest.fixture
def paint(device: Device) -> Callable[..., np.ndarray]:
    """Output of a program in a float image with one component, row 0 at the bottom; 0 where nothing is drawn."""

    def draw(program: Program, textures=None, side: int = 4, mode: int = moderngl.TRIANGLES, count: int = 3):
        image = device.context.texture((side, side), 1, dtype="f4")
        target = device.context.framebuffer([image])
        target.clear()
        vertices = device.context.vertex_array(program.linked, [])
        Drawable(program, vertices, mode, count).draw(target, textures or {}, State())
        values = np.frombuffer(image.read(), dtype=np.float32).reshape(side, side)
        device.free((vertices, target, image))
        return values

    return draw


@pytest.fixture
def at_depth(device: Device, program) -> Callable[..., None]:
    """Draws a constant depth over a whole target."""
    flat = program("void main() {}", AT_DEPTH)
    vertices = device.context.vertex_array(flat.linked, [])

    def draw(target: moderngl.Framebuffer, depth: float, state: State = NEARER) -> None:
        flat.set(depth=depth)
        Drawable(flat, vertices, count=3).draw(target, state=state)

    return draw
