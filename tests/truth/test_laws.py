"""What may be done to a scene without moving a shadow; exact wherever both answers are decided."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench.scenes.model import Floats, Light, Mesh, View, vec3
from shadowbench.truth.trace import Truth, trace

few = settings(
    max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], database=None
)

COARSE: dict[str, dict[str, int]] = {
    "box": {},
    "sphere": {"subdivisions": 2},
    "torus": {"sections": 16},
    "cone": {"sections": 12},
    "plane": {},
}
CONVEX = ("box", "cone", "sphere")


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 3))


def casters(*kinds: str) -> st.SearchStrategy[list[dict[str, Any]]]:
    one = st.fixed_dictionaries(
        {
            "kind": st.sampled_from(kinds or sorted(COARSE)),
            "scale": st.tuples(spread(0.3, 1.2), spread(0.2, 1.5), spread(0.3, 1.2)),
            "at": st.tuples(spread(-1.2, 1.2), spread(0.8, 1.4), spread(-1.2, 1.2)),
        }
    )
    return st.lists(one, min_size=1, max_size=3)


@st.composite
def lights(draw: st.DrawFn) -> Light:
    elevation, azimuth = draw(spread(20.0, 85.0)), draw(spread(0.0, 360.0))
    level = math.cos(math.radians(elevation))
    toward = np.array(
        [
            level * math.cos(math.radians(azimuth)),
            math.sin(math.radians(elevation)),
            level * math.sin(math.radians(azimuth)),
        ]
    )
    kind = draw(st.sampled_from(["directional", "spot", "point"]))
    position = (0.0, 0.0, 0.0) if kind == "directional" else vec3(toward * 6.0)
    return Light("light", kind, vec3(-toward), position, math.radians(50.0))


@pytest.fixture(scope="module")
def seen(shape: Callable[..., Mesh], looking: Callable[..., View]) -> Callable[..., View]:
    """Casters over a ground, seen from above."""

    def make(described: list[dict[str, Any]], light: Light, *more: Mesh) -> View:
        meshes = [shape(**caster, **COARSE[caster["kind"]]) for caster in described]
        return looking([shape("plane", 8.0), *meshes, *more], light)

    return make


def with_meshes(view: View, meshes: list[Mesh]) -> View:
    return replace(view, scene=replace(view.scene, meshes=tuple(meshes)))


def with_faces(mesh: Mesh, vertices: Floats, faces: np.ndarray) -> Mesh:
    return replace(mesh, vertices=vertices, faces=np.ascontiguousarray(faces, dtype=np.int32))


def assert_same(first: Truth, second: Truth) -> None:
    both = ~first.undecided & ~second.undecided
    assert both.mean() > 0.97
    assert (first.receivers == second.receivers)[both].all()
    assert (first.visibility == second.visibility)[both].all()


@few
@given(casters(), lights(), st.randoms(use_true_random=False))
def test_order_of_triangles_and_meshes_moves_no_shadow(
    seen: Callable[..., View], described: list[dict[str, Any]], light: Light, random: Any
) -> None:
    view = seen(described, light)
    shuffled = []
    for mesh in view.scene.meshes:
        order = list(range(len(mesh.faces)))
        random.shuffle(order)
        turned = np.roll(mesh.faces[order], random.randrange(3), axis=1)  # another corner first
        shuffled.append(with_faces(mesh, mesh.vertices, turned))
    random.shuffle(shuffled)
    assert_same(trace(view), trace(with_meshes(view, shuffled)))


@few
@given(casters(), lights())
def test_winding_moves_no_shadow(seen: Callable[..., View], described: list[dict[str, Any]], light: Light) -> None:
    view = seen(described, light)
    flipped = [with_faces(mesh, mesh.vertices, mesh.faces[:, ::-1]) for mesh in view.scene.meshes]
    assert_same(trace(view), trace(with_meshes(view, flipped)))


@few
@given(casters(), lights())
def test_splitting_triangles_moves_no_shadow(
    seen: Callable[..., View], described: list[dict[str, Any]], light: Light
) -> None:
    def split(mesh: Mesh) -> Mesh:
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
        return with_faces(mesh, corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))

    view = seen(described, light)
    assert_same(trace(view), trace(with_meshes(view, [split(mesh) for mesh in view.scene.meshes])))


@few
@given(casters(), lights(), st.booleans())
def test_caster_beside_all_ways_to_the_light_shadows_nothing(
    seen: Callable[..., View],
    shape: Callable[..., Mesh],
    described: list[dict[str, Any]],
    light: Light,
    below: bool,
) -> None:
    """Below the ground, or farther than the light, or for a sun on the far side of the ground."""
    away = np.asarray(light.direction)
    beside = (0.0, -1.5, 0.0) if below else vec3(-away * 8.0 if light.kind != "directional" else away * 6.0)
    if not below and light.kind == "directional" and beside[1] > -2.5:
        beside = (0.0, -2.5, 0.0)  # a low sun's far side could be seen beyond the ground
    more = shape("box", 1.0, beside)
    assert_same(trace(seen(described, light)), trace(seen(described, light, more)))


@few
@given(casters(), lights(), spread(1.0, 359.0))
def test_turning_everything_about_y_changes_nothing(
    seen: Callable[..., View], described: list[dict[str, Any]], light: Light, degrees: float
) -> None:
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    view = seen(described, light)
    meshes = [replace(mesh, vertices=mesh.vertices @ turn.T) for mesh in view.scene.meshes]
    camera = replace(
        view.camera,
        position=vec3(turn @ view.camera.position),
        target=vec3(turn @ view.camera.target),
        near=0.2,
        far=30.0,
    )
    turned_light = replace(light, direction=vec3(turn @ light.direction), position=vec3(turn @ light.position))
    turned = replace(with_meshes(view, meshes), camera=camera, light=turned_light)
    assert_same(trace(view), trace(turned))


@few
@given(casters(*CONVEX), lights())
def test_caster_inside_a_caster_lights_and_shadows_nothing(
    seen: Callable[..., View], described: list[dict[str, Any]], light: Light
) -> None:
    view = seen(described, light)
    _, *solid = view.scene.meshes
    inner = [replace(mesh, vertices=(mesh.vertices + mesh.vertices.mean(axis=0)) / 2) for mesh in solid]
    assert_same(trace(view), trace(with_meshes(view, [*view.scene.meshes, *inner])))


@few
@given(casters(), casters(), lights())
def test_another_caster_lights_no_pixel(
    seen: Callable[..., View], first: list[dict[str, Any]], second: list[dict[str, Any]], light: Light
) -> None:
    fewer, more = trace(seen(first, light)), trace(seen(first + second, light))
    same = (fewer.triangle == more.triangle) & fewer.receivers & ~fewer.undecided & ~more.undecided
    assert same.any()
    assert (more.visibility <= fewer.visibility)[same].all()
