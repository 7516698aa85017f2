"""Depth targets have the precision that their format names."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench.gl import targets
from shadowbench.gl.device import Device
from shadowbench.gl.targets import depth_target, unsupported_map

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


def test_16_bits_cannot_tell_apart_what_24_and_floats_can(stored) -> None:
    level = 40_000 / 65_535
    near, far = level - 2.0**-19, level + 2.0**-19
    assert stored(near, "d16")[0, 0] == stored(far, "d16")[0, 0]
    for kind in ("d24", "d32f"):
        assert stored(near, kind)[0, 0] < stored(far, kind)[0, 0]


@pytest.mark.parametrize("kind", ["d16", "d24", "d32f"])
def test_step_is_what_separates_values_near_1(device, stored, kind) -> None:
    target = depth_target(device, 1, kind)
    step = target.step
    device.free([target])
    # The pipeline's own float32 blurs by a step of 2⁻²⁴, so two steps are told apart and a quarter is not.
    assert stored(1 - 4 * step, kind)[0, 0] < stored(1 - 2 * step, kind)[0, 0] < 1
    assert stored(1 - step / 8, kind)[0, 0] == 1
    assert (stored(0.0, kind) == 0).all()


def test_a_mask_of_another_precision_is_an_error(device, monkeypatch) -> None:
    lies = {"d16": (*targets._FORMATS["d24"][:2], 16, 2.0**-16)}
    monkeypatch.setattr(targets, "_FORMATS", lies)
    with pytest.raises(RuntimeError, match="asked the driver for 16 bits in a d16 target of 8², got 24"):
        depth_target(device, 8, "d16")


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
