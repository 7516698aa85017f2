"""The visible receivers of a view, by the arrays of its truth, and the shadow map that techniques fit to them.

In local coordinates. `needs` traces nothing itself: a truth has a pixel's triangle, whether it is lit, and the distance
to its blocker; the geometry has the rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from shadowbench.errors import InputError
from shadowbench.geometry.lights import Box, LightSpace, light_space
from shadowbench.scenes.model import View
from shadowbench.scenes.placement import Placement
from shadowbench.scenes.vectors import Floats, perpendicular_basis
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.rays import EDGE_ON, Indices, Mask, dot

LATTICE = 512  # largest number of sampled pixels along a side
ARRAYS = ("pixel", "triangle", "point", "normal", "to_light", "distance", "across", "down", "blocker")
DIRECTIONS = 16  # of shadow edges in the map, over 180°, all equally likely
# Mean displacement, in texels, of a straight edge by a 2×2 linear comparison, by its angle to the grid's nearer axis:
# Monte Carlo over the grid's position, ± 0.001, repeated by tests/survey/test_maps.py.
ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 45.0])
DISPLACEMENTS = np.array([0.250, 0.218, 0.182, 0.159, 0.168, 0.181])
PADDING = 2.0  # default texels around the receivers: one for a 2×2 comparison, one for receivers offset by a bias
REFERENCE_SIZE = 1024  # map size, the techniques' default, for which texels and biases are reported
FLAT = 1e-9  # least extent of a map, a local length


@dataclass(frozen=True, eq=False)
class Samples:
    """The R decided receivers at the centres of the sampled pixels.

    view, placement: in local coordinates; side: sampled pixels along a side; step: the view's pixels between them;
    pixel: (R,) index in the lattice, row by row; triangle: (R,); point, normal (towards the camera), to_light (unit):
    (3, R); distance: (R,) to the light, inf for a directional one; across, down: (3, R) derivatives of the point, on
    its plane, by a pixel of the view to the right and downwards; blocker: (R,) distance along L to the nearest caster,
    inf where lit.
    """

    view: View
    placement: Placement
    side: int
    step: float
    pixel: Indices
    triangle: Indices
    point: Floats
    normal: Floats
    to_light: Floats
    distance: Floats
    across: Floats
    down: Floats
    blocker: Floats

    @cached_property
    def cosine(self) -> Floats:
        """(R,) N·L."""
        return dot(self.normal, self.to_light)

    @cached_property
    def shadowed(self) -> Mask:
        """(R,) bool: whether each sample is in shadow."""
        return np.isfinite(self.blocker)

    @cached_property
    def edges(self) -> Indices:
        """(E,) indices of the edge pixels: samples in shadow with a lit receiver among their four neighbours."""
        lit = np.zeros((self.side + 2, self.side + 2), dtype=bool)
        row, column = np.divmod(self.pixel, self.side)
        lit[row + 1, column + 1] = ~self.shadowed
        beside = lit[row, column + 1] | lit[row + 2, column + 1] | lit[row + 1, column] | lit[row + 1, column + 2]
        return np.flatnonzero(self.shadowed & beside)

    def select(self, chosen: Indices) -> "Samples":
        """The chosen samples. Their `edges` differ, as neighbours may be missing."""
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in ARRAYS})


def hard_view(view: View) -> View:
    """The view of at most LATTICE² pixels, with the centre of the light alone."""
    light = replace(view.light, radius=0.0, size=(0.0, 0.0))
    return replace(view, size=min(view.size, LATTICE), light=light)


def sample_view(view: View) -> Samples:
    """The samples of a view from `view_of`. Raises InputError if no receiver is visible."""
    hard = hard_view(view)
    truth, side, step = cached_truth(hard), hard.size, view.size / hard.size
    pixel = np.flatnonzero(truth.receivers & ~truth.undecided)
    if not len(pixel):
        raise InputError(
            f"view {view.camera.name!r} of {view.scene.name}: no pixel shows a receiver that {view.light.name!r} "
            "lights; needs are those of the visible receivers"
        )
    placed, placement = hard.placed()
    triangle = truth.triangle.ravel()[pixel].astype(np.intp)
    a, b, c = placed.scene.geometry.corners(triangle).transpose(1, 2, 0)
    right, up, back = placed.camera.basis()[:, :, None]
    eye, extent = np.array(placed.camera.position)[:, None], 2 * float(np.tan(placed.camera.fov_y / 2)) / side
    moves = extent * right, -extent * up
    y, x = np.divmod(pixel, side)
    rays = (x + 0.5 - side / 2) * moves[0] + (y + 0.5 - side / 2) * moves[1] - back
    normal = np.cross(b - a, c - a, axis=0)
    normal *= -np.sign(dot(normal, rays)) / np.sqrt(dot(normal, normal))
    slant = np.minimum(dot(normal, rays), -EDGE_ON)
    depth = dot(normal, a - eye) / slant
    # Derivatives of P = eye + t·d, t = N·(A − eye)/(N·d), along the image's axes.
    across, down = (depth / step * (move - rays * (dot(normal, move) / slant)) for move in moves)
    point = eye + rays * depth
    source, w = placed.light.homogeneous
    to_light = np.array(source)[:, None] - w * point
    length = np.sqrt(dot(to_light, to_light))
    return Samples(
        view=placed,
        placement=placement,
        side=side,
        step=step,
        pixel=pixel,
        triangle=triangle,
        point=point,
        normal=normal,
        to_light=to_light / length,
        distance=length if w else np.full(len(pixel), np.inf),
        across=across,
        down=down,
        blocker=truth.blocker.ravel()[pixel].astype(np.float64) * placement.scale,
    )


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


@dataclass(frozen=True, eq=False)
class FittedMap:
    """One map fitted to samples, as by `fit=visible`, or a point light's cube map.

    spaces: the map's light space, or those of a cube's six faces; face: (R,) index of each sample's; footprint: of the
    samples, in units of light space, or of a cube's face at distance 1; box: bounds of the samples; extent: (2,) width
    and height of the box; padding: texels around the box on each side.
    """

    samples: Samples
    spaces: tuple[LightSpace, ...]
    face: Indices
    footprint: Footprint
    box: Box
    extent: Floats
    padding: float

    @property
    def cube(self) -> bool:
        """Whether it is a cube map."""
        return len(self.spaces) > 1

    @cached_property
    def unit(self) -> Footprint:
        """The samples' footprint, with the whole map without its padding as the unit."""
        return self.footprint.scaled(self.extent)

    def texels(self, size: float) -> float:
        """Number of texels along a side of a map of this size, without the padding."""
        return size - 2 * self.padding

    @cached_property
    def lit_samples(self) -> list[tuple[Indices, cKDTree]]:
        """For each light space the indices of its lit samples, and a tree of their places in the map."""
        lit = [np.flatnonzero(~self.samples.shadowed & (self.face == index)) for index in range(len(self.spaces))]
        return [(own, cKDTree(self.footprint.coords[:2, own].T)) for own in lit]

    def stored(self, coords: Floats) -> Floats:
        """(N,) what the map stores at (3, N) coordinates, a local length: a cube the distance to the light."""
        u, v, ahead = coords
        return np.asarray(ahead * np.sqrt(u**2 + v**2 + 1) if self.cube else ahead)


