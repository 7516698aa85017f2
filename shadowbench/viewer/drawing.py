"""Drawing of a state with the passes, techniques and shaders of `run`: the G-buffer, and the masks of the specs."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import message
from shadowbench.gl.clock import Clock, PassTimes, with_cost, work_of
from shadowbench.gl.device import Device
from shadowbench.measure.session import LoadedScene, checked_texture, declared_work, finite_facts, visibility_of
from shadowbench.plugin.base import Frame, Phase, Stage, Technique, surface_of
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import View
from shadowbench.viewer.state import Colors, ViewerState, recolored

SHRINKS = (1, 2, 4)
SMOOTH_MS = 50.0
"""Time of a frame that is not too long for motion, in milliseconds."""
LEAST_SIZE = 64
LONGEST_FAILURE = 2000
RAISED = (Exception, SystemExit)
"""What a technique may raise while the window lives."""


def moving_size(size: int, rested_ms: float, software: bool) -> int:
    """Size of the image while something moves: on a software renderer a half or a quarter, if the whole takes long."""
    if not software:
        return size
    shrink = next((one for one in SHRINKS if rested_ms / one**2 <= SMOOTH_MS), SHRINKS[-1])
    return max(size // shrink, min(size, LEAST_SIZE))


def told(error: BaseException) -> str:
    """An exception as text of several lines, such as a shader's errors."""
    return f"{type(error).__name__}: {message(error)}"[:LONGEST_FAILURE]


@dataclass(frozen=True, eq=False)
class Mask:
    """What a spec drew: a texture of visibility, and the times of its passes; or why it drew nothing."""

    spec: Spec
    technique: Technique | None = None
    visibility: moderngl.Texture | None = None
    passes: PassTimes = field(default_factory=PassTimes)
    failure: str = ""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A state drawn at one size: its frame, with view and G-buffer in local coordinates, and the specs' masks.

    lit: visibility 1 everywhere; ms: the time of all of it, without building.
    """

    loaded: LoadedScene
    frame: Frame
    masks: tuple[Mask, ...]
    lit: moderngl.Texture
    ms: float

    @property
    def size(self) -> int:
        """Pixels along a side."""
        return self.frame.view.size

    def release(self) -> None:
        """Free the G-buffer; the masks belong to their techniques."""
        self.frame.surface.release()
        self.lit.release()


class Drawing:
    """Draws states on one device. Techniques stay built while shown, at the sizes of a rested and a moving image.

    tell: called with the text of a spec before its technique is.
    """

    def __init__(self, device: Device) -> None:
        self.device, self.clock = device, Clock(device)
        self.tell: Callable[[str], object] = lambda spec: None
        self._loaded: LoadedScene | None = None
        self._colors: Colors = ()
        self._built: dict[tuple[Spec, int], tuple[Technique, Stage]] = {}

    def draw(self, state: ViewerState, size: int) -> Drawn:
        """Draw a state's G-buffer and masks, of size × size pixels. Raises InputError if the camera shows nothing."""
        file_view, loaded = state.view(size), self._load(state)
        view = loaded.to_drawing_coordinates(file_view)
        built = [self._build(loaded, spec, view) for spec in state.specs]
        start = time.perf_counter()
        self._recover()
        surface = loaded.surface_pass.draw(view)
        try:
            # Index 0 always: each image is the one that is scored, without history of earlier frames.
            frame = Frame(view, Phase(state.phase), 0, surface, self.clock)
            masks = tuple(self._mask(loaded, spec, one, frame) for spec, one in zip(state.specs, built, strict=True))
            white = np.ones((size, size), dtype=np.float32)
            lit = self.device.context.texture((size, size), 1, white.tobytes(), dtype="f4")
        except BaseException:
            surface.release()
            raise
        self.device.context.finish()
        return Drawn(loaded, frame, masks, lit, (time.perf_counter() - start) * 1e3)

    def keep_only(self, specs: tuple[Spec, ...], sizes: tuple[int, ...]) -> None:
        """Free the techniques that are built for other specs or sizes."""
        for key in [(spec, size) for spec, size in self._built if spec not in specs or size not in sizes]:
            self._built.pop(key)[1].release()

    def reload(self) -> None:
        """Free everything, so that changed shaders are read again."""
        self.keep_only((), ())
        if self._loaded is not None:
            self._loaded.release()
            self._loaded = None

    @property
    def bytes(self) -> int:
        """Device memory of the techniques' textures and buffers."""
        return sum(stage.bytes for _, stage in self._built.values())

    def visibility(self, drawn: Drawn, mask: Mask) -> NDArray[np.float32]:
        """A mask read back as `render` reads it: quantised, row 0 at the top. Raises ValueError for NaN or infinity."""
        return visibility_of(mask.spec.text, mask.visibility, drawn.size)

    def work(self, drawn: Drawn, mask: Mask) -> dict[str, int]:
        """Counts of work of a mask that was drawn, which is drawn once more for that."""
        technique = mask.technique
        assert technique is not None
        self.tell(mask.spec.text)
        facts = finite_facts(mask.spec.text, technique.facts())
        self.device.reset()
        frame = replace(drawn.frame, surface=surface_of(technique, drawn.frame.surface))
        work = work_of(self.device, lambda: technique.draw(frame))
        return with_cost(work | declared_work(technique, drawn.size**2, facts))

    def paint(self, state: ViewerState) -> None:
        """Give the triangles of the drawn scene a state's colours of materials."""
        if self._loaded is not None and self._colors != state.colors:
            self._loaded.geometry.recolor(recolored(state.scene, dict(state.colors)))
            self._colors = state.colors

    def _load(self, state: ViewerState) -> LoadedScene:
        if self._loaded is None or not self._loaded.matches(state.scene, state.coordinates):
            self.reload()
            self._loaded, self._colors = LoadedScene(self.device, state.scene, state.coordinates), ()
        return self._loaded

    def _build(self, loaded: LoadedScene, spec: Spec, view: View) -> Technique | str:
        """A built technique; or why there is none. It may raise anything, which is shown in place of its picture."""
        key = (spec, view.size)
        self.tell(spec.text)
        try:
            reason = spec.drawn_here.declines(spec.params, view, self.device)
            if reason is None and key not in self._built:
                self._recover()
                self._built[key] = loaded.build(spec, view.size)
        except RAISED as error:
            return told(error)
        return self._built[key][0] if reason is None else f"unsupported: {reason}"

    def _mask(self, loaded: LoadedScene, spec: Spec, technique: Technique | str, frame: Frame) -> Mask:
        if isinstance(technique, str):
            return Mask(spec, failure=technique)
        self._recover()
        self.tell(spec.text)
        try:
            visibility: list[moderngl.Texture] = []
            on_cpu = technique.draws_on_cpu(spec.params)
            own = replace(frame, surface=surface_of(technique, frame.surface))
            passes = self.clock.passes(lambda: visibility.append(technique.draw(own)), on_cpu)
            self.device.reset()
            self.device.check(f"drawing {spec.text}")
            loaded.darken_facets(spec.text, technique, visibility[0], frame.surface, frame.view)
            return Mask(spec, technique, checked_texture(spec.text, visibility[0], frame.view.size), passes)
        except RAISED as error:
            return Mask(spec, failure=told(error))

    def _recover(self) -> None:
        """Default state, and no recorded error for which the next technique would be blamed."""
        self.device.reset()
        with suppress(RuntimeError):
            self.device.check("what was drawn before")
