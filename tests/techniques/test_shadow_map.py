"""Settings of the shadow map, good and bad: each has the effect that it demonstrates."""

import numpy as np
import pytest

from shadowbench.scenes.model import Light
from shadowbench.truths.trace import trace
from tests.samples import by_turns, pairs

SIZE = 96
ROUNDED = 8 * 2.0**-24  # of two depths near 1, and four steps of polygon-offset, which are smaller near 0
SCENES = {"directional": "sphere-and-torus", "spot": "spot-lamp"}


@pytest.mark.parametrize(
    ("kind", "bias", "filter_"),
    pairs(
        SCENES,
        ["constant(0.005)", "polygon-offset", "texel", "receiver-plane", "two-planes"],
        ["hard", "hardware", "dither-4"],
    ),
)
def test_reversed_depth_shadows_what_forward_depth_does(kind, bias, filter_, builtin, mask, device) -> None:
    if not device.clip_control:
        pytest.skip("no clip control")
    view, spec = builtin(SCENES[kind], SIZE), f"shadow-map:fit=scene,size=256,filter={filter_},bias={bias}"
    forward, backward = (mask(f"{spec},reversed={way}", view) for way in ("false", "true"))
    lighter, other = (mask(f"{spec}+constant({ROUNDED}),reversed={way}", view) for way in ("false", "true"))
    assert (forward < 0.5).mean() > 0.02
    assert (backward <= lighter).all() and (forward <= other).all()
    assert (forward < lighter - 0.01).mean() < 0.005


@pytest.mark.parametrize("filter_", ["hard", "hardware", "pcf(3)"])
def test_repeat_shadows_what_the_map_never_saw_and_border_does_not(shape, looking, sun, mask, studio, filter_) -> None:
    """A map of 1.6 m around a box of 1 m on a ground of 12 m: its repeats fall all over the ground."""
    view = looking([shape("plane", 12.0), shape("box", 0.5, (0.0, 0.25, 0.0))], sun(60, 150), 128, eye=(4.0, 6.0, 5.0))
    shot = studio.shot(view)
    outside = np.linalg.norm(shot.position[..., :3] / shot.placement.scale + shot.placement.center, axis=-1) > 2.0
    spec = f"shadow-map:fit=fixed(half=0.8,near=1,far=20,distance=10),size=128,bias=constant(0.002),filter={filter_}"
    border, edge, repeat = (mask(f"{spec},wrap={wrap}", view) for wrap in ("border", "edge", "repeat"))
    assert (border[outside] == 1).all()
    assert (edge[outside] == 1).mean() > 0.5
    assert (repeat[outside] < 0.5).mean() > 0.05
    inside = ~outside & (shot.triangle >= 0)
    assert (border[inside] < 0.5).sum() > 10


@pytest.mark.parametrize(
    ("reversed_", "depth", "filter_"), pairs(["false", "true"], ["d16", "d24", "d32f"], ["hard", "hardware"])
)
def test_without_a_far_rule_all_beyond_the_far_plane_is_in_shadow(
    reversed_, depth, filter_, shape, looking, sun, mask, studio, device
) -> None:
    """A ground seen by a light 10 m away whose far plane lies at 10 m: half of the ground is beyond it."""
    if reversed_ == "true" and not device.clip_control:
        pytest.skip("no clip control")
    light = sun(40)
    view = looking([shape("plane", 6.0)], light, SIZE, eye=(1.0, 5.0, 1.0))
    shot = studio.shot(view)
    position = shot.position[..., :3] / shot.placement.scale + shot.placement.center
    beyond = position @ np.asarray(light.direction)  # metres past the plane through the origin
    spec = f"shadow-map:fit=fixed(half=6,near=1,far=10,distance=10),size=256,bias=constant(0.02),depth={depth}"
    spec += f",filter={filter_},reversed={reversed_}"
    none, lit = (mask(f"{spec},far_rule={rule}", view) for rule in ("none", "lit"))
    hit, margin = shot.triangle >= 0, 0.3
    assert (hit & (beyond > margin)).sum() > 500 and (hit & (beyond < -margin)).sum() > 500
    assert (none[hit & (beyond > margin)] == 0).all()
    assert (none[beyond < -margin] == 1).all() and (lit[beyond < -margin] == 1).all()
    assert (lit[hit & (beyond > margin)] == 1).all()


def test_16_bits_are_too_few_for_a_deep_perspective_map(shape, looking, spot, studio, build, scored) -> None:
    """A mote a millimetre before a lamp that shines 8 m far pulls near to far/10⁴.

    A step of 16 bits is then 8 m · 10⁴ / 2¹⁶ = 1.2 m at the ground, more than the ball on it is high; of 24 bits 5 mm.
    """
    lamp = spot((0.2, 8.0, 0.3), angle=40)
    mote = shape("plane", 1e-5, (0.2, 7.999, 0.3))
    view = looking([shape("plane", 5.0), shape("sphere", 1.0, (0.0, 0.5, 0.0)), mote], lamp, 256)
    shot, truth = studio.shot(view), trace(view, pixel_samples=1)
    iou = {}
    for depth in ("d16", "d24", "d32f"):
        one = build(f"shadow-map:fit=scene,bias=texel(scale=1,limit=8,ulps=4),size=1024,depth={depth}", shot)
        iou[depth] = scored(one.draw(shot), truth)["iou"]
    assert one.technique.light_view.far / one.technique.light_view.near == pytest.approx(1e4)
    assert iou["d16"] < 0.1
    assert iou["d24"] > 0.95 and iou["d32f"] > 0.95


@pytest.mark.parametrize(
    ("bias", "fit", "size"),
    by_turns(["texel", "constant(0.05)", "slope", "receiver-plane", "two-planes"], ["visible", "view"], [64, 256]),
)
def test_a_caster_in_front_of_the_near_plane_shadows_under_every_bias(size, fit, bias, shape, looking, mask, studio):
    """A low sun behind a block that stands far outside the picture: all that is seen lies in its shadow."""
    low = Light("sun", "directional", (1.0, -0.0875, 0.0))
    view = looking([shape("plane", 80.0), shape("box", 20.0, (-25.0, 10.0, 0.0))], low, 64, eye=(3.0, 4.0, 3.0))
    dark = mask(f"shadow-map:size={size},fit={fit},bias={bias}", view)
    assert (dark[studio.shot(view).triangle >= 0] == 0).all()
