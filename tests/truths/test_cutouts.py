"""The truth of cut-out surfaces: against all hits in float64, and against the same surfaces made of triangles."""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from numba.core import caching

from shadowbench.scenes.cutouts import WRAPS, Cutout, Wrap
from shadowbench.scenes.model import Light, Mesh, Scene, view_of
from shadowbench.truths import packets
from shadowbench.truths.cutout_filter import filter_address
from shadowbench.truths.cutouts import OPAQUE, cutout_arrays, decide
from shadowbench.truths.embree import INFINITE, Tracer
from shadowbench.truths.trace import trace
from tests.cards import CAMERA, GROUND, alpha_of, cards, made_of_triangles


@pytest.mark.parametrize(
    ("nearest", "wrap", "factor"), [(True, "repeat", 0.9), (False, "mirror", 1.0), (False, "clamp", 0.8)]
)
def test_cut_outs_agree_with_every_triangle_against_every_ray(
    nearest: bool, wrap: Wrap, factor: float, light: Light, judged: Callable[..., Any]
) -> None:
    leaves = cards(150, Cutout(alpha_of("noise"), factor, 0.45, nearest, (wrap, wrap)))
    view = view_of(Scene("leaves", (GROUND, leaves), (CAMERA,), (light,)), CAMERA, light, 128)
    truth = trace(view, pixel_samples=1)
    found = judged(view, truth, pixels=np.arange(128 * 128))
    assert (found.receiver & found.lit).sum() > 1000
    assert (found.receiver & ~found.lit).sum() > 1000
    assert found.wrong == 0


@pytest.mark.parametrize("instructions", ["sse2", "avx2"])
@pytest.mark.parametrize("width", [4, 8, 16, 1])
def test_rays_decide_the_same_in_packets_of_any_width(
    width: int, instructions: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    geometry = (
        Scene("leaves", (cards(60, Cutout(alpha_of("noise"))),), (), ())
        .placement.scene(Scene("leaves", (cards(60, Cutout(alpha_of("noise"))), GROUND), (), ()))
        .geometry
    )
    library = packets.load_library()
    assert library is not None
    device = packets.make_device(library, instructions)._replace(width=width) if width > 1 else None
    monkeypatch.setattr(packets, "default_device", lambda: device)
    random = np.random.default_rng(3)
    origins, directions = random.uniform(-0.5, 0.5, (3001, 3)), random.normal(size=(3001, 3))
    tracer = Tracer(geometry.vertices, geometry.faces, geometry.cutouts)
    hits, (blocked, left_open) = (
        tracer.hits(origins, directions, INFINITE),
        tracer.occlusion(origins, directions, INFINITE),
    )
    monkeypatch.setattr(packets, "default_device", lambda: None)
    alone = Tracer(geometry.vertices, geometry.faces, geometry.cutouts)  # every ray in float64
    others = alone.hits(origins, directions, INFINITE)
    sure = ~(hits.left_open | others.left_open | left_open)
    assert sure.mean() > 0.999
    assert 0.2 < blocked.mean() < 0.8
    assert np.array_equal(hits.triangle[sure], others.triangle[sure])
    assert np.array_equal(blocked[sure], others.triangle[sure] >= 0)


@pytest.mark.parametrize("nearest", [True, False])
@pytest.mark.parametrize("wrap", list(product(WRAPS, repeat=2)))
def test_rays_pass_where_a_mask_of_plateaus_is_clear(nearest: bool, wrap: tuple[Wrap, Wrap]) -> None:
    """Most hits are far from what differs; texture coordinates from −1.8 to 2.6."""
    random = np.random.default_rng(9)
    alpha = np.repeat(np.repeat(random.choice([0, 90, 160, 255], (5, 3)).astype(np.uint8), 7, axis=0), 9, axis=1)
    cutout = Cutout(alpha, 1.0, 0.5, nearest, wrap)
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0.0]])
    places = (corners[:, :2] * 4.4 + 0.4).astype(np.float32)
    mesh = Mesh("card", corners, GROUND.faces, cutout=cutout, coordinates=places[GROUND.faces])
    geometry = Scene("card", (mesh,), (), ()).geometry
    at = random.uniform(-0.49, 0.49, (20_000, 2))
    tracer = Tracer(geometry.vertices, geometry.faces, geometry.cutouts)
    blocked, left_open = tracer.occlusion(
        np.column_stack([at, np.ones(len(at))]), np.array([[0.0, 0.0, -1.0]]), INFINITE
    )
    assert left_open.mean() < 1e-3
    assert 0.1 < blocked.mean() < 0.9
    assert (blocked != cutout.opaque(at * 4.4 + 0.4))[~left_open].sum() == 0


def test_soft_shadows_of_texels_are_those_of_their_triangles() -> None:
    lamp = Light("lamp", "disc", (0.0, -1.0, 0.0), (0.3, 4.0, 0.2), radius=0.2)
    leaves = cards(25, Cutout(alpha_of("leaf"), nearest=True, wrap=("clamp", "clamp")))
    cut, exact = (
        trace(view_of(Scene("leaves", (GROUND, mesh), (CAMERA,), (lamp,)), CAMERA, lamp, 64), 1, standard_error=0.01)
        for mesh in (leaves, made_of_triangles(leaves))
    )
    decided = ~(cut.undecided | exact.undecided) & cut.receivers & exact.receivers
    error = np.hypot(cut.standard_error, exact.standard_error)[decided]
    off = np.abs(cut.visibility - exact.visibility)[decided]
    assert ((cut.visibility > 0.02) & (cut.visibility < 0.98))[decided].sum() > 200
    assert (off <= 4 * error + 1e-6).mean() > 0.995


def test_vertex_alphas_that_are_equal_are_not_rounded_where_they_are_interpolated() -> None:
    random = np.random.default_rng(7)
    weights = random.dirichlet(np.ones(3), 2000)
    for vertex in (1.0, 0.75, 0.5):
        mesh = Mesh(
            "card",
            np.eye(3),
            np.array([[0, 1, 2]], dtype=np.int32),
            cutout=Cutout(np.full((1, 1), 100, np.uint8), cutoff=100 * vertex / 255, nearest=True),
            coordinates=np.zeros((1, 3, 2), np.float32),
            alpha=np.full((1, 3), vertex, np.float32),
        )
        geometry = Scene("card", (mesh,), (), ()).geometry
        assert geometry.cutouts is not None
        assert geometry.cutouts.opaque(np.zeros(2000, int), weights).all()
        cut = cutout_arrays(geometry.cutouts, geometry.vertices, geometry.faces)
        assert all(decide(cut, 0, second, third, 0.0) == OPAQUE for _, second, third in weights)


def test_the_filter_is_compiled_where_nothing_can_be_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caching.CodeLibraryCacheImpl, "_locator_classes", [])
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    assert filter_address.__wrapped__() != 0
