"""Moments of 16 bits compared with those of 32."""

import numpy as np
import pytest


@pytest.mark.parametrize("technique", ["shadow-map", "cascades", "cube-map"])
@pytest.mark.parametrize(
    ("filter_", "dtype"),
    [("msm(bias=6e-5)", "nu2"), ("evsm(positive=5.54)", "f2"), ("vsm(min_variance=0.0001)", "f2")],
)
def test_sixteen_bits_are_nearly_as_good_as_thirty_two(
    technique, filter_, dtype, builtin, studio, build, device
) -> None:
    shot = studio.shot(builtin("lamp-over-table" if technique == "cube-map" else "sphere-and-torus", 128))
    exact, rounded = (build(f"{technique}:filter={filter_[:-1]},blur=3,bits={bits})", shot) for bits in (32, 16))
    difference = exact.draw(shot) - rounded.draw(shot)
    assert (exact.technique.contents.texture.dtype, rounded.technique.contents.texture.dtype) == ("f4", dtype)
    # GPUs weigh halves with 8 bits: .011 on an H100.
    assert 0 < np.sqrt(np.mean(difference**2)) < (0.005 if device.software else 0.02)


@pytest.mark.parametrize(("filter_", "bias"), [("msm(bits=16", 6e-5), ("msm(bits=32", 3e-6)])
def test_the_moment_bias_is_the_published_one_for_the_bits(filter_: str, bias: float, builtin, mask) -> None:
    view = builtin("sphere-and-torus", 96)
    default = mask(f"shadow-map:filter={filter_})", view)
    assert np.array_equal(default, mask(f"shadow-map:filter={filter_},bias={bias})", view))
    assert not np.array_equal(default, mask(f"shadow-map:filter={filter_},bias={10 * bias})", view))
