"""Lookups in a 2-D map, compared with NumPy on the map's texels and the G-buffer's positions.

Nothing of the shader is used. Pixels are left out whose answer hangs on float32: where a texel's edge or a depth's tie
is nearer than rounding can tell.
"""

from collections.abc import Callable

import numpy as np
import pytest

from tests.samples import pairs

SIZE = 192
EDGE = 2e-3  # texels
TIE = 2e-6  # of depth in [0, 1]
SCENES = {"directional": "sphere-and-torus", "spot": "spot-lamp"}
# Bias and window are the same for all filters, so that one can be compared with another.
FIXED = {
    "directional": "fit=fixed(half=4,near=0.5,far=20,distance=10)",
    "spot": "fit=fixed(near=0.5,far=9,fov=58)",
}


class MapLookup:
    """Where the receivers of a shot lie in a technique's map, in texels and depth."""

    def __init__(self, technique, shot, bias: float, wrap: str = "border") -> None:
        light_view, size = technique.light_view, technique.params.size
        space = light_view.space
        x, y, axial = np.moveaxis((shot.position[..., :3] - space.origin) @ space.basis.T * [1, 1, -1], -1, 0)
        near, far = light_view.near, light_view.far
        with np.errstate(all="ignore"):
            if space.perspective:
                x, y = x / axial, y / axial
                self.depth = far * (axial - near) / (axial * (far - near))
            else:
                self.depth = (axial - near) / (far - near)
        low, high = light_view.box.low, light_view.box.high
        self.axial = axial
        self.u, self.v = (x - low[0]) / (high[0] - low[0]) * size, (y - low[1]) / (high[1] - low[1]) * size
        light, w = shot.view.light.homogeneous
        to_light = np.asarray(light) - w * shot.position[..., :3]
        to_light /= np.linalg.norm(to_light, axis=-1, keepdims=True)
        self.cosine = np.einsum("ijk,ijk->ij", shot.normal[..., :3], to_light)
        facing = (shot.position[..., 3] > 0) & (self.cosine > 1e-4) & (axial > 0) & (self.depth < 1 - TIE)
        self.usable = facing & np.isfinite(self.u) & (np.abs(self.u) < 1e4) & (np.abs(self.v) < 1e4)
        self.map = technique.map.texture.read()[0].astype(np.float64)  # row 0 where v is 0
        self.size, self.bias, self.wrap = size, bias, wrap
        self.sure = self.usable.copy()

    def stored(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        inside = (column >= 0) & (column < self.size) & (row >= 0) & (row < self.size)
        if self.wrap == "repeat":
            return self.map[row % self.size, column % self.size]
        clamped = self.map[np.clip(row, 0, self.size - 1), np.clip(column, 0, self.size - 1)]
        return clamped if self.wrap == "edge" else np.where(inside, clamped, 1.0)

    def lit(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        stored = self.stored(column, row)
        self.sure &= np.abs(self.depth - self.bias - stored) > TIE
        return (self.depth - self.bias <= stored).astype(float)

    def nearest(self, across: float = 0.0, up: float = 0.0) -> np.ndarray:
        u, v = np.where(self.usable, self.u + across, 0.5), np.where(self.usable, self.v + up, 0.5)
        for value in (u, v):
            self.sure &= np.abs(value - np.round(value)) > EDGE
        return self.lit(np.floor(u).astype(int), np.floor(v).astype(int))

    def linear(self, across=0.0, up=0.0) -> np.ndarray:
        u, v = (np.where(self.usable, one, 0.5) for one in (self.u + across - 0.5, self.v + up - 0.5))
        column, row = np.floor(u).astype(int), np.floor(v).astype(int)
        a, b = u - column, v - row
        below = self.lit(column, row) * (1 - a) + self.lit(column + 1, row) * a
        above = self.lit(column, row + 1) * (1 - a) + self.lit(column + 1, row + 1) * a
        return below * (1 - b) + above * b

    def box(self, taps: int) -> np.ndarray:
        reach = range(-(taps // 2), taps // 2 + 1)
        return np.mean([self.nearest(x, y) for x in reach for y in reach], axis=0)

    def kernel(self, weights: list[float]) -> np.ndarray:
        """Bilinear interpolation of a separable kernel over whole texels."""
        texels = [(weight / sum(weights), at - len(weights) // 2) for at, weight in enumerate(weights)]
        return sum(a * b * self.linear(x, y) for a, x in texels for b, y in texels)

    def dithered(self, width: float) -> np.ndarray:
        down, across = np.indices(self.u.shape)
        column, row = across, len(down) - 1 - down  # OpenGL counts rows from below
        ox, oy = column % 2 * width, row % 2 * width
        taps = [(x * width + ox, y * width - oy) for x in (-1.5, 0.5) for y in (1.5, -0.5)]
        return np.mean([self.linear(x, y) for x, y in taps], axis=0)


@pytest.fixture
def looked_up(build, studio, builtin) -> Callable[..., tuple[np.ndarray, MapLookup]]:
    """The mask of a shadow-map spec, and the lookup that should give it."""

    def make(kind: str, items: str, bias: float, wrap: str = "border", view=None) -> tuple[np.ndarray, MapLookup]:
        shot = studio.shot(view or builtin(SCENES[kind], SIZE))
        one = build(f"shadow-map:size=256,{FIXED[kind]},wrap={wrap},{items}", shot)
        mask = one.draw(shot)
        return mask, MapLookup(one.technique, shot, bias, wrap)

    return make


def check(mask: np.ndarray, expected: np.ndarray, lookup: MapLookup, tolerance: float) -> None:
    sure = lookup.sure
    assert sure.sum() > 0.7 * lookup.usable.sum(), "most of the picture is compared"
    shadowed = (expected[sure] < 0.5).mean()
    assert 0.02 < shadowed < 0.98, "there is something to see"
    assert np.abs(mask - expected)[sure].max() <= tolerance


ROUNDING = 1e-6
WEIGHTS = 0.006  # GPUs weigh texels with 8 bits, of coordinates rounded likewise: .0048 on an H100, less on llvmpipe


BIAS = "constant(0.01)"
GATHERED = "receiver-plane(limit=1e-9,slack=0,ulps=0)"
"""Planes limited to nothing, their slack off: the texels' own comparisons, weighted by the shader."""


@pytest.mark.parametrize(
    ("kind", "wrap", "filter_"), pairs(SCENES, ["border", "edge", "repeat"], ["hard", "hardware", "pcf(3)", "pcf(7)"])
)
def test_lookups_are_of_the_texels_around_the_point(looked_up, kind: str, wrap: str, filter_: str) -> None:
    """`hard` compares the texel that contains it, `hardware` weighs four, `pcf` is the mean over some around it."""
    mask, lookup = looked_up(kind, f"filter={filter_},bias={BIAS}", 0.01, wrap)
    expected = lookup.linear() if filter_ == "hardware" else lookup.box(int(filter_[4:-1] or 1))
    check(mask, expected, lookup, WEIGHTS if filter_ == "hardware" else ROUNDING)


@pytest.mark.parametrize("kind", SCENES)
def test_gathered_texels_are_weighted_as_the_hardware_does(looked_up, kind: str) -> None:
    mask, lookup = looked_up(kind, f"filter=hardware,bias={GATHERED}", 0.0)
    check(mask, lookup.linear(), lookup, 1e-3)


@pytest.mark.parametrize(
    ("kind", "taps", "bias"), [("directional", 3, BIAS), ("spot", 5, BIAS), ("spot", 3, f"{BIAS}+{GATHERED}")]
)
def test_castano_interpolates_a_kernel(looked_up, kind: str, taps: int, bias: str) -> None:
    """By hardware comparison, and by gathered texels that are compared one by one."""
    mask, lookup = looked_up(kind, f"filter=castano({taps}),bias={bias}", 0.01)
    check(mask, lookup.kernel([1, 2, 1] if taps == 3 else [1, 3, 4, 3, 1]), lookup, WEIGHTS)


@pytest.mark.parametrize(("kind", "items", "texels"), [("directional", "2.5", 2.5), ("spot", "10,unit=map", 2.56)])
def test_dither_takes_four_taps_by_the_parity_of_the_pixel(looked_up, kind: str, items: str, texels: float) -> None:
    mask, lookup = looked_up(kind, f"filter=dither-4({items}),bias={BIAS}", 0.01)
    check(mask, lookup.dithered(texels), lookup, WEIGHTS)


@pytest.mark.parametrize("kind", SCENES)
def test_biases_are_subtracted_as_published(looked_up, studio, builtin, kind: str) -> None:
    """max · (1 − N·L), at least min; units/w, w being 1 for a sun and metres along its axis for a spot; their sum."""
    metre = studio.shot(builtin(SCENES[kind], SIZE)).placement.scale
    for bias in ("slope(max=0.05,min=0.005)", "before-divide(0.03)", "constant(0.004)+slope(max=0.05,min=0.005)"):
        mask, lookup = looked_up(kind, f"filter=hard,bias={bias}", 0.0)
        slope = np.maximum(0.05 * (1 - lookup.cosine), 0.005)
        w = lookup.axial / metre if kind == "spot" else np.ones_like(lookup.axial)
        lookup.bias = {"s": slope, "b": 0.03 / w, "c": 0.004 + slope}[bias[0]]
        check(mask, lookup.nearest(), lookup, ROUNDING)


@pytest.mark.parametrize("kind", SCENES)
def test_the_map_image_is_linear_depth_with_row_0_at_the_top(build, studio, builtin, kind: str) -> None:
    shot = studio.shot(builtin(SCENES[kind], 64))
    one = build(f"shadow-map:size=128,{FIXED[kind]}", shot)
    one.draw(shot)
    image, light_view = one.technique.map_image(), one.technique.light_view
    lookup = MapLookup(one.technique, shot, 0.0)
    n, f = light_view.near, light_view.far
    z = 2 * lookup.map[::-1] - 1
    distance = 2 * n * f / (f + n - z * (f - n)) if kind == "spot" else n + (z + 1) / 2 * (f - n)
    assert image.shape == (128, 128)
    assert image == pytest.approx((distance - n) / (f - n), abs=1e-6)
    assert 0 <= image.min() < image.max() <= 1
