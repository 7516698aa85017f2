"""The axes of `stress`: parameters that it drives to extreme values, of lights, views, casters and cut-outs."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from shadowbench.extremes.model import (
    MAP_SIZE,
    NAMES,
    TEXEL,
    VIEW_SIZE,
    Axis,
    Setting,
    base_meshes,
    base_view,
    ground,
    light_at,
    light_from,
    mesh,
    turn_about_y,
    view_of_meshes,
)
from shadowbench.scenes.model import Camera, Coordinates, Light, LightKind, Mesh, Scene, View, view_of
from shadowbench.scenes.shapes import LEAF
from shadowbench.scenes.triangles import Triangles, mean_normals, without_zero_area
from shadowbench.scenes.vectors import Floats, unit, vec3


@partial(
    Axis,
    name="elevation",
    about="the light sinks from the zenith to the horizon: long shadows, light at grazing incidence",
    unit="°",
    values=(
        *(89.9, 85.0, 75.0, 60.0, 50.0, 40.0, 30.0, 20.0, 15.0, 10.0, 7.0),
        *(5.0, 3.0, 2.0, 1.0, 0.8, 0.7, 0.6, 0.5, 0.2, 0.1),
    ),
    default=50.0,
    quick=(89.9, 50.0, 5.0, 0.1),
)
def elevation(degrees: float, kind: LightKind) -> Setting:
    """The base scene under a light at an elevation."""
    return Setting((view_of_meshes(base_meshes(), light_at(kind, degrees)),))


@partial(
    Axis,
    name="through-up",
    about="the light passes through the up axis, where a look-at matrix built from that axis degenerates",
    unit="°",
    values=(5.0, 1.0, 0.1, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-5, -1e-3, -0.1, -1.0, -5.0),
    default=5.0,
    quick=(5.0, 1e-5, 0.0),
    lights=("directional", "spot"),
)
def through_up(degrees: float, kind: LightKind) -> Setting:
    """A floor, perpendicular to the light at 0°, under a box that is out of view."""
    tilt = math.radians(degrees)
    light = light_from(kind, (math.sin(tilt), math.cos(tilt), 0.0))
    box = mesh("box", 0.9, (0.0, 3.0, 0.0), turn=25.0)
    return Setting((view_of_meshes([ground(4.0), box], light, eye=(1.5, 2.0, 1.6), target=(0.1, 0.0, 0.1)),))


@partial(
    Axis,
    name="far-near",
    about="the caster approaches the lamp: the ratio of the far to the near plane, and with it depth precision",
    values=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    default=1e1,
    quick=(1e1, 1e4, 1e7),
    lights=("spot", "point"),
)
def far_near(ratio: float, kind: LightKind) -> Setting:
    """A box near the light, the ground's farthest corner being `ratio` times as far; its shadow is always the same."""
    light = Light(NAMES[kind], kind, (0.0, -1.0, 0.0), (0.2, 2.0, -0.1), math.radians(100.0) if kind == "spot" else 0.0)
    far = float(np.linalg.norm(np.subtract(light.position, (-2.0, 0.0, 2.0))))
    near = far / ratio
    center = np.add(light.position, np.array([0.15, -1.3, 0.1]) * near)
    return Setting((view_of_meshes([ground(4.0), mesh("box", 0.6 * near, center, turn=25.0)], light),))


