"""Sequences: views in order, in which camera, light or objects move, from a scene's file or built in.

Every scene has the built-in ones. They go on at the same speed for as many frames as are wanted, so that frame i is the
same view in a sequence of 2 frames as in one of 300, and move shadow edges by fractions of a pixel to a few pixels from
frame to frame.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from shadowbench.errors import InputError, alternatives
from shadowbench.options import FRAMES
from shadowbench.scenes.assumed import content_of
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.scene_tables import NARROWEST, Direction, Name, Number, Three
from shadowbench.scenes.vectors import Floats, Vec3, rotation, unit, vec3
from shadowbench.strict import Strict, validated

RATE = 24.0
"""Frames a second of the built-in sequences."""
PAN = (0.5, 0.3)
"""Pixels to the right and up by which a pan moves the image in a frame."""
DOLLY, ZOOM, ORBIT, CASTER = 0.5, 1.0, 0.5, 0.7  # pixels a frame
SLOW_SUN, QUICK_SUN = 0.02, 0.5  # degrees a frame
LAMP, BOB, STRIDE = 0.002, 0.01, 12  # shares of the lamp's distance, and frames from step to step
_OVERHEAD = math.sin(math.radians(10.0))
_BESIDE = (0.2, 0.1)  # right of and above the camera, where a lamp is carried, as shares of the target's distance

Move = Callable[[View, int], View]
"""A frame of a view, by its index; frame 0 is the view."""


@dataclass(frozen=True)
class Motion:
    """A sequence. frames: how many there are if no number is given; most: how many there may be.

    seconds: from the first of `frames` to the last.
    """

    name: str
    move: Move
    about: str
    frames: int = 24
    seconds: float = 23 / RATE
    most: int = FRAMES.most


def frames_of(view: View, motion: Motion, frames: int | None = None) -> tuple[View, ...]:
    """The first frames of a motion, by default all of them; frame 0 is the view itself.

    Frames in which nothing but camera or light moves share the view's scene. All have the same near and far planes,
    which enclose the scene in each of them, as an engine's are fixed: were they fitted frame by frame, cascades would
    be split elsewhere in each frame, and stabilised ones would change their size. Raises InputError for a number of
    frames that is not allowed, and for a view in which the motion changes nothing.
    """
    count = motion.frames if frames is None else frames
    if not FRAMES.least <= count <= motion.most:
        raise InputError(
            f"--frames {count}: sequence {motion.name} allows whole numbers from {FRAMES.least} to {motion.most}"
        )
    return _with_shared_planes([motion.move(view, index) for index in range(count)])


ALL = "all"
"""Names the built-in sequences in which something of a scene moves."""


def motions_of(scene: Scene, names: Sequence[str]) -> list[Motion]:
    """Sequences of a scene's file, or built-in ones, by name. Raises InputError for an unknown name."""
    known = {motion.name: motion for motion in (*scene.motions, *BUILT_IN.values())}
    for name in names:
        if name not in (*known, ALL):
            also = alternatives(name, [*known, ALL], f"those of {scene.name}")
            raise InputError(f"--sequence: found {name!r:.60}{also}")
    built_in = [name for name in BUILT_IN if name != "walker" or _poses_change(scene)] if ALL in names else []
    return [known[name] for name in dict.fromkeys([*names, *built_in]) if name != ALL]


def _with_shared_planes(views: Sequence[View]) -> tuple[View, ...]:
    """The views with the nearest near plane and the farthest far plane of all; the file's own planes stay."""
    first = views[0]
    if all(view.camera is first.camera and view.scene is first.scene for view in views):
        return tuple(views)
    own = first.camera
    fitted = view_of(first.scene, replace(own, near=None, far=None), first.light, first.size).camera
    planes = {name: value for name in ("near", "far") if (value := getattr(own, name)) != getattr(fitted, name)}
    free: dict[str, None] = {"near": None, "far": None}
    cameras = [
        view_of(view.scene, replace(view.camera, **(free | planes)), view.light, view.size).camera for view in views
    ]
    near, far = min(camera.near or 0.0 for camera in cameras), max(camera.far or 0.0 for camera in cameras)
    return tuple(replace(view, camera=replace(view.camera, near=near, far=far)) for view in views)


# Built-in sequences

BUILT_IN: dict[str, Motion] = {}
"""The sequences that every scene has, by name."""


def _built_in(move: Move) -> Move:
    name = move.__name__.strip("_").replace("_", "-")
    BUILT_IN[name] = Motion(name, move, (move.__doc__ or "").split("\n\n")[0])
    return move


