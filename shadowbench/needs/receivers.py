"""What receives: whether it lies on planes, so that projected shadows suffice."""

from dataclasses import dataclass

import numpy as np

from shadowbench.needs.rays import Indices
from shadowbench.needs.sampling import Estimate, Samples
from shadowbench.scenes.model import Geometry
from shadowbench.scenes.planes import find_planes
from shadowbench.techniques.planar_projection import PlanarProjection

ENOUGH = 0.999  # share of what is seen that must lie on planes, for projection to suffice


@dataclass(frozen=True)
class Receivers:
    """What is seen and faces the light.

    pixels: share of the view; planar: share of those that lie on planes, of which there are `planes`; shadowed: share
    in shadow.
    """

    pixels: Estimate
    shadowed: Estimate
    planar: Estimate
    planes: int

    @property
    def projection_suffices(self) -> bool:
        """Whether next to all lies on planes."""
        return self.planar.value >= ENOUGH


def receivers_of(samples: Samples) -> Receivers:
    """Planes among the triangles that are seen, by the finder and the limits of `planar-projection`."""
    limits = PlanarProjection.Params()
    triangles, triangle = np.unique(samples.triangle, return_inverse=True)
    seen, widened = _part(samples.view.scene.geometry, triangles)
    everywhere = np.ones(len(triangles), dtype=bool)
    planes = find_planes(seen, everywhere, limits.share, limits.count, limits.tolerance * widened)
    planar = np.zeros(len(triangles), dtype=bool)
    for plane in planes:
        planar[plane.triangles] = True
    everything, lies = np.arange(len(samples.pixel)), planar[triangle]
    side = -(-samples.view.size // samples.step)
    part = len(everything) / side**2
    return Receivers(
        pixels=Estimate(part, 0.0 if samples.step == 1 else float(np.sqrt(part * (1 - part)) / side)),
        shadowed=samples.estimate(lambda chosen: float(samples.shadowed[chosen].mean()), everything),
        planar=samples.estimate(lambda chosen: float(lies[chosen].mean()), everything),
        planes=len(planes),
    )


def _part(geometry: Geometry, triangles: Indices) -> tuple[Geometry, float]:
    """Some triangles alone, and how many times smaller their diagonal is: tolerances are shares of the whole's."""
    vertices, faces = np.unique(geometry.faces[triangles], return_inverse=True)
    part = Geometry(
        vertices=geometry.vertices[vertices],
        faces=faces.reshape(-1, 3).astype(np.int32),
        casts=geometry.casts[triangles],
        receives=geometry.receives[triangles],
        planar=geometry.planar[triangles],
        colors=geometry.colors[triangles],
    )
    whole_diagonal, diagonal = (float(np.linalg.norm(one.bounds[1] - one.bounds[0])) for one in (geometry, part))
    return part, whole_diagonal / diagonal
