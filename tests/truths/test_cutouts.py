"""The truth of cut-out surfaces: against all hits in float64, and against the same surfaces made of triangles."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shadowbench.scenes.cutouts import cut_out
from shadowbench.scenes.model import Light, Mesh, Scene, view_of
from shadowbench.truths import embree
from shadowbench.truths.embree import INFINITE, Tracer
from shadowbench.truths.trace import Truth, trace
from tests.cards import (
    CAMERA,
    GROUND,
    TWO,
    alpha_of,
    cards,
    crossing,
    edge_on,
    made_of_triangles,
    wraps,
)
from tests.truths.conftest import LAMP, SPOT, SUN

BILINEAR = cards(150, cut_out(alpha_of("noise"), 0.9, 0.45, wrap=("mirror", "clamp")))


def traced(meshes: list[Mesh], light: Light, size: int = 128, **options: Any) -> Truth:
    return trace(view_of(Scene("cards", (GROUND, *meshes), (CAMERA,), (light,)), CAMERA, light, size), 1, **options)


@pytest.mark.parametrize(
    ("leaves", "light"),
    [(BILINEAR, SUN), (cards(150, cut_out(alpha_of("noise"), nearest=True)), LAMP)],
    ids=["bilinear", "nearest"],
)
def test_cut_outs_agree_with_every_triangle_against_every_ray(leaves: Mesh, light: Light, judged) -> None:
    truth = traced([leaves], light)
    against = judged(truth.view, truth, pixels=np.arange(128 * 128))
    assert min((against.receiver & against.lit).sum(), (against.receiver & ~against.lit).sum()) > 1000
    assert against.wrong == 0


@pytest.mark.parametrize(
    ("scene", "light", "size"),
    [
        (wraps, SUN, 128),
        (crossing, SPOT, 128),
        (edge_on, LAMP, 128),
        *(pytest.param(scene, light, 640, marks=pytest.mark.slow) for scene, light in ((edge_on, SUN), (wraps, SPOT))),
    ],
)
def test_no_decided_pixel_differs_from_exact_triangles(
    scene: Callable[[Light], list[Mesh]], light: Light, size: int
) -> None:
    meshes = scene(light)
    cut, exact = (traced(each, light, size) for each in (meshes, [made_of_triangles(mesh) for mesh in meshes]))
    decided, ground = ~(cut.undecided | exact.undecided), len(GROUND.faces)
    on_cards, shadow = cut.triangle >= ground, cut.receivers & (cut.visibility == 0)
    assert (on_cards & decided).sum() > 0.02 * size**2
    assert (shadow & decided).sum() > 0.005 * size**2
    assert (on_cards != (exact.triangle >= ground))[decided].sum() <= 2, "where card and ground are both lit"
    assert (cut.receivers != exact.receivers)[decided].sum() == 0
    assert (cut.visibility != exact.visibility)[decided].sum() == 0


@pytest.mark.parametrize(("width", "instructions"), [(4, "sse2"), (8, "avx2"), (16, "sse2")])
def test_rays_pass_where_a_mask_is_clear_in_packets_of_any_width(
    width: int, instructions: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Texture coordinates from −1.8 to 2.6."""
    device = embree.make_device(instructions)._replace(width=width)
    monkeypatch.setattr(embree, "default_device", lambda: device)
    random = np.random.default_rng(9)
    cutout = cut_out(random.choice([0, 90, 160, 255], (5, 3)).astype(np.uint8), wrap=("repeat", "mirror"))
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0.0]])
    coordinates = corners[:, :2] * 4.4 + 0.4
    mesh = Mesh("card", corners, TWO, cutout=cutout, places=cutout.places(coordinates[TWO]))
    geometry = Scene("card", (mesh,), (), ()).geometry
    at = random.uniform(-0.49, 0.49, (20_001, 2))
    tracer = Tracer(geometry.vertices, geometry.faces, geometry.cutouts)
    rays = np.column_stack([at, np.ones(len(at))]), np.array([[0.0, 0.0, -1.0]]), INFINITE
    blocked, places = tracer.occluded(*rays), (at * 4.4 + 0.4) * cutout.size
    sure = (np.abs(places - np.round(places)) > 1e-3).all(axis=1)
    assert 0.1 < blocked.mean() < 0.9
    assert np.array_equal(blocked[sure], cutout.opaque(places)[sure])
    assert np.array_equal(tracer.hits(*rays).triangle >= 0, blocked)


def test_soft_shadows_of_texels_are_those_of_their_triangles() -> None:
    lamp = Light("lamp", "disc", (0.0, -1.0, 0.0), (0.3, 4.0, 0.2), radius=0.2)
    leaves = cards(25, cut_out(alpha_of("leaf"), nearest=True, wrap=("clamp", "clamp")))
    cut, exact = (traced([mesh], lamp, 64, standard_error=0.01) for mesh in (leaves, made_of_triangles(leaves)))
    decided = ~(cut.undecided | exact.undecided) & cut.receivers & exact.receivers
    error = np.hypot(cut.standard_error, exact.standard_error)[decided]
    off = np.abs(cut.visibility - exact.visibility)[decided]
    assert ((cut.visibility > 0.02) & (cut.visibility < 0.98))[decided].sum() > 200
    assert (off <= 4 * error + 1e-6).mean() > 0.995
