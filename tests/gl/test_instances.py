"""Scenes drawn as instances, in comparison with the same scenes expanded: equal to the bit."""

import numpy as np
import pytest

from shadowbench.errors import Unsupported
from shadowbench.gl.gbuffer import download
from shadowbench.scenes.model import Scene, View, view_of


def views(scenes: tuple[Scene, Scene], light: str = "sun") -> tuple[View, View]:
    return tuple(
        view_of(scene, scene.cameras[0], next(each for each in scene.lights if each.name == light), 192)
        for scene in scenes
    )


def test_the_g_buffer_is_the_same(studio, crowd_scenes) -> None:
    flat, shared = (studio.shot(view).surface for view in views(crowd_scenes))
    assert shared.shown is not None and flat.shown is None
    assert len(np.unique(flat.triangles())) > 1000
    assert np.array_equal(shared.triangles(), flat.triangles())
    for name in ("position", "normal", "depth"):
        assert np.array_equal(download(getattr(shared, name)), download(getattr(flat, name))), name
    for mine, other in zip(shared.smooth, flat.smooth, strict=True):
        assert np.array_equal(download(mine), download(other))


@pytest.mark.parametrize(
    ("light", "spec"),
    [
        ("sun", "shadow-map:size=512"),
        ("sun", "shadow-map:size=256,fit=scene,filter=hard,bias=slope,cull=false"),
        ("sun", "shadow-map:size=256,filter=pcss,bias=receiver-plane"),
        ("sun", "shadow-map:size=256,filter=vsm"),
        ("low", "cascades:size=256"),
        ("low", "cascades:size=128,box=sphere,stable=true,filter=pcf(taps=5)"),
        ("sun", "cascades:size=128,layers=geometry"),
        ("lamp", "cube-map:size=256"),
        ("lamp", "cube-map:size=128,filter=pcss,layers=geometry"),
        ("spot", "shadow-map:size=256,filter=pcss"),
    ],
)
def test_masks_are_the_same(studio, build, crowd_scenes, light: str, spec: str) -> None:
    flat, shared = (build(spec, shot).draw(shot) for shot in map(studio.shot, views(crowd_scenes, light)))
    assert 0.02 < (flat < 0.5).mean() < 0.6
    assert np.array_equal(shared, flat)


@pytest.mark.parametrize("spec", ["shadow-volume", "planar-projection", "hybrid", "ray-traced", "soft-volume"])
def test_what_needs_one_list_of_triangles_says_so(studio, build, crowd_scenes, spec: str) -> None:
    shot = studio.shot(views(crowd_scenes)[1])
    with pytest.raises(Unsupported, match="as instances of"):
        build(spec, shot)
