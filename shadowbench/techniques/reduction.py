"""The box of the visible receivers in a light's space, reduced on the device."""

import moderngl
import numpy as np

from shadowbench.gl.program import Sampling
from shadowbench.techniques.base import Frame, Stage
from shadowbench.techniques.lights import Box, LightSpace

_REACH = 8  # texels along a side that one step makes one of


class VisibleBounds:
    """Reduces a G-buffer in steps of 8×8 texels; built once, called each frame."""

    def __init__(self, stage: Stage) -> None:
        defines = {"REACH": _REACH}
        programs = [
            stage.program("fullscreen.vert", "fit/bounds.frag", defines=defines | first) for first in ({"FIRST": 1}, {})
        ]
        self._first, self._next = programs
        self._draw_first, self._draw_next = (stage.fullscreen(program) for program in programs)
        self._steps: list[tuple[moderngl.Texture, moderngl.Texture, moderngl.Framebuffer]] = []
        side = max(stage.size)
        while side > 1 or not self._steps:
            side = -(-side // _REACH)
            low, high = (stage.texture((side, side), 4) for _ in range(2))
            self._steps.append((low, high, stage.target(low, high)))

    def __call__(self, frame: Frame, space: LightSpace) -> Box | None:
        """The box, None when no receiver is seen. Reading it back waits for the device, as any SDSM on the CPU does."""
        self._first.set(
            light=frame.light_uniform,
            world_to_light=space.matrix,
            perspective=float(space.perspective),
            cos_half_angle=frame.light.cos_half_angle,
        )
        low, high, target = self._steps[0]
        self._draw_first.draw(target, frame.surface.inputs)
        for *textures, target in self._steps[1:]:
            self._draw_next.draw(target, {"lows": (low, Sampling()), "highs": (high, Sampling())})
            low, high = textures
        corners = [np.frombuffer(texture.read(), dtype=np.float32)[:3].astype(np.float64) for texture in (low, high)]
        return Box(*corners) if (corners[0] <= corners[1]).all() else None
