"""Min-max reduction of a texture on the device: of its values, or of the visible receivers' positions."""

import math
from typing import Literal

import numpy as np

from shadowbench.geometry.lights import Box, LightSpace
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Sampling, Textures
from shadowbench.plugin.base import Frame, Stage
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats

_REACHES = 8, 16  # texels along a side that the first step and each further step reduce to one
_ROUNDING = 1e-5  # of the largest coordinate: exceeds float32 rounding of a few operations, and of depths in 24 bits


class MinMaxReduction:
    """Reduces textures of one size in steps of 8×8, then 16×16 texels; built once, called each frame.

    source: input of the first step, `values` (the sampler `values`) or those of `VisibleBounds`.
    """

    def __init__(
        self, stage: Stage, size: tuple[int, int], source: Literal["values", "sample", "receivers"] = "values"
    ) -> None:
        self.first, self._next = (
            stage.program("fullscreen.vert", "fit/bounds.frag", defines={"REACH": reach, **more})
            for reach, more in zip(_REACHES, ({f"FROM_{source.upper()}": 1}, {}), strict=True)
        )
        self._draw_first, self._draw_next = (stage.fullscreen(program) for program in (self.first, self._next))
        self._steps: list[tuple[moderngl.Texture, moderngl.Texture, moderngl.Framebuffer]] = []
        while max(size) > 1 or not self._steps:
            reach = _REACHES[1 if self._steps else 0]
            size = -(-size[0] // reach), -(-size[1] // reach)
            low, high = (stage.texture(size, 4) for _ in range(2))
            self._steps.append((low, high, stage.target(low, high)))

    def reduce(self, textures: Textures) -> Textures:
        """The minimum and maximum as textures of one texel, `lows` and `highs`."""
        low, high, target = self._steps[0]
        self._draw_first.draw(target, textures)
        for *step, target in self._steps[1:]:
            self._draw_next.draw(target, {"lows": (low, Sampling()), "highs": (high, Sampling())})
            low, high = step
        return {"lows": (low, Sampling()), "highs": (high, Sampling())}

    def __call__(self, textures: Textures) -> tuple[Floats, Floats]:
        """(3,) minimum and (3,) maximum. The read-back stalls until the device has finished, as in SDSM on the CPU."""
        self.reduce(textures)
        low, high, _ = self._steps[-1]
        lowest, highest = (np.frombuffer(texture.read(), dtype=np.float32)[:3] for texture in (low, high))
        return lowest.astype(np.float64), highest.astype(np.float64)


class VisibleBounds:
    """Bounding box of the visible receivers in light space, from the G-buffer.

    The depths of all pixels are read, and the positions and normals of one pixel in 64 and of those that may lie
    outside the box of the former.
    """

    def __init__(self, stage: Stage) -> None:
        self._sample = MinMaxReduction(stage, stage.size, "sample")
        self._bounds = MinMaxReduction(stage, stage.size, "receivers")

    def __call__(self, frame: Frame, space: LightSpace) -> Box | None:
        """The box; None if no receiver is visible."""
        for program in (self._sample.first, self._bounds.first):
            program.set(
                light=frame.light_uniform,
                world_to_light=space.matrix,
                perspective=float(space.perspective),
                cos_half_angle=frame.light.cos_half_angle,
            )
        to_light = _pixel_to_light(frame.view, space)
        reach = np.abs(to_light[:3, 2]) + frame.view.size * np.abs(to_light[:3, :2]).sum(axis=1)
        rounding = _ROUNDING * float((reach + np.abs(to_light[:3, 3])).max())
        self._bounds.first.set(pixel_to_light=to_light, rounding=rounding)
        inputs = frame.surface.inputs
        low, high = self._bounds({**inputs, **self._sample.reduce(inputs)})
        return Box(low, high) if (low <= high).all() else None


def _pixel_to_light(view: View, space: LightSpace) -> Floats:
    """(4, 4) from (pixel · depth, depth, 1) to light space, z being the distance along the axis.

    pixel: column and row from the lower left; depth: as a share of the far plane's.
    """
    camera, far = view.camera, view.near_far[1]
    right, up, back = camera.basis()
    slope = math.tan(camera.fov_y / 2) * far
    corner = -back * far + (right + up) * slope * (1 / view.size - 1)  # the centre of the pixel at the lower left
    columns = np.column_stack([*(axis * slope * 2 / view.size for axis in (right, up)), corner, camera.position])
    result: Floats = np.diag([1.0, 1.0, -1.0, 1.0]) @ space.matrix @ np.vstack([columns, [0.0, 0.0, 0.0, 1.0]])
    return result
