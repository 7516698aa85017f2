"""The shadow map fitted to the visible receivers, and the footprint of its texels in the image."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shadowbench.geometry.lights import Box, LightSpace, light_space
from shadowbench.scenes.vectors import Floats, perpendicular_basis
from shadowbench.survey.sampling import Samples
from shadowbench.truths.rays import Indices

DIRECTIONS = 16  # of shadow edges in the map, over 180°, all equally likely
# Mean displacement, in texels, of a straight edge by a 2×2 linear comparison, by its angle to the grid's nearer axis:
# Monte Carlo over the grid's position, ± 0.001, repeated by tests/survey/test_footprint.py.
ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 45.0])
DISPLACEMENTS = np.array([0.250, 0.218, 0.182, 0.159, 0.168, 0.181])


@dataclass(frozen=True, eq=False)
class Footprint:
    """R samples in map coordinates, with derivatives by pixels; in units of light space, until `scaled`.

    coords: (3, R) u, v and distance along the light's axis, as in `Box`; jacobian: (2, 2, R) d(u, v)/d(x, y), with x
    and y in pixels, y downwards; slope: (2, R) derivative of the receiver plane's distance by u and v.
    """

    coords: Floats
    jacobian: Floats
    slope: Floats

    def scaled(self, extent: Floats) -> "Footprint":
        """The footprint with (2,) or (2, R) times larger units."""
        across = np.broadcast_to(extent.reshape(2, -1), self.slope.shape)
        return Footprint(self.coords, self.jacobian / across[:, None], self.slope * across)

    def select(self, chosen: Indices) -> "Footprint":
        """The footprint of the chosen samples."""
        return Footprint(self.coords[:, chosen], self.jacobian[..., chosen], self.slope[:, chosen])

    @property
    def longest(self) -> Floats:
        """(R,) largest extent of a unit of the map in the image, in pixels."""
        return longest(*np.moveaxis(self.jacobian, 1, 0))

    @property
    def displacement(self) -> Floats:
        """(R, DIRECTIONS) mean displacement of a shadow edge in pixels by a 2×2 comparison, if a unit is a texel.

        Measured along the image's column or row, whichever is closer to the edge's normal: below 1 it is the share of
        the edge's pixels that are wrong.
        """
        angle = (np.arange(DIRECTIONS) + 0.5) * (np.pi / DIRECTIONS)
        normal = np.stack([np.cos(angle), np.sin(angle)])
        from_axis = np.arcsin(np.abs(normal).min(axis=0))
        texels = np.abs(np.einsum("id,ijr->jrd", normal, self.jacobian)).max(axis=0)
        return np.asarray(np.interp(from_axis, ANGLES, DISPLACEMENTS) / np.maximum(texels, np.finfo(float).tiny))


def longest(across: Floats, down: Floats) -> Floats:
    """(R,) largest extent of a unit in pixels: 1/σ of the smaller singular value σ.

    across, down: (K, R) derivatives of the coordinates by a pixel across and down.
    """
    square_a, square_b = (across**2).sum(axis=0), (down**2).sum(axis=0)
    both = (across * down).sum(axis=0)
    # σ² are the eigenvalues of the Gram matrix; the smaller one as a quotient, which avoids cancellation.
    larger = (square_a + square_b + np.hypot(square_a - square_b, 2 * both)) / 2
    determinant = np.maximum(square_a * square_b - both**2, np.finfo(float).tiny)
    return np.asarray(np.sqrt(larger / determinant))


def footprint(samples: Samples, space: LightSpace) -> Footprint:
    """The footprint of samples in the space of a directional light or spot, whose map stores z along its axis."""
    basis = space.basis
    x, y, back = basis @ (samples.point - space.origin[:, None])
    derivatives = np.stack([basis @ samples.across, basis @ samples.down], axis=1)  # (3, 2, R)
    normal = (basis @ samples.normal)[:2]
    if not space.perspective:
        return Footprint(np.stack([x, y, -back]), derivatives[:2], normal / samples.cosine)
    ahead = -back
    uv = np.stack([x, y]) / ahead
    # On the plane N·P = c, seen along d = (u, v, −1), ahead = c/(N·d), and N·d = −(N·L)|d|.
    ray = samples.distance / ahead
    return Footprint(
        np.vstack([uv, ahead]),
        (derivatives[:2] + uv[:, None] * derivatives[2]) / ahead,
        normal * ahead / (samples.cosine * ray),
    )


def cube_faces(samples: Samples) -> Iterator[tuple[Indices, LightSpace, Footprint]]:
    """The light spaces of a cube map's six faces, of side 2, each with its samples' indices and their footprint."""
    origin = np.array(samples.view.light.position)
    away = samples.point - origin[:, None]
    face = 2 * np.abs(away).argmax(axis=0)
    face += np.take_along_axis(away, face[None] // 2, axis=0)[0] < 0
    for index in range(6):
        mine = np.flatnonzero(face == index)
        back = np.eye(3)[index // 2] * (1 if index % 2 else -1)
        space = LightSpace(perpendicular_basis(back, (0.0, 1.0, 0.0)), origin, True, 1.0)
        yield mine, space, footprint(samples.select(mine), space)


def cube_footprint(samples: Samples) -> Footprint:
    """The footprint of samples in a point light's cube map, whose z is the stored distance to the light."""
    count = len(samples.pixel)
    whole = Footprint(np.empty((3, count)), np.empty((2, 2, count)), np.empty((2, count)))
    for mine, _, part in cube_faces(samples):
        u, v, ahead = part.coords
        ray = np.sqrt(u**2 + v**2 + 1)  # the distance is ray · ahead; its derivative follows the product rule
        whole.coords[:, mine] = u, v, ahead * ray
        whole.jacobian[..., mine] = part.jacobian
        whole.slope[:, mine] = part.slope * ray + ahead * part.coords[:2] / ray
    return whole


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

    def texels(self, size: float) -> float:
        """Number of texels along a side of a map of this size, without the padding."""
        return size - 2 * self.padding

    def light_spaces(self) -> Iterator[tuple[Indices, LightSpace, Footprint]]:
        """The map's light space, or a cube's six, each with its samples' indices and their footprint."""
        if self.space is None:
            yield from cube_faces(self.samples)
        else:
            yield self.samples.all, self.space, self.footprint

    def select(self, chosen: Indices) -> "FittedMap":
        """The same map with the chosen samples."""
        return replace(self, samples=self.samples.select(chosen), footprint=self.footprint.select(chosen))


def fitted_map(samples: Samples) -> FittedMap:
    """The map that techniques fit to samples by default."""
    light = samples.view.light
    space = None if light.kind == "point" else light_space(light)
    found = cube_footprint(samples) if space is None else footprint(samples, space)
    box = Box(found.coords.min(axis=1), found.coords.max(axis=1))
    extent = np.full(2, 2.0) if space is None else np.maximum((box.high - box.low)[:2], FLAT)
    return FittedMap(samples, found, box, extent, space, 0.0 if space is None else PADDING)
