"""What the window does between its frames: draws what has changed, asks for the truth at rest, reads changed files."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import moderngl

from shadowbench.errors import ShadowbenchError
from shadowbench.gl.device import Device
from shadowbench.plugin.base import Technique
from shadowbench.plugin.spec import Spec
from shadowbench.viewer.changed_files import ChangedFiles
from shadowbench.viewer.drawing import Drawing, Drawn, Mask, moving_size, told
from shadowbench.viewer.judge import Judge, Scores
from shadowbench.viewer.lights import Travel
from shadowbench.viewer.panes import Panes
from shadowbench.viewer.state import History, Origin, Source, ViewerState
from shadowbench.viewer.truth import TruthTask

REST_S = 0.15
"""Time without a change after which a motion has ended, in seconds."""
SHOWN_FRAMES = 120
"""Frames in the history of times."""


class Viewer:
    """The window's state and everything that is drawn of it. `change` is the only way to another state."""

    def __init__(
        self,
        device: Device,
        state: ViewerState,
        techniques: Mapping[str, type[Technique]],
        task: TruthTask,
        plugins: Sequence[Path] = (),
        seconds: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device, self.techniques = device, techniques
        self.history = History(state)
        self.drawing, self.panes = Drawing(device), Panes(device)
        self.travel = Travel()
        self.message = ""  # the last error or result of an action
        self.broken = ""  # why nothing can be drawn
        self.drawn: Drawn | None = None
        self.pictures: dict[Source, moderngl.Texture] = {}
        self.map_picture: moderngl.Texture | None = None
        self.map_of, self.shows_map = 0, False  # the spec whose map is shown, and whether it is
        self.judge = Judge(device, task)
        self.work: dict[Spec, Mapping[str, int]] = {}
        self.pass_ms: deque[Mapping[str, float]] = deque(maxlen=SHOWN_FRAMES)
        self._seconds, self._changed_at, self._stepped_at = seconds, -math.inf, seconds()
        self._rested_ms = 0.0
        # Of what the masks, the pictures and the last request are.
        self._drawn_of: tuple[object, ...] = ()
        self._shown_of: tuple[object, ...] = ()
        self._asked_of: Drawn | None = None
        self._plugins = plugins
        self._files = ChangedFiles(state.origin, plugins)

    @property
    def state(self) -> ViewerState:
        """What is shown."""
        return self.history.state

    @property
    def scores(self) -> Scores:
        """The last scores, which are of what is shown if they are `fresh`."""
        return self.judge.scores

    @property
    def judged(self) -> bool:
        """Whether the truth, the scores and the work that are asked for are of the masks that are shown."""
        return not self.broken and self.drawn is not None and self.drawn is self._asked_of

    @property
    def fresh(self) -> bool:
        """Whether the scores are of the masks that are shown."""
        return self.judged and self.scores.viewed == self.state.viewed

    @property
    def moving(self) -> bool:
        """Whether something has changed a moment ago, or the light travels."""
        return self.travel.path != "rest" or self._seconds() - self._changed_at < REST_S

    @property
    def waiting(self) -> bool:
        """Whether a step would change nothing: no motion, no masks to score, no answer about them."""
        return not (self.moving or self._chore() or self.judge.task.has_answers)

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
        except (ShadowbenchError, OSError) as error:
            self.message = str(error)
        except Exception as error:  # a scene too large for the memory, whatever a file's reader raises
            self.message = told(error)

    def open_scene(self, origin: Origin) -> None:
        """Show another scene from its first camera, under its first light. Raises InputError."""
        scene = origin.load()
        shown = replace(self.state, scene=scene, camera=scene.cameras[0], light=scene.lights[0], origin=origin)
        self.change(replace(shown, colors=(), coordinates="relative", phase=0))

    def step(self) -> None:
        """Bring everything up to date that a frame of the window shows."""
        self._read_changed_files()
        self._move_light()
        self.message = self.judge.receive() or self.message
        moving = self.moving
        size = self.state.size
        if moving:
            size = moving_size(size, self._rested_ms, self.device.software)
        drew = self._draw(size)
        chore = None if moving or drew else self._chore()
        if chore is not None:
            chore()
        self._draw_panes()

    def mask_failures(self) -> Sequence[str]:
        """Why A and B drew nothing; empty for one that did."""
        return [mask.failure for mask in self.drawn.masks] if self.drawn else []

    def release(self) -> None:
        """Free what is on the device."""
        self._release_drawn()
        self.drawing.reload()
        self.panes.reload()
        self.judge.release()
        self.device.free(self.pictures.values())

    def _to(self, history: History) -> None:
        if history.state is not self.state:
            self.message = ""
        if self._drawing_key(history.state) != self._drawing_key(self.state):
            self._changed_at = self._seconds()
        if history.state.origin != self.state.origin:
            self._files = ChangedFiles(history.state.origin, self._plugins)
        self.history = history

    @staticmethod
    def _drawing_key(state: ViewerState) -> tuple[object, ...]:
        return (*state.viewed, state.specs, state.coordinates, state.phase, state.colors)

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
        self.drawing.keep_only(self.state.specs, (size, self.state.size))
        self.pass_ms.append(
            {
                f"{source} {name}": ms
                for source, mask in zip("AB", drawn.masks, strict=False)
                for name, ms in mask.passes.ms.items()
            }
        )
        return True

    def _draw_panes(self) -> None:
        """Draw the pictures unless they are of these masks and this way to show them."""
        state, drawn = self.state, self.drawn
        if drawn is None or self.broken:
            return
        truth = self.judge.textures(state, drawn.size)
        shading = (state.shading, state.shadows, state.overlay, state.sources)
        key = (drawn, truth, self.shows_map and not self.moving, self.map_of, shading)
        if key == self._shown_of:
            return
        self._shown_of, start = key, self._seconds()
        for source in state.sources:
            try:
                picture = self.panes.draw(drawn, state, source, truth)
            except Exception as error:  # the tint of a technique, a shader of the overlay
                self.message, picture = told(error), None
            if picture is not None or source != "truth":  # an earlier truth is shown as such
                self._keep(source, picture)
        self.device.context.finish()
        if drawn.size == state.size:
            self._rested_ms = drawn.ms + (self._seconds() - start) * 1e3
        if self.shows_map and not self.moving:
            self._draw_map(drawn)

    def _keep(self, source: Source, picture: moderngl.Texture | None) -> None:
        if source in self.pictures:
            self.device.free((self.pictures.pop(source),))
        if picture is not None:
            self.pictures[source] = picture

    def _draw_map(self, drawn: Drawn) -> None:
        if self.map_picture is not None:
            self.device.free((self.map_picture,))
            self.map_picture = None
        technique = drawn.masks[min(self.map_of, len(drawn.masks) - 1)].technique
        if technique is not None:
            try:
                self.map_picture = self.panes.map_picture(technique)
            except Exception as error:  # a technique may raise anything
                self.message = told(error)

    def _chore(self) -> Callable[[], None] | None:
        """What is to be done next about the masks at rest, a little in each frame; None if nothing is left."""
        drawn = self.drawn
        if drawn is None or self.broken:
            return None
        if drawn is not self._asked_of:
            return partial(self._ask, drawn)
        uncounted = [mask for mask in drawn.masks if mask.visibility is not None and mask.spec not in self.work]
        return partial(self._count, drawn, uncounted[0]) if uncounted else None

    def _ask(self, drawn: Drawn) -> None:
        """Ask for the truth and the scores of what is shown."""
        self._asked_of, self.work, visibility = drawn, {}, {}
        for mask in drawn.masks:
            if mask.visibility is not None:
                try:
                    visibility[mask.spec.full_text] = self.drawing.visibility(drawn, mask)
                except Exception as error:  # NaN, or whatever the driver says
                    self.message = told(error)
        self.judge.ask(self.state, visibility)

    def _count(self, drawn: Drawn, mask: Mask) -> None:
        """Count the work of a technique."""
        self.work[mask.spec] = {}
        try:
            self.work[mask.spec] = self.drawing.work(drawn, mask)
        except Exception as error:  # a technique may raise anything
            self.message = told(error)

    def _move_light(self) -> None:
        """Move a travelling light by the time since the last frame."""
        now = self._seconds()
        passed, self._stepped_at = now - self._stepped_at, now
        if self.travel.path != "rest":
            light = self.travel.moved(self.state.light, self.state.scene, passed)
            self.change(replace(self.state, light=light), "travel")

    def _read_changed_files(self) -> None:
        changed = self._files.changed()
        if changed.scene:
            self.attempt(self._reload_scene)
        for file in changed.plugins:
            self.message = f"{file} has changed: its shader files are read again, its Python when the window is opened"
        if changed.shaders:
            self.panes.reload()
            self._release_drawn()
            self.drawing.reload()
            self._drawn_of = ()
            self._changed_at = self._seconds()

    def _reload_scene(self) -> str:
        """Load the scene's file again, for undo too; a camera or a light that was moved stays where it is."""
        old, origin = self.state.scene, self.state.origin
        assert origin is not None
        scene = origin.load()
        self._to(self.history.mapped(lambda state: state.with_scene(scene) if state.scene is old else state))
        self._files = ChangedFiles(origin, self._plugins)  # it may name other meshes
        return f"{origin.source} was loaded again"

    def _release_drawn(self) -> None:
        if self.drawn is not None:
            self.drawn.release()
            self.drawn = None
            self._shown_of = ()
