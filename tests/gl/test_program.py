"""Uniforms, samplers and fixed-function state of programs."""

import ctypes
import re
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from shadowbench.gl.device import Device, RawGL
from shadowbench.gl.program import Drawable, Program, Sampling, ShaderError, State, Stencil, _explained, link
from shadowbench.gl.shaders import VERSION

POLYGON_OFFSET_FACTOR, POLYGON_OFFSET_UNITS, POLYGON_OFFSET_FILL = 0x8038, 0x2A00, 0x8037
CULL_FACE, DEPTH_TEST, DEPTH_CLAMP, CLIP_DEPTH_MODE, NEGATIVE_ONE_TO_ONE = 0x0B44, 0x0B71, 0x864F, 0x935D, 0x935E
BLEND, STENCIL_TEST, CLIP_DISTANCE0, DEPTH_WRITEMASK = 0x0BE2, 0x0B90, 0x3000, 0x0B72

TWO = "uniform float used; uniform float dropped; out float value; void main() { value = used; }"
POINT = "uniform mat4 place; void main() { gl_Position = place * vec4(0.0, 0.0, 0.0, 1.0); }"
WHITE = "out float value; void main() { value = 1.0; }"


def test_a_misspelt_uniform_is_an_error_that_names_what_there_is(program) -> None:
    with pytest.raises(KeyError, match="no uniform 'usd'; the program has dropped, used"):
        program(TWO).set(usd=1.0)


def test_a_uniform_that_the_compiler_dropped_is_skipped(program, paint) -> None:
    two = program(TWO)
    two.set(dropped=1.0, used=0.5)
    assert (paint(two) == 0.5).all()
    assert two.has("dropped") and not two.has("usd")


def test_uniforms_are_found_however_they_are_declared(program, paint) -> None:
    styles = program(
        "/* uniform float old; */ uniform float a, b; // uniform float gone;\n"
        "uniform highp float c; uniform vec2 list[3];\n uniform\n float d;"
        "out float value; void main() { value = a + b + c + d + list[1].y; }"
    )
    styles.set(a=1.0, b=2.0, c=3.0, d=4.0)
    assert (paint(styles) == 10).all()
    assert styles.has("list") and not styles.has("old") and not styles.has("gone")


def test_samplers_whose_type_is_a_macro_have_units_of_their_own(program, paint, device) -> None:
    dim, bright = (device.context.texture((1, 1), 1, np.float32(value).tobytes(), dtype="f4") for value in (0.25, 0.5))
    both = program(
        "#define IMAGE sampler2D\nuniform IMAGE one; uniform IMAGE two; out float value;"
        "void main() { value = texture(one, vec2(0.5)).r + 2.0 * texture(two, vec2(0.5)).r; }"
    )
    textures = {"one": (dim, Sampling()), "two": (bright, Sampling())}
    assert (paint(both, textures) == 1.25).all()


def test_uniforms_of_all_kinds_of_value(program, paint) -> None:
    kinds = program(
        "uniform float f; uniform int i; uniform vec3 v; uniform vec4 w; out float value;"
        "void main() { value = f + float(i) + v.x + 10.0 * v.y + 100.0 * v.z + w.w; }"
    )
    kinds.set(f=0.5, i=2, v=(1.0, 2.0, 3.0), w=(0.0, 0.0, 0.0, 4.0))
    assert (paint(kinds) == 0.5 + 2 + 321 + 4).all()


def test_a_matrix_that_moves_a_point_right_and_up_moves_it_right_and_up(program, paint) -> None:
    one = program(WHITE, POINT)
    moved = np.eye(4)
    moved[:2, 3] = 0.75, -0.25  # of a 4×4 target: column 3, row 1 from below
    one.set(place=moved)
    image = paint(one, mode=moderngl.POINTS, count=1)
    assert np.argwhere(image).tolist() == [[1, 3]]


