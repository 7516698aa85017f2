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

DOWN = Light("sun", "directional", (0.0, -1.0, 0.0))
FIXED = "fit=fixed(half=2.5,near=1,far=6,distance=5),size=80,bias=none"
TEXEL = 5 / 80  # metres
BLUR = 5
FILTERS = [name for name, row in Filter.table.items() if "blur" in row.model_fields]
LIMITS = "evsm(positive=42,negative=42,min_variance=0.01)"


def plate(name: str, y: float, x: tuple[float, float] = (-2.2, 2.2), z: tuple[float, float] = (-2.2, 2.2)) -> Mesh:
    """A horizontal rectangle."""
    corners = np.array([[x[0], y, z[0]], [x[0], y, z[1]], [x[1], y, z[1]], [x[1], y, z[0]]])
    return Mesh(name, corners, np.array([[0, 1, 2], [0, 2, 3]]))


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
        view = looking([plate("ground", 0.0), *casters], DOWN, 128, eye=(0.3, 0.7, 1.9), target=(0.0, 0.0, -0.2))
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


HEIGHTS = [(1.6, 0.8), (2.0, 0.9), (1.0, 0.9)]  # of the casters over either half


@pytest.fixture
def halves(ground) -> Callable[[float, float], tuple[Ground, np.ndarray]]:
    """The ground under two half-planes, and the (2, N) shares of the kernel that they have."""

    def make(left: float, right: float) -> tuple[Ground, np.ndarray]:
        found = ground(plate("left", left, x=(-2.2, 0.0)), plate("right", right, x=(0.0, 2.2)))
        right_share = share(found.x)
        return found, np.stack([1 - right_share, right_share])

    return make


@pytest.mark.parametrize("heights", HEIGHTS)
def test_vsm_bleeds_by_chebyshev_s_bound_between_two_casters(halves, device, heights) -> None:
    found, weights = halves(*heights)
    expected = chebyshev(np.array([found.depth(height) for height in heights]), weights, found.depth(0.0))
    assert expected.max() > 0.001
    assert found(f"vsm(blur={BLUR},bleed=0,min_variance=0)") == pytest.approx(
        expected,
        abs=2e-4 if device.software else 1e-3,  # GPUs weigh texels with 8 bits
    )


