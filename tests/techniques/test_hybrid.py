"""A map where it is certain, and rays elsewhere; rays in a shader."""

import math

import numpy as np
import pytest

from shadowbench.gl.device import Device
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, Mesh, view_of
from shadowbench.scenes.vectors import unit, vec3
from tests.samples import by_turns

SCENES = ["stairs", "railings", "sphere-and-torus", "spot-lamp", "room-with-lamp"]


@pytest.mark.parametrize("name", SCENES)
def test_rays_in_a_shader_with_and_without_a_small_map_are_the_truth(name, builtin, truth_of, mask, scored) -> None:
    for spec, least in (("ray-traced:where=gpu", 0.9999), ("hybrid:size=256", 0.9998)):
        assert scored(mask(spec, builtin(name)), truth_of(name))["iou"] >= least


def unsure(spec, shot, build) -> int:
    """Number of pixels that the map of a hybrid does not answer: of visibility ½ before they are traced."""
    one = build(spec, shot)
    one.technique.trace = lambda *_: None
    return int((one.draw(shot) == 0.5).sum())


def test_the_map_answers_most_pixels(builtin, build, studio) -> None:
    shot = studio.shot(builtin("stairs"))
    coarse, fine = (unsure(f"hybrid:size={size}", shot, build) for size in (1024, 4096))
    assert 0 < fine < 0.5 * coarse < 0.1 * (shot.triangle >= 0).sum()


HOSTILE = {
    "thin bars far from a spot whose apex is near the eye": """
        light = { kind = "spot", position = [-5, 0.9, 0], direction = [1, -0.05, 0], angle = 60 }
        camera = { position = [5.2, 0.5, 0.6], target = [3.5, 0.15, 0], fov_y = 60 }
        mesh = [
            { shape = "plane", scale = 14 },
            { shape = "sphere", scale = 0.1, translate = [-5.2, 1.3, 0] },
            { shape = "box", scale = [0.005, 0.008, 0.3], translate = [4, 0.003, 0] },
            { shape = "box", scale = [0.005, 0.008, 0.3], translate = [4.3, 0.003, 0.2], rotate = [0, 10, 0] },
        ]""",
    "a disc light, which shines on a half-space": """
        light = { kind = "disc", radius = 0, position = [0, 0.3, 0], direction = [0, -1, 0] }
        camera = { position = [6, 3, 6], target = [2, 0, 2], fov_y = 60 }
        mesh = [
            { shape = "plane", scale = 20 },
            { shape = "box", scale = [0.2, 0.25, 0.2], translate = [2, 0.125, 1] },
        ]""",
    "a tower on its receiver under a high sun": """
        light = { kind = "directional", direction = [1, -10, -0.4] }
        camera = { position = [-3, 2.5, 3], target = [0, 0.4, 0], fov_y = 40 }
        mesh = [
            { shape = "plane", scale = 8 },
            { shape = "box", scale = [0.7, 4, 0.7], translate = [0, 2, 0], rotate = [0, 17, 0] },
        ]""",
    "a lamp close to a ramp": """
        light = { kind = "point", position = [0.3, 0.03, 0.2] }
        camera = { position = [3, 2, 3], target = [0, 0, 0], fov_y = 60 }
        mesh = [
            { shape = "plane", scale = 20, rotate = [25, 0, 20] },
            { shape = "box", scale = [20, 20, 0.2], translate = [0, 0, -6] },
            { shape = "box", scale = [0.2, 20, 20], translate = [-6, 0, 0] },
            { shape = "box", scale = 0.3, translate = [-2, -0.5, 0.5], rotate = [0, 17, 0] },
        ]""",
    "a caster of 0.2 mm at a spot": """
        light = { kind = "spot", position = [-2, 2.5, 0.2], direction = [2, -2.2, -0.1], angle = 70 }
        camera = { position = [3, 2, 3], target = [0, 0.3, 0], fov_y = 45 }
        mesh = [
            { shape = "plane", scale = 8 },
            { shape = "box", scale = [1e-4, 2e-4, 2e-4], translate = [-1.9995, 2.49945, 0.2], rotate = [0, 17, 0] },
        ]""",
}


@pytest.mark.parametrize(
    ("name", "size"),
    by_turns(["canopy", "railings", "room-with-lamp", "lamp-by-wall", "colonnade", "deep-street"], [16, 128]),
)
def test_casters_thinner_than_texels_are_not_missed(name, size, builtin, mask) -> None:
    """Their silhouettes are in the map, where its depths have few of them."""
    view = builtin(name)
    assert (mask(f"hybrid:size={size}", view) != mask("ray-traced:where=gpu", view)).sum() <= 4


@pytest.mark.parametrize("text", HOSTILE.values(), ids=list(HOSTILE))
def test_contacts_and_extremes_are_traced(text, tmp_path, mask) -> None:
    (tmp_path / "hostile.toml").write_text(text)
    scene = load_scene(str(tmp_path / "hostile.toml"))
    view = view_of(scene, scene.cameras[0], scene.lights[0], 192)
    rays = mask("ray-traced", view)
    assert (rays < 1).sum() > 30
    for spec in ("ray-traced:where=gpu", "hybrid:size=16", "hybrid:size=64", "hybrid"):
        assert (mask(spec, view) != rays).mean() < 2e-4, spec


def test_a_scene_whose_tree_fits_no_texture_is_declined(device: Device, builtin, monkeypatch) -> None:
    monkeypatch.setitem(device.__dict__, "max_map_size", 1)
    for text in ("hybrid", "ray-traced:where=gpu"):
        spec = parse_spec(text, techniques())
        assert "triangles" in str(spec.technique.unsupported(spec.params, builtin("canopy", 32), device))


@pytest.mark.parametrize("kind", ["directional", "spot"])
def test_an_inclined_plane_that_faces_the_light_is_certainly_lit(kind, looking, studio, build) -> None:
    """Stored depths differ from the plane's by rounding alone, which the tolerance covers."""
    normal = np.array(unit((0.2, 1.0, 0.35)))
    right = np.array(unit(np.cross(normal, (0.9, 0.1, 0.4))))
    corners = 1.5 * np.array([x * right + y * np.cross(normal, right) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    plane = Mesh("plane", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    light = Light(kind, kind, vec3(-normal), vec3(6.0 * normal), math.radians(45))
    shot = studio.shot(looking([plane], light, 128, eye=vec3(3.2 * normal + 0.4 * right), fov=40.0))
    assert (build("hybrid:size=256", shot).draw(shot)[shot.triangle >= 0] == 1).all()
    assert unsure("hybrid:size=256", shot, build) < 0.01 * (shot.triangle >= 0).sum()
