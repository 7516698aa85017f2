"""The axes of `stress`: what each one varies, and that a mask can be scored at every value."""

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from shadowbench.extremes.axes import AXES, FRAMES
from shadowbench.extremes.model import TEXEL, value_label
from shadowbench.options import ViewSize
from shadowbench.scenes.model import Light, LightKind, View
from shadowbench.truths.trace import trace
from tests.samples import daily

SMALL = ViewSize(48, 48)

every_light = pytest.mark.parametrize("kind", ["directional", "spot", "point"])


def first(axis: str, value: float | str, light: LightKind = "directional") -> View:
    return AXES[axis].at(value, light).views[0]


def casters(view: View) -> list[np.ndarray]:
    """The vertices of all meshes but the ground."""
    return [mesh.vertices for mesh in view.scene.meshes[1:]]


def test_values_are_in_order_each_with_a_scene_of_its_own_and_a_quick_sweep_has_the_default() -> None:
    for axis in AXES.values():
        assert axis.default in axis.quick and set(axis.quick) <= set(axis.values), axis.name
        assert axis.swept(quick=True) == tuple(value for value in axis.values if value in axis.quick)
        assert axis.swept(quick=False) == axis.values and len(set(axis.values)) == len(axis.values)
        if axis.ordered:
            assert axis.values in (tuple(sorted(axis.values)), tuple(sorted(axis.values, reverse=True)))
        names = [axis.at(value, axis.lights[0]).views[0].scene.name for value in axis.quick]
        assert names == [f"{axis.name}-{value_label(value)}" for value in axis.quick] and len({*names}) == len(names)


@pytest.mark.slow
@pytest.mark.parametrize("name", daily(list(AXES), 4))
def test_every_value_shows_light_and_shadow(name: str) -> None:
    """A view without shadow, or wholly in shadow, would measure nothing."""
    axis = AXES[name]
    for light, value in product(axis.lights, axis.values):
        truth = trace(replace(axis.at(value, light).views[0], size=SMALL), pixel_samples=1)
        judged = truth.receivers & ~truth.undecided
        share = (truth.visibility[judged] < 0.5).mean()
        assert 0.01 <= share <= 0.9, (value, light)


def elevation(light: Light) -> float:
    x, y, z = light.direction if light.kind == "directional" else -np.array(light.position)
    return math.degrees(math.atan2(-y, math.hypot(x, z)))


@every_light
def test_the_light_stands_at_its_elevation_and_has_its_angular_radius(kind: LightKind) -> None:
    for value in AXES["elevation"].values:
        assert elevation(first("elevation", value, kind).light) == pytest.approx(value)
    for value in AXES["light-size"].values:
        light = first("light-size", value, kind).light
        sine = math.sin(light.radius) if kind == "directional" else light.radius / np.linalg.norm(light.position)
        assert math.degrees(math.asin(sine)) == pytest.approx(value)


@pytest.mark.parametrize("kind", ["directional", "spot"])
def test_the_light_passes_through_the_up_axis(kind: LightKind) -> None:
    values = AXES["through-up"].values
    directions = np.array([first("through-up", value, kind).light.direction for value in values])
    assert np.degrees(np.arctan2(*-directions[:, :2].T)) == pytest.approx(values, rel=1e-9)
    assert (directions[:, 0] < 0).any() and (directions[:, 0] > 0).any()
    assert (directions == [0.0, -1.0, 0.0]).all(axis=1).any()
    assert np.ptp(directions[:, 2]) == 0


@every_light
def test_distance_moves_everything_and_scale_scales_it(kind: LightKind) -> None:
    home = first("scale", 1.0, kind)
    for axis, value, factor, distance in (("distance", 1e7, 1.0, 1e7), ("scale", 1e-6, 1e-6, 0.0)):
        moved = first(axis, value, kind)
        offset = np.mean(moved.scene.geometry.vertices - home.scene.geometry.vertices * factor, axis=0)
        assert np.linalg.norm(offset) == pytest.approx(distance, abs=1e-9)
        for mine, theirs in (
            (moved.scene.geometry.vertices, home.scene.geometry.vertices),
            (np.array(moved.camera.position), np.array(home.camera.position)),
            (np.array(moved.camera.near), np.array(home.camera.near)),
        ):
            shift = offset if mine.shape else 0.0
            assert np.allclose(mine, theirs * factor + shift, rtol=1e-6, atol=1e-7 * factor)
        if kind == "directional":
            assert moved.light == home.light
        else:
            assert np.allclose(moved.light.position, np.array(home.light.position) * factor + offset)


def test_casters_are_as_thin_and_as_near_as_said() -> None:
    for texels in AXES["thickness"].values:
        _, plate = casters(first("thickness", texels))
        assert np.ptp(plate[:, 1]) == pytest.approx(texels * TEXEL)
    for share in AXES["gap"].values:
        (plate,) = casters(first("gap", share))
        assert plate[:, 1].min() == pytest.approx(share * 1.2)


def test_casters_are_as_many_as_said() -> None:
    for count in AXES["overlap"].values:
        (plates,) = casters(first("overlap", count))
        assert len(plates) == 8 * count
        assert len(np.unique(plates[:, 1])) == 2 * count, "plates touch"
    for count in (1, 12, 1024, 16384):
        assert len(first("triangles", count).scene.meshes[1].faces) == count


def test_meshes_have_the_stated_defects() -> None:
    of = {name: first("mesh", name).scene.meshes[2] for name in AXES["mesh"].values}
    whole = len(of["closed"].faces)
    assert of["closed"].closed and of["slivers"].closed and of["zero-area"].closed
    assert not of["open"].closed and not of["t-junctions"].closed and not of["duplicated"].closed
    assert len(of["zero-area"].faces) == whole < len(of["duplicated"].faces)
    assert len(of["slivers"].faces) == 3 * whole
    corners = of["slivers"].vertices[of["slivers"].faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (2 * areas / longest**2 < 1e-6).sum() == whole
    turned = of["inconsistent-winding"]
    assert turned.closed and len(turned.faces) == whole
    assert (turned.faces != of["closed"].faces).any(axis=1).mean() == pytest.approx(1 / 3, abs=0.01)


@pytest.mark.parametrize("name", ["camera-step", "light-step"])
def test_steps_are_the_speed_in_texels_a_frame(name: str) -> None:
    for texels in AXES[name].values:
        views = AXES[name].at(texels, "directional").views
        assert len(views) == FRAMES and len({view.scene for view in views}) == 1
        for one, other in pairwise(views):
            moved = np.linalg.norm(np.subtract(other.camera.position, one.camera.position))
            turned = np.linalg.norm(np.subtract(other.light.direction, one.light.direction))
            if name == "camera-step":
                assert (moved, turned) == (pytest.approx(texels * TEXEL), 0)
            else:
                assert moved == 0 and 0 < turned <= texels * TEXEL
