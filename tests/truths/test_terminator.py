"""Dark facets along the terminator of smooth surfaces: closed forms and laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import sphere
from shadowbench.scenes.triangles import unit_normals
from shadowbench.scores.metrics import score
from shadowbench.truths.cache import read_truth, write_truth
from shadowbench.truths.trace import Truth, smooth_points, trace

Floats = NDArray[np.float64]
BACKLIT = Light("sun", "directional", (0.8, -0.3, 0.6))


def looked_at(*meshes: Mesh, light: Light = BACKLIT, size: int = 200) -> View:
    """Meshes of a radius of about 1 seen from far away."""
    camera = Camera("camera", (0.0, 0.0, 400.0), (0.0, 0.0, 0.0), 2 * math.atan(1.2 / 400))
    return view_of(Scene("test", meshes, (camera,), (light,)), camera, light, size)


def ball(subdivisions: int, **fields: object) -> Mesh:
    """A smooth sphere of radius 1, whose normals are those of the sphere."""
    vertices, faces = sphere(subdivisions)
    return Mesh("ball", 2 * vertices, faces, normals=unit_normals(vertices[faces]), **fields)


def prism(sides: int, turn: float) -> Mesh:
    """An upright cylinder of radius 1 with as many flat sides as given; turn: the angle of a corner, from x to z."""
    angle = turn + np.arange(sides + 1) * 2 * np.pi / sides
    ring = np.stack([np.cos(angle), np.zeros(sides + 1), np.sin(angle)], axis=1)
    height = np.array([0.0, 2.0, 0.0])
    vertices = np.concatenate([ring - height, ring + height])
    low, after, above = np.arange(sides), np.arange(sides) + 1, sides + 1
    faces = np.concatenate([np.stack([low, low + above, after], 1), np.stack([after, low + above, after + above], 1)])
    return Mesh("prism", vertices, faces.astype(np.int32), normals=unit_normals(np.concatenate([ring, ring])[faces]))


def terminator(truth: Truth) -> float | None:
    return score(truth.visibility, prepare_truth(truth))["terminator"]


@pytest.mark.parametrize("beyond", [0.02, 0.3])
def test_a_facet_hides_the_light_from_its_lit_edge_to_the_terminator(beyond: float) -> None:
    """Its middle lies beyond the terminator by a share of α, the angle of a facet: so does (½ − share) of it before.

    Normals are interpolated along the chord: N(t)·L = (1 − t) N₀·L + t N₁·L is 0 at t* = N₀·L / (N₀·L − N₁·L).
    """
    sides, size = 12, 1000
    step = 2 * math.pi / sides
    middle = math.radians(80)  # of the facet, near the direction to the camera, z
    toward = middle - math.pi / 2 - beyond * step
    sun = Light("sun", "directional", (-math.cos(toward), 0.0, -math.sin(toward)))
    truth = trace(looked_at(prism(sides, middle + step / 2), light=sun, size=size), pixel_samples=1)
    row = truth.facet_shadow[size // 2] & ~truth.undecided[size // 2]

    edges = middle + step * np.array([-0.5, 0.5])
    before, after = np.cos(edges - toward)
    share = before / (before - after)
    assert share == pytest.approx(0.5 - beyond, abs=0.02), "nearly the angle's share"
    x = np.cos(edges)
    assert row.sum() / (size / 2.4) == pytest.approx(share * abs(x[1] - x[0]), abs=3 / size)
    # Light by interpolated normals, of each facet that the camera sees, in units of x.
    found = {True: 0.0, False: 0.0}
    for k in range(sides):
        ends = middle + step * (k + np.array([-0.5, 0.5]))
        span = np.cos(ends[0]) - np.cos(ends[1])  # above 0 where it faces the camera, in turn
        if span <= 0:
            continue
        t = (np.arange(2000) + 0.5) / 2000
        normal = np.outer(1 - t, [np.cos(ends[0]), np.sin(ends[0])]) + np.outer(t, [np.cos(ends[1]), np.sin(ends[1])])
        light = (normal @ [np.cos(toward), np.sin(toward)]) / np.linalg.norm(normal, axis=1)
        lit_by_facet = math.cos(ends.mean() - toward) > 0
        found[lit_by_facet] += span * float(np.maximum(light, 0).mean())
    assert terminator(truth) == pytest.approx(found[False] / (found[False] + found[True]), rel=0.05)


def test_flat_surfaces_have_none() -> None:
    vertices, faces = sphere(1)
    flat = Mesh("ball", 2 * vertices, faces)
    truth = trace(looked_at(flat), pixel_samples=1)
    assert truth.facet_shadow is None and truth.shading_cosine is None
    assert terminator(truth) is None
    corners = flat.vertices[faces]
    normals = unit_normals(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    same = replace(flat, normals=np.repeat(normals[:, None], 3, axis=1))
    assert terminator(trace(looked_at(same), pixel_samples=1)) == 0


def test_the_shadow_of_another_mesh_is_no_facet_s() -> None:
    """A plate before the whole ball."""
    toward = -np.array(BACKLIT.direction)
    plate = Mesh("plate", _plate(toward), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    lit, hidden = (trace(looked_at(ball(1), *others), pixel_samples=1) for others in ((), (plate,)))
    assert lit.facet_shadow.any()
    assert not hidden.facet_shadow.any()


def test_the_truth_is_dark_where_facets_face_away_and_is_kept_with_its_arrays(tmp_path) -> None:
    view = looked_at(ball(1))
    truth = trace(view, pixel_samples=1)
    away = ~truth.receivers & (truth.shading_cosine > 0)
    assert away.any()
    assert not truth.visibility[away].any()
    assert truth.visibility[~truth.receivers & ~away].all()
    write_truth(tmp_path / "a.npz", truth)
    np.testing.assert_equal(read_truth(tmp_path / "a.npz", view).arrays(), truth.arrays())


@pytest.mark.parametrize("size", [0.0, 0.05])
def test_under_a_light_with_a_size_there_is_no_score(size: float) -> None:
    truth = trace(looked_at(ball(1), light=replace(BACKLIT, radius=size), size=64), pixel_samples=1)
    assert (truth.facet_shadow is None) == (size > 0)
    assert truth.shading_cosine.any()


def test_lifted_points_lie_above_the_chord_by_its_depth_twice() -> None:
    """At the middle of a chord of angle α, P' = R cos(α/2) (1 + sin²(α/2)): above the circle as the chord is below."""
    half = 0.2
    ends = np.array([[math.sin(-half), math.cos(half), 0], [math.sin(half), math.cos(half), 0]])
    corners = np.array([[ends[0], ends[1], ends[1] + [0, 0, 1]]])
    normals = np.array([[ends[0], ends[1], ends[1]]])
    middle = np.array([[0.0], [math.cos(half)], [0.0]])
    position, normal = smooth_points(middle, corners, normals, np.array([[0.0], [1.0], [0.0]]))
    assert position[1, 0] == pytest.approx(math.cos(half) * (1 + math.sin(half) ** 2))
    assert normal[:, 0] == pytest.approx([0, 1, 0])
    turned = smooth_points(middle, corners, -normals, np.array([[0.0], [1.0], [0.0]]))
    assert np.array_equal(turned[0], position) and np.array_equal(turned[1], normal)


def _plate(toward: Floats) -> Floats:
    """(4, 3) corners of a square of side 4, square to a direction and 2 away along it."""
    along = np.cross(toward, [0.0, 1.0, 0.0])
    along /= np.linalg.norm(along)
    across = np.cross(toward, along) / np.linalg.norm(toward)
    return 2 * toward + 2 * np.array([along + across, along - across, -along - across, across - along])