def _distance(camera: Camera) -> float:
    return math.dist(camera.position, camera.target)


@_built_in
def _dolly(view: View, index: int) -> View:
    """The camera nears its target, so that points there at the image's upper edge move by half a pixel a frame.

    That is 0.2% of the distance a frame at 512 pixels; points a tenth as far move by 5 pixels. An orthographic camera
    moves as well, and sees the same.
    """
    camera, share = view.camera, (1 - 2 * DOLLY / view.size.height) ** index
    position = np.add(camera.target, share * np.subtract(camera.position, camera.target))
    return replace(view, camera=replace(camera, position=vec3(position)))


@_built_in
def _pan(view: View, index: int) -> View:
    """The camera turns, or moves aside if orthographic: the image moves by 0.5 pixels to the left and 0.3 down a frame.

    All surfaces in the image stay visible to a perspective, at other places between the pixels.
    """
    camera = view.camera
    pixel = 2 * (camera.slope * _distance(camera) or camera.height / 2) / view.size.height
    offset = index * pixel * (np.array([*PAN, 0.0]) @ camera.basis())
    position = np.add(camera.position, (1 - camera.converging) * offset)
    return replace(view, camera=replace(camera, position=vec3(position), target=vec3(np.add(camera.target, offset))))


@_built_in
def _zoom(view: View, index: int) -> View:
    """The field of view narrows, so that the middle of the image's upper edge moves by a pixel a frame."""
    camera, share = view.camera, (1 - 2 * ZOOM / view.size.height) ** index
    fov_y, height = 2 * math.atan(camera.slope * share), camera.height * share
    return replace(view, camera=replace(camera, fov_y=fov_y, height=height)) if index else view


@_built_in
def _orbit(view: View, index: int) -> View:
    """The camera circles its target by the angle of half a pixel a frame, 0.036° at 512 pixels and 36°.

    A point half as far as the target moves by half a pixel, one a tenth as far by 5.
    """
    camera = view.camera
    pixel = 2 * (camera.slope or camera.height / 2 / _distance(camera)) / view.size.height
    turn = rotation(camera.basis()[1], index * ORBIT * pixel)
    position = np.add(camera.target, turn @ np.subtract(camera.position, camera.target))
    return replace(view, camera=replace(camera, position=vec3(position))) if index else view


def _circled(view: View, degrees: float) -> View:
    """The view with its light turned about the vertical through the camera's target, about x if it is overhead.

    degrees: of the light as seen from the target.
    """
    light, target = view.light, view.camera.target
    (x, y, z), w = light.homogeneous
    toward = unit(np.subtract((x, y, z), np.multiply(w, target)))
    level = math.hypot(toward[0], toward[2])
    axis, radius = (
        ((0.0, 1.0, 0.0), level) if level > _OVERHEAD else ((1.0, 0.0, 0.0), math.hypot(toward[1], toward[2]))
    )
    turn = rotation(axis, math.radians(degrees) / radius)
    around = vec3(np.add(target, turn @ np.subtract(light.position, target)))
    position = light.position if light.kind == "directional" else around
    moved = replace(light, direction=vec3(turn @ light.direction), up=vec3(turn @ light.up), position=position)
    return replace(view, light=moved) if degrees else view


@_built_in
def _slow_sun(view: View, index: int) -> View:
    """The light circles the camera's target by 0.02° a frame, a day in 12 minutes: edges move by a tenth of a pixel."""
    return _circled(view, index * SLOW_SUN)


@_built_in
def _quick_sun(view: View, index: int) -> View:
    """The light circles the camera's target by 0.5° a frame, a day in half a minute: edges move by some pixels."""
    return _circled(view, index * QUICK_SUN)


@_built_in
def _carried_lamp(view: View, index: int) -> View:
    """A lamp is carried to the right by 0.2% of the target's distance a frame, and rises and sinks by 1% at each step.

    It is the view's spot, point or area light; a sun gives way to a point light beside the camera.
    """
    camera, light = view.camera, view.light
    right, up, _ = camera.basis()
    if light.kind == "directional":
        beside = np.array([*_BESIDE, 0.0]) @ camera.basis()
        light = Light("lamp", "point", position=vec3(np.add(camera.position, _distance(camera) * beside)))
    away = math.dist(light.position, camera.target)
    bob = BOB * math.sin(2 * math.pi * index / STRIDE)
    position = np.add(light.position, away * (index * LAMP * right + bob * up))
    return replace(view, light=replace(light, position=vec3(position)))


