"""Where a cut-out surface is opaque."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.cutouts import WRAPS, Cutout, Wrap
from shadowbench.scenes.meshes import placed
from shadowbench.scenes.model import Mesh, Scene
from shadowbench.scenes.triangles import Triangles

CHEQUER = np.array([[255, 0], [0, 255]], dtype=np.uint8)


def test_a_texel_covers_its_square_and_the_first_is_at_the_origin() -> None:
    cutout = Cutout(CHEQUER, nearest=True)
    inside = np.array([[0.01, 0.01], [0.49, 0.49], [0.51, 0.49], [0.51, 0.51], [0.49, 0.51]])
    assert cutout.opaque(inside).tolist() == [True, True, False, True, False]


def test_bilinear_alpha_is_linear_between_the_centres_of_texels() -> None:
    ramp = Cutout(np.array([[0, 255]], dtype=np.uint8), cutoff=0.25, wrap=("clamp", "clamp"))
    edge = 0.25 + 0.25 * 0.5  # a quarter of the way between the centres at ¼ and ¾
    assert ramp.opaque(np.array([[edge - 1e-5, 0.5], [edge + 1e-5, 0.5]])).tolist() == [False, True]


@pytest.mark.parametrize(("wrap", "texels"), [("repeat", "1010"), ("mirror", "0110"), ("clamp", "1110")])
def test_coordinates_outside_are_wrapped_as_the_sampler_says(wrap: Wrap, texels: str) -> None:
    cutout = Cutout(np.array([[255, 0]], dtype=np.uint8), nearest=True, wrap=(wrap, "repeat"))
    u = np.array([-0.75, -0.25, 0.25, 0.75])
    found = cutout.opaque(np.stack([u, np.zeros(4)], axis=1))
    assert "".join(str(int(value)) for value in found) == texels


@given(st.integers(0, 255), st.floats(0.01, 1), st.sampled_from([0.25, 0.5, 1.0]))
def test_of_one_texel_the_product_of_alphas_is_compared(alpha: int, cutoff: float, vertex: float) -> None:
    cutout = Cutout(np.full((1, 1), alpha, np.uint8), factor=0.5, cutoff=cutoff)
    opacity = alpha / 255 * 0.5 * vertex
    if abs(opacity - cutoff) > 1e-5:
        assert cutout.opaque(np.array([0.3, 0.7]), vertex) == (opacity >= cutoff)


@pytest.mark.parametrize("step", [1, 51, 127, 128, 254, 255])
def test_a_cutoff_written_as_a_step_of_8_bits_is_that_step(step: int) -> None:
    one, below = (
        Cutout(np.full((1, 1), alpha, np.uint8), cutoff=float(np.float32(step / 255))) for alpha in (step, step - 1)
    )
    assert one.is_whole() and one.opaque(np.zeros(2))
    assert below.is_clear() and not below.opaque(np.zeros(2))


@given(st.sampled_from(WRAPS), st.floats(-5, 5), st.floats(-5, 5))
def test_mirrored_coordinates_of_a_mirrored_texture_are_the_same(wrap: Wrap, u: float, v: float) -> None:
    texels = np.array([[10, 200, 90], [250, 30, 140]], dtype=np.uint8)
    one, other = Cutout(texels, wrap=(wrap, wrap)), Cutout(texels[:, ::-1], wrap=(wrap, wrap))
    here, there = np.array([u, v]), np.array([1 - u, v])
    level = Cutout(texels, cutoff=0.5 + 1e-6, wrap=(wrap, wrap)).opaque(here), one.opaque(here)
    if level[0] == level[1]:  # not within rounding of the cutoff
        assert one.opaque(here) == other.opaque(there)


def test_what_a_mesh_has_by_corner_follows_its_triangles() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    faces = np.array([[0, 1, 1], [0, 1, 2], [2, 1, 3]], dtype=np.int32)  # the first has no area
    coordinates = np.arange(18, dtype=np.float32).reshape(3, 3, 2)
    mesh = Mesh("leaf", corners, faces, cutout=Cutout(CHEQUER), coordinates=coordinates)
    still, mirrored = (placed([(mesh, np.diag([side, 1.0, 1.0, 1.0]))], "file")[0][0] for side in (1.0, -1.0))
    assert np.array_equal(still.coordinates, coordinates[1:])
    assert np.array_equal(mirrored.coordinates, coordinates[1:, ::-1])
    assert np.array_equal(mirrored.vertices[mirrored.faces][0, 0] * [-1, 1, 1], still.vertices[still.faces][0, 2])


def test_the_cut_out_triangles_of_a_scene_are_those_of_its_meshes() -> None:
    triangle = Triangles(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    cutouts = Cutout(CHEQUER), Cutout(CHEQUER, nearest=True)
    meshes = [Mesh("a", *triangle), *(Mesh("b", *triangle, cutout=cutout) for cutout in (*cutouts, cutouts[0]))]
    geometry = Scene("scene", (meshes[1], meshes[0], *meshes[2:]), (), ()).geometry
    assert geometry.cutouts is not None
    assert geometry.cutouts.faces.tolist() == [0, 2, 3]
    assert geometry.cutouts.number.tolist() == [0, 1, 0]
    among = geometry.cutouts.among(np.array([False, True, False, True]))
    assert among is not None
    assert (among.faces.tolist(), among.number.tolist()) == ([1], [0])
    assert geometry.digest() != Scene("scene", (meshes[0],) * 4, (), ()).geometry.digest()