@partial(
    Axis,
    name="lamp-distance",
    about="a point light approaches a wall: light at grazing incidence, and a wide range of depths",
    unit="m",
    values=(2.0, 1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4),
    default=1.0,
    quick=(1.0, 1e-2, 1e-4),
    lights=("point",),
)
def lamp_distance(metres: float, kind: LightKind) -> Setting:
    """A lamp beside a wall on the ground, at half the wall's height."""
    corners = np.array([[-2.0, 0.0, 2.0], [-2.0, 0.0, -2.0], [-2.0, 3.0, -2.0], [-2.0, 3.0, 2.0]])
    wall = Mesh("wall", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    light = Light(NAMES[kind], kind, position=(-2.0 + metres, 1.5, 0.1))
    return Setting((view_of_meshes([*base_meshes(), wall], light, eye=(4.6, 3.4, 3.6), target=(-0.6, 0.7, 0.0)),))


@partial(
    Axis,
    name="light-size",
    about="the light grows, from a point to a broad light: penumbrae from less than a pixel to wider than the casters",
    unit="°",
    values=(0.01, 0.03, 0.1, 0.2665, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0),
    default=0.01,
    quick=(0.01, 1.0, 20.0),
)
def light_size(degrees: float, kind: LightKind) -> Setting:
    """A light of an angular radius as seen from the scene's centre."""
    light, angle = light_at(kind), math.radians(degrees)
    distance = float(np.linalg.norm(light.position))
    sized = replace(light, radius=angle if kind == "directional" else distance * math.sin(angle))
    return Setting((view_of_meshes(base_meshes(), sized),))


FRAMES = 5  # frames of an animation, the first at rest
_DIRECTION = np.array([0.8, 0.36, -0.48])  # unit length, along no axis
_REVERSED = "d32f-reversed"


@partial(
    Axis,
    name="volume-wall",
    about="the eye crosses the side of a shadow volume: z-pass counts go wrong at the near plane",
    unit="m",
    values=(0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0, -1e-6, -1e-5, -1e-4, -1e-3, -1e-2, -0.1, -0.5),
    default=0.5,
    quick=(0.5, 1e-4, 0.0, -0.1),
)
def volume_wall(metres: float, kind: LightKind) -> Setting:
    """The eye at a distance from the side of a plate's shadow volume, inside it if `metres` is negative."""
    light = light_at(kind, 70.0)
    plate = mesh("box", (1.0, 0.1, 1.6), (0.3, 1.6, 0.0))
    edge = np.array([0.8, 1.55, 0.4])  # on the plate's lower edge at +x, the side away from the light
    position, w = light.homogeneous
    away = unit(edge * w - np.asarray(position)) if w else -np.asarray(position)
    out = unit(np.cross(away, [0.0, 0.0, 1.0]))
    out = out if out[0] > 0 else -out
    eye = edge + away * 0.9 + out * metres
    post = mesh("box", (0.3, 0.8, 0.3), (-0.4, 0.4, -1.5), turn=25.0)
    target = vec3(eye + np.array([-0.55, -0.35, -1.2]))
    return Setting((view_of_meshes([ground(), plate, post], light, eye=vec3(eye), target=target, fov=70.0),))


@partial(
    Axis,
    name="camera-step",
    about="the camera's speed: edges that shimmer, and what is kept of earlier frames",
    unit="texels of 5.9 mm a frame",
    values=(0.05, 0.1, 0.25, 0.5, 0.75, 2.0, 8.0, 32.0),
    default=0.05,
    quick=(0.05, 0.5, 8.0),
)
def camera_step(texels: float, kind: LightKind) -> Setting:
    """The camera moves by that many texels per frame."""
    first = base_view(kind)
    step = np.array([0.8, 0.0, -0.6]) * texels * TEXEL
    cameras = [_moved(first.camera, 1.0, step * frame) for frame in range(FRAMES)]
    return Setting(tuple(view_of(first.scene, camera, first.light, first.size) for camera in cameras))


def _light_steps(texels: float, kind: LightKind) -> Setting:
    """The light rotates about the y axis so that the shadow of a point 1 m high moves by that many texels per frame."""
    first = base_view(kind)
    light = first.light
    turns = [turn_about_y(texels * TEXEL * frame) for frame in range(FRAMES)]
    poses = [(vec3(turn @ light.direction), vec3(turn @ light.position)) for turn in turns]
    lights = [replace(light, direction=direction, position=position) for direction, position in poses]
    return Setting(tuple(replace(first, light=light) for light in lights))


light_step = replace(
    camera_step,
    name="light-step",
    about="the speed of the light, by that of shadow edges: those that shimmer, step or lag",
    change=_light_steps,
)


def _translated(metres: float, kind: LightKind, coordinates: Coordinates) -> Setting:
    return Setting((_transformed(base_view(kind), 1.0, _DIRECTION * metres),), coordinates)


distance = Axis(
    partial(_translated, coordinates="relative"),
    name="distance",
    about="the whole scene moves away from the world origin; coordinates are taken relative to its centre",
    unit="m",
    values=(0.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
    default=0.0,
    quick=(0.0, 1e4, 1e7),
)
distance_absolute = replace(
    distance,
    name="distance-absolute",
    about="the whole scene moves away from the world origin, in absolute float32 coordinates",
    change=partial(_translated, coordinates="absolute"),
)


@partial(
    Axis,
    name="scale",
    about="the whole scene is scaled: lengths that are hard-coded in metres show",
    unit="×",
    values=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
    default=1.0,
    quick=(1e-6, 1.0, 1e6),
)
def scale(factor: float, kind: LightKind) -> Setting:
    """The base scene, scaled about the origin."""
    return Setting((_transformed(base_view(kind), factor, np.zeros(3)),))


def _transformed(view: View, factor: float, offset: Floats) -> View:
    """The view with scene, camera and light scaled, then translated."""
    scene, camera, light = view.scene, _moved(view.camera, factor, offset), view.light
    if light.kind != "directional":
        light = replace(light, position=vec3(np.array(light.position) * factor + offset))
    meshes = tuple(replace(mesh, vertices=mesh.vertices * factor + offset) for mesh in scene.meshes)
    return view_of(Scene(scene.name, meshes, (camera,), (light,)), camera, light, view.size)


def _moved(camera: Camera, factor: float, offset: Floats) -> Camera:
    position, target = (vec3(np.array(point) * factor + offset) for point in (camera.position, camera.target))
    return replace(camera, position=position, target=target, near=None, far=None)


@partial(
    Axis,
    name="depth-format",
    about="depth formats from reversed 32-bit float to 16 bits: precision of the depth comparison",
    values=(_REVERSED, "d32f", "d24", "d16"),
    default="d32f",
    quick=(_REVERSED, "d32f", "d16"),
    ordered=False,
)
def depth_format(name: str, kind: LightKind) -> Setting:
    """The base scene, with a depth format."""
    params = {"reversed": True, "depth": "d32f"} if name == _REVERSED else {"depth": name}
    return Setting((base_view(kind),), params=params)


@partial(
    Axis,
    name="map-size",
    about="texels along a side of the shadow map: aliasing of a small map, memory of a large one",
    unit="texels",
    values=(16, 32, 64, 128, 256, 512, MAP_SIZE, 2048, 4096, 8192, 16384),
    default=MAP_SIZE,
    quick=(16, 256, MAP_SIZE, 2048),
)
def map_size(texels: float, kind: LightKind) -> Setting:
    """The base scene, with a map size."""
    return Setting((base_view(kind),), params={"size": int(texels)})


@partial(
    Axis,
    name="view-size",
    about="pixels along a side of the picture, over a shadow map of fixed size",
    unit="px",
    values=(16, 32, 64, 128, VIEW_SIZE, 512, 1024, 2048, 4096),
    default=VIEW_SIZE,
    quick=(16, VIEW_SIZE, 512),
    lights=("directional", "point"),
)
def view_size(pixels: float, kind: LightKind) -> Setting:
    """The base scene, at a view size."""
    return Setting((base_view(kind, int(pixels)),))


_PLATE = 1.2
_SECTIONS = {1024: 32, 16384: 128, 262144: 512, 1048576: 1024}  # sections of a torus by its number of triangles
_FLAT = 1e-7  # height of a sliver relative to its longest edge


@partial(
    Axis,
    name="thickness",
    about="a wall gets thinner than a shadow-map texel: light leaks through it",
    unit="texels of 5.9 mm",
    values=(30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01),
    default=10.0,
    quick=(10.0, 1.0, 0.01),
)
def thickness(texels: float, kind: LightKind) -> Setting:
    """A wall on the ground, roughly perpendicular to the light's azimuth, and a plate above the ground."""
    thick = texels * TEXEL
    wall = mesh("box", (thick, 1.2, 1.8), (-0.9, 0.6, 0.3), turn=-30.0)
    plate = mesh("box", (1.1, thick, 1.1), (1.1, 0.6, -0.9), turn=20.0)
    return Setting((view_of_meshes([ground(), wall, plate], light_at(kind)),))


@partial(
    Axis,
    name="gap",
    about="a caster is lowered onto its receiver: peter-panning where the bias exceeds the gap",
    unit="of the caster",
    values=(1.0, 0.3, 0.1, 0.03, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5),
    default=0.3,
    quick=(0.3, 1e-2, 1e-5),
)
def gap(share: float, kind: LightKind) -> Setting:
    """A plate above the ground, at a height given as a share of its side; its shadow is visible beside and below it."""
    gap, high = share * _PLATE, 0.2 * _PLATE
    plate = mesh("box", (_PLATE, high, _PLATE), (-0.3, gap + high / 2, -0.2), turn=25.0)
    eye, target = (2.2, 2.4, 2.6), (0.3, 0.3, 0.2)
    return Setting((view_of_meshes([ground(), plate], light_at(kind), eye=eye, target=target),))


@partial(
    Axis,
    name="overlap",
    about="stacked casters: the stencil count of a shadow volume overflows 8 bits at 256",
    unit="casters",
    values=(1, 3, 10, 30, 100, 127, 128, 255, 256, 257, 512, 1000),
    default=1,
    quick=(1, 256, 1000),
    lights=("directional", "point"),
)
def overlap(count: float, kind: LightKind) -> Setting:
    """A stack of plates, 5 cm high in all, so that a shadow ray crosses nearly all of them."""
    step = 0.05 / int(count)
    heights = 0.5 + np.arange(int(count)) * step
    plates = [mesh("box", (0.9, 0.3 * step, 0.9), (-0.4, y, 0.1), turn=25.0) for y in heights]
    corners = np.concatenate([plate.vertices for plate in plates])
    faces = np.concatenate([plate.faces + 8 * k for k, plate in enumerate(plates)])
    return Setting((view_of_meshes([ground(), Mesh("plates", corners, faces)], light_at(kind, 75.0)),))


@partial(
    Axis,
    name="layers",
    about="the upper of two casters rises: their distance over that of the lower one to the ground; maps that are"
    " filtered let light through where casters overlap (bleeding), the more, the farther they are apart",
    values=(0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    default=0.1,
    quick=(0.1, 1.0, 10.0),
)
def layers(ratio: float, kind: LightKind) -> Setting:
    """A plate, and above it along the light a smaller one, whose shadow's edge lies in the first one's shadow."""
    light = light_at(kind, 75.0)
    height = 0.6
    lower = np.array([-0.2, height, 0.1])
    toward = -np.array(light.direction) if kind == "directional" else np.array(light.position) - lower
    upper = lower + toward / toward[1] * height * ratio
    plates = [mesh("box", (side, 0.02, side), at, turn=25.0) for side, at in ((1.6, lower), (0.8, upper))]
    eye, target = (1.7, 0.75, 1.9), (0.0, 0.0, 0.0)  # below the plates
    return Setting((view_of_meshes([ground(), *plates], light, eye=eye, target=target),))


@partial(
    Axis,
    name="triangles",
    about="triangles of one caster, up to two million",
    values=(1, 12, 1024, 16384, 262144, 1048576, 2097152),
    default=1024,
    quick=(1, 1024, 16384),
    lights=("directional", "point"),
)
def triangles(count: float, kind: LightKind) -> Setting:
    """One caster with a number of triangles: a triangle, a box, tori of more and more sections, finally two tori."""
    copies = 2 if count > max(_SECTIONS) else 1
    if count == 1:
        corners = np.array([[-0.6, 0.5, 0.7], [0.9, 0.7, 0.2], [-0.3, 0.6, -0.8]])
        casters = [Mesh("one", corners, np.array([[0, 1, 2]], dtype=np.int32))]
    elif count == 12:
        casters = [base_meshes()[1]]
    else:
        sections = _SECTIONS[int(count) // copies]
        casters = [mesh("torus", 1.1, (-0.8 + 1.6 * k, 0.6, 0.5 - k), sections=sections) for k in range(copies)]
    return Setting((view_of_meshes([ground(), *casters], light_at(kind, 65.0)),))


@partial(
    Axis,
    name="smoothness",
    about="triangles of a sphere with smooth normals: dark facets along the terminator where there are few",
    unit="triangles",
    values=(20, 80, 320, 1280, 5120, 20480),
    default=1280,
    quick=(20, 80, 1280),
)
def smoothness(triangles: float, kind: LightKind) -> Setting:
    """A sphere above the ground, lit from the side."""
    level = round(math.log(triangles / 20, 4))
    ball = mesh("sphere", 1.2, (0.0, 0.8, 0.0), subdivisions=level)
    smooth = replace(ball, normals=mean_normals(Triangles(ball.vertices, ball.faces)))
    return Setting((view_of_meshes([ground(), smooth], light_at(kind, 25.0)),))


@partial(
    Axis,
    name="mesh",
    about="defects of casters: slivers, duplicated triangles, T-junctions, inconsistent winding, holes",
    values=("closed", "slivers", "zero-area", "duplicated", "t-junctions", "inconsistent-winding", "open"),
    default="closed",
    quick=("closed", "slivers", "inconsistent-winding", "open"),
    lights=("directional", "point"),
    ordered=False,
)
def defects(name: str, kind: LightKind) -> Setting:
    """The base scene, its casters with a kind of defect."""
    floor, *casters = base_meshes()
    meshes = [Mesh(caster.name, *_with_defect(name, caster.vertices, caster.faces)) for caster in casters]
    return Setting((view_of_meshes([floor, *meshes], light_at(kind)),))


def _with_defect(name: str, vertices: Floats, faces: np.ndarray) -> Triangles:
    """A mesh as modelling tools and scanners leave it behind."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    match name:
        case "slivers":  # every triangle cut in three at a point close to the middle of an edge: one part is a sliver
            inner = (a + b) / 2 * (1 - _FLAT) + c * _FLAT
            return _loose([(a, b, inner), (b, c, inner), (c, a, inner)])
        case "zero-area":  # a triangle of zero area on every edge, dropped as loading does
            flat = _loose([(a, b, (a + b) / 2)])
            both = np.concatenate([vertices, flat.vertices]), np.concatenate([faces, flat.faces + len(vertices)])
            return without_zero_area(Triangles(*both))[0]
        case "duplicated":  # every triangle twice, every third one three times
            return Triangles(vertices, np.concatenate([faces, faces, faces[::3]]))
        case "t-junctions":  # every second triangle split at the middle of an edge that its neighbour keeps unsplit
            middle = ((a + b) / 2)[::2]
            whole = a[1::2], b[1::2], c[1::2]
            return _loose([whole, (a[::2], middle, c[::2]), (middle, b[::2], c[::2])])
        case "inconsistent-winding":  # of every third triangle
            turned = faces.copy()
            turned[::3] = turned[::3, ::-1]
            return Triangles(vertices, turned)
        case "open":  # every fifth triangle missing
            return Triangles(vertices, faces[np.arange(len(faces)) % 5 != 0])
    return Triangles(vertices, faces)


def _loose(parts: list[tuple[Floats, Floats, Floats]]) -> Triangles:
    """Triangles from their first, second and third corners, (N, 3) each, no vertex shared."""
    corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return Triangles(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


_CROWN = 1.5  # diameter, in metres
_COVER = 5.5  # area of all cards over that of the crown's cross-section


def _crown(size: float, count: int, kind: LightKind) -> Setting:
    """A crown of cards of a size in metres, above the ground."""
    crown = mesh("foliage", _CROWN, (-0.3, 1.0, 0.1), count=count, size=size / _CROWN)
    return Setting((view_of_meshes([ground(), crown], light_at(kind, 65.0)),))


@partial(
    Axis,
    name="leaf-size",
    about="leaves cut out of cards get smaller than a shadow-map texel: light no longer comes through between them",
    unit="texels of 5.9 mm",
    values=(30.0, 20.0, 10.0, 5.0, 3.0, 2.0, 1.0),
    default=20.0,
    quick=(20.0, 5.0, 1.0),
)
def leaf_size(texels: float, kind: LightKind) -> Setting:
    """A crown of leaves of a length; their number grows so that they cover the same area."""
    size = texels * TEXEL / LEAF
    return _crown(size, max(1, round(_COVER * _CROWN**2 / size**2)), kind)


@partial(
    Axis,
    name="cards",
    about="more and more cards overlap in one crown: a shadow ray meets many before one that is opaque there",
    unit="cards",
    values=(10, 30, 100, 300, 1000, 10_000),
    default=100,
    quick=(10, 100, 1000),
)
def cards(count: float, kind: LightKind) -> Setting:
    """A crown of cards of one size."""
    return _crown(0.3, int(count), kind)


AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        *(elevation, through_up, far_near),
        *(distance, distance_absolute, scale, depth_format, map_size, view_size),
        *(thickness, gap, lamp_distance, light_size, volume_wall),
        *(defects, overlap, layers, triangles, leaf_size, cards),
        *(smoothness, camera_step, light_step),
    )
}
"""All axes by name, in the order of tables."""
