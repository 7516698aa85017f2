"""Meshes, cameras, lights, scenes, and views, the input of both truth and techniques.

Right-handed, y up, cameras look along −z; metres, radians, float64. All classes are immutable.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.options import ViewSize, ViewSizeLike
from shadowbench.scenes.cutouts import Cutout, cutout_faces
from shadowbench.scenes.triangles import Geometry, bounds_of, mirrors, turned, used_by
from shadowbench.scenes.vectors import Floats, Vec3, perpendicular_basis, unit, vec3

if TYPE_CHECKING:
    from shadowbench.scenes.sequences import Motion

GREY: Vec3 = (0.8, 0.8, 0.8)
WHITE: Vec3 = (1.0, 1.0, 1.0)
CORNERS = ("coordinates", "places", "normals")
"""What a mesh has by corner of a triangle, as vertices at one place are one."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one surface, in world space.

    vertices: (V, 3) float64; faces: (F, 3) int32 indices into them, counter-clockwise seen from outside; both are
    read-only, as results computed from them are cached. color: linear RGB in [0, 1]; casts, receives: whether it casts
    and receives shadows. cutout: where it is opaque, None for everywhere; places: (F, 3, 2) float32 of the triangles'
    corners in it, in sub-texels, None for 0. coordinates: (F, 3, 2) float32 texture coordinates of the corners, None
    for 0. normals: (F, 3, 3) float32 of a smooth surface, which it is shaded by; None if it is flat, and zero at
    corners without one. tints: (F, 3) float32 linear RGB that color is multiplied by.
    """

    name: str
    vertices: Floats = field(repr=False)
    faces: NDArray[np.int32] = field(repr=False)
    color: Vec3 = GREY
    casts: bool = True
    receives: bool = True
    cutout: Cutout | None = None
    coordinates: NDArray[np.float32] | None = field(default=None, repr=False)
    places: NDArray[np.float32] | None = field(default=None, repr=False)
    normals: NDArray[np.float32] | None = field(default=None, repr=False)
    tints: NDArray[np.float32] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name in ("vertices", "faces", *CORNERS):
            values = getattr(self, name)
            if values is not None:
                view = values.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) lowest and highest vertex in use."""
        return bounds_of(used_by(self.faces, self.vertices))

    def reshaped(
        self, vertices: Floats, faces: NDArray[np.int32], matrix: Floats, kept: NDArray[np.bool_] | None = None
    ) -> "Mesh":
        """The mesh with vertices moved by an affine (4, 4) matrix; one that mirrors has reversed the faces' corners.

        kept: (F,) bool, which of its faces these are, by default all.
        """
        corners, tints = {name: values for name in CORNERS if (values := getattr(self, name)) is not None}, self.tints
        if kept is not None:
            corners = {name: values[kept] for name, values in corners.items()}
            tints = None if tints is None else tints[kept]
        if mirrors(matrix):
            corners = {name: values[:, ::-1] for name, values in corners.items()}
        if self.normals is not None:
            corners["normals"] = turned(corners["normals"], matrix)
        return replace(self, vertices=vertices, faces=faces, tints=tints, **corners)

    @cached_property
    def closed(self) -> bool:
        """Whether every edge, after welding by position, is shared by exactly two triangles."""
        import trimesh  # the import takes 0.3 s, and most commands do not need it

        welded = trimesh.Trimesh(self.vertices, self.faces, process=False)
        welded.merge_vertices()
        return bool(welded.is_watertight)


