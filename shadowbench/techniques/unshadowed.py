"""Unshadowed rendering."""

from shadowbench.gl.device import moderngl
from shadowbench.maps.caster_map import ResolvePass
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams


class Unshadowed(Technique):
    """Everything is lit: the floor with which scores and times are compared."""

    name = "unshadowed"
    catalogue = Entry(
        exact=True,
        never_recommended="draws no shadows: enough only where there are none",
    )

    @classmethod
    def lifts(cls, params: TechniqueParams) -> bool:
        return True

    def build(self, stage: Stage) -> None:
        self.resolve = ResolvePass(stage, "unshadowed/resolve.frag")

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("resolve", changes="view"):
            return self.resolve(frame)
