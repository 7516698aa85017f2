"""Everything that the window shows, as one immutable value, and its history for undo and redo."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

from shadowbench.files import data_folder
from shadowbench.gl.picture import Shading
from shadowbench.options import FIRST, SceneOptions
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, View, triangle_colors, view_of
from shadowbench.scenes.opening import Named, opened
from shadowbench.scenes.vectors import Floats, Vec3
from shadowbench.truths.embree import tracer_of

Layout = Literal["one", "wipe", "side by side"]
Source = Literal["A", "B", "truth"]
Overlay = Literal["picture", "error", "mask", "normals", "N·L", "texels", "blockers", "tint"]
OVERLAYS = get_args(Overlay)

Colors = tuple[tuple[str, Vec3], ...]
"""Linear RGB of materials, with their names."""
MOST_UNDO = 500
_COPY = re.compile(r"( \d+)+$")  # what a repeated mesh's name ends with


@dataclass(frozen=True)
class Origin:
    """Where a scene was loaded from: the arguments of `opened`."""

    source: str
    options: SceneOptions = FIRST

    @property
    def file(self) -> Path:
        """The scene's own file."""
        is_builtin = self.source in builtin_names()
        return data_folder("scenes") / f"{self.source}.toml" if is_builtin else Path(self.source)

    def load(self) -> Scene:
        """The scene, as it is on disk now. Raises InputError, as `opened` does."""
        return opened(self.source, self.options, tracer_of)


@dataclass(frozen=True)
class ViewerState:
    """What the window shows.

    size: of the image, in pixels along a side; origin: of the scene, None for one that no file has, such as a sweep's;
    coordinates: in which it is drawn; phase: see `Phase`; colors: in place of those of `materials`; wipe: the share of
    the picture that `left` takes.
    """

    scene: Scene
    camera: Camera
    light: Light
    specs: tuple[Spec, ...]
    size: int = 512
    origin: Origin | None = None
    coordinates: Coordinates = "relative"
    phase: int = 0
    shading: Shading = field(default_factory=Shading)
    colors: Colors = ()
    shadows: bool = True
    layout: Layout = "wipe"
    left: Source = "A"
    right: Source = "truth"
    wipe: float = 0.5
    overlay: Overlay = "picture"

    def view(self, size: int | None = None) -> View:
        """The view, by default of `size`. Raises InputError, as `view_of` does."""
        return view_of(self.scene, self.camera, self.light, size or self.size)

    @property
    def viewed(self) -> tuple[object, ...]:
        """What the truth depends on; equal for states that have the same one."""
        return (self.scene, self.camera, self.light, self.size)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The pictures that the layout shows, from the left."""
        if self.layout == "side by side":
            return ("A", *(("B",) if len(self.specs) > 1 else ()), "truth")
        return (self.left,) if self.layout == "one" else (self.left, self.right)

    def with_spec(self, index: int, spec: Spec) -> "ViewerState":
        """With another spec as A (0) or B (1)."""
        return replace(self, specs=(*self.specs[:index], spec, *self.specs[index + 1 :]))

    def with_scene(self, scene: Scene) -> "ViewerState":
        """With another version of its scene, whose camera and light of the same names it has unless they were moved."""
        camera = _followed(self.camera, self.scene.cameras, scene.cameras)
        return replace(self, scene=scene, camera=camera, light=_followed(self.light, self.scene.lights, scene.lights))


def materials(scene: Scene) -> dict[str, Vec3]:
    """Linear RGB by name of what a scene is made of: meshes, and copies of one as one."""
    return {_COPY.sub("", mesh.name): mesh.color for mesh in reversed(scene.meshes)}


def recolored(scene: Scene, colors: Mapping[str, Vec3]) -> Floats:
    """(F, 3) colours of a scene's triangles, with others of some materials."""
    shown = [colors.get(_COPY.sub("", mesh.name), mesh.color) for mesh in scene.meshes]
    return triangle_colors(scene.meshes, shown)


@dataclass(frozen=True)
class History:
    """The current state, what undo and redo return to, and the gesture that made it.

    A gesture, such as a drag, makes many states, of which undo skips all but the first.
    """

    state: ViewerState
    past: tuple[ViewerState, ...] = ()
    future: tuple[ViewerState, ...] = ()
    gesture: str = ""

    def changed(self, state: ViewerState, gesture: str = "") -> "History":
        """With another state; one of the same gesture, unless that is empty, replaces the last."""
        if state == self.state:
            return self
        same = gesture != "" and gesture == self.gesture
        return History(state, self.past if same else (*self.past, self.state)[-MOST_UNDO:], (), gesture)

    def mapped(self, change: Callable[[ViewerState], ViewerState]) -> "History":
        """With every state changed, such as by a scene whose file has changed on disk."""
        past, future = (tuple(map(change, states)) for states in (self.past, self.future))
        return History(change(self.state), past, future, self.gesture)

    def rested(self) -> "History":
        """The gesture has ended: the next change is one of its own."""
        return replace(self, gesture="")

    def undone(self) -> "History":
        """The state before; itself if there is none."""
        return History(self.past[-1], self.past[:-1], (self.state, *self.future)) if self.past else self

    def redone(self) -> "History":
        """The state that was undone last; itself if there is none."""
        return History(self.future[0], (*self.past, self.state), self.future[1:]) if self.future else self


def _followed(shown: Named, before: Sequence[Named], now: Sequence[Named]) -> Named:
    """A camera or light as it is now, of the same name or else the first; one that was moved as it is."""
    return next((one for one in now if one.name == shown.name), now[0]) if shown in before else shown