def joined(meshes: Sequence[Mesh]) -> Geometry:
    """The triangles of meshes in turn."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    counts = [len(mesh.faces) for mesh in meshes]
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Geometry(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(faces, dtype=np.int32),
        casts=np.repeat([mesh.casts for mesh in meshes], counts),
        receives=np.repeat([mesh.receives for mesh in meshes], counts),
        colors=np.concatenate([_tinted(mesh) for mesh in meshes]),
        cutouts=cutout_faces([(len(mesh.faces), mesh.cutout, mesh.places) for mesh in meshes]),
        corner_normals=_normals(meshes),
    )


def _tinted(mesh: Mesh) -> Floats:
    """(F, 3) linear RGB of the triangles of a mesh."""
    return np.ones((len(mesh.faces), 3)) * mesh.color * (1.0 if mesh.tints is None else mesh.tints)


def _normals(meshes: Sequence[Mesh]) -> NDArray[np.float32] | None:
    """(F, 3, 3) normals at the corners, zero for flat meshes; None if all are."""
    if all(mesh.normals is None for mesh in meshes):
        return None
    flat = [np.zeros((len(mesh.faces), 3, 3), np.float32) if mesh.normals is None else mesh.normals for mesh in meshes]
    return np.concatenate(flat)


@dataclass(frozen=True)
class Placement:
    """Transform from file coordinates to local ones, local = (file − center) · scale, in float64.

    Local coordinates keep float32 precision for scenes of any size far from the origin.
    """

    center: Vec3
    scale: float

    def points(self, points: Floats | Vec3) -> Floats:
        """(…, 3) points in local coordinates."""
        return (np.asarray(points, dtype=np.float64) - self.center) * self.scale

    def length(self, metres: float) -> float:
        """A length in metres as a local length."""
        return metres * self.scale

    def camera(self, camera: "Camera") -> "Camera":
        """The camera in local coordinates."""
        position, target = (vec3(self.points(point)) for point in (camera.position, camera.target))
        near, far = (None if plane is None else self.length(plane) for plane in (camera.near, camera.far))
        height = self.length(camera.height)
        return replace(camera, position=position, target=target, near=near, far=far, height=height)

    def light(self, light: "Light") -> "Light":
        """The light in local coordinates; the angular radius of a directional light is unchanged."""
        if light.kind == "directional":
            return light
        width, height = (self.length(side) for side in light.size)
        position, radius = vec3(self.points(light.position)), self.length(light.radius)
        return replace(light, position=position, radius=radius, size=(width, height))

    def scene(self, scene: "Scene") -> "Scene":
        """The scene with all its meshes, cameras and lights in local coordinates."""
        return replace(
            scene,
            meshes=tuple(replace(mesh, vertices=self.points(mesh.vertices)) for mesh in scene.meshes),
            cameras=tuple(self.camera(camera) for camera in scene.cameras),
            lights=tuple(self.light(light) for light in scene.lights),
        )


IDENTITY_PLACEMENT = Placement((0.0, 0.0, 0.0), 1.0)


LightKind = Literal["directional", "spot", "point"]
LightShape = Literal[LightKind, "disc", "rectangle"]
Coordinates = Literal["relative", "absolute"]

WIDEST_CONE = 170.0
"""Largest full cone angle of a spot, and of the frustum in which maps draw a disc or rectangle light, in degrees."""
LONGEST_VIEW_NAME = 200
"""Limit in bytes of UTF-8. File systems allow 255 for a file name, which includes a suffix or a temporary one."""
SUN_RADIUS = float(np.radians(0.2665))
"""Mean angular radius of the sun, in radians."""
NEAREST_TARGET = 1e-12
"""Least distance from a camera to its target, as a share of their coordinates, whose float64 precision is 2e-16."""


@dataclass(frozen=True)
class Camera:
    """A perspective or an orthographic camera.

    fov_y: vertical field of view in radians, 0 if orthographic; height: of an orthographic view in metres, else 0;
    near, far: None until `view_of` sets them. Half of what is seen is height/2 + slope · d high at a view depth d, and
    a pixel's ray starts in the plane of the position at its place in height/2: both kinds by the same formulas.
    """

    name: str
    position: Vec3
    target: Vec3
    fov_y: float
    up: Vec3 = (0.0, 1.0, 0.0)
    near: float | None = None
    far: float | None = None
    height: float = 0.0

    @property
    def slope(self) -> float:
        """Tangent of half the field of view: what half of the view's height grows by with view depth."""
        return float(np.tan(self.fov_y / 2))

    @property
    def converging(self) -> float:
        """1 if all rays meet in the position; 0 if they are parallel."""
        return float(self.height == 0.0)

    @property
    def eye(self) -> tuple[float, float, float, float]:
        """The eye in homogeneous coordinates: the position and 1; of parallel rays the way to it, `height` long, and 0.

        So what formulas with the distance from the eye take for it in an orthographic view is `height`.
        """
        x, y, z = self.position if self.converging else vec3(self.height * self.basis()[2])
        return x, y, z, self.converging

    def half_height(self, depth: float) -> float:
        """Half the height of what is seen at a view depth."""
        return self.height / 2 + self.slope * depth

    def basis(self) -> Floats:
        """(3, 3) rows right, up, back in world space."""
        return perpendicular_basis(unit(np.subtract(self.position, self.target)), self.up)

    def depths_of(self, bounds: Floats, aspect: float) -> tuple[float, float]:
        """Bounds of the view depth of what is visible in (2, 3) bounds; aspect: of the image.

        Of a perspective, the depth in the image's corner of a point as near as the nearest, and the farthest distance.
        """
        low, high = bounds
        position = np.asarray(self.position)
        if not self.converging:
            depths = (np.stack(np.meshgrid(*bounds.T), axis=-1).reshape(-1, 3) - position) @ -self.basis()[2]
            return max(float(depths.min()), 0.0), float(depths.max())
        farthest = float(np.linalg.norm(np.maximum(np.abs(low - position), np.abs(high - position))))
        nearest = float(np.linalg.norm(np.maximum(np.maximum(low - position, position - high), 0.0)))
        return nearest / np.sqrt(1 + (1 + aspect**2) * self.slope**2), farthest


