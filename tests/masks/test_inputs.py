"""Visibility from masks and screenshots: decoded to linear light, and refused if it cannot be."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.masks.inputs import decode_srgb, from_screenshots, mask_from_array, mask_from_file, read_luminance
from tests.masks.conftest import srgb


def encoded(linear: float) -> float:
    return float(srgb(np.array(linear)))


def flat(value: float, side: int = 8) -> np.ndarray:
    return np.full((side, side), value)


def test_srgb_is_decoded_as_the_standard_says() -> None:
    # IEC 61966-2-1: straight below 0.04045, and mid grey is about a fifth of the light.
    np.testing.assert_allclose(decode_srgb([0, 0.04, 0.5, 1]), [0, 0.04 / 12.92, 0.2140411, 1], atol=1e-7)
    assert decode_srgb(encoded(0.3)) == pytest.approx(0.3)


def test_every_kind_of_png_is_read_as_its_luminance(tmp_path: Path) -> None:
    """Of colours by ITU-R BT.709; without transparency, with a palette, and of 16 bits."""
    grey = Image.new("RGB", (4, 4), (188, 188, 188))
    for number, (image, luminance) in enumerate(
        [
            (Image.new("RGB", (4, 4), "red"), 0.2126),
            (Image.new("RGB", (4, 4), (0, 255, 0)), 0.7152),
            (Image.new("RGB", (4, 4), "blue"), 0.0722),
            (Image.merge("RGBA", [*grey.split(), Image.new("L", (4, 4), 7)]), decode_srgb(188 / 255)),
            (grey.quantize(4), decode_srgb(188 / 255)),
            (grey.convert("L"), decode_srgb(188 / 255)),
            (Image.fromarray(np.full((4, 4), 188 * 257, np.uint16)), decode_srgb(188 / 255)),
        ]
    ):
        image.save(tmp_path / f"{number}.png")
        np.testing.assert_allclose(read_luminance(tmp_path / f"{number}.png"), luminance, err_msg=str(number))


def test_visibility_is_the_share_of_the_light_that_is_left_with_ambient_light_taken_off(png: Callable) -> None:
    lit, shadowed, ambient = (png(f"{value}.png", flat(encoded(value))) for value in (0.7, 0.3, 0.2))
    np.testing.assert_allclose(from_screenshots(lit, shadowed, ambient).visibility, 0.2, atol=1e-2)
    np.testing.assert_allclose(from_screenshots(lit, shadowed).visibility, 3 / 7, atol=5e-3)
    dark = from_screenshots(lit, ambient, ambient)
    assert dark.visibility.max() == 0 and dark.measurable is not None and dark.measurable.all()


def test_linear_pictures_give_the_mask_of_encoded_ones(tmp_path: Path) -> None:
    """Of 16 bits, whose rounding is below a level of the test."""
    values = np.linspace(0.3, 0.95, 64).reshape(8, 8)
    pictures = {"lit": values, "shadowed": 0.1 + 0.2 * values, "ambient": flat(0.1)}
    for encode, linear in ((srgb, False), (np.asarray, True)):
        files = [tmp_path / f"{name}-{linear}.png" for name in pictures]
        for file, picture in zip(files, pictures.values(), strict=True):
            Image.fromarray(np.rint(encode(picture) * 65535).astype(np.uint16)).save(file)
        mask = from_screenshots(*files, linear=linear)
        np.testing.assert_allclose(mask.visibility, 0.2 * values / (values - 0.1), atol=1e-3)


def test_visibility_is_not_measured_where_the_light_is_weak(png: Callable) -> None:
    lit = flat(encoded(0.5))
    lit[:3] = decode_srgb(0)
    lit[3] = encoded(0.2 + 0.9 / 64)
    dark = np.minimum(lit, encoded(0.2))
    mask = from_screenshots(png("l.png", lit), png("s.png", dark), png("a.png", dark))
    assert mask.measurable is not None
    assert mask.measurable.sum(axis=1).tolist() == [0, 0, 0, 0, 8, 8, 8, 8]
    assert mask.visibility[:4].min() == 1 and mask.visibility[4:].max() == 0


def test_full_is_the_lit_level_of_every_array_type() -> None:
    for full in (flat(1.0).astype(bool), flat(1.0), flat(255).astype(np.uint8), flat(65535).astype("u2")):
        assert (mask_from_array(full).visibility == 1).all()
        assert (mask_from_array(np.zeros_like(full)).visibility == 0).all()


def test_other_arrays_and_files_are_refused(png: Callable, tmp_path: Path) -> None:
    square, wide, small = png("square.png", flat(1)), png("wide.png", np.ones((4, 8))), png("small.png", flat(1, 4))
    red, text = png("red.png", np.ones((4, 4, 3)) * [1, 0, 0]), tmp_path / "text.png"
    text.write_text("no picture")
    large = tmp_path / "large.png"
    Image.new("1", (4097, 4097)).save(large)
    for read, pictures, line in [
        (mask_from_array, [np.ones((4, 4, 3))], "found 4 × 4 × 3 pixels; allowed: rows of columns"),
        (mask_from_array, [np.ones((4, 4), np.int64)], "found an array of int64; allowed: float"),
        (mask_from_array, [np.full((4, 4), np.nan)], "NaN or infinite in 16 of 16"),
        (mask_from_array, [np.full((4, 4), 255.0)], "outside [0, 1] in 16 of 16"),
        (mask_from_file, [red], "found a PNG of mode RGB; allowed: an opaque grey PNG"),
        (mask_from_file, [tmp_path / "no.png"], "no such file"),
        (mask_from_file, [tmp_path], "is not a file; allowed: "),
        (from_screenshots, [square, small], "small.png: found 4 × 4 pixels; allowed: 8 × 8, as "),
        (from_screenshots, [square, square, small], "small.png: found 4 × 4 pixels"),
        (from_screenshots, [wide, square], "square.png: found 8 × 8 pixels; allowed: 8 × 4, as "),
        (from_screenshots, [square, text], "text.png: cannot be read as an image"),
        (
            from_screenshots,
            [large, large],
            "large.png: found 4097 × 4097 pixels; allowed: a PNG of at most 4096 × ",
        ),
    ]:
        with pytest.raises(InputError) as caught:
            read(*pictures)  # type: ignore[operator]
        assert line in str(caught.value) and "\n" not in str(caught.value)
