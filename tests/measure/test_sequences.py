"""Frames of sequences, drawn in order by cells that stay built: what they remember, and that no others do."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.errors import InputError, Unsupported
from shadowbench.gl.gbuffer import download
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.registry import own_techniques, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Camera, Light, Scene, View, view_of
from shadowbench.scenes.vectors import rotation
from shadowbench.scores import PreparedTruth, score
from shadowbench.scores.masks import greatest
from shadowbench.truths.trace import trace

SIZE = 64
SUN = Light("sun", "directional", (0.5, -1.0, -0.3))
LIGHTS = {
    "directional": SUN,
    "spot": Light("spot", "spot", (1.7, -3.0, -1.5), (-1.7, 3.2, 1.3), 1.0),
    "point": Light("point", "point", position=(-1.0, 2.2, 0.8)),
}
BITS = 1 / 65535
Draw = Callable[..., list[Rendering]]


@pytest.fixture
def call(lent_worker) -> Iterator[Callable]:
    with lent_worker() as worker:
        yield worker.call


@pytest.fixture
def draw(call) -> Draw:
    """A spec drawn in views in turn, as the frames of a sequence."""

    def frames(spec: str, views: Sequence[View]) -> list[Rendering]:
        return [call(Session.draw, view, CellRequest(spec), index=index) for index, view in enumerate(views)]

    return frames


@pytest.fixture
def alone(call) -> Draw:
    """A spec drawn in each view, as if there were no other."""

    def frames(spec: str, views: Sequence[View], phase: Callable[[int], int] = lambda _: 0) -> list[Rendering]:
        return [call(Session.draw, view, CellRequest(spec, phase(index))) for index, view in enumerate(views)]

    return frames


def masks(drawn: Sequence[Rendering]) -> np.ndarray:
    return np.stack([one.visibility for one in drawn])


def shifted(light: Light, by: float) -> Light:
    moved = {name: tuple(np.add(getattr(light, name), [by, 0, by])) for name in ("direction", "position")}
    return replace(light, **moved)


@pytest.fixture
def moving(shape) -> Callable[..., list[View]]:
    """Views of a floor with a box, by frame: where a ball is, which is out of view, and what light and camera move by.

    Far away, the ball enlarges the bounds and changes the local coordinates.
    """
    still = shape("plane", 6.0), shape("box", 0.5, (0.6, 0.25, 0.2))

    def views(light: Light = SUN, ball=(-0.4,), by=(0.0,), pan=(0.0,), size: int = SIZE, more=()) -> list[View]:
        count, scenes, made = max(map(len, (ball, by, pan))), dict[float, Scene](), []
        for frame in range(count):
            x, light_by, side = (values[min(frame, len(values) - 1)] for values in (ball, by, pan))
            camera = Camera("camera", (1.6 + side, 1.0, 2.4), (0.1 + side, 0.0, 0.0), 0.7)
            ball_mesh = shape("sphere", 0.6, (x, 1.2, 0.3), subdivisions=2)
            scene = scenes.setdefault(x, Scene("ball", (*still, *more, ball_mesh), (camera,), (light,)))
            made.append(view_of(scene, camera, shifted(light, light_by), size))
        return made

    return views


FAR = 20.0
CELLS = [(one.name, kind) for one in own_techniques() for kind in sorted(one.lights)]


@pytest.mark.parametrize(("spec", "kind"), CELLS)
def test_without_memory_a_frame_of_a_sequence_is_the_frame_alone(spec, kind, moving, draw, alone) -> None:
    """Camera, light and geometry move, and with it the local coordinates."""
    views = moving(LIGHTS[kind], ball=(-0.4, -0.4, -0.1, FAR), by=(0, 0.05, 0.1), pan=(0, 0.1, 0.2, 0.3))
    frames, single = draw(spec, views), alone(spec, views[::-1])[::-1]
    assert np.array_equal(masks(frames), masks(single))
    assert [one.work for one in frames] == [one.work for one in single]
    assert spec == "unshadowed" or not np.array_equal(frames[1].visibility, frames[2].visibility)


def test_frames_out_of_order_are_refused_in_one_line(moving, call, draw) -> None:
    first, second, _ = views = moving(by=(0, 0.1, 0.2))
    cell, other = CellRequest("shadow-map"), CellRequest("unshadowed")
    wider = replace(second, size=second.size.times(2))
    draw(cell.spec, views[:2])
    for view, request, index in ((first, cell, 3), (first, cell, 1), (first, other, 2), (wider, cell, 2)):
        with pytest.raises(CellFailed, match=f"frame {index} of {request.spec} after frame 1 of shadow-map; allowed"):
            call(Session.draw, view, request, index=index)
    assert call(Session.draw, first, cell, index=2)  # it has gone on all the while


# Maps whose windows rest while only the camera moves, and those that follow it.
RESTING = [
    ("shadow-map:fit=scene", "directional"),
    ("shadow-map:fit=scene,bias=two-planes", "spot"),
    ("cube-map:size=256", "point"),
    ("cube-map:size=64,filter=evsm,layers=geometry", "spot"),
]
FOLLOWING = [
    ("shadow-map:filter=vsm", "directional"),
    ("cascades:count=3,size=128,filter=evsm,box=sphere,stable=true", "directional"),
    ("cascades:count=2,size=128,layers=geometry,select=depth", "directional"),
]


@pytest.mark.parametrize(("spec", "kind"), RESTING)
def test_between_redraws_the_shadow_is_that_of_the_earlier_light(spec, kind, moving, draw, alone) -> None:
    """From the new camera, to the bit; and no caster is drawn."""
    lights, pan = np.arange(6) * 0.04, np.arange(6) * 0.1
    views, stale = moving(LIGHTS[kind], by=lights, pan=pan), moving(LIGHTS[kind], by=np.repeat(lights[::3], 3), pan=pan)
    every, always = draw(f"{spec},update=every(n=3)", views), masks(alone(spec, views))
    assert np.array_equal(masks(every), masks(alone(spec, stale)))
    assert [np.array_equal(one.visibility, other) for one, other in zip(every, always, strict=True)] == [
        index % 3 == 0 for index in range(6)
    ]
    assert [one.work["vertices"] > 100 for one in every] == [index % 3 == 0 for index in range(6)]
    if "evsm" in spec:
        assert every[0].work["reads"] > every[1].work["reads"] == every[2].work["reads"]
    assert {one.gpu_bytes for one in every} == {alone(spec, views[:1])[0].gpu_bytes}


@pytest.mark.parametrize(("spec", "kind"), RESTING + FOLLOWING)
def test_between_redraws_a_moved_caster_leaves_its_shadow_behind(spec, kind, moving, draw, alone) -> None:
    """Built again for the new geometry, it still has the map, also in other local coordinates."""
    views = moving(LIGHTS[kind], ball=(-0.4, -0.1, 0.1, FAR))
    drawn, fresh = masks(draw(f"{spec},update=every(n=3)", views)), masks(alone(spec, views))
    assert np.array_equal(drawn[1], fresh[0]) and np.array_equal(drawn[2], fresh[0])
    assert np.abs(drawn[3] - fresh[3]).mean() < 1e-3 and not np.array_equal(fresh[3], fresh[0])
    assert not np.array_equal(fresh[1], fresh[0])


@pytest.mark.parametrize(("spec", "kind"), RESTING + FOLLOWING)
def test_a_map_redrawn_where_needed_is_always_right(spec, kind, moving, draw, alone) -> None:
    """The camera pans in frames 2 and 3, the light moves in 5, the ball in 7."""
    views = moving(LIGHTS[kind], pan=(0, 0, 0.1, 0.2), by=[0] * 5 + [0.05], ball=[-0.4] * 7 + [-0.1, -0.1])
    needed = draw(f"{spec},update=needed", views)
    assert np.array_equal(masks(needed), masks(alone(spec, views)))
    redrawn = [index for index, one in enumerate(needed) if one.work["vertices"] > 100]
    assert redrawn == ([0, 5, 7] if (spec, kind) in RESTING else [0, 2, 3, 5, 7])


JITTERED = "shadow-map:fit=scene,size=96,filter=hard"


@pytest.mark.parametrize("spec", [JITTERED, "cascades:count=2,size=96,filter=hard", "shadow-volume:compare=depth"])
def test_an_exponential_history_is_the_sum_of_its_frames(spec, moving, draw, alone) -> None:
    """x = α Σ (1 − α)ʲ c_(k − j), and of the first frame the rest; also where the local coordinates change."""
    views, alpha = moving(by=np.arange(9) * 0.03, ball=[-0.4] * 7 + [FAR]), 0.3
    phased = techniques()[spec.partition(":")[0]].phased
    frames = masks(alone(spec, views, lambda index: index % 4 * phased)).astype(float)
    expected = frames[0]
    for k, drawn in enumerate(masks(draw(f"{spec},history=exponential(alpha={alpha},jitter=4)", views))):
        expected = alpha * frames[k] + (1 - alpha) * expected
        assert np.abs(drawn - expected).max() <= (1 if k < 7 else 300) * BITS
        assert (np.abs(drawn - frames[k]) > 0.2).any() == (k > 0)
        expected = np.where(np.abs(drawn - expected) < 2 * BITS, expected, drawn)


def test_a_history_lags_by_the_frames_that_its_share_says(moving, draw, alone) -> None:
    """After a step of the light, the frames missed add up to (1 − α)/α."""
    views, spec, alpha = moving(by=[0.0] + [0.1] * 40), "shadow-volume", 0.25
    missed = np.abs(masks(draw(f"{spec}:history=exponential(alpha={alpha})", views)) - masks(alone(spec, views)))
    changed = missed[1] > 0.5
    assert changed.sum() > 20 and np.allclose(missed[1:].sum(axis=0)[changed], (1 - alpha) / alpha, atol=1e-3)
    assert (missed[:, ~changed] == 0).all()


@pytest.mark.parametrize("history", ["exponential", "confidence"])
def test_a_still_view_converges_to_sharper_edges_than_the_maps(history, builtin, draw) -> None:
    view = builtin("stairs", 96)
    frames = draw(f"shadow-map:size=128,filter=hard,history={history}", [view] * 61)
    truth = PreparedTruth(trace(view, pixel_samples=1).arrays())
    first, last = (1 - score(frames[index].visibility, truth)["iou"] for index in (0, 60))
    assert first > 0.04 and last < 0.25 * first


@pytest.mark.parametrize(
    "spec", ["shadow-volume:history=exponential", f"{JITTERED},history=confidence", f"{JITTERED},update=every(n=9)"]
)
def test_frame_0_forgets_and_others_do_not(spec, moving, studio, build) -> None:
    first, second = (studio.shot(view) for view in moving(by=(0.0, 0.2)))
    fresh, used = build(spec, second), build(spec, first)
    expected = [fresh.draw(second), fresh.draw(first)]
    before = [used.draw(shot) for shot in (first, second, second, first)]
    used.frames = 0
    assert np.array_equal([used.draw(second), used.draw(first)], expected) and not np.array_equal(before[2:], expected)


def test_a_point_has_the_history_of_its_place_from_another_camera(moving, draw, alone, shape) -> None:
    """All but edges, which are resampled: nothing is dragged along, and what a lit panel hid is as dark as it is."""
    panel_and_roof = shape("box", [0.05, 0.6, 0.6], (1.3, 0.75, 1.95)), shape("box", [3.0, 0.1, 3.0], (0.0, 3.0, 0.0))
    light = replace(SUN, direction=(0.2, -1.0, 0.1))
    views = moving(light, pan=np.arange(8) * 0.11, size=96, more=panel_and_roof)
    drawn, exact = (
        masks(draw("shadow-volume:history=exponential(alpha=0.1)", views)),
        masks(alone("shadow-volume", views)),
    )
    for frame, own in zip(drawn, exact, strict=True):
        edge = greatest(own, 8) != -greatest(-own, 8)
        assert (np.abs(frame - own)[~edge] < 2 * BITS).all() and (~edge).mean() > 0.2
        assert 0.2 < own.mean() < 0.9
    assert np.abs(drawn[7] - exact[7]).max() > 0.05


def test_what_moves_as_a_whole_has_the_history_that_it_has_at_rest(moving, draw) -> None:
    """Surfaces, camera and light are carried around; the light steps aside, so that the frames before count."""

    def carried(view: View, k: int) -> View:
        turn, shift = rotation((0.0, 1.0, 0.0), 0.2 * k), k * np.array([0.3, 0.1, -0.2])
        meshes = tuple(replace(mesh, vertices=mesh.vertices @ turn.T + shift) for mesh in view.scene.meshes)
        camera = {name: tuple(turn @ getattr(view.camera, name) + shift) for name in ("position", "target")}
        light = replace(view.light, direction=tuple(turn @ view.light.direction))
        return view_of(replace(view.scene, meshes=meshes), replace(view.camera, **camera), light, view.size)

    still, spec = moving(by=[0.0, 0.2, 0.2, 0.2]), "shadow-volume:history=exponential(alpha=0.3)"
    drawn, expected = masks(draw(spec, [carried(view, k) for k, view in enumerate(still)])), masks(draw(spec, still))
    assert (np.abs(expected - np.round(expected)) > 0.1).sum() > 50
    assert (np.abs(drawn - expected) > BITS).sum() < 5


@pytest.mark.parametrize("technique", own_techniques(), ids=lambda one: one.name)
def test_any_technique_has_a_history_on_top(technique, moving, draw, alone) -> None:
    """Of the whole share it is the frame alone. It takes 36 bytes and reads four texels per pixel."""
    views = moving(LIGHTS[min(technique.lights)], by=(0, 0.1))
    drawn = draw(f"{technique.name}:history=exponential(alpha=1,jitter=1)", views)
    plain = alone(technique.name, views)
    assert np.array_equal(masks(drawn), masks(plain))
    assert drawn[0].gpu_bytes - plain[0].gpu_bytes == 36 * SIZE**2
    assert drawn[1].work["reads"] - plain[1].work.get("reads", 0) == 4 * SIZE**2
    half = masks(draw(f"{technique.name}:history=exponential(alpha=0.5,jitter=1)", views))[1]
    assert np.abs(half - masks(plain).mean(axis=0)).max() <= BITS


@pytest.mark.parametrize(("spec", "layer"), [(JITTERED, None), ("cascades:count=1,size=96", 0)])
def test_the_confidence_is_the_distance_to_a_texels_centre(spec, layer, moving, studio, build) -> None:
    shot = studio.shot(moving()[0])
    separator = "," if ":" in spec else ":"
    built = build(f"{spec}{separator}bias=none,history=confidence", shot)
    built.draw(shot)
    technique = built.technique
    view = technique.light_view if layer is None else technique.light_views[layer]
    uv = shot.position @ view.to_map().T
    within = uv[..., :2] * 96 % 1
    confidence = 1 - 2 * np.abs(within - 0.5).max(axis=-1)
    clear = (shot.triangle >= 0) & (np.abs(within - 0.5).max(axis=-1) < 0.499)
    assert clear.sum() > 500 and np.abs(download(technique.confidence())[..., 0] - confidence)[clear].max() < 2e-3


def test_what_cannot_remember_says_so(moving, call) -> None:
    with pytest.raises(
        Unsupported, match="history=confidence needs a shadow map's texels, which shadow-volume has not"
    ):
        call(Session.draw, moving()[0], CellRequest("shadow-volume:history=confidence"))
    with pytest.raises(InputError, match="drawn several times a frame; allowed: one that remembers no frames"):
        parse_spec("light-samples:of=shadow-map(update=needed)", techniques())
    assert not {"update", "history"} & set(parse_spec("shadow-map", techniques()).full_text.split("="))
