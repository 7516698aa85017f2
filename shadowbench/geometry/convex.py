"""Convex regions: intersections of half-spaces and their corners; slices of a frustum; hulls of casters and receivers.

A plane is (n, d) with a unit normal n; n·x + d ≥ 0 is inside.
"""

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import Light, Scene, View
from shadowbench.scenes.triangles import Faces, Geometry, bounds_of, in_slices, used_by
from shadowbench.scenes.vectors import Floats

PRACTICAL_WEIGHT = 0.9
"""Default λ of the practical split."""
_AT_ONCE = 1 << 17  # triangles that the nearest caster is looked for among, which takes a kilobyte each


def box_planes(bounds: Floats) -> Floats:
    """(6, 4) planes of a box with (2, 3) lowest and highest corner."""
    low, high = bounds
    return np.vstack([np.column_stack([np.eye(3), -low]), np.column_stack([-np.eye(3), high])])


def frustum_planes(
    eye: Floats, basis: Floats, slope: float, near: float, far: float, half: float = 0.0, aspect: float = 1.0
) -> Floats:
    """(6, 4) planes of a frustum between two depths.

    basis: rows right, up, back; slope: of its upper and lower side, which are `half` from the axis at the eye, the tip
    by default; aspect: its width over its height.
    """
    right, up, back = basis
    outward, scales = [sign * axis for axis in (-right, -up) for sign in (1, -1)], (aspect, aspect, 1.0, 1.0)
    sides = [scale * slope * -back - side for scale, side in zip(scales, outward, strict=True)]
    normals = np.array([*(side / np.linalg.norm(side) for side in sides), -back, back])
    points = np.array(
        [
            *(eye + scale * half * side for scale, side in zip(scales, outward, strict=True)),
            eye - near * back,
            eye - far * back,
        ]
    )
    return np.column_stack([normals, -np.einsum("ij,ij->i", normals, points)])


@cache
def _triples(count: int) -> NDArray[np.intp]:
    return np.array(list(combinations(range(count), 3))).T


def corners(planes: Floats, extent: float) -> Floats:
    """(N, 3) corners of the region inside all (P, 4) planes: intersections of three planes that are inside all others.

    extent: largest coordinate of the region, which scales the tolerance for rounding.
    """
    a, b, c = planes[_triples(len(planes))]
    bc, ca, ab = np.cross([b[:, :3], c[:, :3], a[:, :3]], [c[:, :3], a[:, :3], b[:, :3]])
    determinant = np.einsum("ij,ij->i", a[:, :3], bc)
    intersect = np.abs(determinant) > 1e-12
    points = -(a[:, 3:] * bc + b[:, 3:] * ca + c[:, 3:] * ab)[intersect] / determinant[intersect, None]
    inside = (points @ planes[:, :3].T + planes[:, 3] >= -1e-9 * extent).all(axis=1)
    inner: Floats = points[inside]
    return inner


def hull_points(points: Floats) -> Floats:
    """(H, 3) vertices of the convex hull of (N, 3) points; for coplanar points the corners of their bounding box."""
    from scipy.spatial import ConvexHull, QhullError  # the import takes 0.3 s

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return corners(box_planes(bounds_of(points)), float(np.abs(points).max()))


def is_outside(points: Floats, planes: Floats) -> bool:
    """Whether all (N, 3) points are outside one of (P, 4) planes, so that their hull does not intersect the region."""
    return bool((points @ planes[:, :3].T + planes[:, 3] < 0.0).all(axis=0).any())


def caster_and_receiver_faces(geometry: Geometry) -> Faces:
    """(F, 3) faces of all casters and receivers, or of the whole scene if it has neither."""
    shadowing = geometry.casts | geometry.receives  # a sky, which is neither, must not enlarge the map
    return geometry.faces[shadowing] if shadowing.any() else geometry.faces


def caster_and_receiver_vertices(geometry: Geometry) -> Floats:
    """(N, 3) vertices of these faces."""
    return used_by(caster_and_receiver_faces(geometry), geometry.vertices)


def practical_depths(near: float, far: float, count: int, weight: float = PRACTICAL_WEIGHT) -> Floats:
    """(count + 1,) view depths of the practical split, λ · n (f/n)^(i/m) + (1 − λ) (n + (f − n) i/m).

    weight: λ, 1 for the logarithmic split, 0 for the uniform one (Zhang, Sun, Xu and Lun 2006).
    """
    share = np.arange(count + 1) / count
    ratios, lengths = near * (far / near) ** share, near + (far - near) * share
    return weight * ratios + (1 - weight) * lengths


