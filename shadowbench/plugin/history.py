"""Visibility of earlier frames, blended into what any technique draws."""

from collections.abc import Callable
from dataclasses import replace
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

    A point's history is where the camera before saw it, on its triangle as that was: the bilinear mean of those of the
    four nearest pixels whose surface lies within a pixel of the point's plane. Without one, and in the first frame of a
    sequence, the frame has all. of_texels: whether the shader reads `map_confidence`, see `Technique.confidence`.
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

    Over the jittered phases of a texel grid it is smooth where a frame has stairs.
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


class HistoryPass:
    """Draws a technique under a jittered phase, and blends with the frames before. draw: of the technique."""

    def __init__(self, stage: "Stage", technique: "Technique", draw: "Callable[[Frame], moderngl.Texture]") -> None:
        self._stage, self._technique, self._draw = stage, technique, draw
        # By turns of the frame before and of this one: RGBA, position and visibility, −1 where there is none.
        self._images = stage.remembered("images", lambda: [stage.texture(components=4) for _ in range(2)])
        self._views: list[View] = stage.remembered("views", list)  # of the frame before
        self._program = stage.program("fullscreen.vert", "history.frag", params=technique.params)
        self._texture = stage.texture()
        self._targets = {image: stage.target(self._texture, image) for image in self._images}
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: "Frame") -> moderngl.Texture:
        """Visibility of this frame and of those before."""
        history, images = self._technique.params.history, self._images
        assert isinstance(history, Blend)
        phase = replace(frame.phase, index=frame.phase.index + frame.index % history.jitter)
        drawn = self._draw(replace(frame, phase=phase))
        past = self._views[-1] if self._views and frame.index else frame.view
        textures = {**frame.surface.inputs, "drawn": (drawn, Sampling()), "past": (images[0], Sampling())}
        textures["before"] = textures["surface_position"]
        if past.scene is not frame.view.scene:
            before = self._stage.texture(components=3)
            before.write(frame.surface.before(frame.view.scene.geometry, past.scene.geometry).tobytes())
            textures["before"] = before, Sampling()
        if history.of_texels:
            textures["map_confidence"] = self._technique.confidence(), Sampling()
        with frame.timed("history"):
            self._program.set(light=frame.light_uniform, past_clip=view_projection(past), past_pixel=past.pixel)
            self._program.set(first=float(frame.index == 0))
            self._triangle.draw(self._targets[images[1]], textures)
        images.reverse()
        self._views[:] = [frame.view]
        return self._texture
