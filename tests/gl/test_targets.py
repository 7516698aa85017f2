"""Depth targets, their layers and precision; stencil, blending and clip distances."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench.gl.device import Device
from shadowbench.gl.program import Drawable, Sampling, State, Stencil
from shadowbench.gl.targets import depth_target, stencil_target, unsupported_map

BITS = {"d16": 16, "d24": 24}
FLOAT_ROUNDING = 2.0**-23  # of depth · 2 − 1, and of the way back, in the pipeline's float32


@pytest.fixture
def stored(device: Device, at_depth) -> Callable[..., np.ndarray]:
    """The depth stored by a target of a format when a depth is drawn over all of it."""

    def draw(depth: float, kind: str, side: int = 2) -> np.ndarray:
        target = depth_target(device, side, kind)
        target.target.clear(depth=1.0)
        at_depth(target.target, depth)
        values = target.texture.read()[0].astype(np.float64)
        device.free([target])
        return values

    return draw


@pytest.mark.parametrize("kind", BITS)
@given(depth=st.floats(0.0, 1.0, width=32))
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_fixed_point_target_keeps_the_nearest_step(stored, kind, depth) -> None:
    levels = 2 ** BITS[kind] - 1
    values = stored(depth, kind)
    assert (values == values[0, 0]).all()
    assert abs(values[0, 0] - depth) <= 0.5 / levels + FLOAT_ROUNDING
    level = values[0, 0] * levels
    assert abs(level - round(level)) <= levels * 2.0**-24, "a level, as exact as the float32 that it is read as"


@pytest.mark.parametrize("kind", ["d16", "d24", "d32f"])
def test_step_is_what_separates_values_near_1(device, stored, kind) -> None:
    target = depth_target(device, 1, kind)
    step = target.step
    device.free([target])
    # The pipeline's own float32 blurs by a step of 2⁻²⁴, so two steps are told apart and a quarter is not.
    assert stored(1 - 4 * step, kind)[0, 0] < stored(1 - 2 * step, kind)[0, 0] < 1
    assert stored(1 - step / 8, kind)[0, 0] == 1
    assert (stored(0.0, kind) == 0).all()


@pytest.mark.parametrize("kind", ["2d", "array", "cube"])
def test_unsupported_texture_sizes_are_reported_before_allocation(device, kind) -> None:
    assert unsupported_map(device, 64, "d16", kind, 6) is None
    too_large = unsupported_map(device, 4 * device.max_map_size, "d16", kind, 6)
    what = {"2d": "a map", "array": "6 maps", "cube": "a cube"}[kind]
    assert too_large == f"the driver refuses {what} of {4 * device.max_map_size}² texels in d16"
    device.check("asking")
    with pytest.raises(Exception, match=r"GL_|target|size|texture|allowed"):
        depth_target(device, 4 * device.max_map_size, "d16", kind, 6)
    assert device.context.error in ("GL_NO_ERROR", "GL_INVALID_VALUE")


BYTES = {"d16": 2, "d24": 3, "d32f": 4}


@pytest.mark.parametrize(("kind", "depth"), [("array", "d16"), ("cube", "d24"), ("array", "d32f")])
def test_each_layer_is_drawn_into_and_read_by_itself(device, at_depth, kind, depth) -> None:
    layers = depth_target(device, 4, depth, kind, 6)
    layers.target.clear(depth=1.0)
    for layer, target in enumerate(layers.layer_targets):
        at_depth(target, layer / 8)
    stored = layers.texture.read()
    assert stored.shape == (6, 4, 4)
    assert np.abs(stored - np.arange(6)[:, None, None] / 8).max() < 2 * layers.step
    assert layers.bytes == 6 * 16 * BYTES[depth]
    device.free([layers])


@pytest.mark.parametrize(("face", "direction"), [(0, "1,0,0"), (3, "0,-1,0"), (4, "0,0,1")])
def test_a_cube_is_sampled_by_direction(device, program, paint, face, direction) -> None:
    layers = depth_target(device, 4, "d32f", "cube")
    for layer, target in enumerate(layers.layer_targets):
        target.clear(depth=layer / 8)
    read = program(
        "uniform samplerCube depths; uniform samplerCubeShadow compared; out float value;"
        f"void main() {{ vec3 d = vec3({direction}); value = texture(depths, d).r"
        f" + 2.0 * texture(compared, vec4(d, {face / 8 - 0.05:g}))"
        f" + 4.0 * texture(compared, vec4(d, {face / 8 + 0.05:g})); }}"
    )
    textures = {
        "depths": (layers.texture, Sampling()),
        "compared": (layers.texture, Sampling(linear=True, compare="<=")),
    }
    assert np.allclose(paint(read, textures), face / 8 + 2)
    device.free([layers])


def test_the_two_sides_of_a_closed_body_count_in_opposite_directions(device, program, paint) -> None:
    """Three front faces and one back face over a pixel leave a count of two; 256 increments wrap to none."""
    image = device.context.texture((4, 4), 1, dtype="f4")
    buffers = stencil_target(device, (4, 4), image)
    white = program("out float value; void main() { value = 1.0; }")
    turned = program(
        "out float value; void main() { value = 1.0; }",
        "void main() { vec2 c = vec2(gl_VertexID & 2, (gl_VertexID << 1) & 2);"
        " gl_Position = vec4(c * 2.0 - 1.0, 0, 1); }",
    )
    front, back = (Drawable(one, device.context.vertex_array(one.linked, []), count=3) for one in (white, turned))
    counting = Stencil(front=("keep", "keep", "increment"), back=("keep", "keep", "decrement"))
    for fronts, reference in ((3, 2), (257, 0)):
        buffers.target.clear()
        buffers.clear_stencil()
        for _ in range(fronts):
            front.draw(buffers.target, state=State(color_write=False, stencil=counting))
        back.draw(buffers.target, state=State(color_write=False, stencil=counting))
        front.draw(buffers.target, state=State(stencil=Stencil(test="==", reference=reference)))
        painted = np.frombuffer(image.read(), np.float32)
        assert (painted == 1).all(), reference
        front.draw(buffers.target, state=State(stencil=Stencil(test="!=", reference=reference), blend="add"))
        assert (np.frombuffer(image.read(), np.float32) == 1).all(), "drawn where it must not be"
    assert buffers.bits == 8 and buffers.bytes == 4 * 4 * 4
    device.free([front.vertices, back.vertices, buffers, image])


@pytest.mark.parametrize(("blend", "result"), [("", 3.0), ("add", 5.0), ("min", 2.0), ("max", 3.0)])
def test_a_draw_resets_the_blending_and_masks_of_the_previous_one(device, program, blend, result) -> None:
    image = device.context.texture((4, 4), 1, dtype="f4")
    target = device.context.framebuffer([image])
    target.clear(red=2.0)
    three = program("out float value; void main() { value = 3.0; }")
    drawable = Drawable(three, device.context.vertex_array(three.linked, []), count=3)
    drawable.draw(target, state=State(blend=blend))
    assert (np.frombuffer(image.read(), np.float32) == result).all()
    drawable.draw(target, state=State(blend=blend, color_write=False))
    assert (np.frombuffer(image.read(), np.float32) == result).all()
    drawable.draw(target)
    assert (np.frombuffer(image.read(), np.float32) == 3).all(), "no blending, no mask remains"
    device.free([drawable.vertices, target, image])
