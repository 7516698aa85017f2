"""Views at extremes of size, position and direction."""

from collections.abc import Callable

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.trace import Truth, trace

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
OnGround = Callable[[View], Floats]


def test_camera_inside_a_mesh(shape, looking, sun) -> None:
    lamp = Light("lamp", "point", position=(0.3, 0.2, -0.1))
    truth = trace(looking([shape("box", 2.0)], lamp, eye=(0.5, 0.4, 0.6)))
    assert truth.receivers.all()
    assert (truth.visibility == 1).all()
    dark = trace(looking([shape("box", 2.0)], sun, eye=(0.5, 0.4, 0.6)))
    assert (dark.visibility == 0)[dark.receivers].all()
    assert dark.receivers.any()


@pytest.mark.parametrize("size", [1, 65])
def test_ground_alone_is_lit_in_any_size_and_seen_along_up(size, light, shape, looking) -> None:
    for eye in ((0.0, 6.0, 0.0), (2.3, 4.0, 3.4)):
        truth = trace(looking([shape("plane", 8.0)], light, size, eye))
        assert truth.visibility.shape == (size, size)
        assert truth.receivers[size // 2, size // 2]
        assert (truth.visibility == 1).all() and (truth.area == 1).all()
        assert np.isinf(truth.blocker).all()


def test_light_along_up(shape, looking, on_ground) -> None:
    """The shadow of a box under the zenith is its footprint."""
    noon = Light("sun", "directional", (0.0, -1.0, 0.0))
    view = looking([shape("plane", 8.0), shape("box", at=(0, 1.5, 0))], noon, size=128)
    truth = trace(view)
    ground = (truth.triangle == 0) | (truth.triangle == 1)
    under = (np.abs(on_ground(view)[..., [0, 2]]) < 0.5).all(axis=-1)
    decided = ground & ~truth.undecided
    assert (under & decided).any()
    assert ((truth.visibility == 0) == under)[decided].all()


def test_camera_looking_at_nothing_is_refused(shape, looking, sun) -> None:
    with pytest.raises(InputError, match="shows nothing"):
        trace(looking([shape("plane", 8.0)], sun, target=(2.3, 9.0, 3.5)))
    with pytest.raises(InputError, match="1 and more"):
        trace(looking([shape("plane", 8.0)], sun), 0)


def between_planes(shape: Shape, looking: Looking, sun: Light, **planes: float) -> Truth:
    """A plate at depth 2 and the ground at depth 5, seen from above through it."""
    plate = shape("plane", 1.0, (0.0, 3.0, 0.0))
    return trace(looking([shape("plane", 8.0), plate], sun, eye=(0.0, 5.0, 0.0), size=65, **planes))


def test_mesh_before_near_is_not_seen_but_casts(shape, looking, sun) -> None:
    assert between_planes(shape, looking, sun).triangle[32, 32] >= 2
    cut = between_planes(shape, looking, sun, near=2.5)
    assert cut.triangle.max() < 2
    assert cut.triangle[32, 32] >= 0
    assert (cut.visibility == 0).any()


def test_mesh_beyond_far_is_not_seen(shape, looking, sun) -> None:
    cut = between_planes(shape, looking, sun, far=4.0)
    assert cut.triangle[32, 32] >= 2
    assert (cut.triangle[0] == -1).all()
    assert not cut.receivers[0].any()
