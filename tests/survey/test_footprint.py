"""Footprints of texels in pixels, compared with finite differences and with random edges on a grid."""

import numpy as np
import pytest

from shadowbench.geometry.lights import light_space
from shadowbench.scenes.model import Light
from shadowbench.survey.maps import ANGLES, DISPLACEMENTS, Footprint, cube_footprint, footprint, longest
from shadowbench.survey.sampling import sample_view
from tests.survey.conftest import looking, plate


def test_jacobian_and_slope_are_the_differences_between_neighbours(light: Light) -> None:
    samples = sample_view(looking([plate(30.0)], light, size=128))
    point = light.kind == "point"
    seen = cube_footprint(samples) if point else footprint(samples, light_space(samples.view.light))
    grid = np.full((128, 128), -1)
    grid[np.divmod(samples.pixel, 128)] = np.arange(len(samples.pixel))
    here = grid[1:-1, 1:-1]
    for axis, (before, after) in enumerate(((grid[1:-1, :-2], grid[1:-1, 2:]), (grid[:-2, 1:-1], grid[2:, 1:-1]))):
        inside = (here >= 0) & (before >= 0) & (after >= 0)
        a, b, c = before[inside], here[inside], after[inside]
        if point:  # away from the seams between faces, where coordinates are others
            inner = (np.abs(seen.coords[:2]) < 0.95).all(axis=0)
            same = inner[a] & inner[b] & inner[c]
            a, b, c = a[same], b[same], c[same]
        assert len(b) > 1000
        moved = (seen.coords[:, c] - seen.coords[:, a]) / 2
        scale = np.linalg.norm(moved[:2], axis=0)
        np.testing.assert_allclose(seen.jacobian[:, axis, b], moved[:2], atol=1e-3 * scale.max())
        along = (seen.slope[:, b] * seen.jacobian[:, axis, b]).sum(axis=0)
        np.testing.assert_allclose(along, moved[2], atol=2e-3 * np.abs(moved[2]).max() + 1e-9)


def test_the_longest_reach_is_the_reciprocal_of_the_least_singular_value() -> None:
    matrices = np.random.default_rng(1).normal(size=(2, 2, 100))
    least = np.linalg.svd(matrices.transpose(2, 0, 1))[1][:, 1]
    np.testing.assert_allclose(longest(*np.moveaxis(matrices, 1, 0)), 1 / least, rtol=1e-9)


def test_predicted_edge_displacement_matches_random_edges_on_a_grid() -> None:
    """Points beside a straight edge that a 2×2 linear comparison of texel centres puts on its other side."""
    chance = np.random.default_rng(0)
    for angle, off in zip(ANGLES, DISPLACEMENTS, strict=True):
        normal = np.array([np.cos(angle), np.sin(angle)])
        away = (chance.random(400_000) - 0.5) * 3
        point = away[:, None] * normal + chance.random((400_000, 1)) * 1000 * np.array([-normal[1], normal[0]])
        shift = chance.random((400_000, 2))  # of the grid
        corner, part = np.divmod(point + shift - 0.5, 1.0)
        lit = [[((corner + [i, j] + 0.5 - shift) @ normal > 0) * 1.0 for j in (0, 1)] for i in (0, 1)]
        x, y = part.T
        mixed = (lit[0][0] * (1 - x) + lit[1][0] * x) * (1 - y) + (lit[0][1] * (1 - x) + lit[1][1] * x) * y
        assert 3 * np.mean((mixed > 0.5) != (away > 0)) == pytest.approx(off, abs=0.003)


def test_an_edge_moves_by_a_quarter_of_a_texel_at_most() -> None:
    half = Footprint(np.zeros((3, 1)), np.diag([0.5, 0.5])[..., None], np.zeros((2, 1)))  # a texel is two pixels
    assert (
        0.5 * DISPLACEMENTS.min()
        < half.displacement.min() / 2
        < half.displacement.max() / 2
        <= np.sqrt(2) * DISPLACEMENTS.max()
    )
