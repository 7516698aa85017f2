"""How pixels and a map's texels measure each other: the Jacobian of map coordinates over image coordinates.

The error of a shadow map is how far one texel reaches in the image (Lloyd et al. 2008, "Logarithmic Perspective Shadow
Maps": the largest extent of a texel, projected): the reciprocal of the Jacobian's smaller singular value.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shadowbench.geometry.lights import LightSpace
from shadowbench.scenes.model import Floats, perpendicular_basis
from shadowbench.survey.rays import Indices
from shadowbench.survey.sampling import Samples

DIRECTIONS = 16  # of edges across the map, over half a turn; an edge may have any of them
# Mean distance, in texels, of a straight edge from where a 2×2 linear comparison puts it, by its angle to the grid's
# nearer axis; by Monte Carlo over the grid's position, ± 0.001, which tests/survey/test_footprint.py repeats.
ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 45.0])
OFF = np.array([0.250, 0.218, 0.182, 0.159, 0.168, 0.181])


@dataclass(frozen=True, eq=False)
class Footprint:
    """Samples as a map sees them, R of them; a unit of the map is what `scaled` made it, at first one of light space.

    place: (3, R) u, v and distance along the light's axis, as a map's Box has them; jacobian: (2, 2, R) d(u, v)/d(x, y)
    in pixels, y downwards; slope: (2, R) how much further from the light the receiver's plane is for a unit of u and v.
    """

    coords: Floats
    jacobian: Floats
    slope: Floats

    def scaled(self, extent: Floats) -> "Footprint":
        """The footprint where a unit of the map is (2,) or (2, R) units of this one."""
        across = np.broadcast_to(extent.reshape(2, -1), self.slope.shape)
        return Footprint(self.coords, self.jacobian / across[:, None], self.slope * across)

    def select(self, chosen: Indices) -> "Footprint":
        """The chosen samples."""
        return Footprint(self.coords[:, chosen], self.jacobian[..., chosen], self.slope[:, chosen])

    @property
    def longest(self) -> Floats:
        """(R,) pixels that a unit of the map reaches at most, whatever its direction."""
        return longest(*np.moveaxis(self.jacobian, 1, 0))

    @property
    def displacement(self) -> Floats:
        """(R, DIRECTIONS) pixels that an edge is off, on average, where a unit is a texel and 2×2 of them are compared.

        For each direction of the edge across the map. Counted along the image's column or row, whichever crosses the
        edge more squarely: below 1 it is the share of the edge's pixels that are wrong.
        """
        angle = (np.arange(DIRECTIONS) + 0.5) * (np.pi / DIRECTIONS)
        normal = np.stack([np.cos(angle), np.sin(angle)])
        from_axis = np.arcsin(np.abs(normal).min(axis=0))
        texels = np.abs(np.einsum("id,ijr->jrd", normal, self.jacobian)).max(axis=0)
        moved: Floats = np.interp(from_axis, ANGLES, OFF) / np.maximum(texels, np.finfo(float).tiny)
        return moved


def longest(across: Floats, down: Floats) -> Floats:
    """(R,) pixels that a unit reaches at most, of (K, R) moves for a pixel across and down: 1/σ of the smaller σ."""
    square_a, square_b = (across**2).sum(axis=0), (down**2).sum(axis=0)
    both = (across * down).sum(axis=0)
    # σ² are the eigenvalues of the Gram matrix; the smaller one as a quotient, which loses no digits.
    larger = (square_a + square_b + np.hypot(square_a - square_b, 2 * both)) / 2
    determinant = np.maximum(square_a * square_b - both**2, np.finfo(float).tiny)
    reach: Floats = np.sqrt(larger / determinant)
    return reach


def footprint(samples: Samples, space: LightSpace) -> Footprint:
    """The samples in a directional light's or spot's space; z along its axis is what a map stores."""
    basis = space.basis
    x, y, back = basis @ (samples.point - space.origin[:, None])
    moves = np.stack([basis @ samples.across, basis @ samples.down], axis=1)  # (3, 2, R)
    lean = (basis @ samples.normal)[:2]
    if not space.perspective:
        return Footprint(np.stack([x, y, -back]), moves[:2], lean / samples.cosine)
    ahead = -back
    place = np.stack([x, y]) / ahead
    # On the plane N·P = c, seen along d = (u, v, −1), ahead = c/(N·d), and N·d = −(N·L)|d|.
    ray = samples.distance / ahead
    return Footprint(
        np.vstack([place, ahead]),
        (moves[:2] + place[:, None] * moves[2]) / ahead,
        lean * ahead / (samples.cosine * ray),
    )


def cube_faces(samples: Samples) -> Iterator[tuple[Indices, LightSpace, Footprint]]:
    """The six spaces of a point light, each with the samples on its face, of side 2, and their footprint there."""
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
    """The samples in the cube map of a point light: z is the distance to the light, which it stores."""
    count = len(samples.pixel)
    whole = Footprint(np.empty((3, count)), np.empty((2, 2, count)), np.empty((2, count)))
    for mine, _, part in cube_faces(samples):
        u, v, ahead = part.coords
        ray = np.sqrt(u**2 + v**2 + 1)  # the distance is ray · ahead, and changes with both
        whole.coords[:, mine] = u, v, ahead * ray
        whole.jacobian[..., mine] = part.jacobian
        whole.slope[:, mine] = part.slope * ray + ahead * part.coords[:2] / ray
    return whole
