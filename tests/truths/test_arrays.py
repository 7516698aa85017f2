"""The arrays of a truth, on scenes with known values."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.trace import trace

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
OnGround = Callable[[View], Floats]
Toward = Callable[[Light, Floats], Floats]


def test_shapes_and_types(shape, looking, sun) -> None:
    truth = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], sun, size=48))
    types = dict.fromkeys(("visibility", "standard_error", "irradiance", "area", "blocker", "cosine"), np.float32)
    types |= {"receivers": np.bool_, "undecided": np.bool_, "triangle": np.int32}
    arrays = truth.arrays()
    assert arrays.keys() == {*types, "diagonal"}
    assert {name: arrays[name].dtype for name in types} == types
    assert all(arrays[name].shape == (48, 48) for name in types)
    assert set(np.unique(truth.visibility)) == {0.0, 1.0}


def test_outside_receivers_nothing_is_in_shadow_and_no_sample_counts(light, shape, looking) -> None:
    assert (trace(looking([shape("plane", 2.0)], light, size=96)).area == 1).all()  # also at the rim of a lit ground
    truth = trace(looking([shape("plane", 3.0), shape("box", at=(0, 0.5, 0))], light, size=96))
    outside = ~truth.receivers
    assert (truth.triangle[outside] >= 0).any()
    assert (truth.triangle[outside] < 0).any()
    assert (truth.visibility[outside] == 1).all()
    assert (truth.area[outside] == 1).all()
    assert np.isinf(truth.blocker[outside]).all()
    assert (truth.cosine[outside] == 0).all()
    assert (truth.cosine[truth.receivers] > 0).all()


def test_area_is_visibility_where_no_edge_is_near(shape, looking, sun) -> None:
    truth = trace(looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], sun, size=128))
    code = truth.receivers + 2 * truth.visibility
    flat = maximum_filter(code, 3) == minimum_filter(code, 3)
    assert flat.mean() > 0.8
    assert (truth.area == truth.visibility)[flat].all()
    assert ((truth.area > 0) & (truth.area < 1)).any()


@pytest.mark.parametrize("samples", [4, 8])
def test_area_of_a_straight_edge_is_its_coverage(samples, shape, looking, on_ground, sun) -> None:
    """A row of an n × n grid misjudges a straight edge by half a sample at most."""
    plate = shape("plane", (20.0, 1.0, 10.0), (0.0, 2.0, 5.0))  # its edge over z = 0 casts one straight shadow
    view = looking([shape("plane", 40.0), plate], sun, eye=(0.3, 1.5, 0.3), target=(0.6, 0.0, -0.6))
    truth = trace(view, pixel_samples=samples)
    fine = 32
    points = on_ground(replace(view, size=view.size * fine))
    crossing = points + (2.0 / -sun.direction[1]) * -np.asarray(sun.direction)
    lit = (crossing[..., 2] < 0).reshape(view.size, fine, view.size, fine).mean(axis=(1, 3))
    at_edge = (lit > 0) & (lit < 1)
    assert at_edge.sum() > view.size / 2
    assert truth.receivers.all()
    error = truth.area - lit
    assert np.abs(error).max() <= 0.5 / samples + 0.5 / fine
    assert np.abs(error[at_edge].mean()) < 0.02
    assert np.abs(error[~at_edge]).max() == 0


def test_blocker_is_the_distance_to_the_near_side_of_a_box(light, shape, looking, on_ground, toward) -> None:
    """The first crossing of six planes, seen from outside: the entry of the slab test."""
    box = shape("box", (1.0, 0.4, 1.2), (0.0, 0.9, 0.1))
    view = looking([shape("plane", 8.0), box], light, size=96)
    truth = trace(view)
    points = on_ground(view)
    ways = np.broadcast_to(toward(light, points), points.shape)
    shadowed = (truth.triangle >= 0) & (truth.triangle < 2) & (truth.visibility == 0) & ~truth.undecided
    low, high = box.vertices.min(axis=0), box.vertices.max(axis=0)
    crossings = np.stack([(low - points) / ways, (high - points) / ways])[:, shadowed]
    entry = crossings.min(axis=0).max(axis=1)
    assert len(entry) > 50
    assert truth.blocker[shadowed] == pytest.approx(entry, rel=1e-4)
    assert np.isinf(truth.blocker[truth.visibility == 1]).all()


def test_triangles_are_counted_over_meshes_in_file_order(shape, looking, sun) -> None:
    ground, box, sphere = shape("plane", 3.0), shape("box", at=(-0.8, 0.5, 0)), shape("sphere", at=(0.8, 0.5, 0))
    view = looking([ground, box, sphere], sun, size=128)
    truth = trace(view)
    ends = np.cumsum([len(mesh.faces) for mesh in view.scene.meshes])
    mesh_of = np.searchsorted(ends, truth.triangle, side="right")
    assert set(np.unique(mesh_of)) == {0, 1, 2}
    assert truth.triangle.min() == -1
    half = view.size // 2
    assert (mesh_of[:, :half] == 2).sum() < (mesh_of[:, half:] == 2).sum()  # the sphere stands on the right
    assert (mesh_of[:, :half] == 1).sum() > (mesh_of[:, half:] == 1).sum()


def test_diagonal_is_of_casters_and_visible_receivers(shape, looking, sun) -> None:
    ground, box = shape("plane", 1000.0, casts=False), shape("box", at=(0, 0.5, 0))
    seen = trace(looking([ground, box], sun, target=(0.0, -1.0, 0.0), fov=30.0)).diagonal
    assert seen < 20
    assert trace(looking([replace(ground, casts=True), box], sun)).diagonal == pytest.approx(1000 * math.sqrt(2))
