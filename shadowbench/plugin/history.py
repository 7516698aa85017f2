"""Visibility of earlier frames, blended into what any technique draws."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from shadowbench.gl.device import moderngl
from shadowbench.gl.gbuffer import view_projection
from shadowbench.gl.program import Sampling
from shadowbench.plugin.params import Component, param
from shadowbench.scenes.model import View

if TYPE_CHECKING:
    from shadowbench.plugin.base import Frame, Technique
    from shadowbench.plugin.stage import Stage


class History(Component):
    """Base class of histories. A shader defines `float share_of_frame(ivec2 pixel)`; the frames before have the rest.

    A point's history is where the camera before saw that place: the bilinear mean of those of the four nearest pixels
    whose surface lies within a pixel of the point's plane. Without one, and in the first frame of a sequence, the frame
    has all. of_texels: whether the shader reads `map_confidence`, see `Technique.confidence`.
    """

    of_texels: ClassVar[bool] = False

    @property
    def reads(self) -> int:
        """Texels that it reads per pixel, besides this frame's."""
        return 4 * self.remembers + self.of_texels


class NoHistory(History):
    """Each frame alone."""

    name = "none"
    unwritten = True


class Blend(History):
    """Base class of those that blend, under jittered phases."""

    remembers = True
    jitter: int = param(64, "phases of the texel grid, a frame each, in turn; with 1 it rests", ge=1, le=1024)


class Exponential(Blend):
    """The exponential mean over frames, x = α · frame + (1 − α) · history, which lags by (1 − α)/α frames.

    Over the jittered phases of a texel grid it is smooth where a frame has stairs. Moved receivers have the history of
    the place, not of the surface.
    """

    name = "exponential"
    shader = "history/exponential.glsl"
    alpha: float = param(0.1, "α, the share of this frame", gt=0, le=1)


class Confidence(Blend):
    """A share by the confidence in the shadow test, conf^power (Scherzer, Jeschke and Wimmer 2007).

    conf = 1 − 2 · max(|x − x_c|, |y − y_c|) of a point (x, y) in the map, in texels, and the centre (x_c, y_c) of its
    texel, where the test is right. Over the jittered phases every point comes near one: edges get as sharp as pixels.
    """

    name = "confidence"
    shader = "history/confidence.glsl"
    of_texels = True
    power: float = param(4.0, "exponent of the confidence", ge=0, le=64)


@dataclass(eq=False)
class _Past:
    """The frame before. images: two by turns, its own first; RGBA, position and visibility, −1 where there is none."""

    images: tuple[moderngl.Texture, moderngl.Texture]
    view: View | None = None


class HistoryPass:
    """Draws a technique under a jittered phase, and blends with the frames before. draw: of the technique."""

    def __init__(self, stage: "Stage", technique: "Technique", draw: "Callable[[Frame], moderngl.Texture]") -> None:
        self._technique, self._draw = technique, draw
        self._past = stage.remembered(
            "history", lambda: _Past((stage.texture(components=4), stage.texture(components=4)))
        )
        self._program = stage.program("fullscreen.vert", "history.frag", params=technique.params)
        self._texture = stage.texture()
        self._targets = {image: stage.target(self._texture, image) for image in self._past.images}
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: "Frame") -> moderngl.Texture:
        """Visibility of this frame and of those before."""
        past, history = self._past, self._technique.params.history
        assert isinstance(history, Blend)
        phase = replace(frame.phase, index=frame.phase.index + frame.index % history.jitter)
        drawn = self._draw(replace(frame, phase=phase))
        before = past.view if past.view and frame.index else frame.view
        last, other = past.images
        textures = {**frame.surface.inputs, "drawn": (drawn, Sampling()), "past": (last, Sampling())}
        if history.of_texels:
            textures["map_confidence"] = self._technique.confidence(), Sampling()
        with frame.timed("history"):
            self._program.set(light=frame.light_uniform, past_clip=view_projection(before), past_pixel=before.pixel)
            self._program.set(first=float(frame.index == 0))
            self._triangle.draw(self._targets[other], textures)
        past.images, past.view = (other, last), frame.view
        return self._texture
