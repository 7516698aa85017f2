"""What the window shows of a state: masks by the passes, techniques and shaders of `run`, their pictures and scores."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import ShadowbenchError, message
from shadowbench.gl.clock import Clock
from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import download
from shadowbench.measure.session import Draw, LoadedScene, checked_texture, visibility_of
from shadowbench.options import ViewSize
from shadowbench.plugin.base import Frame, Phase, Stage, Technique, surface_of
from shadowbench.plugin.spec import Spec
from shadowbench.plugin.stage import Memory
from shadowbench.scenes.model import IDENTITY_PLACEMENT, View
from shadowbench.scores.difference import difference_over, weight, with_facets
from shadowbench.studies.crossing import Techniques
from shadowbench.viewer.judge import Judge, Traced
from shadowbench.viewer.state import Origin, Source, ViewerState

REST_S = 0.15
"""Time without a change after which a motion has ended, in seconds."""
SHRINKS = (1, 2, 4)
SMOOTH_MS = 50.0
"""Time of a frame that is not too long for motion, in milliseconds."""
LEAST_SIZE = 64
Number = TypeVar("Number", np.float32, np.bool_)
_Built = tuple[Technique, Stage, Draw]
_RAISED = (Exception, SystemExit)  # what a technique may raise while the window lives


def moving_size(size: ViewSize, rested_ms: float, software: bool) -> ViewSize:
    """Size of the image while something moves: on a software renderer a half or a quarter, if the whole takes long."""
    if not software:
        return size
    shrink = next((shrink for shrink in SHRINKS if rested_ms / shrink**2 <= SMOOTH_MS), SHRINKS[-1])
    return size.times(max(1 / shrink, min(1.0, LEAST_SIZE / min(size))))


def reason_of(error: BaseException) -> str:
    """Why something failed, perhaps in several lines, such as a shader's errors."""
    if isinstance(error, ShadowbenchError | OSError):
        return str(error)
    return f"{type(error).__name__}: {message(error)}"


