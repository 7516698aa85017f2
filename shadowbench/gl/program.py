"""Programs: shader texts composed from includes and defines, uniforms, textures, and draws with their render state.

`#include "bias/slope.glsl"` includes a file of the first root that has it, `#include <bias>` the file or text that the
caller assigned to this slot, `#include "bias/<bias>.glsl"` the file of the name assigned. Each file is included once,
at its first include. Followed by `with bias = bias_first`, an include renames: `bias_`, `BIAS_` and `bias(` in the file
and its includes become `bias_first_`, `BIAS_FIRST_` and `bias_first(`, and `<bias_scale>` becomes the slot
`<bias_first_scale>`.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from shadowbench.files import data_folder
from shadowbench.gl.device import Device, moderngl

Comparison = Literal["", "<", "<=", ">", ">=", "=="]
Wrap = Literal["border", "edge", "repeat"]
Value = bool | int | float | tuple[float, ...] | NDArray[np.float64]

# GL_SAMPLER_1D to …_2D_RECT_SHADOW, …_1D_ARRAY to …_CUBE_SHADOW, those of integers, and of arrays of cubes.
_SAMPLERS = {*range(0x8B5D, 0x8B65), *range(0x8DC0, 0x8DC6), *range(0x8DC9, 0x8DD9), *range(0x900C, 0x9010)}
_PLACE = re.compile(r"\b0(?::(\d+)(?:\(\d+\))?|\((\d+)\)(?: (?=:))?)")  # Mesa: 0:12(5):, NVIDIA: 0(12) :, others: 0:12:
_STENCIL_TEST, _CLIP_DISTANCE, _FRONT, _BACK = 0x0B90, 0x3000, 0x0404, 0x0405
_STENCIL_TESTS = {"always": 0x0207, "==": 0x0202, "!=": 0x0205}
_STENCIL_OPS = {"keep": 0x1E00, "zero": 0, "replace": 0x1E01, "increment": 0x8507, "decrement": 0x8508}
_BLENDS = {"add": moderngl.FUNC_ADD, "min": moderngl.MIN, "max": moderngl.MAX}
_LOWER_LEFT, _NEGATIVE_ONE_TO_ONE, _ZERO_TO_ONE = 0x8CA1, 0x935E, 0x935F


class Texture(Protocol):
    """A texture that a sampler can read: moderngl's, or a `DepthTexture`."""

    def use(self, location: int) -> None:
        """Bind to a texture unit."""


@dataclass(frozen=True)
class Sampling:
    """Sampler state. border: outside the texture; compare: by hardware; mips: the nearest level, else the first."""

    linear: bool = False
    wrap: Wrap = "edge"
    border: float | tuple[float, float, float, float] = 1.0
    compare: Comparison = ""
    mips: bool = False


Textures = Mapping[str, tuple[Texture, Sampling]]
"""Textures by the names of their samplers."""
StencilOp = Literal["keep", "zero", "replace", "increment", "decrement"]


@dataclass(frozen=True)
class Stencil:
    """Stencil test, and operations for front and back faces if (stencil fails, depth fails, both pass); counts wrap."""

    test: Literal["always", "==", "!="] = "always"
    reference: int = 0
    front: tuple[StencilOp, StencilOp, StencilOp] = ("keep", "keep", "keep")
    back: tuple[StencilOp, StencilOp, StencilOp] = ("keep", "keep", "keep")