def test_an_array_whose_last_elements_are_unused_takes_all_values(program, paint) -> None:
    one = program("uniform vec2 v[4]; out float value; void main() { value = v[1].x; }")
    one.set(v=np.arange(8.0).reshape(4, 2))
    assert (paint(one) == 2.0).all()


def test_sampling_of_each_wrap(device, program, paint) -> None:
    texture = device.context.texture((2, 1), 1, np.array([0.25, 0.5], np.float32).tobytes(), dtype="f4")
    beyond = program("uniform sampler2D s; out float value; void main() { value = texture(s, vec2(1.25, 0.5)).r; }")
    assert (paint(beyond, {"s": (texture, Sampling(wrap="edge"))}) == 0.5).all()
    assert (paint(beyond, {"s": (texture, Sampling(wrap="repeat"))}) == 0.25).all()
    assert (paint(beyond, {"s": (texture, Sampling(wrap="border", border=0.75))}) == 0.75).all()
    assert (paint(beyond, {"s": (texture, Sampling(wrap="border", border=0.0))}) == 0.0).all()
    device.free([texture])


def test_every_kind_of_2d_sampler_reads_its_own_texture(device, program, paint) -> None:
    context = device.context
    decoy = context.texture((1, 1), 1, np.array([99], np.float32).tobytes(), dtype="f4")
    plain = context.texture((1, 1), 1, np.array([0.5], np.float32).tobytes(), dtype="f4")
    signed = context.texture((1, 1), 1, np.array([-3], np.int32).tobytes(), dtype="i4")
    unsigned = context.texture((1, 1), 1, np.array([7], np.uint32).tobytes(), dtype="u4")
    depth = context.depth_texture((1, 1))
    context.framebuffer(depth_attachment=depth).clear(depth=0.5)
    mixed = program(
        "uniform sampler2D decoy; uniform sampler2D plain; uniform isampler2D whole; uniform usampler2D natural;"
        "uniform sampler2DShadow compared; uniform sampler2D depths; out float value;"
        "void main() { vec2 at = vec2(0.5);"
        "value = 1e6 * float(texture(decoy, at).r == 99.0) + texture(plain, at).r + 10.0 * float(texture(whole, at).r)"
        " + 100.0 * float(texture(natural, at).r) + 1000.0 * texture(compared, vec3(at, 0.25))"
        " + 2000.0 * texture(compared, vec3(at, 0.75)) + 10000.0 * texture(depths, at).r; }"
    )
    depth.compare_func = ""
    image = paint(
        mixed,
        {
            "decoy": (decoy, Sampling()),
            "plain": (plain, Sampling()),
            "whole": (signed, Sampling()),
            "natural": (unsigned, Sampling()),
            "compared": (depth, Sampling(linear=True, compare="<=")),
            "depths": (depth, Sampling()),
        },
    )
    assert image == pytest.approx(1e6 + 0.5 - 30 + 700 + 1000 + 5000, abs=0.1)
    device.free([decoy, plain, signed, unsigned, depth])


@pytest.mark.parametrize("kind", ["sampler2DArray", "sampler2DArrayShadow", "samplerCube", "samplerCubeShadow"])
def test_samplers_that_moderngl_ignores_get_a_unit_of_their_own(device, program, kind) -> None:
    get = RawGL(device.context, {"glGetUniformiv": (ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)})
    read = "texture(s, vec4(0.5))" if kind.endswith("Shadow") else "texture(s, vec3(0.5)).r"
    two = program(
        f"uniform sampler2D first; uniform {kind} s; out float value;"
        f"void main() {{ value = texture(first, vec2(0.5)).r + {read}; }}"
    )
    location = device.raw("glGetUniformLocation", two.linked.glo, b"s")
    value = np.zeros(1, np.int32)
    get("glGetUniformiv", two.linked.glo, location, value.ctypes.data)
    assert value[0] == two._units["s"] != two._units["first"]