@dataclass(frozen=True, eq=False)
class Mask:
    """What a spec drew: a texture of visibility; or why it drew nothing."""

    spec: Spec
    visibility: moderngl.Texture | None = None
    failure: str = ""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A state drawn at one size: its frame, with view and G-buffer in local coordinates, and the specs' masks.

    ms: the time of all of it, without building.
    """

    loaded: LoadedScene
    frame: Frame
    masks: tuple[Mask, ...]
    ms: float

    @property
    def size(self) -> ViewSize:
        """Of its images."""
        return self.frame.view.size

    def visibility(self, mask: Mask) -> NDArray[np.float32]:
        """A mask read back as `render` reads it: quantised, row 0 at the top. Raises ValueError for NaN or infinity."""
        return visibility_of(mask.spec.text, mask.visibility, self.size)


class Drawing:
    """Draws states on one device. Techniques stay built while shown, at the sizes of a rested and a moving image."""

    def __init__(self, device: Device) -> None:
        self.device, self.clock = device, Clock(device)
        self._loaded: LoadedScene | None = None
        self._built: dict[tuple[Spec, ViewSize], _Built] = {}
        self._memories: dict[tuple[Spec, ViewSize], Memory] = {}
        self._last: tuple[object, int] = ((), 0)  # what the last frame was of, and its index

    def draw(self, state: ViewerState, size: ViewSize) -> Drawn:
        """Draw a state's G-buffer and masks, at a size. Raises InputError if the camera shows nothing.

        What remembers earlier frames of a sequence is drawn in all of them, in order.
        """
        remembers = any(component.remembers for spec in state.specs for component in spec.components)
        drawn_of = state.start, *_how(state), size
        goes_on = not remembers or self._last == (drawn_of, state.frame - 1)
        for index in range(state.frame if goes_on else 0, state.frame):
            self._draw(replace(state, frame=index), size, remembers).frame.surface.release()
        drawn = self._draw(state, size, remembers)
        self._last = drawn_of, state.frame
        return drawn

    def _draw(self, state: ViewerState, size: ViewSize, remembers: bool) -> Drawn:
        file_view = state.view(size)
        loaded = self._load(file_view, state, goes_on=remembers and state.frame > 0)
        view = loaded.to_drawing_coordinates(file_view)
        built = [self._build(loaded, spec, view) for spec in state.specs]
        start = time.perf_counter()
        self._recover()
        surface = loaded.surface_pass.draw(view)
        frame = Frame(view, Phase(state.phase), state.frame, surface, self.clock)
        masks = [self._mask(loaded, *drawn, frame) for drawn in zip(state.specs, built, strict=True)]
        self.device.context.finish()
        return Drawn(loaded, frame, tuple(masks), (time.perf_counter() - start) * 1e3)

    def picture(self, drawn: Drawn, state: ViewerState, source: Source, traced: Traced | None) -> moderngl.Texture:
        """A texture that the caller frees: the picture of the truth, which must be traced, or of a mask, lit if none.

        state: says what is laid over it; traced: the truth of the drawn view, None if it is not traced yet.
        """
        size, context = drawn.size, self.device.context
        mask = None if source == "truth" else drawn.masks["AB".index(source)]
        owned: list[moderngl.Texture] = []
        if mask is not None and mask.visibility is not None:
            visibility = mask.visibility
        else:
            level = np.ones(size.shape) if mask or traced is None else _resized(traced.visibility, size)
            visibility = context.texture(size, 1, level[::-1].astype("f4").tobytes(), dtype="f4")
            owned.append(visibility)
        self.device.reset()
        picture = drawn.loaded.picture_pass.shade(drawn.frame.surface, drawn.frame.view, visibility)
        shown = np.clip(np.nan_to_num(download(visibility)[..., 0]), 0, 1)
        over = None
        if state.overlay == "mask":
            over = np.repeat(np.rint(shown * 255).astype(np.uint8)[..., np.newaxis], 3, axis=2)
        elif state.overlay == "error" and traced is not None:
            over = _error_over(download(picture, "u1")[..., :3].mean(axis=2), shown, traced)
        if over is not None:
            owned.append(picture)
            picture = context.texture(size, 3, over[::-1].tobytes(), alignment=1)
        self.device.free(owned)
        return picture

    def keep_only(self, specs: tuple[Spec, ...], sizes: tuple[ViewSize, ...]) -> None:
        """Free the techniques that are built for other specs or sizes."""
        for key in [(spec, size) for spec, size in self._built if spec not in specs or size not in sizes]:
            self._built.pop(key)[1].release()

    def release(self) -> None:
        """Free everything."""
        self.keep_only((), ())
        if self._loaded is not None:
            self._loaded.release()
            self._loaded = None

    def _load(self, view: View, state: ViewerState, goes_on: bool) -> LoadedScene:
        """A view's scene; goes_on: in the coordinates of the scene before, and with what was remembered there."""
        placement = view.scene.placement if state.coordinates == "relative" else IDENTITY_PLACEMENT
        placement = self._loaded.placement if goes_on and self._loaded else placement
        if self._loaded is None or not self._loaded.matches(view.scene, placement):
            last, self._built = (self._built, {}) if goes_on else ({}, self._built)
            for _, stage, _ in last.values():
                stage.release(but_memory=True)
            self.release()
            self._memories = {key: stage.memory for key, (_, stage, _) in last.items()}
            self._loaded = LoadedScene(self.device, view.scene, placement)
        return self._loaded

    def _build(self, loaded: LoadedScene, spec: Spec, view: View) -> _Built | str:
        """A built technique; or why there is none. It may raise anything, which is shown in place of its picture."""
        key = (spec, view.size)
        try:
            reason = spec.drawn_here.declines(spec.params, view, self.device)
            if reason is None and key not in self._built:
                self._recover()
                self._built[key] = loaded.build(spec, view.size, memory=self._memories.pop(key, None))
        except _RAISED as error:
            return reason_of(error)
        return self._built[key] if reason is None else f"unsupported: {reason}"

    def _mask(self, loaded: LoadedScene, spec: Spec, built: _Built | str, frame: Frame) -> Mask:
        if isinstance(built, str):
            return Mask(spec, failure=built)
        technique, _, draw = built
        self._recover()
        try:
            visibility = draw(replace(frame, surface=surface_of(technique, frame.surface)))
            self.device.reset()
            self.device.check(f"drawing {spec.text}")
            loaded.darken_facets(spec.text, technique, visibility, frame.surface, frame.view)
            return Mask(spec, checked_texture(spec.text, visibility, frame.view.size))
        except _RAISED as error:
            return Mask(spec, failure=reason_of(error))

    def _recover(self) -> None:
        """Default state, and no recorded error for which the next technique would be blamed."""
        self.device.reset()
        with suppress(RuntimeError):
            self.device.check("what was drawn before")


