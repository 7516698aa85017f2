"""The model of a scene: meshes, cameras, lights, and the view that truth and technique receive.

Right-handed, y up, cameras look down −z, metres, radians, float64. Everything is frozen; moving a
camera or a light makes a new value.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import Floats as Floats
from shadowbench.scenes.geometry import Geometry

Vec3 = tuple[float, float, float]
LightKind = Literal["directional", "spot", "point"]
Coordinates = Literal["relative", "absolute"]

LONGEST_VIEW_NAME = 200
"""Bytes of UTF-8. File systems allow 255 for a file's name, of which endings and temporary names need some."""
NEAREST_TARGET = 1e-12
"""Distance of a camera's target, as a share of the coordinates that it is the difference of: float64 has 2e-16."""


def vec3(values: Sequence[float] | Floats) -> Vec3:
    """Three numbers as a hashable tuple of floats."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def unit(vector: Sequence[float] | Floats) -> Floats:
    """(3,) float64 of length 1; raises ZeroDivisionError for a vector without a direction."""
    array = np.asarray(vector, dtype=np.float64)
    largest = float(np.abs(array).max())
    if not largest > 0.0 or not np.isfinite(largest):
        raise ZeroDivisionError(f"no direction in {array}")
    array = array / largest  # so that neither 1e-200 nor 1e200 loses its direction in a square
    return array / np.linalg.norm(array)


def perpendicular_basis(back: Floats, up: Sequence[float] | Floats) -> Floats:
    """(3, 3) rows right, up, back: a right-handed basis whose last row is the unit vector `back`.

    An `up` along `back` is replaced by the axis that `back` leans on least, so every direction has a basis.
    """
    right = np.cross(unit(up), back)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right = unit(right)
    return np.stack([right, np.cross(back, right), back])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one surface, in world space.

    vertices: (V, 3) float64; faces: (F, 3) int32 into them, counter-clockwise seen from outside; both read-only,
    as what is made of them is kept. color: linear RGB in [0, 1]; planar: flagged as a planar receiver.
    """

    name: str
    vertices: Floats
    faces: NDArray[np.int32]
    color: Vec3 = (0.8, 0.8, 0.8)
    casts: bool = True
    receives: bool = True
    planar: bool = False

    def __post_init__(self) -> None:
        for name in ("vertices", "faces"):
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)

    @cached_property
    def closed(self) -> bool:
        """Whether every edge, after welding by position, is shared by exactly two triangles."""
        import trimesh  # a cached answer, and 0.3 s of import that most commands never need

        welded = trimesh.Trimesh(self.vertices, self.faces, process=False)
        welded.merge_vertices()
        return bool(welded.is_watertight)


@dataclass(frozen=True)
class Camera:
    """A perspective camera. `fov_y` in radians; `near` and `far` None until a view gives them numbers."""

    name: str
    position: Vec3
    target: Vec3
    fov_y: float
    up: Vec3 = (0.0, 1.0, 0.0)
    near: float | None = None
    far: float | None = None

    def basis(self) -> Floats:
        """(3, 3) rows right, up, back in world space."""
        return perpendicular_basis(unit(np.subtract(self.position, self.target)), self.up)


@dataclass(frozen=True)
class Light:
    """A light. `direction` is the way it travels (directional, spot), `angle` a spot's full cone in radians.

    `radius` is the light's size: radians (angular) for a directional light, metres otherwise; 0 is a hard light.
    """

    name: str
    kind: LightKind
    direction: Vec3 = (0.0, -1.0, 0.0)
    position: Vec3 = (0.0, 0.0, 0.0)
    angle: float = 0.0
    radius: float = 0.0

    @property
    def homogeneous(self) -> tuple[Vec3, float]:
        """(xyz, w): the position with w = 1, or for a directional light the unit vector towards it with w = 0."""
        if self.kind == "directional":
            return vec3(-unit(self.direction)), 0.0
        return self.position, 1.0

    @property
    def cos_half_angle(self) -> float:
        """Cosine of a spot's half angle; −1 for a light without a cone."""
        return float(np.cos(self.angle / 2)) if self.kind == "spot" else -1.0


@dataclass(frozen=True, eq=False)
class Scene:
    """What a file holds, plus what was assumed for it.

    notes: one line for each assumption or thing that could not be honoured; dropped: zero-area triangles left out.
    """

    name: str
    meshes: tuple[Mesh, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Light, ...]
    notes: tuple[str, ...] = ()
    dropped: int = 0

    @cached_property
    def geometry(self) -> Geometry:
        """All meshes as one indexed triangle list."""
        offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)])
        counts = [len(mesh.faces) for mesh in self.meshes]
        return Geometry(
            vertices=np.concatenate([mesh.vertices for mesh in self.meshes]),
            faces=np.concatenate(
                [mesh.faces + offset for mesh, offset in zip(self.meshes, offsets, strict=False)], dtype=np.int32
            ),
            casts=np.repeat([mesh.casts for mesh in self.meshes], counts),
            receives=np.repeat([mesh.receives for mesh in self.meshes], counts),
            planar=np.repeat([mesh.planar for mesh in self.meshes], counts),
            colors=np.repeat(np.array([mesh.color for mesh in self.meshes], dtype=np.float64), counts, axis=0),
        )

    @cached_property
    def placement(self) -> "Placement":
        """To the scene's centre, scaled by a power of two to a diagonal of about 1."""
        low, high = self.geometry.bounds
        diagonal = float(np.linalg.norm(high - low))
        return Placement(vec3((low + high) / 2), float(2.0 ** -np.round(np.log2(diagonal))))


