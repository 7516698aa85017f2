"""No shadows at all."""

import moderngl

from shadowbench.techniques.base import Frame, Stage, Technique
from shadowbench.techniques.resolve import ResolvePass


class Unshadowed(Technique):
    """All is lit: the floor that every score and every time is read against."""

    name = "unshadowed"
    exact = True
    never_recommended = "draws no shadow: enough only where there is none"

    def build(self, stage: Stage) -> None:
        self.resolve = ResolvePass(stage, "unshadowed/resolve.frag")

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("resolve", changes="view"):
            return self.resolve(frame)
