"""Soft shadow volumes: penumbra wedges of silhouette edges, counted for points of the light."""

import math
from dataclasses import replace

import numpy as np

from shadowbench.geometry.convex import SceneHull
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import view_projection
from shadowbench.gl.program import Sampling, State
from shadowbench.maps.caster_map import ResolvePass
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import Light, View
from shadowbench.techniques.light_samples import LightSamples, hard_light, light_points
from shadowbench.techniques.shadow_volume import ShadowVolume, cut_out_casters

POINTS = 16  # of the light in a pass: a target of four floats holds as many counters


class SoftVolume(Technique):
    """Shadow volumes of a light with a size: each point of the light has a counter, changed in penumbrae only.

    A shadow volume counts the caster layers before the light's centre. Then each edge that some point of the light sees
    as a silhouette draws its penumbra wedge (Assarsson and Akenine-Möller 2003), and each receiver in it finds the
    points that the edge parts from the centre, and changes their counts (depth complexity sampling, Laine et al. 2005).
    As exact as `light-samples` with as many points, with the same bands. Wrong where the number of layers changes by 32
    or more within a penumbra, and for casters inside the light. The time grows with the silhouette edges times the area
    of their penumbrae: below that of `light-samples` unless the light is as wide as the casters.
    """

    name = "soft-volume"
    catalogue = Entry(
        picture_scene="post",
        soft_only=True,
        builds_on=(ShadowVolume, LightSamples),
    )

    class Params(TechniqueParams):
        n: int = param(32, "points of the light", ge=1, le=4096)

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        return cut_out_casters(view)

    @classmethod
    def draws_on_cpu(cls, params: Params) -> bool:
        return True  # the shadow volume of the light's centre

    @classmethod
    def extra_work(cls, params: Params) -> str | None:
        return f"tests {POINTS} points of the light per fragment, which the count of work takes for one"

    def build(self, stage: Stage) -> None:
        self.center = ShadowVolume(ShadowVolume.Params(counter="color"))
        self.center.build(stage)
        self.reach = 4 * SceneHull(stage.scene).extent
        defines = {"POINTS": POINTS}
        shaders = "soft-volume/corner.vert", "soft-volume/count.frag", "soft-volume/wedge.geom"
        self.wedges = stage.program(*shaders, defines=defines)
        closed_and_open = np.split(self.center.casters.edges, [self.center.casters.closed_edges])
        self.edges = [stage.indexed(self.wedges, edges, moderngl.LINES_ADJACENCY) for edges in closed_and_open]
        self.counts, self.sums = stage.texture(components=4), stage.texture(components=2)
        self.counting, self.summing = stage.target(self.counts), stage.target(self.sums)
        self.add = stage.program("fullscreen.vert", "soft-volume/add.frag", defines=defines)
        self.fullscreen = stage.fullscreen(self.add)
        self.resolve = ResolvePass(stage, "light-samples/resolve.frag")

    def draw(self, frame: Frame) -> moderngl.Texture:
        light = frame.light
        hard = hard_light(light, light.position)
        visibility = self.center.draw(replace(frame, view=replace(frame.view, light=hard)))
        if not light.soft:
            return visibility
        self.summing.clear()
        radius, (position, w) = _radius(light), light.homogeneous
        # As the shadow volume of the centre counts.
        both_facings = bool(w) and self.center.casters.may_contain(position)
        chosen = list(light_points(light, self.params.n))
        for start in range(0, len(chosen), POINTS):
            batch = chosen[start : start + POINTS]
            points, normals = np.zeros((POINTS, 3)), np.zeros((POINTS, 3))
            points[: len(batch)] = [point.homogeneous[0] for point, _ in batch]
            normals[: len(batch)] = [normal for _, normal in batch]
            with frame.timed("wedges", changes="view"):
                self.counting.clear()
                self.wedges.set(
                    world_to_clip=view_projection(frame.view),
                    light=frame.light_uniform,
                    radius=radius,
                    reach=self.reach,
                    points=points,
                )
                # Back faces: a camera's ray leaves a convex wedge once, from inside it too.
                state = State(cull="front", depth_clamp=True, blend="add")
                for edges, is_open in zip(self.edges, (False, True), strict=True):
                    self.wedges.set(count_both_facings=both_facings or is_open)
                    edges.draw(self.counting, frame.surface.inputs, state)
            with frame.timed("add", changes="view"):
                self.add.set(light=frame.light_uniform, points=points, normals=normals, used=len(batch))
                inputs = {"center_counts": (self.center.counts, Sampling()), "counts": (self.counts, Sampling())}
                self.fullscreen.draw(self.summing, frame.surface.inputs | inputs, State(blend="add"))
        with frame.timed("average", changes="view"):
            return self.resolve(frame, {"sums": (self.sums, Sampling())})

    def facts(self) -> dict[str, float]:
        return self.center.facts()


def _radius(light: Light) -> float:
    """The tangent of a sun's angular radius; of other lights the distance of their farthest point from the centre."""
    if light.kind == "directional":
        return math.tan(light.radius)
    return math.hypot(*light.size) / 2 if light.kind == "rectangle" else light.radius
