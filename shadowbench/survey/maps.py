"""The shadow map fitted to the visible receivers, independent of its size."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shadowbench.geometry.lights import Box, LightSpace, light_space
from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import Footprint, cube_faces, cube_footprint, footprint
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Samples

PADDING = 2.0  # default texels around the receivers: one for a 2×2 comparison, one for receivers offset by a bias
REFERENCE_SIZE = 1024  # map size, the techniques' default, for which texels and biases are reported
FLAT = 1e-9  # least extent of a map, a local length


@dataclass(frozen=True, eq=False)
class FittedMap:
    """One map fitted to samples, as by `fit=visible`, or a point light's cube map.

    footprint: of the samples, in units of light space, or of a cube's face at distance 1; box: bounds of the samples;
    extent: (2,) width and height of the box; space: of the light, None for a cube; padding: texels around the box on
    each side.
    """

    samples: Samples
    footprint: Footprint
    box: Box
    extent: Floats
    space: LightSpace | None
    padding: float

    @cached_property
    def unit(self) -> Footprint:
        """The samples' footprint, with the whole map without its padding as the unit."""
        return self.footprint.scaled(self.extent)

    @cached_property
    def single_texel_extent(self) -> Floats:
        """(R,) largest extent in pixels of the texel of a 1 × 1 map; divide by `texels(size)` for larger maps."""
        return self.unit.longest

    def texels(self, size: float) -> float:
        """Number of texels along a side of a map of this size, without the padding."""
        return size - 2 * self.padding

    def light_spaces(self) -> Iterator[tuple[Indices, LightSpace, Footprint]]:
        """The map's light space, or a cube's six, each with its samples' indices and their footprint."""
        if self.space is None:
            yield from cube_faces(self.samples)
        else:
            yield self.all_samples, self.space, self.footprint

    def select(self, chosen: Indices) -> "FittedMap":
        """The same map with the chosen samples."""
        return replace(self, samples=self.samples.select(chosen), footprint=self.footprint.select(chosen))

    @property
    def all_samples(self) -> Indices:
        """Indices of all samples."""
        return np.arange(len(self.samples.pixel))


def fitted_map(samples: Samples) -> FittedMap:
    """The map that techniques fit to samples by default."""
    light = samples.view.light
    if light.kind == "point":
        found = cube_footprint(samples)
        return FittedMap(samples, found, _box(found), np.full(2, 2.0), None, 0.0)
    space = light_space(light)
    found = footprint(samples, space)
    box = _box(found)
    extent = np.maximum((box.high - box.low)[:2], FLAT)
    return FittedMap(samples, found, box, extent, space, PADDING)


def _box(found: Footprint) -> Box:
    return Box(found.coords.min(axis=1), found.coords.max(axis=1))
