"""Points of surfaces through frames in which camera, light and meshes move."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.measure.points import Points, motion_scores
from shadowbench.measure.scoring import positions
from shadowbench.options import ViewSize
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.vectors import perpendicular_basis, unit, vec3
from shadowbench.truths.trace import Truth, trace
from tests.parallel import parallel

SIZE = ViewSize(48, 36)


@cache
def first(orthographic: bool = False) -> View:
    scene = load_scene("cube-on-plane")
    return parallel(scene, SIZE) if orthographic else view_of(scene, scene.cameras[0], scene.lights[0], SIZE)


def later(view: View, across: float = 0.0, ahead: float = 0.0, sun: float = 0.0, cube: float = 0.0) -> View:
    """The view of a camera that has moved by shares of its distance, its sun turned by degrees, its cube moved."""
    camera, light = view.camera, view.light
    right, _, back = camera.basis()
    position = np.add(camera.position, np.linalg.norm(np.subtract(camera.position, camera.target)) * -ahead * back)
    aside = 3 * across * right
    camera = replace(camera, position=vec3(position + aside), target=vec3(camera.target + aside), near=None, far=None)
    away = np.tan(np.radians(sun)) * perpendicular_basis(unit(light.direction), camera.up)[0]
    light = replace(light, direction=vec3(unit(light.direction) + away))
    plane, box = view.scene.meshes
    box = replace(box, vertices=box.vertices + np.array([cube, 0, 0]))
    return view_of(replace(view.scene, meshes=(plane, box)), camera, light, view.size)


@cache
def traced(orthographic: bool, *steps: tuple[float, ...]) -> Sequence[Truth]:
    return [trace(later(first(orthographic), *step), 1) for step in steps]


def projected(view: View, points: np.ndarray) -> np.ndarray:
    """(N, 2) columns and rows of points (N, 3), by the matrices that OpenGL is given."""
    to_camera = (points - view.camera.position) @ view.camera.basis().T
    clip = np.concatenate([to_camera, np.ones((len(points), 1))], axis=1) @ view.projection.T
    x, y = (clip[:, axis] / clip[:, 3] for axis in (0, 1))
    return np.stack([(1 + x) / 2 * view.size.width - 0.5, (1 - y) / 2 * view.size.height - 0.5], axis=1)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("step", [(0.04, 0.0, 0.0, 0.0), (-0.1, 0.1, 0.0, 0.0), (0.02, 0.0, 0.0, 0.15)])
def test_points_are_where_their_surface_is(orthographic: bool, step: tuple[float, ...]) -> None:
    was, now = traced(orthographic, (), step)
    points = Points()
    start, seen = points.see(was), points.see(now)
    assert np.array_equal(start.pixel, np.flatnonzero(was.receivers & ~was.undecided)) and start.read.all()
    own = was.triangle.ravel()[start.pixel]
    places = positions(was.view, was.triangle).reshape(-1, 3)[start.pixel] + was.view.camera.position
    on_cube = own >= 2  # the plane has two triangles
    places += np.where(on_cube[:, np.newaxis], [step[3], 0, 0], 0)
    at = projected(now.view, places)
    nearest = np.rint(at).astype(int)
    kept = seen.kept
    assert np.array_equal(seen.pixel[: len(kept)], nearest[kept, 1] * SIZE[0] + nearest[kept, 0])
    inside = ((nearest >= 0) & (nearest < SIZE)).all(axis=1)
    shown = np.full(len(own), -1)
    shown[inside] = now.triangle[nearest[inside, 1], nearest[inside, 0]]
    # All that show their triangle are kept, but for the younger of two at a pixel, and none that shows the other mesh.
    assert set(nearest[shown == own, 1] * SIZE[0] + nearest[shown == own, 0]) <= set(seen.pixel[: len(kept)])
    assert ((shown >= 2) == on_cube)[kept].all() and len(set(seen.pixel)) == len(seen.pixel) > 0.5 * len(own)
    assert set(seen.pixel) >= set(np.flatnonzero(now.receivers & ~now.undecided))
    # The point is between the centres of the pixels that are read.
    pixel = np.stack(np.divmod(seen.pixel, SIZE[0])[::-1], axis=1)[: len(kept)]
    other = pixel + np.stack([seen.right, seen.below // SIZE[0]], axis=1)[: len(kept)]
    low, high = np.minimum(pixel, other), np.maximum(pixel, other)
    assert ((low - 1 / 200 <= at[kept]) & (at[kept] <= high + 1 / 200)).all()


PATHS = {"pan": (0.013, 0, 0, 0), "dolly": (0, 0.021, 0, 0), "sun": (0, 0, 0.7, 0), "cube": (0, 0, 0, 0.03),
         "all": (0.013, 0.021, 0.7, 0.03)}  # fmt: skip


def path(name: str, orthographic: bool = False, frames: int = 6) -> Sequence[Truth]:
    return traced(orthographic, *(tuple(frame * np.array(PATHS[name])) for frame in range(frames)))


@settings(max_examples=40)
@given(st.sampled_from(sorted(PATHS)), st.booleans(), st.integers(0, 999))
def test_wherever_a_mask_is_the_truth_on_decided_receivers_all_scores_are_0(name: str, ortho: bool, seed: int) -> None:
    random, truths = np.random.default_rng(seed), path(name, ortho)
    masks = [
        np.where(truth.receivers & ~truth.undecided, truth.visibility, random.random(truth.visibility.shape))
        for truth in truths
    ]
    scores = motion_scores(zip(masks, truths, strict=True))
    assert {value for value in scores.values() if value is not None} == {0}
    assert (scores["swim"] is None) == (name in ("sun", "cube", "all")) != (scores["false_change"] is None)


def turned(truths: Sequence[Truth], degrees: Sequence[float]) -> list[np.ndarray]:
    """The truths' visibility under suns that are turned further."""
    return [
        trace(later(truth.view, sun=angle), 1).visibility if angle else truth.visibility
        for truth, angle in zip(truths, degrees, strict=True)
    ]


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_displaced_shadow_that_stays_on_its_surface_neither_flickers_nor_swims(orthographic: bool) -> None:
    """Control: the truth of a sun turned by 4°. By its nearest pixels alone it would flicker."""
    truths = path("pan", orthographic)
    still, shaken = turned(truths, [4] * 6), turned(truths, [12, 0] * 3)
    scores = motion_scores(zip(still, truths, strict=True))
    assert scores["flicker"] < 0.01 and scores["swim"] < 0.05 and scores["pop"] < 3
    points, before, changed = Points(), still[0].ravel(), 0
    for mask, truth in zip(still, truths, strict=True):
        seen = points.see(truth)
        count = len(seen.kept)
        changed += np.count_nonzero((before[seen.kept] != mask.ravel()[seen.pixel[:count]]) & seen.read[:count])
        before = mask.ravel()[seen.pixel]
    assert changed > 20
    scores = motion_scores(zip(shaken, truths, strict=True))
    assert scores["flicker"] > 0.3 and scores["swim"] > 0.2


@pytest.mark.parametrize("ahead", [0, 2])
def test_a_shadow_that_is_ahead_of_the_sun_has_a_lag_below_0_though_the_camera_moves(ahead: int) -> None:
    masks, truths = (
        traced(False, *((0.003 * frame, 0.002 * frame, 1.5 * (frame + more), 0.0) for frame in range(24)))
        for more in (ahead, 0)
    )
    scores = motion_scores([(mask.visibility, truth) for mask, truth in zip(masks, truths, strict=True)])
    assert (scores["lag"], scores["lag_bias"]) == pytest.approx((-ahead, 0), abs=0.15)
    assert scores["flicker"] < 0.1


def test_frames_whose_surfaces_are_not_those_before_are_refused() -> None:
    points, (truth, *_) = Points(), path("pan")
    with pytest.raises(ValueError, match=r"without a view; allowed: one of `trace`"):
        points.see(replace(truth, view=None))
    points.see(truth)
    plane = replace(truth.view.scene, meshes=truth.view.scene.meshes[:1])
    with pytest.raises(ValueError, match="other triangles than in the frame before"):
        points.see(replace(truth, view=replace(truth.view, scene=plane)))
