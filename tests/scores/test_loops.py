"""Compiled loops against the functions of SciPy and NumPy that they stand for: equal to the last bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import ndimage

from shadowbench.scores import loops
from shadowbench.scores.masks import greatest

SHAPES = array_shapes(min_dims=2, max_dims=2, max_side=40)
VISIBILITY = st.floats(0, 1, width=32)


@given(arrays(bool, SHAPES, elements=st.sampled_from([False] * 15 + [True])))
def test_squared_distances_are_those_of_the_nearest_pixel(to) -> None:
    to[-1, 0] = True  # SciPy's distance to an empty set is arbitrary
    distance = ndimage.distance_transform_edt(~to)
    np.testing.assert_array_equal(loops.squared_distance(to), np.rint(distance**2))


def test_distances_in_a_wide_image_are_exact() -> None:
    """The quotients of the envelope are in floating point: of numbers up to the square of the width."""
    rng = np.random.default_rng(3)
    to = rng.random((40, 9000)) < 1e-4
    rows, columns = ndimage.distance_transform_edt(~to, return_distances=False, return_indices=True)
    y, x = np.indices(to.shape)
    np.testing.assert_array_equal(loops.squared_distance(to), (rows - y) ** 2 + (columns - x) ** 2)


@given(arrays(np.float32, SHAPES, elements=VISIBILITY), st.integers(0, 9))
def test_the_greatest_is_that_of_a_maximum_filter_that_repeats_the_border(values, reach) -> None:
    expected = ndimage.maximum_filter(values, 2 * reach + 1, mode="nearest")
    np.testing.assert_array_equal(greatest(values, reach), expected)
    dark = (values < 0.1).view(np.uint8)
    expected = ndimage.maximum_filter(dark, 2 * reach + 1, mode="nearest")
    np.testing.assert_array_equal(greatest(dark, reach), expected)


@given(
    arrays(np.float32, (7, 9), elements=VISIBILITY), arrays(bool, (7, 9)), st.floats(-2, 9, width=32), st.floats(-2, 9)
)
def test_samples_are_bilinear_and_nothing_outside_the_image(values, valid, row, column) -> None:
    point = np.float32([[row], [column]])
    expected = [
        ndimage.map_coordinates(image.astype(np.float32), point, order=1, mode="constant")[0]
        for image in (np.where(valid, values, 0), valid)
    ]
    assert [*loops.sample(values, valid, *point[:, 0])] == expected
