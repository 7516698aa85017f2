"""Filters over wide kernels and discs, whose answers under a half-plane and a vertical sun are closed forms."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.scenes.model import Light, Mesh
from tests.samples import by_turns

HEIGHT, DISTANCE = 2.0, 10.0  # of the half-plane above the ground, of the map's origin above it, in metres
HALF, SIZE = 4.0, 2048  # of the map
TEXEL = 2 * HALF / SIZE
RADIUS = 0.05  # of the sun, in radians

Answer = tuple[np.ndarray, np.ndarray]


@pytest.fixture
def under_edge(looking, shape, studio, build) -> Callable[..., Answer]:
    """Distances of the ground's pixels from the edge's shadow, in metres towards the light, and their visibility."""

    def draw(filter_: str, near: float = 1.0, far: float = 14.0, size: int = SIZE) -> Answer:
        sheet = shape("plane", (6.0, 1.0, 6.0), (3.0, HEIGHT, 0.0))
        light = Light("sun", "directional", (0.0, -1.0, 0.0), radius=RADIUS)
        shot = studio.shot(looking([shape("plane", 8.0), sheet], light, 96, eye=(0.0, 1.0, 1.2), fov=36.0))
        fit = f"fixed(half={HALF},near={near},far={far},distance={DISTANCE})"
        spec = f"shadow-map:size={size},fit={fit},bias=constant(world=0.01),filter={filter_}"
        visibility = build(spec, shot).draw(shot)
        ground = shot.position[..., 3] > 0
        across = shot.position[..., 0] / shot.placement.scale + shot.placement.center[0]
        return -across[ground], visibility[ground]

    return draw


def disc_share(across: np.ndarray, radius: float) -> np.ndarray:
    """Share of a disc on the lit side of a line at a distance from its centre."""
    x = np.clip(across / radius, -1, 1)
    return 0.5 + (x * np.sqrt(1 - x**2) + np.arcsin(x)) / math.pi


@pytest.mark.parametrize(
    "filter_", ["pcf-disc(pattern=vogel,width=48,taps=64)", "pcf-disc(pattern=poisson,width=48,taps=32)"]
)
def test_a_disc_across_an_edge_is_the_share_of_its_area(under_edge, filter_: str) -> None:
    across, visibility = under_edge(filter_)
    assert np.sqrt(np.mean((visibility - disc_share(across, 48 * TEXEL)) ** 2)) < 0.02


def test_before_a_light_of_nearly_no_size_an_edge_is_as_wide_as_a_texel_s_diagonal(under_edge) -> None:
    """So that its pixels are not the map's texels."""
    across, visibility = under_edge("pcss(angle=1e-4,search=64,taps=64)", size=128)
    expected = disc_share(across, math.sqrt(0.5) * 2 * HALF / 128)
    assert ((expected > 0.1) & (expected < 0.9)).mean() > 0.02
    assert np.sqrt(np.mean((visibility - expected) ** 2)) < 0.04


def test_an_inclined_receiver_is_no_blocker_of_its_own(looking, shape, studio, build) -> None:
    """Its penumbra is as wide as the distance to the sheet that casts it; the sheet faces the sun."""
    tilt, gap = math.radians(60.0), 3.0
    toward, aside = np.array([math.sin(tilt), math.cos(tilt), 0.0]), np.array([math.cos(tilt), -math.sin(tilt), 0.0])
    corners = [gap * toward + s * aside + [0.0, 0.0, z] for s, z in ((0.0, -4.0), (3.0, -4.0), (3.0, 4.0), (0.0, 4.0))]
    sheet = Mesh("sheet", np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    light = Light("sun", "directional", tuple((-toward).tolist()), radius=RADIUS)
    shot = studio.shot(looking([shape("plane", 8.0), sheet], light, 96, eye=(-0.6, 1.5, 0.3), fov=36.0))
    fit = f"fixed(half={HALF},near=1,far=20,distance={DISTANCE})"
    spec = f"shadow-map:size={SIZE},fit={fit},bias=constant(world=0.01),filter=pcss(search=64,taps=64)"
    visibility = build(spec, shot).draw(shot)
    ground = (shot.triangle >= 0) & (shot.triangle < 2)
    points = shot.position[..., :3][ground] / shot.placement.scale + shot.placement.center
    expected = disc_share(-points @ aside, math.tan(RADIUS) * (gap - points @ toward))
    assert ((expected > 0.1) & (expected < 0.9)).mean() > 0.05
    assert np.sqrt(np.mean((visibility[ground] - expected) ** 2)) < 0.04


def published(variant: str, near: float, far: float) -> float:
    """Radius of a variant's penumbra under the half-plane, in metres, by depths z and b of [0, 1]."""
    z, b = (DISTANCE - near) / (far - near), (DISTANCE - HEIGHT - near) / (far - near)
    side = 2 * HALF
    if variant == "world":
        return math.tan(RADIUS) * HEIGHT
    if variant == "godot":  # its disc's radius is the sun's diameter
        return math.tan(2 * RADIUS) * z * (far - near) * (z - b) / b
    if variant == "filament":
        return 0.4 * (z - b) / b
    if variant == "bevy":
        fudge = 0.015 + (TEXEL - 0.00390625) / (0.022949219 - 0.00390625) * (0.035 - 0.015)
        return fudge * max((z - b) * 3 / (1 - z), 0.5)
    if variant == "babylon":
        return (z - b + 10 / SIZE) * 0.1 * side
    return (z - b) / b * 0.01 * side * 9.5 / z


LIGHTS = {
    "world": "",
    "godot": "",
    "filament": ",light=0.4",
    "bevy": ",light=3",
    "babylon": "",
    "three": ",light=0.01",
}


@pytest.mark.parametrize(
    ("variant", "near", "far"), by_turns([*LIGHTS, *LIGHTS], [1.0, 6.0, 1.0, 1.0], [14, 14, 11.5, 14])
)
def test_penumbrae_of_the_variants_are_as_wide_as_published(under_edge, variant: str, near: float, far: float) -> None:
    across, visibility = under_edge(f"pcss(variant={variant},search=64,taps=64{LIGHTS[variant]})", near, far)
    radius = published(variant, near, far)
    expected = disc_share(across, radius)
    if variant == "babylon":
        expected += (1 - expected) * HEIGHT / (far - near)  # its shadows lighten with the depth
    seen = np.abs(across) < 0.9 * radius
    assert seen.sum() > 200
    assert np.sqrt(np.mean((visibility - expected)[seen] ** 2)) < 0.04


@pytest.mark.parametrize("near", [1.0, 6.0])
def test_dpcf_sharpens_the_share_of_shadowed_taps_by_the_ratio_of_depths(under_edge, near: float) -> None:
    across, visibility = under_edge("dpcf(taps=256,bulb=0.25)", near)
    share = 1 - disc_share(across, 0.25)
    s = 2 * share - 1
    hardened = 0.5 + 0.5 * np.sign(s) * (1 - (1 - np.abs(s)) ** 3)
    ratio = min(HEIGHT / (DISTANCE - HEIGHT - near), 1.0)
    assert np.sqrt(np.mean((1 - visibility - hardened * (1 - ratio) - share * ratio) ** 2)) < 0.02