def fitted_map(samples: Samples) -> FittedMap:
    """The map that techniques fit to samples by default."""
    light, face = samples.view.light, np.zeros(len(samples.pixel), dtype=np.intp)
    if light.kind != "point":
        space = light_space(light)
        footprint = footprint_in(space, samples)
        box = Box(footprint.coords.min(axis=1), footprint.coords.max(axis=1))
        extent = np.maximum((box.high - box.low)[:2], FLAT)
        return FittedMap(samples, (space,), face, footprint, box, extent, PADDING)
    origin = np.array(light.position)
    away = samples.point - origin[:, None]
    face = 2 * np.abs(away).argmax(axis=0)
    face += np.take_along_axis(away, face[None] // 2, axis=0)[0] < 0
    backs = [np.eye(3)[index // 2] * (1 if index % 2 else -1) for index in range(6)]
    spaces = tuple(LightSpace(perpendicular_basis(back, (0.0, 1.0, 0.0)), origin, True, 1.0) for back in backs)
    count = len(face)
    footprint = Footprint(np.empty((3, count)), np.empty((2, 2, count)), np.empty((2, count)))
    for index, space in enumerate(spaces):
        chosen = np.flatnonzero(face == index)
        part = footprint_in(space, samples.select(chosen))
        footprint.coords[:, chosen], footprint.jacobian[..., chosen] = part.coords, part.jacobian
        footprint.slope[:, chosen] = part.slope
    box = Box(footprint.coords.min(axis=1), footprint.coords.max(axis=1))
    return FittedMap(samples, spaces, face, footprint, box, np.full(2, 2.0), 0.0)


def footprint_in(space: LightSpace, samples: Samples) -> Footprint:
    """The footprint of samples in a light space, whose map stores z along its axis."""
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
