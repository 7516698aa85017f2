"""No shadows at all."""

import moderngl

from shadowbench.techniques.base import Frame, Stage, Technique


class Unshadowed(Technique):
    """All is lit: the floor that every score and every time is read against."""

    name = "unshadowed"

    def build(self, stage: Stage) -> None:
        self.program = stage.program("fullscreen.vert", "unshadowed/resolve.frag")
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("resolve", changes="view"):
            self.program.set(light=frame.light_uniform)
            self.fullscreen.draw(self.target, frame.surface.inputs)
        return self.visibility