@dataclass(frozen=True, eq=False)
class Slice:
    """The frustum of a view between two view depths."""

    view: View
    near: float
    far: float

    @property
    def planes(self) -> Floats:
        """(6, 4) planes."""
        camera = self.view.camera
        shape = camera.slope, self.near, self.far, camera.height / 2, self.view.size.aspect
        return frustum_planes(np.array(camera.position), camera.basis(), *shape)

    @property
    def corners(self) -> Floats:
        """(8, 3) corners, the near ones first."""
        camera, aspect = self.view.camera, self.view.size.aspect
        (right, up, back), slope, half = camera.basis(), camera.slope, camera.height / 2
        rays = np.array([x * slope * right + y * slope * up - back for x in (-aspect, aspect) for y in (-1, 1)])
        starts = np.array([x * half * right + y * half * up for x in (-aspect, aspect) for y in (-1, 1)])
        return np.array(camera.position) + np.vstack([starts + self.near * rays, starts + self.far * rays])

    def corners_within(self, bounds: Floats, extent: float) -> Floats:
        """(N, 3) corners of the slice's intersection with a (2, 3) box; its own corners if that is empty."""
        shared = corners(np.vstack([box_planes(bounds), self.planes]), extent)
        return shared if len(shared) else self.corners

    @property
    def sphere(self) -> tuple[Floats, float]:
        """(3,) centre and radius of the smallest bounding sphere; the radius is independent of the camera's pose."""
        camera, edges = self.view.camera, 1 + self.view.size.aspect**2
        slope = edges * camera.slope**2  # squared slope of the frustum's edges
        along = min((self.near + self.far) / 2 * (1 + slope), self.far)
        radius = np.hypot(along - self.far, self.far * np.sqrt(slope) + camera.height / 2 * np.sqrt(edges))
        return np.array(camera.position) - camera.basis()[2] * along, float(radius)


def view_planes(view: View) -> Floats:
    """(6, 4) planes of a view's frustum."""
    return Slice(view, *view.near_far).planes


def slices(view: View, depths: Floats, overlap: float) -> list[Slice]:
    """The slices between view depths, each extended towards the camera by `overlap` of the previous slice's length."""
    lengths = np.diff(depths)
    starts = depths[:-1] - overlap * np.array([0.0, *lengths[:-1]])
    return [Slice(view, float(near), float(far)) for near, far in zip(starts, depths[1:], strict=True)]


class SceneHull:
    """A scene's casters and receivers for fits: (2, 3) bounds, largest absolute coordinate, (N, 3) hull points."""

    def __init__(self, scene: Scene) -> None:
        self._geometry = scene.geometry
        self._nearest: tuple[Light, float] | None = None
        vertices = caster_and_receiver_vertices(scene.geometry)
        self.bounds = bounds_of(vertices)
        self.extent = float(np.abs(self.bounds).max())
        self.points = hull_points(vertices)

    def highest_caster(self, sun: Light) -> float:
        """Largest coordinate of a caster or receiver along the direction towards a directional light."""
        return float((self.points @ sun.homogeneous[0]).max())

    def nearest_caster(self, light: Light) -> float:
        """Distance from a lamp or spot to the nearest caster, at least the light's radius and 1e-6 of the extent."""
        if self._nearest is None or self._nearest[0] != light:
            import trimesh  # the import takes 0.3 s

            position, nearest = np.array(light.position), np.inf
            vertices, faces = self._geometry.vertices, self._geometry.caster_faces
            for part in in_slices(len(faces), _AT_ONCE):
                triangles = vertices[faces[part]]
                origins = np.broadcast_to(position, (len(triangles), 3))
                closest = trimesh.triangles.closest_point(triangles, origins)  # type: ignore[no-untyped-call]
                nearest = min(nearest, np.linalg.norm(closest - position, axis=1).min())
            self._nearest = light, max(float(nearest), light.radius, 1e-6 * self.extent)
        return self._nearest[1]

    def position_step(self, light: Light) -> float:
        """Float32 rounding error of positions in the scene and of the light's position, a local length."""
        farthest = self.extent if light.kind == "directional" else max(self.extent, *map(abs, light.position))
        return 2.0**-24 * farthest
