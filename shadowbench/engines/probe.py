"""A picture of known light, which shows whether an engine's frame, encoding and shading are what they should be."""

import math

import numpy as np

from shadowbench.engines.pictures import Luminance
from shadowbench.measure.worker import CellFailed
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View
from shadowbench.truths.cache import cached_truth

TURNS = {"upper right": -60.0, "upper left": 0.0, "lower left": 15.52, "lower right": 50.0}
"""Degrees by which the probe's squares are turned to the right. No reflection or turn of the picture is like it."""
_SUN = 60.0  # degrees from the camera's axis to the left, so that N·L is 1, 0.5 and 0.25, and one square is not lit
_PLACES = {"upper left": (-1, 1), "upper right": (1, 1), "lower left": (-1, -1), "lower right": (1, -1)}
_UNLIT = 0.002  # of the brightest, that the unlit square may have
_TOLERANCE = 0.03  # of the ratio of luminances, of which 8 bits take 0.01 at N·L = 1/4
_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def probe_view(size: int) -> View:
    """Four squares before a camera that looks along −z, of which a sun from the left lights three."""
    meshes = tuple(_square(name, *_PLACES[name], math.radians(turn)) for name, turn in TURNS.items())
    camera = Camera("eye", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), math.radians(60), near=0.1, far=10.0)
    angle = math.radians(_SUN)
    sun = Light("sun", "directional", (math.sin(angle), 0.0, -math.cos(angle)))
    return View(Scene("probe", meshes, (camera,), (sun,)), camera, sun, size)


def _square(name: str, right: int, up: int, turn: float) -> Mesh:
    """A square with its centre at a corner of another one, turned about its vertical axis."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.7
    points = [(right + x * math.cos(turn), up + y, -4 - x * math.sin(turn)) for x, y in corners]
    return Mesh(name, np.array(points, np.float64), _FACES)


def cosines() -> dict[str, float]:
    """N·L of the squares, 0 of the one that is not lit."""
    return {name: max(math.cos(math.radians(turn + _SUN)), 0.0) for name, turn in TURNS.items()}


def check_probe(view: View, picture: Luminance) -> None:
    """Raises CellFailed unless each square is where it should be, and as bright as its N·L says."""
    truth = cached_truth(view)
    found = truth.triangle // len(_FACES)
    if (picture[~_widened(found >= 0)] > 0.02).any():
        raise CellFailed("drew the probe where nothing is: is the picture upside down, or with a background?")
    levels = {name: float(np.median(picture[found == index])) for index, name in enumerate(TURNS)}
    brightest = max(levels["upper right"], 1e-6)
    for name, cosine in cosines().items():
        if not abs(levels[name] / brightest - cosine) <= (_TOLERANCE if cosine else _UNLIT):
            seen = ", ".join(f"{one} {level:.3f}" for one, level in levels.items())
            wanted = ", ".join(f"{cosine:.2f}" for cosine in cosines().values())
            raise CellFailed(
                f"drew the probe's squares as {seen}, whose N·L are {wanted}: is the picture upside down, of another "
                "encoding, or with ambient light?"
            )


def _widened(mask: np.ndarray) -> np.ndarray:
    """A mask with the pixels beside its own, where rasterisers may differ."""
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(mask, iterations=2))
