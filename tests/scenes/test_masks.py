"""A scene file's `mask`, which cuts meshes out."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.scenes.cutouts import cut_out
from shadowbench.scenes.images import read_image
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Mesh
from tests.scenes.conftest import refused

ALPHA = np.array([[0, 51, 102, 153], [255, 0, 0, 255]], dtype=np.uint8)
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 3 0\nvt 0 3\nf 1/1 2/2 3/3\n"


@pytest.fixture
def masked(tmp_path: Path, scene_file):
    """Writes a scene file of one mesh with a mask."""

    def write(table: str, alpha: np.ndarray = ALPHA, keys: str = 'mask = "leaf.png"') -> Path:
        Image.fromarray(np.dstack([np.zeros((*alpha.shape, 3), np.uint8), alpha])).save(tmp_path / "leaf.png")
        (tmp_path / "a.obj").write_text(OBJ)
        (tmp_path / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        (tmp_path / "text.txt").write_text("no image")
        return scene_file(f"[[mesh]]\n{table}\n{keys}\n")

    return write


def only(path: Path, **options: Any) -> Mesh:
    (mesh,) = load_scene(path, **options).meshes
    return mesh


def test_a_mask_cuts_shapes_and_files_out_that_have_coordinates(masked) -> None:
    for table, wrap in (
        ('shape = "plane"', "clamp"),
        ('shape = "foliage"\ncount = 2', "clamp"),
        ('file = "a.obj"', "repeat"),
    ):
        cutout = only(masked(table)).cutout
        assert cutout is not None and cutout.wrap == (wrap, wrap)
        assert np.array_equal(cutout.words, cut_out(ALPHA, wrap=(wrap, wrap)).words)
        cutout = only(masked(table, keys='mask = "leaf.png"\ncutoff = 0.25\nmask_filter = "nearest"')).cutout
        assert cutout is not None and np.array_equal(cutout.bits, ALPHA > 63)


def test_an_image_on_an_upright_plane_is_upright(masked) -> None:
    mesh = only(masked('shape = "plane"\nrotate = [90, 0, 0]'))
    assert mesh.coordinates is not None
    corners = zip(mesh.vertices[mesh.faces].reshape(-1, 3), mesh.coordinates.reshape(-1, 2), strict=True)
    assert {(x, y): tuple(place) for (x, y, _), place in corners} == {
        (-0.5, -0.5): (0, 1), (0.5, -0.5): (1, 1), (0.5, 0.5): (1, 0), (-0.5, 0.5): (0, 0),
    }  # fmt: skip


def test_a_bad_mask_is_one_line(masked) -> None:
    for table, keys, words in (
        ('shape = "box"', 'mask = "leaf.png"', ["mask", "'box' has no texture coordinates", "plane, foliage"]),
        ('file = "bare.obj"', 'mask = "leaf.png"', ["mask", "'bare' has no texture coordinates"]),
        ('shape = "plane"', 'mask = "none.png"', ["mask", "'none.png' is not a file in"]),
        ('shape = "plane"', 'mask = "../leaf.png"', ["mask", "'../leaf.png'"]),
        ('shape = "plane"', 'mask = "text.txt"', ["mask", "'text.txt'", "not an image"]),
        ('shape = "plane"', 'mask = ""', ["mask"]),
        ('shape = "plane"', 'mask = "leaf.png"\ncutoff = 0', ["cutoff", "0"]),
        ('shape = "plane"', 'mask = "leaf.png"\ncutoff = 1.5', ["cutoff", "1.5"]),
        ('shape = "plane"', 'mask = "leaf.png"\nmask_filter = "cubic"', ["mask_filter", "linear", "nearest"]),
        ('shape = "plane"', "cutoff = 0.3", ["cutoff and mask_filter are for a mask"]),
    ):
        refused(masked(table, keys=keys), "[[mesh]] 1", *words)


def test_a_mask_that_leaves_nothing_is_refused(masked) -> None:
    refused(masked('shape = "plane"', np.full((2, 2), 60, np.uint8)), "mask", "below the cutoff 0.5 everywhere")


def test_a_grey_image_of_16_bits_has_the_texels_of_its_8_bits() -> None:
    """A PNG may call one grey transparent."""
    for clear in (None, 4 * 257):
        grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
        files = []
        for levels, scale in ((grey, 1), (grey.astype(np.uint16) * 257, 257)):
            files.append(io.BytesIO())
            options = {} if clear is None else {"transparency": clear * scale // 257}
            Image.fromarray(levels).save(files[-1], "PNG", **options)
        shallow, deep = (read_image(file.getvalue(), "a") for file in files)
        assert np.array_equal(deep, shallow) and np.array_equal(deep[..., 0], grey)
