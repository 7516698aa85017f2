"""Linked programs: uniforms by value, textures by name, and the draw itself with all the state it needs."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray
from pyglm import glm

from shadowbench.gl.device import Device
from shadowbench.gl.shaders import numbered

Comparison = Literal["", "<", "<=", ">", ">=", "=="]
Wrap = Literal["border", "edge", "repeat"]
Value = bool | int | float | tuple[float, ...] | NDArray[np.float64]

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_UNIFORM = re.compile(r"\buniform\s+(?:(?:low|medium|high)p\s+)?(\w+)\s+(\w[^;{]*);")
_PLACE = re.compile(r"\b0[:(](\d+)")  # Mesa: 0:12(5), NVIDIA: 0(12), Apple and AMD: 0:12
_STENCIL_TEST, _CLIP_DISTANCE, _FRONT, _BACK = 0x0B90, 0x3000, 0x0404, 0x0405
_STENCIL_TESTS = {"always": 0x0207, "==": 0x0202, "!=": 0x0205}
_STENCIL_OPS = {"keep": 0x1E00, "zero": 0, "replace": 0x1E01, "increment": 0x8507, "decrement": 0x8508}
_BLENDS = {"add": moderngl.FUNC_ADD, "min": moderngl.MIN, "max": moderngl.MAX}
_LOWER_LEFT, _NEGATIVE_ONE_TO_ONE, _ZERO_TO_ONE = 0x8CA1, 0x935E, 0x935F


class Texture(Protocol):
    """What a sampler reads: a texture of moderngl's, or a layered one."""

    def use(self, location: int) -> None:
        """Bind to a texture unit."""


@dataclass(frozen=True)
class Sampling:
    """How a texture is read. `border` is the value outside, with wrap "border"; `compare` a depth comparison."""

    linear: bool = False
    wrap: Wrap = "edge"
    border: float = 1.0
    compare: Comparison = ""


StencilOp = Literal["keep", "zero", "replace", "increment", "decrement"]


@dataclass(frozen=True)
class Stencil:
    """A stencil test, and what becomes of the stencil: (test fails, depth fails, both pass) of front and back faces.

    Incrementing and decrementing wrap.
    """

    test: Literal["always", "==", "!="] = "always"
    reference: int = 0
    front: tuple[StencilOp, StencilOp, StencilOp] = ("keep", "keep", "keep")
    back: tuple[StencilOp, StencilOp, StencilOp] = ("keep", "keep", "keep")


@dataclass(frozen=True)
class State:
    """Fixed-function state of one draw; everything is reset after it, so that nothing leaks into the next.

    `blend` combines with what the target holds; `clip_distances` is how many of them the vertex shader writes.
    """

    depth_test: Comparison = ""
    depth_write: bool = True
    color_write: bool = True
    cull: Literal["", "front", "back"] = ""
    polygon_offset: tuple[float, float] = (0.0, 0.0)
    depth_clamp: bool = False
    zero_to_one: bool = False
    blend: Literal["", "add", "min", "max"] = ""
    stencil: Stencil | None = None
    clip_distances: int = 0


class Program:
    """A linked program. Made by `link`."""

    def __init__(self, device: Device, program: moderngl.Program, text: str) -> None:
        self.device = device
        self.linked = program
        types = _uniforms(text)
        self._known = set(types)
        self._units: dict[str, int] = {}
        # moderngl ignores some sampler types without a word, so all of them are set here.
        device.raw("glUseProgram", program.glo)
        for name in sorted(name for name, kind in types.items() if "sampler" in kind):
            location = device.raw("glGetUniformLocation", program.glo, name.encode())
            if location >= 0:  # the compiler drops what a variant does not use
                self._units[name] = len(self._units)
                device.raw("glUniform1i", location, self._units[name])

    def set(self, **values: Value) -> None:
        """Uniforms by name: numbers, tuples as vectors, (4, 4) arrays (row-major, as written) as matrices.

        Arrays in the shader take (n, 4, 4) for matrices, (n, k) for vectors, (n,) for floats. A uniform that the
        compiler dropped is skipped; a name that the text lacks raises KeyError.
        """
        for name, value in values.items():
            if name not in self._known:
                raise KeyError(f"no uniform {name!r}; the program has {', '.join(sorted(self._known))}")
            if name not in self.linked:
                continue
            if isinstance(value, np.ndarray):
                self.linked[name].write(_bytes(value))  # type: ignore[union-attr]
            else:
                self.linked[name].value = value  # type: ignore[union-attr]

    def has(self, name: str) -> bool:
        """Whether the text declares a uniform of this name."""
        return name in self._known

    def bind(self, textures: Mapping[str, tuple[Texture, Sampling]]) -> None:
        """Bind textures to the samplers of their names; a sampler in use that is left out raises KeyError."""
        for name, unit in self._units.items():
            texture, sampling = textures[name]
            texture.use(unit)
            sampler_of(self.device, sampling).use(unit)


def _uniforms(text: str) -> dict[str, str]:
    """The type of each uniform that a text declares, whether or not the compiler keeps it."""
    types = {}
    for kind, names in _UNIFORM.findall(_COMMENT.sub("", text)):
        for name in names.split(","):
            types[re.split(r"\W", name.strip())[0]] = kind
    return types


