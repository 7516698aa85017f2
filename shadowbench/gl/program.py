"""Linked programs: uniforms by value, textures by name, and the draw itself with all the state it needs."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray
from pyglm import glm

from shadowbench.gl.device import Device
from shadowbench.gl.shaders import numbered

Value = bool | int | float | tuple[float, ...] | NDArray[np.float64]

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_UNIFORM = re.compile(r"\buniform\s+(?:(?:low|medium|high)p\s+)?(\w+)\s+(\w[^;{]*);")
_PLACE = re.compile(r"\b0[:(](\d+)")  # Mesa: 0:12(5), NVIDIA: 0(12), Apple and AMD: 0:12
_LOWER_LEFT, _NEGATIVE_ONE_TO_ONE, _ZERO_TO_ONE = 0x8CA1, 0x935E, 0x935F


@dataclass(frozen=True)
class Sampling:
    """How a texture is read. `border` is the value outside, with wrap "border"; `compare` a depth comparison."""

    linear: bool = False
    wrap: Literal["edge", "repeat", "border"] = "edge"
    border: float = 1.0
    compare: Literal["", "<=", ">="] = ""


@dataclass(frozen=True)
class State:
    """Fixed-function state of one draw; everything is reset after it, so that nothing leaks into the next."""

    depth_test: Literal["", "<", "<=", ">", ">="] = ""
    cull: Literal["", "front", "back"] = ""
    polygon_offset: tuple[float, float] = (0.0, 0.0)
    depth_clamp: bool = False
    zero_to_one: bool = False


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

        A uniform that the compiler dropped is skipped; a name that the text lacks raises KeyError.
        """
        for name, value in values.items():
            if name not in self._known:
                raise KeyError(f"no uniform {name!r}; the program has {', '.join(sorted(self._known))}")
            if name not in self.linked:
                continue
            if isinstance(value, np.ndarray):
                self.linked[name].write(_matrix(value).to_bytes())  # type: ignore[union-attr]
            else:
                self.linked[name].value = value  # type: ignore[union-attr]

    def has(self, name: str) -> bool:
        """Whether the text declares a uniform of this name."""
        return name in self._known

    def bind(self, textures: Mapping[str, tuple[moderngl.Texture, Sampling]]) -> None:
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


def _matrix(rows: NDArray[np.float64]) -> glm.mat4:
    return glm.mat4(*rows.T.ravel().tolist())


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
        textures: Mapping[str, tuple[moderngl.Texture, Sampling]] = {},
        state: State = State(),
    ) -> None:
        """Draw into a target with the given textures and state."""
        device = self.program.device
        target.use()
        self.program.bind(textures)
        with _applied(device, state):
            self.vertices.render(self.mode, vertices=self.count)
        device.draws += 1


@contextmanager
def _applied(device: Device, state: State) -> Iterator[None]:
    context = device.context
    flags = (moderngl.DEPTH_TEST if state.depth_test else 0) | (moderngl.CULL_FACE if state.cull else 0)
    context.enable_only(flags)
    context.depth_func = state.depth_test or "<"
    context.cull_face = state.cull or "back"
    context.polygon_offset = state.polygon_offset
    context.depth_clamp_range = (0.0, 1.0) if state.depth_clamp else None
    if state.zero_to_one:
        device.raw("glClipControl", _LOWER_LEFT, _ZERO_TO_ONE)
    try:
        yield
    finally:
        context.enable_only(moderngl.NOTHING)
        context.polygon_offset = (0.0, 0.0)
        context.depth_clamp_range = None
        if state.zero_to_one:
            device.raw("glClipControl", _LOWER_LEFT, _NEGATIVE_ONE_TO_ONE)
