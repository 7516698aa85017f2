"""The map that our techniques fit to what is seen, at no size yet."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shadowbench.geometry.lights import Box, LightSpace, light_space
from shadowbench.scenes.model import Floats
from shadowbench.survey.footprint import Footprint, cube_faces, cube_footprint, footprint
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Samples

PADDING = 2.0  # texels around the window, by default: a 2×2 comparison reaches one, and a bias may move by another
REFERENCE_SIZE = 1024  # the map whose texels and biases are told, as techniques default to it
FLAT = 1e-9  # local length below which a window has no extent


@dataclass(frozen=True, eq=False)
class FittedMap:
    """One map fitted to samples, as `fit=visible` does, or the cube around a point light.

    footprint: the samples' where a unit is one of light space, of a cube's face at distance 1; box: theirs; space:
    the light's, None for a cube; padding: texels around the box on each side, which a filter reads.
    """

    samples: Samples
    footprint: Footprint
    box: Box
    extent: Floats
    space: LightSpace | None
    padding: float

    @cached_property
    def unit(self) -> Footprint:
        """The samples' footprint where the whole window, without the padding, is a unit."""
        return self.footprint.scaled(self.extent)

    @cached_property
    def reach(self) -> Floats:
        """(R,) pixels that the window would reach if it were one texel: divided by texels across, a texel's reach."""
        return self.unit.longest

    def texels(self, size: float) -> float:
        """How many texels of a map of a size lie across the window."""
        return size - 2 * self.padding

    def light_spaces(self) -> Iterator[tuple[Indices, LightSpace, Footprint]]:
        """The map's spaces, one or a cube's six, each with the samples in it and their footprint there."""
        if self.space is None:
            yield from cube_faces(self.samples)
        else:
            yield self.all_samples, self.space, self.footprint

    @property
    def all_samples(self) -> Indices:
        """All samples."""
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
