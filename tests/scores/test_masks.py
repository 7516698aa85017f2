import hashlib
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.scores import mask_sha256, quantise, read_mask, write_mask

images = arrays(np.float32, (5, 7), elements=st.floats(0, 1, width=32))


def test_every_level_survives_all_precisions():
    levels = np.arange(65536).reshape(256, 256)
    for dtype in (np.float32, np.float64):
        quantised = quantise((levels / 65535).astype(dtype))
        np.testing.assert_array_equal(np.rint(quantised.astype(float) * 65535), levels)
    np.testing.assert_array_equal(quantise(np.array([[0, 0.5, 1]], np.float16)), quantise([[0, 0.5, 1]]))
    np.testing.assert_array_equal(quantise([[False, True]]), [[0, 1]])


def test_a_millionth_beyond_the_range_is_rounding_and_more_is_not():
    for edge, outwards in [(0.0, -1), (1.0, 1)]:
        assert quantise([[edge + outwards * 1e-6]])[0, 0] == edge
        with pytest.raises(ValueError, match=r"outside \[0, 1\] in 1 of 2 pixels"):
            quantise([[edge + outwards * 1.05e-6, edge + outwards * 1e-6]])


def test_an_invalid_mask_is_one_line():
    for bad, message in [
        ([[0.5, np.nan, np.inf, -np.inf]], "NaN or infinite in 3 of 4 pixels"),
        ([[0.5, 1.01, -0.25, 0]], r"outside \[0, 1\] in 2 of 4 pixels \(found -0.25 to 1.01\)"),
        ([[0, 255]], r"outside \[0, 1\] in 1 of 2"),
        ([0.5], r"shape \(1,\)"),
        ([[[0.5]]], r"shape \(1, 1, 1\)"),
        (np.ones((0, 4)), r"shape \(0, 4\)"),
    ]:
        with pytest.raises(ValueError, match=message) as caught:
            quantise(bad)
        assert "\n" not in str(caught.value)


@given(images)
def test_a_stored_mask_comes_back_bit_for_bit(tmp_path_factory, visibility):
    path = tmp_path_factory.getbasetemp() / "mask.png"
    write_mask(path, visibility)
    again = read_mask(path)
    assert again.dtype == np.float32
    np.testing.assert_array_equal(again, quantise(visibility))
    assert mask_sha256(again) == mask_sha256(visibility)


def test_a_mask_that_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(ValueError, match="NaN"):
        write_mask(tmp_path / "mask.png", [[np.nan]])
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="nowhere"):
        write_mask(tmp_path / "nowhere" / "mask.png", [[1.0]])


def test_an_opaque_mask_whose_channels_are_equal_is_grey(tmp_path):
    for mode in ["1", "LA", "P", "RGB", "RGBA"]:
        levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
        grey = Image.fromarray(np.where(levels < 99, 0, 255).astype(np.uint8) if mode == "1" else levels)
        grey.save(tmp_path / "grey.png")
        grey.convert(mode).save(tmp_path / "colour.png")
        assert np.array_equal(read_mask(tmp_path / "colour.png"), read_mask(tmp_path / "grey.png"))
        assert mode == "1" or np.allclose(read_mask(tmp_path / "grey.png"), levels / 255, atol=1e-7)


def test_one_pixel_that_is_coloured_or_transparent_makes_no_mask(tmp_path):
    for channel in [0, 1, 2, 3]:
        levels = np.full((4, 4, 4), 255, np.uint8)
        levels[2, 1, channel] = 254
        Image.fromarray(levels).save(tmp_path / "colour.png")
        with pytest.raises(InputError, match=r"mode RGBA; allowed: .* in colour or with a palette, all of it grey"):
            read_mask(tmp_path / "colour.png")


def test_sixteen_bits_in_colour_are_no_mask_as_half_of_them_would_be_lost(tmp_path):
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", 2, 2, 16, 2, 0, 0, 0)
    rows = zlib.compress(2 * (b"\0" + 2 * 3 * b"\x12\x34"))
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    (tmp_path / "deep.png").write_bytes(png)
    with pytest.raises(InputError, match=r"deep\.png: found a PNG of mode RGB; allowed"):
        read_mask(tmp_path / "deep.png")


def test_a_file_that_is_not_a_png_is_refused_by_name(tmp_path):
    path = tmp_path / "mask.png"
    with pytest.raises(InputError, match=r"mask\.png: no such file"):
        read_mask(path)
    path.write_text("not an image")
    with pytest.raises(InputError, match=r"mask\.png: cannot be read"):
        read_mask(path)
    write_mask(path, np.random.default_rng(0).random((32, 32)))
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"mask\.png: cannot be read"):
        read_mask(path)


def test_the_checksum_is_that_of_the_levels():
    assert mask_sha256([[0, 1]]) == hashlib.sha256(b"\x00\x00\xff\xff").hexdigest()
    assert mask_sha256([[0.5]]) != mask_sha256([[0.5001]])
