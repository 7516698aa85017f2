"""Flips after a small step: of the camera, which turns, and of the light."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.measure.flips import RIGHT, UP, Stepped, flips
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View
from shadowbench.truths.rays import ViewRays
from shadowbench.truths.trace import Truth
from tests.parallel import parallel

STUDY = """
scenes = ["street"]
view_size = 128
map_size = 256
rounds = 0
step = "camera"
[[technique]]
spec = "ray-traced"
[[technique]]
spec = "shadow-volume"
[[technique]]
spec = "shadow-map:filter=hard"
fit = ["scene", "view"]
[[technique]]
spec = "cascades:count=1,box=sphere,filter=hard"
stable = [true, false]
"""
SIZE = 64

Frames = tuple[Stepped, np.ndarray, np.ndarray, Truth, Truth]


def test_only_a_window_that_follows_the_camera_shimmers_when_it_turns_unless_it_is_snapped(
    shadowbench: Any, records: Any, tmp_path: Path
) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    assert shadowbench("run", "-s", tmp_path / "study.toml", "-o", tmp_path / "out", "-q").code == 0
    rows = {row["spec"]: row for row in records(tmp_path / "out", "score")}
    for spec in ("ray-traced", "shadow-volume", "shadow-map:fit=scene,filter=hard"):
        assert rows[spec]["flips"] == 0, spec
    loose, snapped = (rows[f"cascades:count=1,box=sphere{more},filter=hard"]["flips"] for more in ("", ",stable=true"))
    assert min(loose, rows["shadow-map:fit=view,filter=hard"]["flips"]) > 0.02
    assert snapped < loose / 20  # found: one pixel, where a texel's corner lies between the four around it


def ahead(view: View) -> np.ndarray:
    """(3, H, W) points at a depth of 1 on the camera's rays, from its position."""
    rays = ViewRays(view).camera_rays(slice(0, view.size.height))
    points = rays.origins + rays.directions - np.array(view.camera.position)[:, np.newaxis]
    return points.reshape(3, *view.size.shape)


@pytest.fixture(params=["perspective", "orthographic"])
def turned(builtin: Callable[..., View], request: pytest.FixtureRequest) -> Callable[..., Frames]:
    """An edge `at` pixels right of the centre, or above it, and after the camera has turned, `moved` further."""
    before = (
        builtin("cube-on-plane", SIZE)
        if request.param == "perspective"
        else parallel(load_scene("cube-on-plane"), SIZE)
    )
    stepped = Stepped(before, "camera")
    *axes, back = before.camera.basis()
    pixel = 2 * before.camera.half_height(1.0) / SIZE

    def mask(view: View, at: float, axis: int) -> np.ndarray:
        moved = axes[axis] @ np.subtract(view.camera.position, before.camera.position)
        across = np.tensordot(axes[axis], ahead(view), 1) / -np.tensordot(back, ahead(view), 1)
        return (across + moved > at * pixel).astype(np.float32)

    def truth(visibility: np.ndarray) -> Truth:
        no, lit = np.zeros(visibility.shape, bool), visibility
        return Truth(lit, 0 * lit, lit, ~no, no, lit, lit, no.astype(np.int32), lit, 1.0)

    def make(at: float, moved: float, true_at: float, axis: int = 0) -> Frames:
        masks = mask(before, at, axis), mask(stepped.view, at + moved, axis)
        return stepped, *masks, *(truth(mask(view, true_at, axis)) for view in (before, stepped.view))

    return make


@pytest.mark.parametrize("axis", [0, 1])
def test_an_edge_flips_by_as_many_lines_as_it_moves_on_its_surface_wherever_the_pixels_are(turned, axis: int) -> None:
    for at in (-3.0, -0.5, 0.0, 1.5):
        stepped, before, after, was, now = turned(at, 0.0, 0.0, axis)
        assert stepped.count([before, after], [was, now]) == 0 and len(np.unique(before)) == 2
    stepped, before, after, was, now = turned(0.0, 1.0, 0.0, axis)  # one of the four lines beside the true edge
    assert stepped.count([before, after], [was, now]) == pytest.approx(1 / 4, abs=1 / SIZE)


@pytest.mark.parametrize(("at", "true_at", "found"), [(10.0, 0.0, 0), (0.0, 1000.0, None)])
def test_flips_are_counted_near_true_edges_alone(turned, at: float, true_at: float, found: float | None) -> None:
    stepped, before, after, was, now = turned(at, 1.0, true_at)
    assert stepped.count([before, after], [was, now]) == found


def test_under_a_light_with_a_size_flips_are_undefined(turned) -> None:
    """The truth changes throughout the penumbra with each step, and a mask's middle line with it."""
    stepped, before, after, was, now = turned(0.0, 1.0, 0.0)
    soft = replace(was, standard_error=np.full_like(was.visibility, 1e-3))
    assert flips([before, 1 - before], [soft, soft]) is None
    assert stepped.count([before, after], [soft, now]) is None


@pytest.mark.parametrize("scene", ["cube-on-plane", "spot-lamp", "lamp-by-wall"])
def test_a_step_of_the_light_is_as_wide_as_seen_from_what_is_looked_at(builtin, scene: str) -> None:
    before = builtin(scene, SIZE)
    position, w = zip(*(view.light.homogeneous for view in (before, Stepped(before, "light").view)), strict=True)
    ways = np.asarray(position) - np.multiply(w[0], before.camera.target)
    angle = np.linalg.norm(np.subtract(*(way / np.linalg.norm(way) for way in ways)))
    moved = np.hypot(RIGHT, UP) * 2 * np.tan(before.camera.fov_y / 2) / SIZE
    assert (0.99 * moved if scene == "cube-on-plane" else 0) < angle <= moved * (1 + 1e-3)


STILL, FAR = (1, 1, 0, 0), (1, 1, 1, 1, 1, 1, 1, 0, 0, 0)


@pytest.mark.parametrize(
    ("masks", "truths", "share"),
    [
        ([STILL, (1, 1, 0, 1)], [STILL, STILL], 1 / 4),
        ([STILL, (1, 1, 1, 0)], [STILL, (1, 1, 1, 0)], 0),
        ([STILL, (1, 1, 1, 1)], [STILL, (1, 1, 0, None)], 1 / 3),  # None: undecided
        ([STILL, STILL, (0, 0, 0, 0)], [STILL] * 3, 1 / 2),  # the largest of two steps
        ([FAR, (0, 0, *FAR[2:])], [FAR, FAR], 0),  # farther than 2 px from every true edge
    ],
)
def test_flips_are_changes_near_a_true_edge_where_the_truth_does_not_change(
    masks: list[tuple[float, ...]], truths: list[tuple[float | None, ...]], share: float | None
) -> None:
    def truth(row: tuple[float | None, ...]) -> Truth:
        undecided = np.array([[value is None for value in row]])
        lit = np.array([[value or 0 for value in row]], np.float32)
        return Truth(lit, 0 * lit, lit, lit >= 0, undecided, lit, lit, np.zeros_like(lit, np.int32), lit, 1.0)

    assert flips([np.array([mask], np.float32) for mask in masks], [truth(row) for row in truths]) == share