def _bytes(value: NDArray[np.float64]) -> bytes:
    """An array as a shader holds it: float32, matrices by columns."""
    if value.shape[-2:] != (4, 4):
        return value.astype(np.float32).tobytes()
    return b"".join(glm.mat4(*rows.T.ravel().tolist()).to_bytes() for rows in value.reshape(-1, 4, 4))


def sampler_of(device: Device, sampling: Sampling) -> moderngl.Sampler:
    """The sampler object of a way of reading, made once a context."""
    if sampling not in device.samplers:
        mode = moderngl.LINEAR if sampling.linear else moderngl.NEAREST
        sampler = device.context.sampler(
            filter=(mode, mode), repeat_x=sampling.wrap == "repeat", repeat_y=sampling.wrap == "repeat"
        )
        if sampling.wrap == "border":
            sampler.border_color = (sampling.border,) * 4
        if sampling.compare:
            sampler.compare_func = sampling.compare
        device.samplers[sampling] = sampler
    return device.samplers[sampling]


class ShaderError(ValueError):
    """A shader that does not compile or link. The first line says where and why; log and text follow."""


def _first_complaint(log: str, stage: str, text: str | None) -> str:
    """The first error of a driver's log with the line of the text that it means."""
    lines = [line.strip() for line in log.splitlines()]
    complaint = next((line for line in lines if "error" in line.lower() and "failed" not in line.lower()), lines[0])
    place = _PLACE.search(complaint)
    source = (text or "").splitlines()
    if place is None or not 0 < int(place[1]) <= len(source):
        return f"{stage} shader: {complaint}"
    return f"{stage} shader: {complaint}: {source[int(place[1]) - 1].strip()!r}"


def link(device: Device, vertex: str, fragment: str, geometry: str | None = None) -> Program:
    """Compile and link whole shader texts; raises ShaderError with the log and the numbered text."""
    try:
        program = device.context.program(vertex_shader=vertex, fragment_shader=fragment, geometry_shader=geometry)
    except moderngl.Error as error:
        texts = {"vertex": vertex, "geometry": geometry, "fragment": fragment}
        guilty = [name for name in texts if f"{name}_shader" in str(error)] or list(texts)
        listing = "\n\n".join(numbered(texts[name] or "") for name in guilty)
        raise ShaderError(f"{_first_complaint(str(error), guilty[0], texts[guilty[0]])}\n{error}\n{listing}") from None
    return Program(device, program, "\n".join([vertex, geometry or "", fragment]))


Ranges = Sequence[tuple[int, int]]  # (first, count) of vertices or indices


@dataclass(frozen=True, eq=False)
class Drawable:
    """Vertices bound to a program; `draw` is the one place where anything is drawn, and counted."""

    program: Program
    vertices: moderngl.VertexArray
    mode: int = moderngl.TRIANGLES
    count: int = -1

    def draw(
        self,
        target: moderngl.Framebuffer,
        textures: Mapping[str, tuple[Texture, Sampling]] = {},
        state: State = State(),
        ranges: Ranges | None = None,
    ) -> None:
        """Draw into a target with the given textures and state; of the vertices or indices some ranges, or all."""
        device = self.program.device
        target.use()
        self.program.bind(textures)
        ranges = ((0, self.count),) if ranges is None else ranges
        with _applied(device, state):
            for first, count in ranges:
                self.vertices.render(self.mode, vertices=count, first=first)
        device.draws += len(ranges)


@contextmanager
def _applied(device: Device, state: State) -> Iterator[None]:
    context, raw = device.context, device.raw
    flags = (moderngl.DEPTH_TEST if state.depth_test else 0) | (moderngl.CULL_FACE if state.cull else 0)
    context.enable_only(flags | (moderngl.BLEND if state.blend else 0))
    context.depth_func = state.depth_test or "<"
    context.cull_face = state.cull or "back"
    context.polygon_offset = state.polygon_offset
    context.depth_clamp_range = (0.0, 1.0) if state.depth_clamp else None
    direct = [_CLIP_DISTANCE + plane for plane in range(state.clip_distances)]
    if state.blend:
        context.blend_func = (moderngl.ONE, moderngl.ONE)
        context.blend_equation = (_BLENDS[state.blend],) * 2
    if state.zero_to_one:
        raw("glClipControl", _LOWER_LEFT, _ZERO_TO_ONE)
    if state.stencil is not None:
        direct.append(_STENCIL_TEST)
        raw("glStencilFunc", _STENCIL_TESTS[state.stencil.test], state.stencil.reference, 0xFF)
        for side, operations in ((_FRONT, state.stencil.front), (_BACK, state.stencil.back)):
            raw("glStencilOpSeparate", side, *(_STENCIL_OPS[operation] for operation in operations))
    if not state.depth_write:
        raw("glDepthMask", False)
    if not state.color_write:
        raw("glColorMask", False, False, False, False)
    for flag in direct:
        context.enable_direct(flag)
    try:
        yield
    finally:
        for flag in direct:
            context.disable_direct(flag)
        context.enable_only(moderngl.NOTHING)
        context.polygon_offset = (0.0, 0.0)
        context.depth_clamp_range = None
        if not state.depth_write:
            raw("glDepthMask", True)
        if not state.color_write:
            raw("glColorMask", True, True, True, True)
        if state.zero_to_one:
            raw("glClipControl", _LOWER_LEFT, _NEGATIVE_ONE_TO_ONE)
