"""Depth targets, their layers and precision; blending and masks."""

import numpy as np
import pytest

from shadowbench.gl.program import Drawable, State
from shadowbench.gl.targets import depth_target, unsupported_map


@pytest.mark.parametrize("depth", ["d16", "d24", "d32f"])
def test_step_is_what_separates_values_near_1(device, at_depth, depth) -> None:
    target = depth_target(device, 2, depth)
    step, stored = target.step, []
    for value in (0.0, 1 - 4 * target.step, 1 - 2 * target.step, 1 - step / 8):
        target.target.clear(depth=1.0)
        at_depth(target.target, value)
        (first, *_), *_ = target.texture.read()[0]
        stored.append(first)
    device.free([target])
    # The pipeline's own float32 blurs by a step of 2⁻²⁴, so two steps are told apart and a quarter is not.
    assert 0 == stored[0] < stored[1] < stored[2] < stored[3] == 1


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


@pytest.mark.parametrize(("kind", "depth"), [("array", "d16"), ("cube", "d24"), ("array", "d32f")])
def test_each_layer_is_drawn_into_and_read_by_itself(device, at_depth, kind, depth) -> None:
    layers = depth_target(device, 4, depth, kind, 6)
    layers.target.clear(depth=1.0)
    for layer, target in enumerate(layers.layer_targets):
        at_depth(target, layer / 8)
    stored = layers.texture.read()
    assert stored.shape == (6, 4, 4)
    assert np.abs(stored - np.arange(6)[:, None, None] / 8).max() < 2 * layers.step
    device.free([layers])


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