@dataclass(frozen=True)
class State:
    """Fixed-function state of one draw, reset after it.

    polygon_offset: (factor, units); zero_to_one: clip-space depth; clip_distances: how many the shaders write.
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
    """A linked program, created by `link`. cut: the same shaders with CUTOUTS defined, if something is cut out."""

    cut: "Program | None" = None

    def __init__(self, device: Device, program: moderngl.Program, text: str) -> None:
        self.device = device
        self.linked = program
        self._text = text
        self._units: dict[str, int] = {}
        # All sampler uniforms are set here, as moderngl silently ignores some sampler types.
        device.raw("glUseProgram", program.glo)
        for name in program:
            uniform = program[name]
            if isinstance(uniform, moderngl.Uniform) and uniform.gl_type in _SAMPLERS:  # type: ignore[attr-defined]
                self._units[name] = len(self._units)
                device.raw("glUniform1i", uniform.location, self._units[name])

    def set(self, **values: Value) -> None:
        """Set uniforms by name, those of `cut` too: numbers, tuples as vectors, (4, 4) row-major arrays as matrices.

        Arrays of these set arrays. A uniform that the compiler removed is skipped. Raises KeyError for a name that the
        source does not have.
        """
        if self.cut is not None:
            self.cut.set(**values)
        for name, value in values.items():
            uniform = self.linked.get(name, None)
            if uniform is None:
                if not re.search(rf"\b{name}\b", self._text):
                    raise KeyError(f"the shaders have no uniform {name!r}")
                continue
            assert isinstance(uniform, moderngl.Uniform)
            if isinstance(value, np.ndarray):
                columns = value.swapaxes(-1, -2) if uniform.matrix else value  # type: ignore[attr-defined]
                # Compilers shorten arrays whose last elements are unused.
                size = uniform.array_length * uniform.dimension * 4
                uniform.write(columns.astype(np.float32).tobytes()[:size])
            else:
                uniform.value = value

    def has(self, name: str) -> bool:
        """Whether the shaders use a uniform of this name."""
        return name in self.linked or (self.cut is not None and self.cut.has(name))

    def bind(self, textures: Textures) -> None:
        """Bind textures to samplers by name. Raises KeyError if a sampler in use has no texture."""
        for name, unit in self._units.items():
            texture, sampling = textures[name]
            texture.use(unit)
            sampler_of(self.device, sampling).use(unit)


def sampler_of(device: Device, sampling: Sampling) -> moderngl.Sampler:
    """The sampler object of a sampler state, cached by context."""
    if sampling not in device.samplers:
        mode, repeat = moderngl.LINEAR if sampling.linear else moderngl.NEAREST, sampling.wrap == "repeat"
        smaller = moderngl.LINEAR_MIPMAP_NEAREST if sampling.mips else mode
        sampler = device.context.sampler(filter=(smaller, mode), repeat_x=repeat, repeat_y=repeat)
        if sampling.wrap == "border":
            border = sampling.border
            sampler.border_color = border if isinstance(border, tuple) else (border,) * 4
        if sampling.compare:
            sampler.compare_func = sampling.compare
        device.samplers[sampling] = sampler
    return device.samplers[sampling]


class ShaderError(ValueError):
    """A shader that does not compile or link: the driver's first error, with its place and source line."""


def _first_error(log: str, stage: str, text: str) -> str:
    logged = [line.strip() for line in log.splitlines()]
    error = next((line for line in logged if "error" in line.lower() and "failed" not in line.lower()), logged[0])
    lines, place = text.split("\n"), _PLACE.search(error)
    index = int(place[1] or place[2]) - 1 if place else -1
    if place and 0 <= index < len(lines):
        name, number = text.places[index] if isinstance(text, Composed) else ("", 0)
        where = f"{name}:{number}" if name else f"line {index + 1}"
        error = f"{error.replace(place[0], where)}: {lines[index].strip()!r}"
    return f"{stage} shader: {error}"


def link(device: Device, vertex: str, fragment: str, geometry: str | None = None) -> Program:
    """Compile and link complete shader texts. Raises ShaderError."""
    try:
        program = device.context.program(vertex_shader=vertex, fragment_shader=fragment, geometry_shader=geometry)
    except moderngl.Error as error:
        texts = {"vertex": vertex, "geometry": geometry or "", "fragment": fragment}
        failed = next((name for name in texts if f"{name}_shader" in str(error)), "vertex")
        raise ShaderError(_first_error(str(error), failed, texts[failed])) from None
    return Program(device, program, "\n".join([vertex, geometry or "", fragment]))


Ranges = Sequence[tuple[int, int]]  # (first, count) of vertices or indices


