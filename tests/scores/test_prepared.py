import numpy as np


def test_interiors_keep_four_pixels_from_an_undecided_one(truth):
    undecided = np.zeros((31, 31), bool)
    undecided[15, 15] = True
    y, x = np.mgrid[:31, :31] - 15
    lit = truth(np.ones((31, 31)), undecided=undecided)
    np.testing.assert_array_equal(lit.lit_interior, y**2 + x**2 >= 16)
    shadowed = truth(np.zeros((31, 31)), undecided=undecided)
    np.testing.assert_array_equal(shadowed.shadow_interior, y**2 + x**2 >= 16)


def test_the_edge_zone_of_one_pixel_is_round(truth):
    """The border is half a pixel from the pixel's centre."""
    y, x = np.mgrid[:31, :31] - 15
    prepared = truth(np.where((x == 0) & (y == 0), 0.0, 1.0))
    np.testing.assert_array_equal(prepared.edge_zone, x**2 + y**2 <= 8.5**2)


def test_neither_a_gap_of_invalid_pixels_nor_the_border_of_the_image_is_an_edge(truth, half_plane):
    receivers = np.ones((128, 128), bool)
    receivers[:, 64] = False
    prepared = truth(half_plane(64), receivers=receivers)
    assert not prepared.edge.any()
    assert not prepared.boundary.any()
    assert not prepared.edge_zone.any()
    assert not truth(np.zeros((16, 16))).edge.any()


def test_the_boundary_is_a_fiftieth_of_the_diagonal_wide_and_at_least_a_pixel(truth, half_plane):
    for side, width in [(8, 1), (52, 1), (54, 2), (128, 4)]:
        prepared = truth(half_plane(side // 2, side, side))
        assert prepared.boundary_width == width
        assert np.flatnonzero(prepared.boundary[0]).tolist() == list(range(side // 2 - width, side // 2))


def test_penumbra_umbra_and_full_light_begin_between_two_levels(truth):
    """Of levels from 0 to 65535, 1310.7 are 0.02, 64224.3 are 0.98, 655.35 are 0.01 and 64879.65 are 0.99."""
    levels = {"penumbra": ((1310, 1311), (64225, 64224)), "umbra": ((656, 655),), "full_light": ((64879, 64880),)}
    for part, outside, inside in ((part, *pair) for part, pairs in levels.items() for pair in pairs):
        assert not getattr(truth([[outside / 65535]]), part).any()
        assert getattr(truth([[inside / 65535]]), part).all()
