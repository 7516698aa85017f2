"""Filters with contents of their own (moments and exponentials): closed forms at edges, and what must stay lit.

A directional light from above, casters that face it, and a blur of an odd number of texels: the share of the kernel on
either side of a caster's edge is known, and with it every moment.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from shadowbench.maps.filters import Filter
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.vectors import unit
from tests.maps.test_contents import plate
from tests.samples import by_turns

DOWN = Light("sun", "directional", (0.0, -1.0, 0.0))
FIXED = "fit=fixed(half=2.5,near=1,far=6,distance=5),size=80,bias=none"
TEXEL = 5 / 80  # metres
BLUR = 5
FILTERS = [name for name, row in Filter.table.items() if "blur" in row.model_fields]


def share(coordinate: np.ndarray) -> np.ndarray:
    """Share of the kernel beyond an edge at 0 in the blurred texels, read with bilinear weights."""
    centres = np.arange(-40, 40) + 0.5
    return np.interp(coordinate / TEXEL, centres, np.clip(0.5 + centres / BLUR, 0, 1))


@dataclass(frozen=True)
class Ground:
    """Masks at the points of the ground, of filters on one scene. z: linear depths, of the ground and by height."""

    drawn: Callable[[str], np.ndarray]
    x: np.ndarray
    y: np.ndarray
    depth: Callable[[float], float]

    def __call__(self, filter_: str) -> np.ndarray:
        return self.drawn(filter_)


@pytest.fixture
def ground(looking, studio, build) -> Callable[..., Ground]:
    """The ground under some casters, seen from below them."""

    def make(*casters: Mesh, fit: str = FIXED) -> Ground:
        view = looking([plate(0.0), *casters], DOWN, 128, eye=(0.3, 0.7, 1.9), target=(0.0, 0.0, -0.2))
        shot = studio.shot(view)
        position = shot.position[..., :3] / shot.placement.scale + shot.placement.center
        on_ground = (shot.triangle >= 0) & (shot.triangle < 2) & (np.abs(position[..., [0, 2]]).max(axis=-1) < 1.8)
        x, _, y = position[on_ground].T
        assert (np.abs(x) < BLUR * TEXEL / 2).sum() > 300, "the edge is in the picture"
        linear = build(f"shadow-map:{fit}", shot)
        linear.draw(shot)

        def depth(height: float) -> float:
            local = (np.array([0.0, height, 0.0]) - shot.placement.center) * shot.placement.scale
            return float(linear.technique.light_view.to_linear @ [*local, 1.0])

        def drawn(filter_: str) -> np.ndarray:
            return build(f"shadow-map:filter={filter_},{fit}", shot).draw(shot)[on_ground]

        return Ground(drawn, x, y, depth)

    return make


def chebyshev(values: np.ndarray, weights: np.ndarray, z: float) -> np.ndarray:
    """σ²/(σ² + d²) of a distribution over (values), with (values, N) weights."""
    mean = values @ weights
    variance = values**2 @ weights - mean**2
    with np.errstate(invalid="ignore"):
        return np.where(z > mean, variance / (variance + (z - mean) ** 2), 1.0)


@pytest.fixture
def halves(ground) -> Callable[[float, float], tuple[Ground, np.ndarray]]:
    """The ground under two half-planes, and the (2, N) shares of the kernel that they have."""

    def make(left: float, right: float) -> tuple[Ground, np.ndarray]:
        under = ground(plate(left, x=(-2.2, 0.0)), plate(right, x=(0.0, 2.2)))
        right_share = share(under.x)
        return under, np.stack([1 - right_share, right_share])

    return make


@pytest.mark.parametrize("heights", [(1.6, 0.8), (1.0, 0.9)])
def test_vsm_bleeds_by_chebyshev_s_bound_between_two_casters(halves, device, heights) -> None:
    under, weights = halves(*heights)
    expected = chebyshev(np.array([under.depth(height) for height in heights]), weights, under.depth(0.0))
    assert expected.max() > 0.001
    assert under(f"vsm(blur={BLUR},bleed=0,min_variance=0)") == pytest.approx(
        expected,
        abs=2e-4 if device.software else 1e-3,  # GPUs weigh texels with 8 bits
    )


def test_vsm_takes_a_quarter_of_an_inclined_caster_s_squared_change_for_its_variance_in_a_texel(ground) -> None:
    """Which a bilinear read between texels' centres, at t, raises by t(1 − t) of it."""
    low, slope, texel = 0.2, 0.8, 5 / 16
    corners = [[x, low + slope * (x + 2.2), z] for x, z in ((-2.2, -2.2), (-2.2, 2.2), (2.2, 2.2), (2.2, -2.2))]
    ramp = Mesh("ramp", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
    under = ground(ramp, fit=FIXED.replace("size=80", "size=16"))
    metre = under.depth(0.0) - under.depth(1.0)
    between = (under.x / texel - 0.5) % 1.0
    variance = (0.25 + between * (1 - between)) * (slope * texel * metre) ** 2
    behind = (low + slope * (under.x + 2.2)) * metre
    assert under("vsm(blur=1,bleed=0)") == pytest.approx(variance / (variance + behind**2), abs=2e-3)


@pytest.mark.parametrize(("heights", "positive", "negative"), [((1.6, 0.8), 4.0, 3.0), ((2.0, 0.9), 10.0, 5.0)])
def test_evsm_is_the_smaller_bound_of_two_warps(halves, heights, positive, negative) -> None:
    under, weights = halves(*heights)
    depths, z = np.array([under.depth(height) for height in heights]), under.depth(0.0)
    up = [np.exp(positive * (2 * one - 1)) for one in (depths, z)]
    down = [-np.exp(-negative * (2 * one - 1)) for one in (depths, z)]
    items = f"blur={BLUR},positive={positive},negative={negative},min_variance=0"
    first = chebyshev(up[0], weights, up[1])
    assert under(f"evsm({items},components=2)") == pytest.approx(first, abs=5e-4)
    both = np.minimum(first, chebyshev(down[0], weights, down[1]))
    assert under(f"evsm({items})") == pytest.approx(both, abs=5e-4)


@pytest.mark.parametrize(("heights", "c"), [((1.6, 0.8), 2.0), ((2.0, 0.9), 10.0)])
def test_esm_is_the_mean_exponential_over_the_receiver_s(halves, heights, c) -> None:
    under, weights = halves(*heights)
    depths = np.array([under.depth(height) for height in heights])
    expected = np.exp(c * (depths - under.depth(0.0))) @ weights
    assert under(f"esm(blur={BLUR},c={c})") == pytest.approx(expected, abs=1e-4)


def test_msm_is_exact_for_three_depths_with_the_receiver_s(ground) -> None:
    """Four moments bound more sharply than two."""
    under = ground(plate(2.0, x=(-2.2, 0.0)), plate(1.4, x=(0.0, 2.2), z=(-2.2, 0.0)))
    right, near = share(under.x), share(under.y)
    weights = np.stack([1 - right, right * (1 - near), right * near])
    depths = np.array([under.depth(height) for height in (2.0, 1.4, 0.0)])
    vsm = chebyshev(depths, weights, under.depth(0.0))
    mixed = weights.min(axis=0) > 0.05
    assert mixed.sum() > 50
    msm = under(f"msm(blur={BLUR})")[mixed]
    assert (msm < vsm[mixed] + 1e-4).all() and (msm < vsm[mixed] - 0.01).mean() > 0.5
    assert msm == pytest.approx(weights[2][mixed], abs=1e-3)


TECHNIQUES = ["shadow-map", "shadow-map", "cascades", "cube-map"], ["directional", "spot", "directional", "spot"]
SUN = Light("sun", "directional", (0.3, -1.0, 0.2))


def inclined(kind: str, degrees: float) -> Light:
    """A light that falls on the ground at an angle, along no axis of the map."""
    t = math.radians(degrees)
    direction = np.array(unit((0.8 * math.sin(t), -math.cos(t), 0.6 * math.sin(t))))
    if kind == "directional":
        return Light("light", kind, tuple(direction.tolist()))
    return Light("light", kind, tuple(direction.tolist()), tuple((-4 * direction).tolist()), math.radians(60))


@pytest.mark.parametrize(
    ("filter_", "name", "kind"),
    by_turns([*(f"{one}(blur=9)" for one in FILTERS), "msm(blur=16,kernel=gaussian)", "vsm(blur=2)"], *TECHNIQUES),
)
def test_a_plane_that_fills_the_kernel_is_lit_at_every_slope(filter_, name, kind, looking, build, studio) -> None:
    for degrees in (0.0, 30.0, 60.0, 75.0):
        view = looking([plate(0.0)], inclined(kind, degrees), 64, eye=(0.5, 3.0, 1.5))
        shot = studio.shot(view)
        mask = build(f"{name}:size=128,filter={filter_}", shot).draw(shot)
        assert mask.min() > 0.999, degrees


@pytest.mark.parametrize("filter_", FILTERS)
def test_far_surrounds_the_map(filter_, looking, build, studio) -> None:
    """Beyond its border the ground is lit, and what is stored there blurs into it."""
    shot = studio.shot(looking([plate(0.0), plate(1.0)], DOWN, 96, eye=(0.3, 0.7, 1.9)))
    one = build(f"shadow-map:filter={filter_}(blur=9),fit=fixed(half=0.5,near=1,far=6,distance=5),size=64", shot)
    mask = one.draw(shot)
    x, _, z = np.moveaxis(shot.position[..., :3] / shot.placement.scale + shot.placement.center, -1, 0)
    ground = (shot.triangle >= 0) & (shot.triangle < 2)
    distance = np.maximum(np.abs(x), np.abs(z)) - 0.5
    outside = ground & (distance > 5.5 / 64)
    assert outside.sum() > 500 and mask[outside].min() > 1 - 1e-5
    inside = ground & (distance < -5.5 / 64)
    assert inside.sum() > 100 and mask[inside].max() < 0.02


def test_mips_are_the_share_of_stripes_narrower_than_a_pixel(looking, build, studio) -> None:
    """Above the camera, three a pixel; without mips a pixel has the depth of a texel."""
    at = 0.1 * np.arange(-120, 120)
    stripes = [plate(50.0, (x, x + 0.05), (-12.0, 12.0)) for x in at.tolist()]
    vertices, faces = np.vstack([one.vertices for one in stripes]), np.arange(len(stripes))[:, None, None] * 4
    roof = Mesh("roof", vertices, (stripes[0].faces + faces).reshape(-1, 3))
    ground = plate(0.0, (-12.0, 12.0), (-12.0, 12.0))
    shot = studio.shot(looking([ground, roof], DOWN, 64, eye=(0.0, 20.0, 0.1)))
    masks = [
        build(f"shadow-map:size=2048,fit=scene,filter=vsm(blur=1,bleed=0,mips={mips})", shot).draw(shot)[8:-8, 8:-8]
        for mips in ("true", "false")
    ]
    assert masks[0].mean() == pytest.approx(0.5, abs=0.05) and masks[0].std() < 0.1
    assert masks[1].std() > 0.3


@pytest.mark.parametrize(
    ("filter_", "name", "kind"),
    by_turns(
        ["vsm", "esm", "evsm(positive=42,negative=42,min_variance=0.01)", "evsm(positive=42)", "msm", "pcss"],
        *TECHNIQUES,
    ),
)
def test_nothing_overflows_over_the_whole_range_of_depths(filter_, name, kind, looking, build, studio) -> None:
    """A roof from the light's plane to the ground; every warp at its largest exponent."""
    corners = np.array([[-2.0, 3.9, -2], [-2, 3.9, 2], [2, 0.0, 2], [2, 0.0, -2]])
    roof = Mesh("roof", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    light = inclined(kind, 10.0)
    shot = studio.shot(looking([plate(0.0, (-9.0, 9.0), (-9.0, 9.0)), roof], light, 64))
    one = build(f"{name}:size=128,filter={filter_}", shot)
    mask = one.draw(shot)
    assert np.isfinite(mask).all() and mask.min() >= 0 and mask.max() <= 1 and 0.02 < (mask < 0.5).mean() < 0.9