def test_vsm_takes_a_quarter_of_an_inclined_caster_s_squared_change_for_its_variance_in_a_texel(ground) -> None:
    """Which a bilinear read between texels' centres, at t, raises by t(1 − t) of it."""
    low, slope, texel = 0.2, 0.8, 5 / 16
    corners = [[x, low + slope * (x + 2.2), z] for x, z in ((-2.2, -2.2), (-2.2, 2.2), (2.2, 2.2), (2.2, -2.2))]
    ramp = Mesh("ramp", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
    found = ground(ramp, fit=FIXED.replace("size=80", "size=16"))
    metre = found.depth(0.0) - found.depth(1.0)
    between = (found.x / texel - 0.5) % 1.0
    variance = (0.25 + between * (1 - between)) * (slope * texel * metre) ** 2
    behind = (low + slope * (found.x + 2.2)) * metre
    assert found("vsm(blur=1,bleed=0)") == pytest.approx(variance / (variance + behind**2), abs=2e-3)


@pytest.mark.parametrize("heights", HEIGHTS)
@pytest.mark.parametrize(("positive", "negative"), [(4.0, 3.0), (10.0, 5.0)])
def test_evsm_is_the_smaller_bound_of_two_warps(halves, heights, positive, negative) -> None:
    found, weights = halves(*heights)
    depths, z = np.array([found.depth(height) for height in heights]), found.depth(0.0)
    up = [np.exp(positive * (2 * one - 1)) for one in (depths, z)]
    down = [-np.exp(-negative * (2 * one - 1)) for one in (depths, z)]
    items = f"blur={BLUR},positive={positive},negative={negative},min_variance=0"
    first = chebyshev(up[0], weights, up[1])
    assert found(f"evsm({items},components=2)") == pytest.approx(first, abs=5e-4)
    both = np.minimum(first, chebyshev(down[0], weights, down[1]))
    assert found(f"evsm({items})") == pytest.approx(both, abs=5e-4)


@pytest.mark.parametrize("heights", HEIGHTS)
@pytest.mark.parametrize("c", [2.0, 10.0])
def test_esm_is_the_mean_exponential_over_the_receiver_s(halves, heights, c) -> None:
    found, weights = halves(*heights)
    depths = np.array([found.depth(height) for height in heights])
    expected = np.exp(c * (depths - found.depth(0.0))) @ weights
    assert found(f"esm(blur={BLUR},c={c})") == pytest.approx(expected, abs=1e-4)


def test_esm_leaks_wherever_the_kernel_holds_texels_deeper_than_the_receiver(ground) -> None:
    """On a plate beside lower ground: the plate's own edge is lit as by a share of more than 1, which is cut off."""
    found = ground(plate("caster", 1.0, x=(-2.2, 0.0)))
    lit = share(found.x)
    for c in (20.0, 80.0):
        expected = np.minimum((1 - lit) * math.exp(c * (found.depth(1.0) - found.depth(0.0))) + lit, 1.0)
        assert found(f"esm(blur={BLUR},c={c})") == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("heights", HEIGHTS)
def test_msm_bleeds_nothing_between_two_casters(halves, heights) -> None:
    found, weights = halves(*heights)
    mixed = weights.min(axis=0) > 0.1
    lit = found(f"msm(blur={BLUR})")
    assert lit[mixed].max() < 0.03  # the moment bias
    assert lit[mixed].max() < 0.5 * found(f"vsm(blur={BLUR},bleed=0)")[mixed].max() or heights == (1.0, 0.9)


@pytest.mark.parametrize("height", [0.8, 1.2, 2.0])
@pytest.mark.parametrize("filter_", ["vsm", "evsm", "msm"])
def test_a_single_caster_s_bound_is_the_lit_share(ground, filter_, height) -> None:
    """Of a distribution of two depths, the farther one the receiver's: all bounds are sharp."""
    found = ground(plate("caster", height, x=(-2.2, 0.0)))
    lit = found(f"{filter_}(blur={BLUR},bleed=0)")
    inner = np.abs(found.x) < 0.4 * BLUR * TEXEL  # further out a share of 1 is compared with a share of nearly 1
    assert lit[inner] == pytest.approx(share(found.x)[inner], abs=0.02)
    assert lit[found.x > BLUR * TEXEL].min() > 0.999 and lit[found.x < -BLUR * TEXEL].max() < 0.01


@pytest.mark.parametrize("lowest", [0.0, 0.8])
def test_msm_is_exact_for_three_depths_with_the_receiver_s_and_else_between_the_truth_and_vsm(ground, lowest) -> None:
    """Four moments bound more sharply than two; none is below the truth."""
    front = [plate("front", lowest)] if lowest else []
    found = ground(plate("left", 2.0, x=(-2.2, 0.0)), plate("back", 1.4, x=(0.0, 2.2), z=(-2.2, 0.0)), *front)
    right, near = share(found.x), share(found.y)
    weights = np.stack([1 - right, right * (1 - near), right * near])
    depths = np.array([found.depth(height) for height in (2.0, 1.4, lowest)])
    vsm = chebyshev(depths, weights, found.depth(0.0))
    mixed = weights.min(axis=0) > 0.05
    assert mixed.sum() > 50
    msm = found(f"msm(blur={BLUR})")[mixed]
    assert (msm < vsm[mixed] + 1e-4).all() and (msm < vsm[mixed] - 0.01).mean() > 0.5
    if not lowest:
        assert msm == pytest.approx(weights[2][mixed], abs=1e-3)


BLEEDING = {
    "vsm": "vsm(",
    "evsm2": "evsm(components=2,",
    "evsm4": "evsm(",
    "msm32": "msm(",
    "msm16": "msm(bits=16,",
}


@pytest.fixture
def bleeding(ground) -> Callable[[int, float], dict[str, float]]:
    """Mean light at the ground below two or three plates, where the kernel holds all of them, by filter.

    The lowest, 1 m above the ground, covers all of it. far: of the map, below a near plane 19 m above the ground.
    """

    def measure(casters: int, far: float) -> dict[str, float]:
        plates = [plate("lowest", 1.0), plate("left", 18.0 if casters == 3 else 12.0, x=(-2.2, 0.0))]
        if casters == 3:
            plates.append(plate("back", 12.0, x=(0.0, 2.2), z=(-2.2, 0.0)))
        found = ground(*plates, fit=f"fit=fixed(half=2.5,near=1,far={far},distance=20),size=80,bias=none")
        all_in_kernel = np.abs(found.x) < 2 * TEXEL
        if casters == 3:
            all_in_kernel &= np.abs(found.y) < 2 * TEXEL
        assert all_in_kernel.sum() > 50
        return {
            name: float(found(f"{row}blur={BLUR},bleed=0)")[all_in_kernel].mean()) for name, row in BLEEDING.items()
        }

    return measure


@pytest.mark.parametrize("casters", [2, 3])
def test_evsm_bleeds_at_most_half_as_much_as_vsm_and_msm_only_below_two_casters(bleeding, casters: int) -> None:
    bleed = bleeding(casters, 21.0)
    assert bleed["vsm"] > 0.2
    assert max(bleed["evsm2"], bleed["evsm4"]) < 0.5 * bleed["vsm"]
    assert all((bleed[msm] < 0.5 * bleed["vsm"]) == (casters == 2) for msm in ("msm32", "msm16"))


@pytest.mark.parametrize("casters", [2, 3])
def test_a_longer_range_of_depths_adds_to_all_bleeding_but_vsm_s(bleeding, casters: int) -> None:
    """Which is a ratio of depths; EVSM's exponents are of the range, and moments nearer together need a larger bias."""
    short, long = bleeding(casters, 21.0), bleeding(casters, 101.0)
    assert long.pop("vsm") == pytest.approx(short["vsm"], abs=0.005)
    assert all(bleed > short[name] + 0.001 for name, bleed in long.items())


@pytest.mark.parametrize("filter_", ["vsm", "evsm", "msm"])
def test_bleed_reduction_cuts_off_low_bounds_and_stretches_the_others(halves, filter_) -> None:
    found, _ = halves(1.9, 0.8)
    bound = found(f"{filter_}(blur={BLUR},bleed=0)")
    reduced = found(f"{filter_}(blur={BLUR},bleed=0.3)")
    assert reduced == pytest.approx(np.clip((bound - 0.3) / 0.7, 0, 1), abs=1e-5)


SUN = Light("sun", "directional", (0.3, -1.0, 0.2))
TECHNIQUES = {
    "shadow-map": "directional",
    "shadow-map of a spot": "spot",
    "cascades": "directional",
    "cube-map": "spot",
}


def inclined(kind: str, degrees: float) -> Light:
    """A light that falls on the ground at an angle, along no axis of the map."""
    t = math.radians(degrees)
    direction = np.array(unit((0.8 * math.sin(t), -math.cos(t), 0.6 * math.sin(t))))
    if kind == "directional":
        return Light("light", kind, tuple(direction.tolist()))
    return Light("light", kind, tuple(direction.tolist()), tuple((-4 * direction).tolist()), math.radians(60))


@pytest.mark.parametrize("name", TECHNIQUES)
@pytest.mark.parametrize("filter_", [*(f"{one}(blur=9)" for one in FILTERS), "msm(blur=16,kernel=gaussian)"])
def test_a_plane_that_fills_the_kernel_is_lit_at_every_slope(filter_, name, looking, build, studio) -> None:
    for degrees in (0.0, 30.0, 60.0, 75.0):
        view = looking([plate("ground", 0.0)], inclined(TECHNIQUES[name], degrees), 64, eye=(0.5, 3.0, 1.5))
        shot = studio.shot(view)
        mask = build(f"{name.split()[0]}:size=128,filter={filter_}", shot).draw(shot)
        assert mask.min() > 0.999, degrees


@pytest.mark.parametrize("filter_", FILTERS)
def test_far_surrounds_the_map(filter_, looking, build, studio) -> None:
    """Beyond its border the ground is lit, and what is stored there blurs into it."""
    shot = studio.shot(looking([plate("ground", 0.0), plate("caster", 1.0)], DOWN, 96, eye=(0.3, 0.7, 1.9)))
    one = build(f"shadow-map:filter={filter_}(blur=9),fit=fixed(half=0.5,near=1,far=6,distance=5),size=64", shot)
    mask = one.draw(shot)
    x, _, z = np.moveaxis(shot.position[..., :3] / shot.placement.scale + shot.placement.center, -1, 0)
    ground = (shot.triangle >= 0) & (shot.triangle < 2)
    distance = np.maximum(np.abs(x), np.abs(z)) - 0.5
    outside = ground & (distance > 5.5 / 64)
    assert outside.sum() > 500 and mask[outside].min() > 1 - 1e-5
    inside = ground & (distance < -5.5 / 64)
    assert inside.sum() > 100 and mask[inside].max() < 0.02


@pytest.mark.parametrize("name", ["shadow-map", "cascades"])
@pytest.mark.parametrize("filter_", FILTERS)
def test_mips_of_a_plane_far_away_are_lit(filter_, name, looking, build, studio) -> None:
    """Pixels that cover hundreds of texels along the view; at the horizon bounds of higher moments fall below 1."""
    far = plate("ground", 0.0, (-300.0, 300.0), (-600.0, 10.0))
    shot = studio.shot(looking([far], SUN, 64, eye=(0.0, 2.0, 8.0), target=(0.0, 0.0, -20.0)))
    mask = build(f"{name}:size=1024,filter={filter_}(mips=true)", shot).draw(shot)
    if filter_ == "esm" or (filter_, name) == ("vsm", "shadow-map"):
        assert mask.min() > 0.999
    assert mask.mean() > 0.97


def test_mips_are_the_share_of_stripes_narrower_than_a_pixel(looking, build, studio) -> None:
    """Above the camera, three a pixel; without mips a pixel has the depth of a texel."""
    at = 0.1 * np.arange(-120, 120)
    stripes = [plate("stripe", 50.0, (x, x + 0.05), (-12.0, 12.0)) for x in at.tolist()]
    vertices, faces = np.vstack([one.vertices for one in stripes]), np.arange(len(stripes))[:, None, None] * 4
    roof = Mesh("roof", vertices, (stripes[0].faces + faces).reshape(-1, 3))
    ground = plate("ground", 0.0, (-12.0, 12.0), (-12.0, 12.0))
    shot = studio.shot(looking([ground, roof], DOWN, 64, eye=(0.0, 20.0, 0.1)))
    masks = [
        build(f"shadow-map:size=2048,fit=scene,filter=vsm(blur=1,bleed=0,mips={mips})", shot).draw(shot)[8:-8, 8:-8]
        for mips in ("true", "false")
    ]
    assert masks[0].mean() == pytest.approx(0.5, abs=0.05) and masks[0].std() < 0.1
    assert masks[1].std() > 0.3


@pytest.mark.parametrize("filter_", ["vsm", "esm", LIMITS, "evsm(components=2,positive=42)", "msm", "pcss"])
@pytest.mark.parametrize("name", TECHNIQUES)
def test_nothing_overflows_over_the_whole_range_of_depths(filter_, name, looking, build, studio) -> None:
    """A roof from the light's plane to the ground; every warp at its largest exponent."""
    corners = np.array([[-2.0, 3.9, -2], [-2, 3.9, 2], [2, 0.0, 2], [2, 0.0, -2]])
    roof = Mesh("roof", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    light = inclined(TECHNIQUES[name], 10.0)
    shot = studio.shot(looking([plate("ground", 0.0, (-9.0, 9.0), (-9.0, 9.0)), roof], light, 64))
    one = build(f"{name.split()[0]}:size=128,filter={filter_}", shot)
    mask = one.draw(shot)
    assert np.isfinite(mask).all() and mask.min() >= 0 and mask.max() <= 1 and 0.02 < (mask < 0.5).mean() < 0.9


@pytest.mark.parametrize("filter_", FILTERS)
def test_receivers_at_1e5_metres_are_shadowed_as_by_a_depth_map(filter_, looking, build, studio) -> None:
    """Over a short range of depths; the ground has other meshes 100 km away."""
    at = 1e5
    casters = [plate("caster", 16.0, (at - 8, at + 8), (-8.0, 8.0)), plate("home", 0.0)]
    sun = Light("sun", "directional", (0.9, -1.0, 0.3))
    ground = plate("ground", 0.0, (at - 40, at + 40), (-40.0, 40.0))
    view = looking([ground, *casters], sun, 128, eye=(0.0, 1e5, 0.0), target=(at, 0.0, 0.0), fov=0.025)
    shot = studio.shot(view)
    masks = [build(f"shadow-map:filter={one}", shot).draw(shot) for one in (filter_, "hardware")]
    shadow = (masks[1] < 0.5).mean()
    assert 0.01 < shadow < 0.9
    assert ((masks[0] < 0.5) != (masks[1] < 0.5)).mean() < 0.1 * shadow


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
    assert (exact.technique.map.contents.texture.dtype, rounded.technique.map.contents.texture.dtype) == ("f4", dtype)
    # GPUs weigh halves with 8 bits: .011 on an H100.
    assert 0 < np.sqrt(np.mean(difference**2)) < (0.005 if device.software else 0.02)


@pytest.mark.parametrize(("filter_", "bias"), [("msm(bits=16", 6e-5), ("msm(bits=32", 3e-6)])
def test_the_moment_bias_is_the_published_one_for_the_bits(filter_: str, bias: float, builtin, mask) -> None:
    view = builtin("sphere-and-torus", 96)
    default = mask(f"shadow-map:filter={filter_})", view)
    assert np.array_equal(default, mask(f"shadow-map:filter={filter_},bias={bias})", view))
    assert not np.array_equal(default, mask(f"shadow-map:filter={filter_},bias={10 * bias})", view))