def _resized(values: NDArray[Number], size: ViewSize) -> NDArray[Number]:
    """(height, width) values, each the nearest of a larger image."""
    return values[np.ix_(*(np.arange(new) * old // new for new, old in zip(size.shape, values.shape, strict=True)))]


def _error_over(grey: NDArray[np.floating], visibility: NDArray[np.floating], traced: Traced) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: false shadow, false light and dark facets in their colours, over a grey picture."""
    size = ViewSize(*grey.shape[::-1])
    error = np.where(_resized(traced.scored, size), visibility - _resized(traced.visibility, size), 0)
    over = difference_over(grey, weight(error, traced.soft))
    return with_facets(over, _resized(traced.facets, size), visibility)


class Viewer:
    """The window's state and everything that is drawn of it. `change` is the only way to another state.

    message: the last error or result of an action; broken: why nothing can be drawn; playing: whether the next frame
    of the sequence follows as soon as one is scored; pictures: of A, B and the truth.
    """

    def __init__(
        self,
        device: Device,
        state: ViewerState,
        techniques: Techniques,
        judge: Judge,
        seconds: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device, self.state, self.techniques, self.judge = device, state, techniques, judge
        self.drawing = Drawing(device)
        self.message = self.broken = ""
        self.playing = False
        self.drawn: Drawn | None = None
        self.pictures: dict[Source, moderngl.Texture] = {}
        self._seconds, self._changed_at = seconds, -math.inf
        self._rested_ms = 0.0
        # Of what the masks, the pictures and the last question are.
        self._drawn_of: tuple[object, ...] = ()
        self._shown_of: tuple[object, ...] = ()
        self._judged: Drawn | None = None

    @property
    def judged(self) -> bool:
        """Whether the truth and the scores that were asked for are of the masks that are shown."""
        return not self.broken and self.drawn is not None and self.drawn is self._judged

    @property
    def fresh(self) -> bool:
        """Whether the scores are of the masks that are shown."""
        return self.judged and self.judge.is_answered

    @property
    def moving(self) -> bool:
        """Whether something has changed a moment ago."""
        return self._seconds() - self._changed_at < REST_S

    @property
    def waiting(self) -> bool:
        """Whether a step would change nothing: no motion, no masks to score, no answer about them."""
        return not (self.moving or self._unjudged or self.judge.has_answers or (self.playing and self.fresh))

    @property
    def _unjudged(self) -> bool:
        return self.drawn is not None and not self.broken and self.drawn is not self._judged

    @property
    def outruns_truth(self) -> bool:
        """Whether pictures are of a view whose truth is not traced yet; while a sequence plays they wait for it."""
        waits = self.playing and self.pictures and not self.moving
        return self.judge.traced(self.state) is None and not waits

    @property
    def failures(self) -> list[str]:
        """Why A and B drew nothing; empty for one that did."""
        return [mask.failure for mask in self.drawn.masks] if self.drawn else []

    def change(self, state: ViewerState) -> None:
        """Show another state."""
        if state != self.state:
            self.message = ""
        if (state.start, _how(state)) != (self.state.start, _how(self.state)):  # another frame is no motion
            self._changed_at = self._seconds()
        self.state = state

    def attempt(self, action: Callable[[], str | None]) -> None:
        """Do something that may fail for the user's input or a file's contents; its message stands in the window."""
        try:
            self.message = action() or ""
        except Exception as error:  # a scene too large for the memory, whatever a file's reader raises
            self.message = reason_of(error)

    def open_scene(self, origin: Origin, specs: tuple[Spec, ...] = ()) -> None:
        """Show another scene from its first camera, under its first light, with specs in place of A and B."""
        scene, specs = origin.load(), specs or self.state.specs
        camera, light, self.playing = scene.cameras[0], scene.lights[0], False
        shown = replace(self.state, scene=scene, camera=camera, light=light, origin=origin, specs=specs)
        self.change(replace(shown, coordinates="relative", phase=0, sequence="", frame=0))

    def step(self) -> None:
        """Bring everything up to date that a frame of the window shows."""
        if self.playing and self.fresh:  # and shown, by the step before
            self.to_frame(self.state.frame + 1)
        self.judge.receive()
        moving, size = self.moving, self.state.size
        drew = self._draw(moving_size(size, self._rested_ms, self.device.software) if moving else size)
        if self.drawn is not None and self._unjudged and not (moving or drew):
            self._ask(self.drawn)
        self._draw_pictures()

    def show_sequence(self, name: str) -> None:
        """Show the first frame of a sequence, or for an empty name the view alone. Raises InputError."""
        self.playing, state = False, replace(self.state, sequence=name, frame=0)
        if state.frames:
            self.change(state)

    def to_frame(self, frame: int) -> None:
        """Show another frame of the sequence; after the last one comes the first."""
        self.change(replace(self.state, frame=frame % len(self.state.frames)))

    def release(self) -> None:
        """Free what is on the device."""
        self._release_drawn()
        self.drawing.release()
        self.device.free(self.pictures.values())

    def _draw(self, size: ViewSize) -> bool:
        """Draw the masks unless they are of this state and size; whether they were drawn."""
        key = (*self.state.viewed, *_how(self.state), size)
        if key == self._drawn_of:
            return False
        self._drawn_of = key
        try:
            drawn = self.drawing.draw(self.state, size)
        except Exception as error:  # a camera inside the ground, a scene too large for the device
            self.broken = reason_of(error)
            return False
        self._release_drawn()
        self.drawn, self.broken = drawn, ""
        self.drawing.keep_only(self.state.specs, (size, self.state.size))
        return True

    def _ask(self, drawn: Drawn) -> None:
        """Ask for the truth and the scores of what is shown."""
        self._judged, masks = drawn, {}
        for mask in drawn.masks:
            if mask.visibility is not None:
                try:
                    masks[mask.spec.full_text] = drawn.visibility(mask)
                except ValueError as error:  # NaN in a mask
                    self.message = reason_of(error)
        self.judge.ask(self.state, masks)

    def _draw_pictures(self) -> None:
        """Draw the pictures unless they are of these masks and this way to show them."""
        state, drawn = self.state, self.drawn
        if drawn is None or self.broken:
            return
        traced = self.judge.traced(state)
        if traced is None and not self.outruns_truth:
            return
        key = (drawn, traced, state.overlay, state.sources)
        if key == self._shown_of:
            return
        self._shown_of, start = key, self._seconds()
        for source in state.sources:
            if source == "truth" and traced is None:
                continue  # an earlier truth is shown as such
            self.device.free([self.pictures.pop(source)] if source in self.pictures else [])
            if source != "B" or len(drawn.masks) > 1:
                self.pictures[source] = self.drawing.picture(drawn, state, source, traced)
        self.device.context.finish()
        if drawn.size == state.size:
            self._rested_ms = drawn.ms + (self._seconds() - start) * 1e3

    def _release_drawn(self) -> None:
        if self.drawn is not None:
            self.drawn.frame.surface.release()
            self.drawn = None


def _how(state: ViewerState) -> tuple[object, ...]:
    return (state.specs, state.coordinates, state.phase)
