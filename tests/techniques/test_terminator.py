"""Smooth surfaces on the device: the G-buffer's, and shadows received on them instead of on their triangles."""

from dataclasses import replace

import numpy as np
import pytest

import shadowbench as sb
from shadowbench.gl.gbuffer import download
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.vectors import unit, vec3
from shadowbench.truths.trace import Truth, smooth_points
from tests.truths.test_terminator import ball

CURED = {
    "shadow-map:size=512": "shadow-map:bias=terminator+texel,size=512",
    "shadow-map:size=1024,filter=pcf(taps=3)": "shadow-map:bias=terminator+receiver-plane,size=1024,filter=pcf(taps=3)",
    "cascades": "cascades:bias=terminator+texel",
    "ray-traced": "ray-traced:terminator=true",
    "ray-traced:where=gpu": "ray-traced:terminator=true,where=gpu",
    "hybrid": "hybrid:terminator=true",
    "light-samples:of=shadow-map,n=1": "light-samples:of=shadow-map(bias=terminator+texel),n=1",
}


@pytest.fixture(autouse=True, scope="module")
def end():
    yield
    sb.close()


@pytest.fixture(scope="module")
def scene() -> Scene:
    """That of the gallery."""
    return sb.load("docs/gallery/terminator.toml")


@pytest.fixture(scope="module")
def truth(scene: Scene) -> Truth:
    return sb.truth(scene, view_size=160)


def terminator(spec: str, scene: Scene, truth: Truth) -> float:
    value = sb.score(sb.render(scene, spec, view_size=160).visibility, truth)["terminator"]
    assert value is not None
    return value


@pytest.mark.parametrize(("spec", "cured"), [*CURED.items(), ("shadow-volume", ""), ("planar-projection", "")])
def test_a_technique_that_follows_the_triangles_has_the_facets_of_the_truth_and_cured_has_none(
    spec: str, cured: str, scene: Scene, truth: Truth
) -> None:
    exact = sb.score(truth.visibility, truth)["terminator"]
    assert exact == pytest.approx(0.0447, abs=3e-3), "4.5% of the crescent's light, as measured at 256 pixels"
    assert terminator(spec, scene, truth) == pytest.approx(exact, rel=0.02)
    assert not cured or terminator(cured, scene, truth) < 1e-3


@pytest.mark.parametrize("turn", [-4e-7, 4e-7])
def test_a_facet_whose_plane_holds_the_light_is_dark_whichever_way_it_is_rounded(
    turn: float, scene: Scene, truth: Truth
) -> None:
    """Of one, N·L is −2e-16 in float64; float32 may make it a few steps of 2⁻²⁴ of either sign."""
    sun, normals = scene.lights[0], scene.geometry.normals
    edge_on = np.abs(normals @ unit(sun.direction)) < 1e-12
    seen = truth.facet_shadow & edge_on[truth.triangle]
    assert seen.any()
    toward = -unit(sun.direction) + turn * normals[truth.triangle[seen][0]]
    turned = replace(scene, lights=(replace(sun, direction=vec3(-toward)),))
    assert not sb.render(turned, "shadow-map:size=512", view_size=160).visibility[seen].any()


def roofed_over(scene: Scene) -> Scene:
    """The scene with a plate that shadows a part of the ball."""
    corners = np.array([[-2.6, 2.0, -2.0], [-0.6, 2.0, -2.0], [-0.6, 2.0, 0.0], [-2.6, 2.0, 0.0]])
    return replace(scene, meshes=(*scene.meshes, Mesh("roof", corners, np.array([[0, 2, 1], [0, 3, 2]], np.int32))))


def test_what_other_meshes_shadow_stays_in_shadow(scene: Scene) -> None:
    roofed = roofed_over(scene)
    truth = sb.truth(roofed, view_size=160)
    shaded = (truth.shading_cosine > 0.01) | (truth.triangle < 2)  # the ball, and the ground
    shadowed = prepare_truth(truth).shadow_interior & shaded & ~truth.facet_shadow
    assert (shadowed & (truth.shading_cosine > 0)).sum() > 50
    for spec in CURED.values():
        assert (sb.render(roofed, spec, view_size=160).visibility < 0.5)[shadowed].mean() > 0.999, spec


def test_the_g_buffer_has_the_smooth_surface_of_the_truth(studio, looking, sun) -> None:
    """Also seen from inside, where both normals are turned and the surface is hollow: nothing is above it."""
    for eye, lifts in (((2.3, 1.0, 3.4), True), ((0.1, 0.2, 0.3), False)):
        shot = studio.shot(looking([ball(2)], sun(), 96, eye=eye, target=(0.0, 0.0, 0.0), fov=60.0))
        geometry, seen = shot.view.scene.geometry, shot.position[..., 3] > 0
        triangle, point, normal = shot.triangle[seen], shot.position[seen][:, :3], shot.normal[seen][:, :3]
        expected_position, expected_normal = smooth_points(
            point.T,
            geometry.vertices[geometry.faces[triangle]],
            geometry.shading_normals[triangle].astype(float),
            normal.T,
        )
        assert shot.surface.smooth is not None
        position, shading = (download(texture)[seen][:, :3] for texture in shot.surface.smooth)
        assert np.abs(position - expected_position.T).max() < 1e-6
        assert np.abs(shading - expected_normal.T).max() < 1e-4
        assert (np.einsum("ij,ij->i", shading, normal) > 0.8).all()
        assert (np.linalg.norm(position - point, axis=1).max() > 1e-3) == lifts
