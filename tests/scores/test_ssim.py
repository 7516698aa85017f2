import numpy as np
import pytest
from skimage.metrics import structural_similarity

from shadowbench.scores import quantise, score
from shadowbench.scores.comparison import RADIUS


def scikit_image(a, b, **options):
    return structural_similarity(
        quantise(a).astype(float),
        quantise(b).astype(float),
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1,
        **options,
    )


def pictures():
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:150, :90]
    wedge = (y < 1.3 * x).astype(float)
    return {
        "noise": (rng.random((150, 90)), wedge),
        "displaced": (np.roll(wedge, 2, 1), wedge),
        "smooth": ((np.sin(y / 9) * np.cos(x / 7) + 1) / 2, wedge),
        "flat grey on flat white": (np.full((150, 90), 0.7), np.ones((150, 90))),
        "nearly flat": (0.9 + 1e-4 * rng.random((150, 90)), np.full((150, 90), 0.9)),
        "larger than a tile": (rng.random((60, 200)), rng.random((60, 200))),
        "one window": (rng.random((11, 11)), rng.random((11, 11))),
    }


def test_ssim_equals_that_of_scikit_image_without_excluded_pixels(truth):
    for name in pictures():
        mask, visibility = pictures()[name]
        assert score(mask, truth(visibility))["ssim"] == pytest.approx(scikit_image(mask, visibility), abs=1e-7)


def test_ssim_edge_is_scikit_images_map_within_the_edge_zone(truth, half_plane):
    mask, visibility = half_plane(67, 60, 80), half_plane(64, 60, 80)
    _, similarity = scikit_image(mask, visibility, full=True)
    expected = similarity[RADIUS:-RADIUS, 56:72].mean()
    assert score(mask, truth(visibility))["ssim_edge"] == pytest.approx(expected, abs=1e-7)


def test_each_window_is_weighted_by_its_valid_pixels(truth):
    rng = np.random.default_rng(1)
    mask, visibility = quantise(rng.random((11, 11))), quantise(rng.random((11, 11)))
    receivers = rng.random((11, 11)) < 0.6
    receivers[5, 5] = True
    offset = np.arange(-5, 6)
    weights = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * 1.5**2)) * receivers
    weights /= weights.sum()
    (mean_a, mean_b) = means = [np.sum(weights * image) for image in (mask, visibility)]
    centred = [image - mean for image, mean in zip((mask, visibility), means, strict=True)]
    a, b, ab = (np.sum(weights * centred[i] * centred[j]) for i, j in ((0, 0), (1, 1), (0, 1)))
    expected = (2 * mean_a * mean_b + 1e-4) * (2 * ab + 9e-4) / ((mean_a**2 + mean_b**2 + 1e-4) * (a + b + 9e-4))
    assert score(mask, truth(visibility, receivers=receivers))["ssim"] == pytest.approx(expected, abs=1e-7)
