"""What receives: whether it lies on planes, so that projected shadows suffice."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.planes import find_planes
from shadowbench.scenes.model import Scene
from shadowbench.survey.sampling import Estimate, Samples

ENOUGH = 0.999  # share of what is seen that must lie on planes, for projection to suffice


@dataclass(frozen=True)
class Receivers:
    """What is seen and faces the light.

    pixels: share of the view; planar: share of those that lie on planes that `planar-projection` takes, of which
    `planes` are seen; shadowed: share in shadow.
    """

    pixels: Estimate
    shadowed: Estimate
    planar: Estimate
    planes: int

    @property
    def projection_suffices(self) -> bool:
        """Whether next to all lies on planes."""
        return self.planar.value >= ENOUGH


def planes_of(scene: Scene) -> NDArray[np.int64]:
    """(T,) which of the planes each triangle lies on that `planar-projection` takes at its defaults, −1 for none."""
    geometry = scene.geometry
    of_triangle = np.full(len(geometry.faces), -1)
    for index, plane in enumerate(find_planes(geometry, geometry.receives)):
        of_triangle[plane.triangles] = index
    return of_triangle


def receivers_of(samples: Samples, of_triangle: NDArray[np.int64]) -> Receivers:
    """What is seen of the planes, (T,) as `planes_of` has them, out of all that receives."""
    plane_of = of_triangle[samples.triangle]
    lies, everything = plane_of >= 0, np.arange(len(samples.pixel))
    side = -(-samples.view.size // samples.step)
    part = len(everything) / side**2
    return Receivers(
        pixels=Estimate(part, 0.0 if samples.step == 1 else float(np.sqrt(part * (1 - part)) / side)),
        shadowed=samples.estimate(lambda chosen: float(samples.shadowed[chosen].mean()), everything),
        planar=samples.estimate(lambda chosen: float(lies[chosen].mean()), everything),
        planes=len(np.unique(plane_of[lies])),
    )
