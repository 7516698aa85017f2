"""A picture of known light, which shows whether an engine's frame, encoding and shading are what they should be."""

import math

import numpy as np

from shadowbench.engines.pictures import Luminance
from shadowbench.measure.drawer import CellFailed
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View
from shadowbench.truths.cache import cached_truth

COSINES = {"upper left": 1.0, "upper right": 0.5, "lower left": 0.25}
"""N·L of the probe's squares. The lower right is empty: no reflection or turn of the picture is like it."""
_PLACES = {"upper left": (-1, 1), "upper right": (1, 1), "lower left": (-1, -1)}
_TOLERANCE = 0.03  # of the ratio of luminances, of which 8 bits take 0.01 at N·L = 1/4
_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def probe_view(size: int) -> View:
    """Three squares before a camera that looks along −z, with a sun behind it, turned from it by arccos N·L."""
    meshes = tuple(_square(name, *_PLACES[name], cosine) for name, cosine in COSINES.items())
    camera = Camera("eye", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), math.radians(60), near=0.1, far=10.0)
    sun = Light("sun", "directional", (0.0, 0.0, -1.0))
    return View(Scene("probe", meshes, (camera,), (sun,)), camera, sun, size)


def _square(name: str, right: int, up: int, cosine: float) -> Mesh:
    """A square with its centre at a corner of another one, turned about its vertical axis towards the middle."""
    sine = math.sqrt(1 - cosine * cosine)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.7
    points = [(right + x * cosine, up + y, -4 + right * x * sine) for x, y in corners]
    return Mesh(name, np.array(points, np.float64), _FACES)


def check_probe(view: View, picture: Luminance) -> None:
    """Raises CellFailed unless each square is where it should be, and as bright as its N·L says."""
    truth = cached_truth(view)
    found = truth.triangle // len(_FACES)
    if (picture[~_widened(found >= 0)] > 0.02).any():
        raise CellFailed("drew the probe where nothing is: is the picture upside down, or with a background?")
    levels = {name: float(np.median(picture[found == index])) for index, name in enumerate(COSINES)}
    brightest = levels["upper left"]
    for name, cosine in COSINES.items():
        if not abs(levels[name] / max(brightest, 1e-6) - cosine) <= _TOLERANCE:
            seen = ", ".join(f"{one} {level:.3f}" for one, level in levels.items())
            raise CellFailed(
                f"drew the probe's squares as {seen}, whose N·L are {', '.join(map(str, COSINES.values()))}: "
                "is the picture upside down, or of another encoding?"
            )


def _widened(mask: np.ndarray) -> np.ndarray:
    """A mask with the pixels beside its own, where rasterisers may differ."""
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(mask, iterations=2))
