"""The full-screen resolve pass: visibility of the G-buffer's receivers, the last pass of most techniques."""

import math
from collections.abc import Mapping
from pathlib import Path

from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Sampling, Texture, Value
from shadowbench.plugin.base import Frame, Stage
from shadowbench.plugin.params import TechniqueParams
from shadowbench.scenes.vectors import vec3


class ResolvePass:
    """Runs a fragment shader that includes `receiver.glsl` for every pixel; built once, called each frame.

    `texture` is its render target; with one component, the visibility.
    """

    def __init__(
        self,
        stage: Stage,
        fragment: Path | str,
        params: TechniqueParams | None = None,
        defines: Mapping[str, int | str] = {},
        includes: Mapping[str, str] = {},
        components: int = 1,
    ) -> None:
        self.program = stage.program("fullscreen.vert", fragment, params=params, defines=defines, includes=includes)
        self.texture = stage.texture(components=components)
        self._target = stage.target(self.texture)
        self._triangle = stage.fullscreen(self.program)

    def __call__(
        self, frame: Frame, textures: Mapping[str, tuple[Texture, Sampling]] = {}, **uniforms: Value
    ) -> moderngl.Texture:
        """Draw with these textures besides the G-buffer's, and these uniforms besides `light`; returns `texture`."""
        if self.program.has("pixel_right"):
            right, up, back = frame.camera.basis()
            width = 2 * math.tan(frame.camera.fov_y / 2) / frame.view.size
            self.program.set(pixel_right=vec3(right * width), pixel_up=vec3(up * width), forward=vec3(-back))
        if self.program.has("eye"):
            self.program.set(eye=frame.camera.position)
        if self.program.has("view_far"):
            self.program.set(view_far=frame.view.near_far[1])
        self.program.set(light=frame.light_uniform, **uniforms)
        self._triangle.draw(self._target, {**frame.surface.inputs, **textures})
        return self.texture
