"""Min-max reduction of a texture on the device: of its values, or of the visible receivers' positions."""

from collections.abc import Mapping
from typing import Literal

import moderngl
import numpy as np

from shadowbench.geometry.lights import Box, LightSpace
from shadowbench.gl.program import Sampling, Texture
from shadowbench.scenes.model import Floats
from shadowbench.techniques.base import Frame, Stage

_REACH = 8  # texels along a side that one step reduces to one


class MinMaxReduction:
    """Reduces textures of one size in steps of 8×8 texels; built once, called each frame.

    source: input of the first step, `values` (the sampler `values`) or `receivers` (a G-buffer's visible receivers, in
    light space).
    """

    def __init__(self, stage: Stage, size: tuple[int, int], source: Literal["values", "receivers"]) -> None:
        self.first, self._next = (
            stage.program("fullscreen.vert", "fit/bounds.frag", defines={"REACH": _REACH} | more)
            for more in ({f"FROM_{source.upper()}": 1}, {})
        )
        self._draw_first, self._draw_next = (stage.fullscreen(program) for program in (self.first, self._next))
        self._steps: list[tuple[moderngl.Texture, moderngl.Texture, moderngl.Framebuffer]] = []
        while max(size) > 1 or not self._steps:
            size = -(-size[0] // _REACH), -(-size[1] // _REACH)
            low, high = (stage.texture(size, 4) for _ in range(2))
            self._steps.append((low, high, stage.target(low, high)))

    def __call__(self, textures: Mapping[str, tuple[Texture, Sampling]]) -> tuple[Floats, Floats]:
        """(3,) minimum and (3,) maximum. The read-back stalls until the device has finished, as in SDSM on the CPU."""
        low, high, target = self._steps[0]
        self._draw_first.draw(target, textures)
        for *step, target in self._steps[1:]:
            self._draw_next.draw(target, {"lows": (low, Sampling()), "highs": (high, Sampling())})
            low, high = step
        lowest, highest = (np.frombuffer(texture.read(), dtype=np.float32)[:3] for texture in (low, high))
        return lowest.astype(np.float64), highest.astype(np.float64)


class VisibleBounds:
    """Bounding box of the visible receivers in light space, from the G-buffer."""

    def __init__(self, stage: Stage) -> None:
        self._bounds = MinMaxReduction(stage, stage.size, "receivers")

    def __call__(self, frame: Frame, space: LightSpace) -> Box | None:
        """The box; None if no receiver is visible."""
        self._bounds.first.set(
            light=frame.light_uniform,
            world_to_light=space.matrix,
            perspective=float(space.perspective),
            cos_half_angle=frame.light.cos_half_angle,
        )
        low, high = self._bounds(frame.surface.inputs)
        return Box(low, high) if (low <= high).all() else None
