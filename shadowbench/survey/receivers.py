"""The visible receivers, and whether they are planar, so that projected shadows suffice."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.planes import find_planes
from shadowbench.scenes.model import Scene
from shadowbench.survey.sampling import Estimate, Samples

PLANAR_SHARE = 0.999  # least planar share of the visible receivers for which projection suffices


@dataclass(frozen=True)
class Receivers:
    """The visible receivers, which face the light.

    pixels: their share of the view; shadowed: their share in shadow; planar: their share on planes that
    `planar-projection` finds; lost: share of the shadow on other receivers; planes: number of visible planes.
    """

    pixels: Estimate
    shadowed: Estimate
    planar: Estimate
    lost: Estimate
    planes: int

    @property
    def projection_suffices(self) -> bool:
        """Whether practically all visible receivers are on planes."""
        return self.planar.value >= PLANAR_SHARE


def planes_of(scene: Scene) -> NDArray[np.int64]:
    """(T,) index of each triangle's plane, of those that `planar-projection` finds by default; −1 for none."""
    geometry = scene.geometry
    of_triangle = np.full(len(geometry.faces), -1)
    for index, plane in enumerate(find_planes(geometry, geometry.receives)):
        of_triangle[plane.triangles] = index
    return of_triangle


def receivers_of(samples: Samples, of_triangle: NDArray[np.int64]) -> Receivers:
    """Statistics of the visible receivers. of_triangle: (T,) planes of the triangles, from `planes_of`."""
    plane_of = of_triangle[samples.triangle]
    planar, everything, shadow = plane_of >= 0, np.arange(len(samples.pixel)), np.flatnonzero(samples.shadowed)
    side = -(-samples.view.size // samples.step)
    share = len(everything) / side**2
    return Receivers(
        pixels=Estimate(share, 0.0 if samples.step == 1 else float(np.sqrt(share * (1 - share)) / side)),
        shadowed=samples.estimate(lambda chosen: float(samples.shadowed[chosen].mean()), everything),
        planar=samples.estimate(lambda chosen: float(planar[chosen].mean()), everything),
        lost=samples.estimate(lambda chosen: float((~planar[chosen]).mean()), shadow) if len(shadow) else Estimate(0.0),
        planes=len(np.unique(plane_of[planar])),
    )