@dataclass(frozen=True)
class Light:
    """A light source; hard-edged shadows if it has no size.

    direction: in which the light travels, or a disc's or rectangle's normal (all but point lights); angle: full cone
    angle of a spot in radians; radius: of the sun in radians as seen from the ground, of a disc or the sphere of a spot
    or point light in metres; size: width and height of a rectangle in metres, up: roughly along its height.
    """

    name: str
    kind: LightShape
    direction: Vec3 = (0.0, -1.0, 0.0)
    position: Vec3 = (0.0, 0.0, 0.0)
    angle: float = 0.0
    radius: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    up: Vec3 = (0.0, 1.0, 0.0)

    @property
    def soft(self) -> bool:
        """Whether the light has a size, so that its shadows have penumbrae."""
        return self.radius > 0.0 or min(self.size) > 0.0

    @property
    def hard_kind(self) -> LightKind:
        """Kind of the light of no size at the centre, as techniques for hard shadows see it: discs are spots."""
        return "spot" if self.kind == "disc" or self.kind == "rectangle" else self.kind

    @property
    def homogeneous(self) -> tuple[Vec3, float]:
        """(xyz, w): the position with w = 1; for a directional light the unit vector towards it with w = 0."""
        if self.kind == "directional":
            return vec3(-unit(self.direction)), 0.0
        return self.position, 1.0

    @property
    def cos_half_angle(self) -> float:
        """Cosine of the largest angle from `direction` that is lit: a spot's cone, a panel's front; −1 for others."""
        if self.kind == "spot":
            return float(np.cos(self.angle / 2))
        return 0.0 if self.hard_kind == "spot" else -1.0

    @property
    def frustum_angle(self) -> float | None:
        """Full angle in radians of the frustum along `direction` that a map covers; None for suns and point lights.

        WIDEST_CONE for a disc or rectangle, which lights a half-space.
        """
        if self.kind == "spot":
            return self.angle
        return float(np.radians(WIDEST_CONE)) if self.hard_kind == "spot" else None


@dataclass(frozen=True, eq=False)
class Scene:
    """Meshes, cameras and lights of a file, with defaults for those that it does not have.

    notes: a line for each default and each unsupported feature; dropped: number of zero-area triangles removed; ground:
    the mesh that was assumed and the note about it, None if none was; assumed: the notes about an assumed `camera` and
    `light`. motions: the file's own sequences; posed: the scene some seconds later, None if it is not of a file.
    """

    name: str
    meshes: tuple[Mesh, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Light, ...]
    notes: tuple[str, ...] = ()
    dropped: int = 0
    ground: tuple[Mesh, str] | None = None
    assumed: Mapping[str, str] = field(default_factory=dict)
    motions: tuple["Motion", ...] = ()
    posed: "Callable[[float], Scene] | None" = field(default=None, repr=False)

    def __repr__(self) -> str:
        triangles = sum(len(mesh.faces) for mesh in self.meshes)
        parts = {"mesh(es)": self.meshes, "camera(s)": self.cameras, "light(s)": self.lights}
        return f"<Scene {self.name}: {triangles} triangles, {', '.join(f'{len(parts[k])} {k}' for k in parts)}>"

    @cached_property
    def geometry(self) -> Geometry:
        """The triangles of all meshes as one indexed list."""
        return joined(self.meshes)

    @cached_property
    def placement(self) -> Placement:
        """The transform to local coordinates: scene centred at the origin, scaled by a power of 2 to diagonal ≈ 1."""
        low, high = self.geometry.bounds
        diagonal = float(np.linalg.norm(high - low))
        return Placement(vec3((low + high) / 2), float(2.0 ** -np.round(np.log2(diagonal))))


