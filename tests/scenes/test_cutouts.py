"""Where a cut-out surface is opaque."""

import numpy as np
import pytest

from shadowbench.scenes.cutouts import SUBTEXELS, Cutout, cut_out
from shadowbench.scenes.meshes import placed
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.triangles import Triangles
from tests.cards import alpha_at

CHEQUER = np.array([[255, 0], [0, 255]], dtype=np.uint8)
NOISE = np.random.default_rng(1).integers(0, 256, (5, 37), dtype=np.uint8)


@pytest.mark.parametrize(
    ("nearest", "wrap", "factor"),
    [
        (True, ("repeat", "mirror"), 1.0),
        (True, ("clamp", "repeat"), 0.7),
        (False, ("mirror", "clamp"), 1.0),
        (False, ("repeat", "repeat"), 0.7),
        (False, ("clamp", "mirror"), 0.9),
    ],
)
def test_a_sub_texel_is_opaque_where_the_sampled_alpha_reaches_the_cutoff(nearest, wrap, factor) -> None:
    cutout = cut_out(NOISE, factor, 0.4, nearest, wrap)
    size = np.array(cutout.size)
    assert size.tolist() == [37 * (1 if nearest else SUBTEXELS), 5 * (1 if nearest else SUBTEXELS)]
    centres = (np.random.default_rng(2).integers(-2 * size, 3 * size, (5000, 2)) + 0.5) / size
    alpha = alpha_at(NOISE, nearest, wrap, centres) * factor
    sure = np.abs(alpha - 0.4 * 255) > 1e-6
    assert np.array_equal(cutout.opaque(centres * size)[sure], (alpha > 0.4 * 255)[sure])
    triangles = np.random.default_rng(3).uniform(-2, 3, (50, 3, 2))
    moved = cutout.places(triangles).mean(axis=1), triangles.mean(axis=1) * size  # by whole periods
    assert (cutout.opaque(moved[0]) == cutout.opaque(moved[1])).all()
    assert np.array_equal(Cutout.of(cutout.bits).words, cutout.words)


@pytest.mark.parametrize("nearest", [True, False])
@pytest.mark.parametrize(
    ("alpha", "factor", "cutoff", "vertex"),
    [(255, 1, 1, 1), (255, 0.5, 0.5, 1), (255, 1, 0.7, 0.7), (100, 1, 100 / 255, 1), (51, 0.5, 0.05, 0.5)],
)
def test_an_alpha_equal_to_the_cutoff_is_opaque(alpha, factor, cutoff, vertex, nearest) -> None:
    texels = np.full((6, 6), alpha, np.uint8)
    assert cut_out(texels, factor * vertex, float(np.float32(cutoff)), nearest).share == 1.0
    assert cut_out(texels - 1, factor * vertex, float(np.float32(cutoff)), nearest).share == 0.0


def test_what_a_mesh_has_by_corner_follows_its_triangles() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    faces = np.array([[0, 1, 1], [0, 1, 2], [2, 1, 3]], dtype=np.int32)  # the first has no area
    places = np.arange(18, dtype=np.float32).reshape(3, 3, 2)
    mesh = Mesh("leaf", corners, faces, cutout=cut_out(CHEQUER), places=places)
    still, mirrored = (placed([(mesh, np.diag([side, 1.0, 1.0, 1.0]))], "file")[0][0] for side in (1.0, -1.0))
    assert np.array_equal(still.places, places[1:])
    assert np.array_equal(mirrored.places, places[1:, ::-1])
    assert np.array_equal(mirrored.vertices[mirrored.faces][0, 0] * [-1, 1, 1], still.vertices[still.faces][0, 2])


def test_the_cut_out_triangles_of_a_scene_are_those_of_its_meshes() -> None:
    triangle = Triangles(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    cutouts = cut_out(CHEQUER), cut_out(CHEQUER, nearest=True)
    meshes = [Mesh("a", *triangle), *(Mesh("b", *triangle, cutout=cutout) for cutout in (*cutouts, cutouts[0]))]
    geometry = Scene("scene", (meshes[1], meshes[0], *meshes[2:]), (), ()).geometry
    assert geometry.cutouts is not None
    assert geometry.cutouts.faces.tolist() == [0, 2, 3]
    assert geometry.cutouts.number.tolist() == [0, 1, 0]
    among = geometry.cutouts.among(np.array([False, True, False, True]))
    assert among is not None
    assert (among.faces.tolist(), among.number.tolist()) == ([1], [0])
    assert geometry.digest() != Scene("scene", (meshes[0],) * 4, (), ()).geometry.digest()
