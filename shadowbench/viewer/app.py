"""What the window does between its frames: draws what has changed, asks for the truth at rest, reads changed files."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import moderngl

from shadowbench.errors import ShadowbenchError
from shadowbench.gl.device import Device
from shadowbench.plugin.spec import Spec
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer.drawing import Drawing, Drawn, Mask, moving_size, told
from shadowbench.viewer.lights import LightPath, travelled
from shadowbench.viewer.panes import Panes
from shadowbench.viewer.state import History, Origin, Source, ViewerState
from shadowbench.viewer.truth import Judge, TruthTask
from shadowbench.viewer.watched import SHADERS, modified, scene_files

REST_S = 0.15
"""Time without a change after which a motion has ended, in seconds."""
FILES_S = 0.5
"""How often files are looked at, in seconds."""
_SHOWN_FRAMES = 120  # in the history of times
Result = TypeVar("Result")


class Viewer:
    """The window's state and everything that is drawn of it. `change` is the only way to another state.

    message: the last error or result of an action; broken: why nothing can be drawn; travel: the light's path; map_of,
    shows_map: the spec whose map is shown, and whether it is; names: of files to write; pass_ms: of the last frames.
    """

    def __init__(
        self,
        device: Device,
        state: ViewerState,
        techniques: Techniques,
        task: TruthTask,
        plugins: Sequence[Path] = (),
        seconds: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device, self.techniques = device, techniques
        self.history, self.judge = History(state), Judge(task)
        self.drawing, self.panes = Drawing(device), Panes(device)
        self.message = self.broken = ""
        self.travel: LightPath = "rest"
        self.turns_a_minute = 2.0
        self.drawn: Drawn | None = None
        self.pictures: dict[Source, moderngl.Texture] = {}
        self.map_picture: moderngl.Texture | None = None
        self.map_of, self.shows_map = 0, False
        self.names = {"study file": "view-study.toml", "picture": "view.png", "state": "view.toml"}
        self.work: dict[Spec, Mapping[str, int]] = {}
        self.pass_ms: deque[Sequence[Mapping[str, float]]] = deque(maxlen=_SHOWN_FRAMES)
        self._seconds, self._changed_at, self._stepped_at = seconds, -math.inf, seconds()
        self._rested_ms = 0.0
        # Of what the masks, the pictures and the last question are.
        self._drawn_of: tuple[object, ...] = ()
        self._shown_of: tuple[object, ...] = ()
        self._asked_of: Drawn | None = None
        self._plugins, self._times, self._looked_at = plugins, modified(state.origin, plugins), seconds()

    @property
    def state(self) -> ViewerState:
        """What is shown."""
        return self.history.state

    @property
    def judged(self) -> bool:
        """Whether the truth, the scores and the work that are asked for are of the masks that are shown."""
        return not self.broken and self.drawn is not None and self.drawn is self._asked_of

    @property
    def fresh(self) -> bool:
        """Whether the scores are of the masks that are shown."""
        return self.judged and self.judge.is_answered

    @property
    def moving(self) -> bool:
        """Whether something has changed a moment ago, or the light travels."""
        return self.travel != "rest" or self._seconds() - self._changed_at < REST_S

    @property
    def waiting(self) -> bool:
        """Whether a step would change nothing: no motion, no masks to score, no answer about them."""
        return not (self.moving or self._is_unasked() or self._uncounted() or self.judge.task.has_answers)

    def change(self, state: ViewerState, gesture: str = "") -> None:
        """Show another state; changes of one gesture are undone together."""
        self._to(self.history.changed(state, gesture))

    def undo(self) -> None:
        """Return to the state before."""
        self._to(self.history.undone())

    def redo(self) -> None:
        """Return to the state that was undone."""
        self._to(self.history.redone())

    def rest(self) -> None:
        """A gesture has ended."""
        self.history = self.history.rested()

    def attempt(self, action: Callable[[], str | None]) -> None:
        """Do something that may fail for the user's input or a file's contents; its message stands in the window."""
        try:
            self.message = action() or ""
        except Exception as error:  # a scene too large for the memory, whatever a file's reader or a technique raises
            self.message = str(error) if isinstance(error, ShadowbenchError | OSError) else told(error)

    def open_scene(self, origin: Origin, specs: tuple[Spec, ...] = ()) -> None:
        """Show another scene from its first camera, under its first light; specs: in place of A and B.

        Raises InputError.
        """
        scene, specs = origin.load(), specs or self.state.specs
        camera, light = scene.cameras[0], scene.lights[0]
        shown = replace(self.state, scene=scene, camera=camera, light=light, origin=origin, specs=specs)
        self.change(replace(shown, colors=(), coordinates="relative", phase=0))

    def step(self) -> None:
        """Bring everything up to date that a frame of the window shows."""
        self._read_changed_files()
        self._move_light()
        self.judge.receive()
        moving, size = self.moving, self.state.size
        drew = self._draw(moving_size(size, self._rested_ms, self.device.software) if moving else size)
        if self.drawn is not None and not (moving or drew):  # a little in each frame
            uncounted = self._uncounted()
            if self._is_unasked():
                self._ask(self.drawn)
            elif uncounted:
                self._count(self.drawn, uncounted[0])
        self.drawing.tell("")
        self._draw_panes()

    def mask_failures(self) -> Sequence[str]:
        """Why A and B drew nothing; empty for one that did."""
        return [mask.failure for mask in self.drawn.masks] if self.drawn else []

    def release(self) -> None:
        """Free what is on the device."""
        self._release_drawn()
        self.drawing.reload()
        self.panes.reload()
        self.device.free(self.pictures.values())

    def _to(self, history: History) -> None:
        if history.state is not self.state:
            self.message = ""
        if self._drawing_key(history.state) != self._drawing_key(self.state):
            self._changed_at = self._seconds()
        if history.state.origin != self.state.origin:
            self._times = modified(history.state.origin, self._plugins)
        self.history = history

    @staticmethod
    def _drawing_key(state: ViewerState) -> tuple[object, ...]:
        return (*state.viewed, state.specs, state.coordinates, state.phase)

    def _draw(self, size: int) -> bool:
        """Draw the masks unless they are of this state and size; whether they were drawn."""
        key = (*self._drawing_key(self.state), size)
        if key == self._drawn_of:
            return False
        self._drawn_of = key
        try:
            drawn = self.drawing.draw(self.state, size)
        except Exception as error:  # a camera inside the ground, a G-buffer shader that does not compile
            self.broken = str(error) if isinstance(error, ShadowbenchError) else told(error)
            return False
        self._release_drawn()
        self.drawn, self.broken = drawn, ""
        self.pass_ms.append([mask.passes.ms for mask in drawn.masks])
        self.drawing.keep_only(self.state.specs, (size, self.state.size))
        return True

    def _draw_panes(self) -> None:
        """Draw the pictures unless they are of these masks and this way to show them."""
        state, drawn = self.state, self.drawn
        if drawn is None or self.broken:
            return
        truth, with_map = self.judge.traced(state), self.shows_map and not self.moving
        shading = (state.shading, state.colors, state.shadows, state.overlay, state.sources)
        key = (drawn, truth, with_map, self.map_of, shading)
        if key == self._shown_of:
            return
        self._shown_of, start = key, self._seconds()
        self.drawing.paint(state)
        for source in state.sources:
            picture = self._tried(partial(self.panes.draw, drawn, state, source, truth))
            if picture is not None or source != "truth":  # an earlier truth is shown as such
                self.device.free([self.pictures.pop(source)] if source in self.pictures else [])
                self.pictures |= {} if picture is None else {source: picture}
        self.device.context.finish()
        if drawn.size == state.size:
            self._rested_ms = drawn.ms + (self._seconds() - start) * 1e3
        if with_map:
            self._draw_map(drawn)

    def _draw_map(self, drawn: Drawn) -> None:
        if self.map_picture is not None:
            self.device.free((self.map_picture,))
        technique = drawn.masks[min(self.map_of, len(drawn.masks) - 1)].technique
        self.map_picture = self._tried(partial(self.panes.map_picture, technique)) if technique else None

    def _tried(self, action: Callable[[], Result | None]) -> Result | None:
        """The result of what may fail for a technique or a shader; None with a message if it did."""
        try:
            return action()
        except Exception as error:  # NaN in a mask, or anything that a technique or the driver raises
            self.message = told(error)
            return None

    def _is_unasked(self) -> bool:
        return self.drawn is not None and not self.broken and self.drawn is not self._asked_of

    def _uncounted(self) -> list[Mask]:
        """Masks whose work is not counted yet."""
        masks = self.drawn.masks if self.drawn and not self.broken else ()
        return [mask for mask in masks if mask.visibility is not None and mask.spec not in self.work]

    def _ask(self, drawn: Drawn) -> None:
        """Ask for the truth and the scores of what is shown."""
        self._asked_of, self.work = drawn, {}
        drew = [mask for mask in drawn.masks if mask.visibility is not None]
        read = {mask.spec.full_text: self._tried(partial(self.drawing.visibility, drawn, mask)) for mask in drew}
        self.judge.ask(self.state, {text: mask for text, mask in read.items() if mask is not None})

    def _count(self, drawn: Drawn, mask: Mask) -> None:
        """Count the work of a technique."""
        self.work[mask.spec] = self._tried(partial(self.drawing.work, drawn, mask)) or {}

    def _move_light(self) -> None:
        """Move a travelling light by the time since the last frame."""
        now = self._seconds()
        turns, self._stepped_at = (now - self._stepped_at) * self.turns_a_minute / 60, now
        light = travelled(self.state.light, self.state.scene, self.travel, turns)
        self.change(replace(self.state, light=light), "travel")

    def _read_changed_files(self) -> None:
        now, origin = self._seconds(), self.state.origin
        if now - self._looked_at < FILES_S:
            return
        before, self._times, self._looked_at = self._times, modified(origin, self._plugins), now
        changed = {file for file, _ in before.items() ^ self._times.items()}
        if origin is not None and changed.intersection(scene_files(origin)):
            self.attempt(lambda: self._reload_scene(origin))
        for file in changed.intersection(self._plugins):
            self.message = f"{file} has changed: its shader files are read again, its Python when the window is opened"
        if any(file.suffix in SHADERS for file in changed):
            self.panes.reload()
            self._release_drawn()
            self.drawing.reload()
            self._drawn_of = ()
            self._changed_at = self._seconds()

    def _reload_scene(self, origin: Origin) -> str:
        """Load the scene's file again, for undo too; a camera or a light that was moved stays where it is."""
        old, scene = self.state.scene, origin.load()
        self._to(self.history.mapped(lambda state: state.with_scene(scene) if state.scene is old else state))
        self._times = modified(origin, self._plugins)  # it may name other meshes
        return f"{origin.source} was loaded again"

    def _release_drawn(self) -> None:
        if self.drawn is not None:
            self.drawn.release()
            self.drawn = None
            self._shown_of = ()
