"""Uniforms, samplers and fixed-function state of programs."""

import re

import moderngl
import numpy as np
import pytest

from shadowbench.gl.program import VERSION, Sampling, ShaderError, _first_error, link

POLYGON_OFFSET_FACTOR, POLYGON_OFFSET_UNITS, POLYGON_OFFSET_FILL = 0x8038, 0x2A00, 0x8037
CULL_FACE, DEPTH_TEST, DEPTH_CLAMP, CLIP_DEPTH_MODE, NEGATIVE_ONE_TO_ONE = 0x0B44, 0x0B71, 0x864F, 0x935D, 0x935E
BLEND, STENCIL_TEST, CLIP_DISTANCE0, DEPTH_WRITEMASK = 0x0BE2, 0x0B90, 0x3000, 0x0B72

TWO = "uniform float used; uniform float dropped; out float value; void main() { value = used; }"
POINT = "uniform mat4 place; void main() { gl_Position = place * vec4(0.0, 0.0, 0.0, 1.0); }"
WHITE = "out float value; void main() { value = 1.0; }"


def test_a_misspelt_uniform_is_an_error_and_an_unused_one_is_not(program) -> None:
    with pytest.raises(KeyError, match="no uniform 'usd'"):
        program(TWO).set(used=1.0, dropped=2.0, usd=3.0)


def test_a_matrix_that_moves_a_point_right_and_up_moves_it_right_and_up(program, paint) -> None:
    one = program(WHITE, POINT)
    moved = np.eye(4)
    moved[:2, 3] = 0.75, -0.25  # of a 4×4 target: column 3, row 1 from below
    one.set(place=moved)
    image = paint(one, mode=moderngl.POINTS, count=1)
    assert np.argwhere(image).tolist() == [[1, 3]]


def test_every_kind_of_2d_sampler_reads_its_own_texture(device, program, paint) -> None:
    context = device.context
    decoy = context.texture((1, 1), 1, np.array([99], np.float32).tobytes(), dtype="f4")
    plain = context.texture((1, 1), 1, np.array([0.5], np.float32).tobytes(), dtype="f4")
    signed = context.texture((1, 1), 1, np.array([-3], np.int32).tobytes(), dtype="i4")
    depth = context.depth_texture((1, 1))
    context.framebuffer(depth_attachment=depth).clear(depth=0.5)
    mixed = program(
        "uniform sampler2D decoy; uniform sampler2D plain; uniform isampler2D whole;"
        "uniform sampler2DShadow compared; uniform sampler2D depths; out float value;"
        "void main() { vec2 at = vec2(0.5);"
        "value = 1e6 * float(texture(decoy, at).r == 99.0) + texture(plain, at).r + 10.0 * float(texture(whole, at).r)"
        " + 1000.0 * texture(compared, vec3(at, 0.25))"
        " + 2000.0 * texture(compared, vec3(at, 0.75)) + 10000.0 * texture(depths, at).r; }"
    )
    depth.compare_func = ""
    image = paint(
        mixed,
        {
            "decoy": (decoy, Sampling()),
            "plain": (plain, Sampling()),
            "whole": (signed, Sampling()),
            "compared": (depth, Sampling(linear=True, compare="<=")),
            "depths": (depth, Sampling()),
        },
    )
    assert image == pytest.approx(1e6 + 0.5 - 30 + 1000 + 5000, abs=0.1)
    device.free([decoy, plain, signed, depth])


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
    line = _first_error(f"GLSL Compiler failed\n\n{error}\n", "fragment", "#version 410\na = b;\n")
    assert re.fullmatch(r"fragment shader: (ERROR: )?line 2: .*\bb\b.*: 'a = b;'", line)