@_built_in
def _moving_caster(view: View, index: int) -> View:
    """A caster moves to the right by 0.7 pixels a frame: the largest that spans less than half of the scene.

    If none does, it is the smallest.
    """
    scene, camera = view.scene, view.camera
    casters = [mesh for mesh in scene.meshes if mesh.casts]
    if not casters:
        raise InputError(f"sequence moving-caster: {scene.name} has no caster")
    spans = {mesh: float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])) for mesh in casters}
    whole = float(np.linalg.norm(scene.geometry.bounds[1] - scene.geometry.bounds[0]))
    small = [mesh for mesh in casters if spans[mesh] < whole / 2]
    chosen = max(small, key=spans.__getitem__) if small else min(casters, key=spans.__getitem__)
    right, _, back = camera.basis()
    depth = float((camera.position - chosen.bounds.mean(axis=0)) @ back)
    pixel = 2 * camera.half_height(abs(depth)) / view.size.height
    return _displaced(view, {chosen.name: (index * CASTER * pixel * right, np.eye(3))}) if index else view


@_built_in
def _walker(view: View, index: int) -> View:
    """Skins, morph targets and nodes move as their clips do, 24 frames a second, from the time of the scene on.

    They are those of glTF files with a clip; the shape `walker` takes a stride a second.
    """
    scene = view.scene
    if scene.posed is None or not _poses_change(scene):
        what = "a glTF with a clip, or the shape walker, in a scene file or alone"
        raise InputError(f"sequence walker: {scene.name} has no pose that changes with time; allowed: {what}")
    posed = content_of(scene.posed(index / RATE)).meshes
    if [len(mesh.faces) for mesh in posed] != [len(mesh.faces) for mesh in content_of(scene).meshes]:
        raise InputError(
            f"sequence walker: in frame {index} of {scene.name} other triangles have an area; allowed: all"
        )
    ground = [mesh for mesh in scene.meshes if scene.ground is not None and mesh is scene.ground[0]]
    return replace(view, scene=replace(scene, meshes=(*posed, *ground))) if index else view


@lru_cache(1)
def _poses_change(scene: Scene) -> bool:
    if scene.posed is None:
        return False
    before, after = content_of(scene).meshes, content_of(scene.posed(1 / RATE)).meshes
    return not all(np.array_equal(old.vertices, new.vertices) for old, new in zip(before, after, strict=False))


def _displaced(view: View, moves: Mapping[str, tuple[Floats, Floats]]) -> View:
    """The view with meshes, by name, translated by a vector and turned about the middle of their bounds by a matrix."""

    def moved(mesh: Mesh) -> Mesh:
        if mesh.name not in moves:
            return mesh
        offset, turn = moves[mesh.name]
        middle, matrix = mesh.bounds.mean(axis=0), np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, middle + offset - turn @ middle
        return mesh.reshaped(mesh.vertices @ turn.T + matrix[:3, 3], mesh.faces, matrix)

    return replace(view, scene=replace(view.scene, meshes=tuple(map(moved, view.scene.meshes))))


# Sequences of scene files


class _CameraKey(Strict):
    position: Three | None = None
    target: Three | None = None
    fov_y: Number | None = Field(None, ge=NARROWEST, lt=180.0)  # degrees
    height: Number | None = Field(None, gt=0.0)  # metres


class _LightKey(Strict):
    direction: Direction | None = None
    position: Three | None = None


class _ObjectKey(Strict):
    translate: Three = (0.0, 0.0, 0.0)
    rotate: Three = (0.0, 0.0, 0.0)  # degrees


class _Key(Strict):
    time: Number = Field(gt=0.0)
    camera: _CameraKey = _CameraKey()
    light: _LightKey = _LightKey()
    object: dict[str, _ObjectKey] = {}


def _increasing(keys: list[_Key]) -> list[_Key]:
    times = [key.time for key in keys]
    if sorted(set(times)) != times:
        raise ValueError(f"found keys at {times} s; allowed: times that increase")
    return keys


class SequenceTable(Strict):
    """A `[[sequence]]` table: frames and their seconds, and key frames, which follow that of the scene itself at 0."""

    name: Name
    frames: int = Field(24, ge=FRAMES.least, le=FRAMES.most, strict=True)
    seconds: Number = Field(1.0, gt=0.0)
    key: Annotated[list[_Key], Field(min_length=1), AfterValidator(_increasing)]

    @model_validator(mode="after")
    def _own_name(self) -> Self:
        if self.name in BUILT_IN:
            raise ValueError(f"name {self.name!r} is that of a sequence which every scene has")
        return self