@dataclass(frozen=True, eq=False)
class Drawable:
    """A vertex array and its program. All draw calls go through `draw`, which counts them.

    textures: besides those that `draw` is given; cut: the cut-out triangles, which follow those of this one in ranges.
    """

    program: Program
    vertices: moderngl.VertexArray
    mode: int = moderngl.TRIANGLES
    count: int = -1
    textures: Textures = field(default_factory=dict)
    cut: "Drawable | None" = None

    def draw(
        self,
        target: moderngl.Framebuffer,
        textures: Mapping[str, tuple[Texture, Sampling]] = {},
        state: State = State(),
        ranges: Ranges | None = None,
    ) -> None:
        """Draw ranges of the vertices or indices, by default all, into a target with these textures and state."""
        device = self.program.device
        own, of_cut = (ranges, None) if ranges is None or self.cut is None else _divided(ranges, self.count)
        target.use()
        self.program.bind({**textures, **self.textures})
        own = ((0, self.count),) if own is None else own
        with _render_state(device, state):
            for first, count in own:
                self.vertices.render(self.mode, vertices=count, first=first)
                device.draws += 1
        if self.cut is not None:
            self.cut.draw(target, textures, state, of_cut)

    def release(self) -> None:
        """Free the programs and vertex arrays, and not the buffers."""
        self.program.device.free((self.vertices, self.program.linked))
        if self.cut is not None:
            self.cut.release()


def _divided(ranges: Ranges, at: int) -> tuple[Ranges, Ranges]:
    """The parts of ranges before an index, and those from it on, counted from there."""
    ends = [(first, first + count) for first, count in ranges]
    before = [(first, min(end, at) - first) for first, end in ends if first < at]
    return before, [(max(first, at) - at, end - max(first, at)) for first, end in ends if end > at]


@contextmanager
def _render_state(device: Device, state: State) -> Iterator[None]:
    context, raw = device.context, device.raw
    flags = (moderngl.DEPTH_TEST if state.depth_test else 0) | (moderngl.CULL_FACE if state.cull else 0)
    context.enable_only(flags | (moderngl.BLEND if state.blend else 0))
    context.depth_func = state.depth_test or "<"
    context.cull_face = state.cull or "back"
    context.polygon_offset = state.polygon_offset
    context.depth_clamp_range = (0.0, 1.0) if state.depth_clamp else None
    if state.blend:
        context.blend_func = (moderngl.ONE, moderngl.ONE)
        context.blend_equation = (_BLENDS[state.blend],) * 2
    direct = [_CLIP_DISTANCE + plane for plane in range(state.clip_distances)]
    if (stencil := state.stencil) is not None:
        raw("glStencilFunc", _STENCIL_TESTS[stencil.test], stencil.reference, 0xFF)
        for side, operations in ((_FRONT, stencil.front), (_BACK, stencil.back)):
            raw("glStencilOpSeparate", side, *(_STENCIL_OPS[operation] for operation in operations))
        direct.append(_STENCIL_TEST)
    for flag in direct:
        context.enable_direct(flag)
    calls = [  # for the draw, and to undo them
        (state.zero_to_one, "glClipControl", (_LOWER_LEFT, _ZERO_TO_ONE), (_LOWER_LEFT, _NEGATIVE_ONE_TO_ONE)),
        (not state.depth_write, "glDepthMask", (False,), (True,)),
        (not state.color_write, "glColorMask", (False,) * 4, (True,) * 4),
    ]
    changed = [(name, inside, after) for needed, name, inside, after in calls if needed]
    for name, inside, _ in changed:
        raw(name, *inside)
    try:
        yield
    finally:
        for flag in direct:
            context.disable_direct(flag)
        context.enable_only(moderngl.NOTHING)
        context.polygon_offset = (0.0, 0.0)
        context.depth_clamp_range = None
        for name, _, after in changed:
            raw(name, *after)


VERSION = "#version 410 core"
SHADERS = (data_folder("shaders"),)
"""The roots of what is drawn by no technique."""
_WITH = r"(?:[ \t]+with[ \t]+(\w+)[ \t]*=[ \t]*(\w+))?"
_SLOT = re.compile(r"<(\w+)>")
_INCLUDE = re.compile(rf'[ \t]*#include[ \t]+(?:"([^"]+)"|<([^>]+)>){_WITH}[ \t]*')