def test_a_texture_that_is_left_out_is_an_error(program, paint) -> None:
    reads = program("uniform sampler2D map; out float value; void main() { value = texture(map, vec2(0.5)).r; }")
    with pytest.raises(KeyError, match="map"):
        paint(reads)


def test_a_shader_error_says_where_and_why_in_its_first_line(device) -> None:
    fragment = f"{VERSION}\nout vec4 color;\nvoid main() {{\n    color = vec4(blurred);\n}}\n"
    with pytest.raises(
        ShaderError, match=r"^fragment shader: line 4: .*blurred.*: 'color = vec4\(blurred\);'"
    ) as error:
        link(device, f"{VERSION}\n{POINT}", fragment)
    assert POINT not in str(error.value), "the vertex shader is not to blame"


@pytest.mark.parametrize(
    "error",
    ["0:2(5): error: `b' undeclared", '0(2) : error C1503: undefined variable "b"', "ERROR: 0:2: 'b' : undeclared"],
    ids=["Mesa", "NVIDIA", "Apple"],
)
def test_the_place_in_a_driver_s_message_is_a_line(error: str) -> None:
    found = _explained(f"GLSL Compiler failed\n\n{error}\n", "fragment", "#version 410\na = b;\n")
    assert re.fullmatch(r"fragment shader: (ERROR: )?line 2: .*\bb\b.*: 'a = b;'", found)


ALL = State(
    depth_test="<=",
    depth_write=False,
    color_write=False,
    cull="front",
    polygon_offset=(2.0, 4.0),
    depth_clamp=True,
    blend="max",
    stencil=Stencil(test="!="),
    clip_distances=1,
)


def state_of(device: Device) -> dict[str, int]:
    names = {"factor": POLYGON_OFFSET_FACTOR, "units": POLYGON_OFFSET_UNITS, "offset": POLYGON_OFFSET_FILL}
    names |= {"cull": CULL_FACE, "test": DEPTH_TEST, "clamp": DEPTH_CLAMP, "mask": DEPTH_WRITEMASK}
    names |= {"blend": BLEND, "stencil": STENCIL_TEST, "plane": CLIP_DISTANCE0}
    if device.clip_control:
        names["clip"] = CLIP_DEPTH_MODE
    return {name: device.raw.integer(value) for name, value in names.items()}


def clean(device: Device) -> dict[str, int]:
    zero = dict.fromkeys(("factor", "units", "offset", "cull", "test", "clamp", "blend", "stencil", "plane"), 0)
    return zero | {"mask": 1} | ({"clip": NEGATIVE_ONE_TO_ONE} if device.clip_control else {})


def drawable(device: Device, one: Program) -> Drawable:
    return Drawable(one, device.context.vertex_array(one.linked, []), count=3)


def test_a_draw_leaves_no_state_for_the_next(device, program) -> None:
    target, draws = device.context.simple_framebuffer((4, 4)), device.draws
    for state in (replace(ALL, zero_to_one=device.clip_control), State()):
        drawable(device, program(WHITE)).draw(target, state=state)
        assert state_of(device) == clean(device)
    assert device.draws == draws + 2
    device.free([target])


def test_a_failing_draw_leaves_no_state_behind(device, program, monkeypatch) -> None:
    seen: dict[str, int] = {}

    def fail(*_: object, **__: object) -> None:
        seen.update(state_of(device))
        raise RuntimeError("out of luck")

    one = drawable(device, program(WHITE))
    monkeypatch.setattr(moderngl.VertexArray, "render", fail)
    target = device.context.simple_framebuffer((4, 4))
    draws = device.draws
    state = replace(ALL, zero_to_one=device.clip_control)
    with pytest.raises(RuntimeError, match="out of luck"):
        one.draw(target, state=state)
    assert all(seen[name] != value for name, value in clean(device).items()), "the state was there to leak"
    assert state_of(device) == clean(device)
    assert device.draws == draws, "only what was drawn is counted"
    device.free([target])