def motion_from_table(table: object, meshes: Sequence[Mesh], where: str) -> Motion:
    """The sequence of a table of a scene file with these meshes. Raises InputError that begins with `where`."""
    row = validated(SequenceTable, table, where)
    names = [mesh.name for mesh in meshes]
    for name in dict.fromkeys(name for key in row.key for name in key.object):
        if name not in names:
            raise InputError(f"{where}: object: found {name!r:.60}{alternatives(name, names, 'meshes')}")
    keyed = Keyed(row.name, row.seconds / (row.frames - 1), tuple(row.key))
    return Motion(row.name, keyed, f"of the scene's file, {row.seconds:g} s", row.frames, row.seconds, row.frames)


@dataclass(frozen=True)
class Keyed:
    """The move of a sequence of a file: from the view by way of its keys, whose last one holds on.

    Numbers are interpolated linearly, directions spherically; interval: seconds from frame to frame.
    """

    name: str
    interval: float
    keys: tuple[_Key, ...]

    def __call__(self, view: View, index: int) -> View:
        """A frame of the view. Raises InputError for a key that its camera or light does not have."""
        if not index:
            return view
        camera, light, time = view.camera, view.light, index * self.interval
        self._check("camera", "height" if camera.converging else "fov_y", f"{camera.name}, as is its kind of camera")
        lacking = {"directional": "position", "point": "direction"}.get(light.kind)
        self._check("light", lacking, f"{light.name}, a {light.kind} light")
        at: dict[str, Any] = {
            name: self._between(own, "camera", name, time)
            for name, own in (("position", camera.position), ("target", camera.target), ("height", camera.height))
        }
        at["fov_y"] = math.radians(self._between(math.degrees(camera.fov_y), "camera", "fov_y", time))
        of_light = {
            "position": self._between(light.position, "light", "position", time),
            "direction": self._between(light.direction, "light", "direction", time),
        }
        still = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        moves = {}
        for name in dict.fromkeys(name for key in self.keys for name in key.object):
            states = [(key.time, key.object[name]) for key in self.keys if name in key.object]
            values = [(0.0, still), *((when, (state.translate, state.rotate)) for when, state in states)]
            offset, degrees = (_at([(when, pair[part]) for when, pair in values], time) for part in (0, 1))
            turn = np.eye(3)
            for axis, angle in zip(np.eye(3), degrees, strict=True):
                turn = rotation(axis, math.radians(angle)) @ turn
            moves[name] = np.asarray(offset), turn
        moved = _displaced(view, moves) if moves else view
        return replace(moved, camera=replace(camera, **at), light=replace(light, **of_light))

    def _check(self, owner: str, name: str | None, of: str) -> None:
        if name and any(getattr(getattr(key, owner), name) is not None for key in self.keys):
            raise InputError(f"sequence {self.name}: found a key of {owner} {name}; allowed: what has {of}")

    def _between(self, own: Any, owner: str, name: str, time: float) -> Any:
        """The value of a field of the camera or light at a time; its own if no key has it."""
        given = [(key.time, value) for key in self.keys if (value := getattr(getattr(key, owner), name)) is not None]
        if not given:
            return own
        value = _at([(0.0, own), *given], time, _along_arc if name == "direction" else _along_line)
        return value if isinstance(own, float) else vec3(value)


def _along_line(before: Any, after: Any, share: float) -> Any:
    return np.add(np.multiply(before, 1 - share), np.multiply(after, share)).tolist()


def _along_arc(before: Vec3, after: Vec3, share: float) -> Vec3:
    """The direction at a share of the shorter arc; of two opposite ones any arc."""
    start, end = unit(before), unit(after)
    across = np.cross(start, end)
    if not across.any():
        return before if start @ end > 0 or share < 0.5 else after
    return vec3(rotation(across, share * math.atan2(float(np.linalg.norm(across)), float(start @ end))) @ start)


def _at(values: Sequence[tuple[float, Any]], time: float, between: Callable[..., Any] = _along_line) -> Any:
    """The value at a time; values: at times that increase from 0. The last one holds on."""
    for (start, before), (end, after) in itertools.pairwise(values):
        if time < end:
            return between(before, after, (time - start) / (end - start))
    return values[-1][1]