@dataclass(frozen=True)
class Placement:
    """File coordinates to local ones, local = (file − center) · scale, done in float64 before any float32 is made.

    This is the one place where a length that a user wrote (metres) becomes a local one.
    """

    center: Vec3
    scale: float

    def points(self, points: Floats | Vec3) -> Floats:
        """(…, 3) points of the file as local ones."""
        return (np.asarray(points, dtype=np.float64) - self.center) * self.scale

    def length(self, metres: float) -> float:
        """A length of the file as a local one."""
        return metres * self.scale

    def camera(self, camera: Camera) -> Camera:
        """The camera in local coordinates."""
        return replace(
            camera,
            position=vec3(self.points(camera.position)),
            target=vec3(self.points(camera.target)),
            near=None if camera.near is None else self.length(camera.near),
            far=None if camera.far is None else self.length(camera.far),
        )

    def light(self, light: Light) -> Light:
        """The light in local coordinates; a directional light's radius is an angle and stays."""
        if light.kind == "directional":
            return light
        return replace(light, position=vec3(self.points(light.position)), radius=self.length(light.radius))

    def scene(self, scene: Scene) -> Scene:
        """The scene with all its meshes, cameras and lights in local coordinates."""
        return replace(
            scene,
            meshes=tuple(replace(mesh, vertices=self.points(mesh.vertices)) for mesh in scene.meshes),
            cameras=tuple(self.camera(camera) for camera in scene.cameras),
            lights=tuple(self.light(light) for light in scene.lights),
        )


IDENTITY_PLACEMENT = Placement((0.0, 0.0, 0.0), 1.0)


@dataclass(frozen=True, eq=False)
class View:
    """Scene × camera × light × image size (size × size pixels): what truth and technique receive."""

    scene: Scene
    camera: Camera
    light: Light
    size: int

    @property
    def name(self) -> str:
        """A name for files: scene, camera, light, size."""
        return f"{self.scene.name}.{self.camera.name}.{self.light.name}.{self.size}"

    @property
    def near_far(self) -> tuple[float, float]:
        """The camera's planes; `view_of` gave them numbers."""
        if self.camera.near is None or self.camera.far is None:
            raise ValueError("a view is made by view_of, which resolves the camera's planes")
        return self.camera.near, self.camera.far

    def placed(self) -> "tuple[View, Placement]":
        """The view in local coordinates, and how it got there."""
        placement = self.scene.placement
        scene = placement.scene(self.scene)
        return View(scene, placement.camera(self.camera), placement.light(self.light), self.size), placement


def view_of(scene: Scene, camera: Camera, light: Light, size: int) -> View:
    """The view with the camera's planes given numbers.

    By the scene's bounds: far is the distance to their farthest corner, near the depth that a point at their nearest
    distance has in the picture's corner, but at least far/10⁴; each a thousandth wider, so that a face lying on the
    bounds is not cut by rounding. Planes that a file gives are clamped to that range, so that no depth range is spent
    on emptiness. Raises InputError for planes that leave out the scene, a target that is as good as the
    position, and names too long to call files.
    """
    low, high = scene.geometry.bounds
    position = np.asarray(camera.position)
    apart = float(np.abs(np.subtract(camera.position, camera.target)).max())
    least = NEAREST_TARGET * float(np.abs([camera.position, camera.target, (low + high) / 2]).max())
    if apart < least:
        raise InputError(
            f"camera {camera.name!r} of {scene.name}: position and target are {apart:.3g} m apart, which rounding may "
            f"turn anywhere; they must be at least {least:.3g} m apart here"
        )
    farthest = float(np.linalg.norm(np.maximum(np.abs(low - position), np.abs(high - position))))
    nearest = float(np.linalg.norm(np.maximum(np.maximum(low - position, position - high), 0.0)))
    nearest /= np.sqrt(1 + 2 * np.tan(camera.fov_y / 2) ** 2)
    nearest, farthest = float(max(nearest, farthest / 1e4)) * 0.999, farthest * 1.001
    near = nearest if camera.near is None else min(max(camera.near, nearest), farthest)
    far = farthest if camera.far is None else min(max(camera.far, nearest), farthest)
    if near >= far:
        raise InputError(
            f"camera {camera.name!r} of {scene.name} looks at nothing: its planes {camera.near} and {camera.far} m "
            f"leave out the scene, which lies between {nearest:.4g} and {farthest:.4g} m"
        )
    view = View(scene, replace(camera, near=near, far=far), light, size)
    if (taken := len(view.name.encode())) > LONGEST_VIEW_NAME:
        raise InputError(
            f"scene {scene.name!r}, camera {camera.name!r}, light {light.name!r}: their names, which call files, take "
            f"{taken} bytes together; allowed are {LONGEST_VIEW_NAME}"
        )
    return view
