"""What filters store in maps: linear depths, their blur and their mip levels, compared with SciPy."""

import math

import numpy as np
import pytest
from scipy import ndimage

from shadowbench.maps.caster_map import kernel_weights
from shadowbench.scenes.model import Light, Mesh
from tests.samples import pairs

SUN = Light("sun", "directional", (0.4, -1.0, 0.3))
SPOT = Light("spot", "spot", (0.5, -1.0, 0.2), (-1.5, 3.0, -0.7), 1.0)
DOWN = Light("sun", "directional", (0.0, -1.0, 0.0))


def plate(y: float, x: tuple[float, float] = (-2.2, 2.2), z: tuple[float, float] = (-2.2, 2.2)) -> Mesh:
    """A horizontal rectangle."""
    corners = np.array([[x[0], y, z[0]], [x[0], y, z[1]], [x[1], y, z[1]], [x[1], y, z[0]]])
    return Mesh(f"plate at {y}", corners, np.array([[0, 1, 2], [0, 2, 3]]))


def stored(one) -> np.ndarray:
    """(layers, size, size, components) of a built technique's map."""
    texture, size = one.technique.map.contents.texture, one.technique.params.size
    data = b"".join(map(texture.read, range(6))) if one.technique.name == "cube-map" else texture.read()
    return np.frombuffer(data, dtype=np.float32).reshape(-1, size, size, texture.components).astype(float)


@pytest.fixture
def contents(looking, studio, build):
    """The contents of a map of one scene, and its technique."""

    def make(spec: str, light: Light, *meshes: Mesh):
        meshes = meshes or (plate(0.0), plate(1.0, (-0.7, 0.4), (-0.3, 0.9)))
        shot = studio.shot(looking(meshes, light, 48, eye=(0.1, 3.5, 4.0)))
        one = build(spec, shot)
        one.draw(shot)
        return stored(one), one

    return make


def test_a_box_weighs_its_texels_equally_and_a_gaussian_deviates_by_a_quarter_of_its_width() -> None:
    assert kernel_weights("box", 5, 5) == pytest.approx(np.full(5, 1 / 5))
    assert kernel_weights("box", 6, 7) * 6 == pytest.approx([0.5, *np.ones(5), 0.5]), "half of either end"
    weights, texels = kernel_weights("gaussian", 8, 65), np.arange(4)
    assert weights[32:36] / weights[32] == pytest.approx(np.exp(-((texels / 2) ** 2) / 2))


@pytest.mark.parametrize("light", [SUN, SPOT], ids=lambda light: light.kind)
def test_the_first_moment_is_the_linear_depth_of_the_map(contents, light) -> None:
    """For a spot too, whose depth buffer is not linear."""
    values, one = contents("shadow-map:size=128,filter=vsm(blur=1)", light)
    assert (values[0, ..., 0] < 0.9).mean() > 0.05
    assert values[0, ::-1, :, 0] == pytest.approx(one.technique.map_image().astype(float), abs=2e-5)


@pytest.mark.parametrize(
    ("filter_", "width", "kernel"), pairs(["vsm", "evsm(positive=5)", "msm"], [5, 31], ["box", "gaussian"])
)
def test_the_blur_is_scipy_s_with_the_far_contents_around(contents, filter_, width, kernel) -> None:
    name, _, items = filter_.strip(")").partition("(")
    items = f"{items}," if items else ""
    blurred, _ = contents(
        f"shadow-map:size=64,fit=fixed(half=0.8),filter={name}({items}blur={width},kernel={kernel})", SUN
    )
    sharp, one = contents(f"shadow-map:size=64,fit=fixed(half=0.8),filter={name}({items}blur=1)", SUN)
    weights = kernel_weights(kernel, width, width | 1)
    for component, far in zip(range(sharp.shape[-1]), one.technique.map.contents.far, strict=False):
        expected = sharp[0, ..., component]
        for axis in (0, 1):
            expected = ndimage.correlate1d(expected, weights, axis, mode="constant", cval=far)
        assert blurred[0, ..., component] == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    assert np.abs(blurred - sharp).max() > 0.01


def test_the_blur_is_as_wide_in_the_scene_in_every_cascade(contents) -> None:
    """The variance of the edge of a half-plane is that of the kernel."""
    ground, half = plate(0.0, (-40.0, 40.0), (-40.0, 40.0)), plate(2.0, (-40.0, 0.0), (-40.0, 40.0))
    values, one = contents("cascades:size=256,count=3,box=tight,filter=vsm(blur=41)", DOWN, ground, half)
    views = one.technique.light_views
    widths = []
    for layer, view in zip(values[..., 0], views, strict=True):
        across = int(np.argmax(np.abs(view.to_map()[:2, 0])))  # the map's axis along x; the edge is at 0
        edge = round(256 * float(view.to_map()[across, 3]))
        assert 24 < edge < 256 - 24
        rise = np.abs(np.diff(np.moveaxis(layer, 1 - across, -1)[128, edge - 24 : edge + 24]))
        at = np.arange(len(rise))
        mean = (rise * at).sum() / rise.sum()
        widths.append(math.sqrt((rise * (at - mean) ** 2).sum() / rise.sum()) * view.texel[0])
    texels = [view.texel[0] for view in views]
    assert max(texels) > 2 * min(texels)
    assert widths == pytest.approx([41 / math.sqrt(12) * min(texels)] * 3, rel=0.05)


def test_the_blur_crosses_the_edges_of_a_cube_s_faces(contents) -> None:
    """A plate before the face +X as far as its edge to +Z: three fifths and two fifths on either side, at every row."""
    lamp = Light("lamp", "point", position=(0.0, 0.0, 0.0))
    corners = np.array([[1.0, -0.4, 1], [1, -0.4, 0], [1, 0.4, 0], [1, 0.4, 1]])
    caster = Mesh("caster", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    ground = plate(-3.0)
    values, _ = contents("cube-map:size=64,filter=vsm(blur=5)", lamp, ground, caster)
    sharp, _ = contents("cube-map:size=64,filter=vsm(blur=1)", lamp, ground, caster)
    rows = slice(26, 38)
    nearer = 1 - sharp[0, rows, 0, 0]  # the column of +X at its edge, where s = −1, z = +1
    assert nearer.min() > 0.3 and (sharp[4, rows, -1, 0] == 1).all()
    assert (1 - values[0, rows, 0, 0]) / nearer == pytest.approx(3 / 5, abs=0.02)
    assert (1 - values[4, rows, -1, 0]) / nearer == pytest.approx(2 / 5, abs=0.02)
