"""Map sizes that cascades need, compared with the size of one map."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.hull import caster_and_receiver_vertices
from shadowbench.geometry.lights import LightSpace
from shadowbench.geometry.slices import practical_depths, slices
from shadowbench.scenes.geometry import bounds_of
from shadowbench.scenes.model import Floats, View
from shadowbench.survey.maps import FLAT, FittedMap
from shadowbench.survey.texels import Texels, edge_size

COUNTS = (2, 3, 4, 5, 6, 7, 8)


@dataclass(frozen=True)
class CascadeSizes:
    """Needed map sizes by number of cascades, with default parameters otherwise.

    depth_ratio: farthest over nearest view depth of the visible receivers; size, edge_size: of each map, defined as in
    `Texels`; best: number of cascades with the fewest texels in total, by `edge_size` if there are edges; saving:
    texels of one map divided by those of the best number of cascades.
    """

    depth_ratio: float
    size: Mapping[int, float]
    edge_size: Mapping[int, float]
    best: int
    saving: float

    @property
    def worthwhile(self) -> bool:
        """Whether some number of cascades needs fewer texels than one map."""
        return self.saving > 1.0


def cascades_of(fitted: FittedMap, one: Texels) -> CascadeSizes | None:
    """The needed sizes of cascades; None for a light that is not directional.

    one: the sizes of one map.
    """
    samples, space = fitted.samples, fitted.space
    if space is None or space.perspective:
        return None
    bounds = bounds_of(caster_and_receiver_vertices(samples.view.scene.geometry))
    sizes, edge_sizes = {}, {}
    for count in COUNTS:
        extents = _extents(samples.view, bounds, space, fitted.footprint.coords, count)
        unit = fitted.footprint.scaled(extents)
        sizes[count] = float(np.percentile(unit.longest, 95)) + 2 * fitted.padding
        by_edges = edge_size(fitted, extents)
        if by_edges is not None:
            edge_sizes[count] = by_edges.value
    single, several = (one.edge_size.value, edge_sizes) if one.edge_size else (one.size.value, sizes)
    best = min(several, key=lambda count: count * several[count] ** 2)
    ahead = samples.view.camera.basis()[2] @ (np.array(samples.view.camera.position)[:, None] - samples.point)
    return CascadeSizes(
        depth_ratio=float(ahead.max() / ahead.min()),
        size=sizes,
        edge_size=edge_sizes,
        best=best,
        saving=single**2 / (best * several[best] ** 2),
    )


def _extents(view: View, bounds: Floats, space: LightSpace, coords: Floats, count: int) -> Floats:
    """(2, R) width and height of each sample's cascade, the first whose box contains it.

    coords: (3, R) light-space coordinates of the samples.
    """
    extents = np.zeros((2, coords.shape[1]))
    remaining = np.arange(coords.shape[1])
    parts = slices(view.camera, practical_depths(*view.near_far, count), 0.0)
    for part in parts:
        box = space.box(part.corners_within(bounds, float(np.abs(bounds).max())))
        inside = np.full(len(remaining), True)
        if part is not parts[-1]:  # samples outside the last box are so by rounding only
            for row, low, high in zip(coords, box.low, box.high, strict=True):
                values = row.take(remaining)
                inside &= (values >= low) & (values <= high)
        extents[:, remaining[inside]] = np.maximum((box.high - box.low)[:2, None], FLAT)
        remaining = remaining[~inside]
    return extents