class Composed(str):
    """A composed text; places: the file and the number of each of its lines there, "" and 0 for those of no file."""

    places: Sequence[tuple[str, int]]


def compose(
    source: Path | str, roots: Sequence[Path], defines: Mapping[str, str] = {}, slots: Mapping[str, str] = {}
) -> Composed:
    """The complete source text of one shader stage.

    source, and each slot's: a file relative to a root, or the source itself if it has several lines. Of the defines,
    those that the text has words for. Raises FileNotFoundError for an include that no root has, KeyError for a slot
    without a file.
    """
    kept = tuple(roots) == SHADERS and "\n" not in str(source)  # our own files do not change, as a plug-in's may
    make = _composed if kept else _composed.__wrapped__
    return make(str(source), tuple(roots), tuple(defines.items()), tuple(slots.items()))


@cache
def _composed(
    source: str, roots: Sequence[Path], defines: Sequence[tuple[str, str]], named: Sequence[tuple[str, str]]
) -> Composed:
    slots = dict(named)
    lines: list[str] = []
    places: list[tuple[str, int]] = []
    taken: set[tuple[str, str]] = set()

    def include(name: str, old: str = "", new: str = "") -> None:
        """Append the lines of a file or text, with names that begin with `old` renamed to `new`."""
        text, label, first = _source_of(name, roots)
        if old:
            text = re.sub(rf"\b{old}(?=[_>(])", new, text)
            text = re.sub(rf"\b{old.upper()}(?=_)", new.upper(), text)
        if (label, text) in taken:
            lines.append("")
            places.append(("", 0))
            return
        taken.add((label, text))
        for number, line in enumerate(text.split("\n"), first):
            if match := _INCLUDE.fullmatch(line):
                inner = _SLOT.sub(lambda slot: slots[slot[1]], match[1]) if match[1] else slots[match[2]]
                include(inner, match[3] or old, match[4] or new)
            else:
                lines.append(line)
                places.append((label, number))

    include(source)
    used = set(re.findall(r"\w+", "\n".join(lines)))
    head = [VERSION, *(f"#define {name} {value}" for name, value in defines if name in used)]
    composed = Composed("\n".join([*head, *lines]))
    composed.places = [("", 0)] * len(head) + places
    return composed


def _source_of(name: str, roots: Sequence[Path]) -> tuple[str, str, int]:
    """A text by its file's name, or the text itself; the file, for a text a Python file beside the shaders that has it.

    Last, the number of the text's first line in the file.
    """
    if "\n" not in name:
        for root in roots:
            if (root / name).is_file():
                return (root / name).read_text(encoding="utf-8"), name, 1
        raise FileNotFoundError(f"no shader file {name!r} in {', '.join(str(root) for root in roots)}")
    for file in (file for root in roots for file in sorted(root.glob("*.py"))):
        before, separator, _ = file.read_text(encoding="utf-8").partition(name)
        if separator:
            return name, file.name, before.count("\n") + 1
    return name, "inline source", 1


def fullscreen(
    device: Device, fragment: str, defines: Mapping[str, str] = {}, vertex: str = "fullscreen.vert"
) -> Drawable:
    """A triangle that covers the target, drawn by no technique. fragment: a file."""
    program = link(device, compose(vertex, SHADERS), compose(fragment, SHADERS, defines))
    return Drawable(program, device.context.vertex_array(program.linked, []), count=3)


_SIDE = 16  # pixels


def arithmetic(device: Device) -> str:
    """Digest of the bits of a small image: equal where a driver rounds and approximates equally."""
    image = device.context.texture((_SIDE, _SIDE), 4, dtype="f4")
    target = device.context.framebuffer([image])
    triangle = fullscreen(device, "arithmetic/probe.frag", vertex="arithmetic/probe.vert")
    triangle.draw(target)
    digest = hashlib.sha256(image.read()).hexdigest()[:8]
    triangle.release()
    device.free((target, image))
    return digest