@dataclass(frozen=True, eq=False)
class View:
    """A scene, camera, light and image size in pixels: the input of truth and techniques."""

    scene: Scene
    camera: Camera
    light: Light
    size: ViewSize

    @property
    def name(self) -> str:
        """File name stem: scene, camera, light, size."""
        return f"{self.scene.name}.{self.camera.name}.{self.light.name}.{self.size}"

    @property
    def near_far(self) -> tuple[float, float]:
        """Distances of the camera's near and far plane, as set by `view_of`."""
        if self.camera.near is None or self.camera.far is None:
            raise ValueError("a view is made by view_of, which resolves the camera's planes")
        return self.camera.near, self.camera.far

    @property
    def pixel(self) -> float:
        """Side of a pixel at a view depth of 1."""
        return 2 * self.camera.half_height(1.0) / self.size.height

    @property
    def projection(self) -> Floats:
        """(4, 4) float64 camera-to-clip matrix for column vectors, in OpenGL's clip space, −w ≤ x, y, z ≤ w."""
        (near, far), scale, converging = self.near_far, 1 / self.camera.half_height(1.0), self.camera.converging
        w_near, w_far = (converging * depth + (1 - converging) for depth in (near, far))
        return np.array(
            [
                [scale / self.size.aspect, 0, 0, 0],
                [0, scale, 0, 0],
                [0, 0, (w_far + w_near) / (near - far), (far * w_near + near * w_far) / (near - far)],
                [0, 0, -converging, 1 - converging],
            ]
        )

    def placed(self) -> "tuple[View, Placement]":
        """The view in local coordinates, and the transform to them."""
        placement, scene = self.scene.placement, _local(self.scene)
        return View(scene, placement.camera(self.camera), placement.light(self.light), self.size), placement


@lru_cache(1)
def _local(scene: Scene) -> Scene:
    """The scene in local coordinates: the same object for the frames of a sequence, one after the other."""
    return scene.placement.scene(scene)


def view_of(scene: Scene, camera: Camera, light: Light, size: ViewSizeLike) -> View:
    """The view, with near and far plane of the camera set; size: as by `ViewSize.of`.

    By default they enclose the scene's bounds (`depths_of`), near being at least far/10⁴, both with a margin of 0.1%
    against rounding. Planes given by a file are clamped to that range, so as not to waste depth range. Raises
    InputError for planes that exclude the scene, a target too close to the position, and names too long for files.
    """
    view = View(scene, camera, light, ViewSize.of(size))
    low, high = scene.geometry.bounds
    position, target = np.asarray(camera.position), np.asarray(camera.target)
    distance = float(np.abs(position - target).max())
    least = NEAREST_TARGET * float(np.abs([position, target, (low + high) / 2]).max())
    if distance < least:
        apart = f"position and target are {distance:.3g} m apart; allowed here: {least:.3g} m or more"
        raise InputError(f"camera {camera.name!r} of {scene.name}: {apart}")
    nearest, farthest = camera.depths_of(scene.geometry.bounds, view.size.aspect)
    if farthest <= 0.0:
        raise InputError(f"camera {camera.name!r} of {scene.name} shows nothing: the scene is behind it")
    nearest, farthest = float(max(nearest, farthest / 1e4)) * 0.999, farthest * 1.001
    near = min(max(camera.near or nearest, nearest), farthest)
    far = min(max(camera.far or farthest, nearest), farthest)
    if near >= far:
        raise InputError(
            f"camera {camera.name!r} of {scene.name} shows nothing: its near and far planes, {camera.near} and "
            f"{camera.far} m, exclude the scene, which lies between {nearest:.4g} and {farthest:.4g} m"
        )
    view = replace(view, camera=replace(camera, near=near, far=far))
    if (taken := len(view.name.encode())) > LONGEST_VIEW_NAME:
        raise InputError(
            f"scene {scene.name!r}, camera {camera.name!r}, light {light.name!r}: their names, which are parts of "
            f"file names, take {taken} bytes together; allowed are {LONGEST_VIEW_NAME}"
        )
    return view


def view_digest(view: View) -> str:
    """Hex digest of a view's geometry, camera, light and size, without names.

    Its geometry is one list of triangles; where its meshes end, and which are flat, decides what is culled, what is
    closed and which facets darken.
    """
    camera, light = view.camera, view.light
    parts = (
        view.scene.geometry.digest(),
        [(len(mesh.vertices), len(mesh.faces), mesh.normals is None) for mesh in view.scene.meshes],
        (camera.position, camera.target, camera.up, camera.fov_y, camera.near, camera.far),
        *([camera.height] if camera.height else []),
        (light.kind, light.direction, light.position, light.angle, light.radius, light.size, light.up),
        view.size,
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()
