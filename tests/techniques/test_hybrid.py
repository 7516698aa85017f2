"""A map where it is certain, and rays elsewhere; rays in a shader."""

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec

SCENES = ["stairs", "railings", "sphere-and-torus", "spot-lamp", "room-with-lamp"]


@pytest.mark.parametrize("name", SCENES)
def test_rays_in_a_shader_are_the_truth_s(name, builtin, truth_of, mask, scored) -> None:
    scores = scored(mask("ray-traced:where=gpu", builtin(name)), truth_of(name))
    assert scores["iou"] >= 0.9999


@pytest.mark.parametrize("name", SCENES)
def test_a_small_map_and_rays_are_the_truth(name, builtin, truth_of, mask, scored) -> None:
    assert scored(mask("hybrid:size=256", builtin(name)), truth_of(name))["iou"] >= 0.9998


@pytest.mark.parametrize("name", ["railings", "spot-lamp", "room-with-lamp"])
def test_the_cpu_s_rays_answer_as_the_shader_s(name, builtin, mask) -> None:
    view = builtin(name)
    shader, cpu = (mask(f"hybrid:rest={rest}", view) for rest in ("trace", "embree"))
    assert (shader != cpu).mean() < 1e-4
    assert set(np.unique(cpu)) == {0.0, 1.0}


def test_the_map_answers_most_pixels(builtin, build, studio) -> None:
    """Only those of the others are counted as rays; what it answers is not drawn over by rays."""
    shot = studio.shot(builtin("stairs"))
    rays = {}
    for spec in ("ray-traced", "hybrid:rest=embree", "hybrid:rest=embree,size=4096"):
        one = build(spec, shot)
        one.draw(shot)
        rays[spec] = one.technique.facts()["rays"]
    traced, coarse, fine = rays.values()
    assert 0 < fine < 0.5 * coarse < 0.1 * traced


@pytest.mark.parametrize("name", ["canopy", "railings", "room-with-lamp"])
def test_casters_thinner_than_texels_are_not_missed(name, builtin, truth_of, mask, scored) -> None:
    """Their silhouettes are in the map, where its depths have few of them."""
    assert scored(mask("hybrid:size=32", builtin(name)), truth_of(name))["iou"] >= 0.9995


def test_a_shader_traces_one_ray_for_each_pixel() -> None:
    with pytest.raises(InputError, match=r"where=gpu .* samples is 4, allowed: 1"):
        parse_spec("ray-traced:where=gpu,samples=4", techniques())


def test_a_scene_whose_tree_fits_no_texture_is_declined(device: Device, builtin, monkeypatch) -> None:
    monkeypatch.setitem(device.__dict__, "max_map_size", 1)
    for text in ("hybrid", "ray-traced:where=gpu"):
        spec = parse_spec(text, techniques())
        assert "triangles" in str(spec.technique.unsupported(spec.params, builtin("canopy", 32), device))
